"""Coupons: raw stress–strain curves of ASTM D3039 and D3518 to moduli and strengths, and batches to
priors.

The rooms in the order in which data flows: curves, d3039 and d3518, batch. Arrays come in SI: N,
Pa, m, m/m.
"""
