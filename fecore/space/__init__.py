"""Structures in space: a mesh with sections, junctions and supports to an affine finite element model."""
