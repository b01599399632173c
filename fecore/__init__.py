"""Finite element model updating of fibre reinforced plastic beams: pure numpy and scipy, usable alone in a notebook.

The rooms stand in the order in which data flows: laminate, mesh, elements, model, eigen, reduction, damping, frf,
identification, correlation, updating, trend. All quantities are SI (m, kg, s, Pa); frequencies are in Hz only where a
name says `_hz`.
"""

__version__ = "0.1.0"
