"""Finite element models as engineers have them: decks to one neutral model, and back with updated numbers."""
