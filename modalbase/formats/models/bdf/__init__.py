"""Nastran bulk data to the neutral model.

card        a deck and its INCLUDE files to lines, and these to cards, whose fields are numbers with their places
frames      coordinate systems and grids
materials   MAT1, MAT2, MAT8
deck        case control, names of sets, and the cards, with these two for all readers of cards; what is lost with the others
shells      plates and laminates
beams       bars, beams and rods
carried     masses and springs, and mass that is spread
held        rigid elements and constraints
read        all of them
write       where updated numbers go in the user's deck
"""

from modalbase.formats.models.bdf.read import read_bdf

__all__ = ["read_bdf"]
