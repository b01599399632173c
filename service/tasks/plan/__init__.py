"""Where to hit next: tests ranked by the information that they are expected to add."""
