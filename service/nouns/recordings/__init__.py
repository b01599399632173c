"""Recordings of responses to loads that nobody measured, and their half spectra."""
