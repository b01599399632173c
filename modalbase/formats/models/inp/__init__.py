"""Decks of Abaqus and CalculiX, `.inp`, read and written back.

lines                             keywords with their options and data
mesh, sections, materials         what the model is made of
beams, orientations
held, carried                     supports and links; masses
read, write
"""

from modalbase.formats.models.inp.read import read_inp

__all__ = ["read_inp"]
