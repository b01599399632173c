"""FRFs: their spectra in the database, cut, written in the formats that clients ask for, and as the
core wants them.
"""
