"""Structures: what a specimen nominally is (geometry, density, laminate or homogenised material),
in versions.
"""
