"""Results and measurements for people: figures, reports, pages and the guide."""
