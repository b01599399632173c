"""Finite element models that users send: a deck, matrices or a mesh to one neutral model, and a
deck back with its updates.

model      what a deck says, whoever wrote it
losses     all that a reader may say is lost of it
questions  what is unusual in a model, or would be left out: asked, and answered by `accept`
shapes     cross sections of beams from their walls, and by name and dimensions
equations  linear equations between dofs as links
check      areas, normals, and what a model must satisfy before it is solved
units      units by name, guessed and checked
files      a deck and what it includes, as lines
changes    what updated numbers change, and where they go in the deck's own lines
write      the deck with them
bdf  inp   decks of Nastran; of Abaqus and CalculiX
matrices   K and M of any solver
meshes     nodes and elements to which the user gives sections
"""
