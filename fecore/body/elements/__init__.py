"""Finite elements, one a file. An element turns node coordinates into matrices; it knows no mesh and no material."""
