"""Finite elements in space, a family a file. An element makes rows of strains of coordinates; it
knows no mesh and no section.

shells     what a shell element is: its shape functions and points of integration
surface    its strains on a curved surface
quads, triangles
beams      Timoshenko beams in space, of two nodes or three
"""
