"""The normal distribution, as intervals need it."""

Z_95 = 1.959963984540054
"""Half of the central 95 % of a normal distribution, in standard deviations; 95 % of a
half-normal's mass lies below it.
"""

SD_OF_MAD = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""
