"""Processings: a campaign's hits are judged, and the good ones become FRFs; its recordings of
responses become half spectra.
"""
