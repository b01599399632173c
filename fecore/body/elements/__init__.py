"""Finite elements in space, a family a file. An element makes rows of strains of coordinates; it
knows no mesh and no section.
"""
