"""Decks of Abaqus and CalculiX, `.inp`, read and written back."""

from modalbase.formats.models.inp.read import read_inp

__all__ = ["read_inp"]
