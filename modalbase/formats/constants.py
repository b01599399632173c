"""Constants that the units of several formats are made of."""

STANDARD_GRAVITY = 9.80665
"""m/s²."""

POUND_FORCE = 4.4482216152605
"""N."""
