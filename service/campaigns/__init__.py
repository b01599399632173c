"""Campaigns: one measurement of a structure each, with its imports, grid points, FRFs and mode sets."""
