"""Updated constants as cards of finite element programs, in a deck that runs: CalculiX, Abaqus, Nastran."""

from modalbase.formats.decks.deck import Deck, Mass
from modalbase.formats.decks.inp import write_shells, write_solids
from modalbase.formats.decks.nastran import write_nastran

__all__ = ["Deck", "Mass", "write_nastran", "write_shells", "write_solids"]
