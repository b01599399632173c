"""Constants that several formats share."""

STANDARD_GRAVITY = 9.80665
"""m/s²."""

INCH, FOOT = 0.0254, 0.3048
"""m."""

POUND_FORCE = 4.4482216152605
"""N."""

ROUND_OFF = 1e-9
"""Relative difference of numbers that are one but for rounding."""
