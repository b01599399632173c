"""Identifications: the modes of a campaign found in its FRFs, kept as a mode set."""
