"""Nastran bulk data to the neutral model.

card        one card: its fields as numbers, each with its place
lines       a deck and its INCLUDE files to lines, and these to cards
case        executive and case control: which sets hold
frames      coordinate systems and grids
labels      names of sets from the comments of pre-processors
materials   MAT1, MAT2, MAT8
deck        its cards, and these four for all readers of cards
shells      plates and laminates
shapes      cross sections by their dimensions
beams       bars, beams and rods
carried     masses and springs, and mass that is spread
held        rigid elements and constraints
unused      what every other card would have done
read        all of them
write       where updated numbers go in the user's deck
"""

from modalbase.formats.models.bdf.read import read_bdf

__all__ = ["read_bdf"]
