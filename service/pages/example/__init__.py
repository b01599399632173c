"""The example: a beam of a paper with its FRFs, modes and coupons, for the demonstration and for newcomers."""
