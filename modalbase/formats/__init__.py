"""Measurement files: bytes to frozen dataclasses and back. Pure: no database, no web, no finite
element core.

registry                        the table of formats of measured data
foreign                         formats of other programs, and what to export instead
recognise                       a file's format, by its content
units, coordinates, dof_names   units by name; curved axes; points and directions in names
factors                         gains, scales and offsets that a file states beside a unit
types, constants, errors        what all of them share
tables                          tables of text, whatever program wrote them
npy                             the arrays of an npz, each read no further than its entry says
uff                             Universal File Format, in and out
arrays_out                      arrays by name and columns, out
frfs                            FRFs of one quantity on one axis, in and out
records                         time blocks and recordings, in
statements                      what a file says in words: when, with which instruments
points, machine_csv             grid points; text files of testing machines
models                          decks, matrices and meshes to a neutral model, and back
cell_types                      the table of elements: nodes, borders, names in every format
meshes, decks                   a mesh with shapes as a file; a model as the deck of a solver
"""
