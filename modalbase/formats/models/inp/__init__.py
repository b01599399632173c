"""Decks of Abaqus and CalculiX, `.inp`, read and written back."""

from modalbase.formats.models.inp.read import read_inp
from modalbase.formats.models.inp.write import write_inp

__all__ = ["read_inp", "write_inp"]
