"""Campaigns: one measurement of a structure each, its grid points, and the frame of its
coordinates.
"""
