"""Coupons: results of tensile tests (ASTM D3039, D3518) in batches, and what they say as a prior of
an update.
"""
