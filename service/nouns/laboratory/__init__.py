"""Who reports: the laboratory's name, address and logo, on top of every report."""
