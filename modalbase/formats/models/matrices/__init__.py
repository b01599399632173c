"""A model as matrices of any solver: K_0, K_k, M_0, M_j, a table of nodes, and which dof each row
is.

files   npz; Matrix Market and what CalculiX and Abaqus write; Nastran's DMIG punch; tables of nodes and dofs
model   the matrices of these, checked
"""

from modalbase.formats.models.matrices.model import MatrixModel, read_matrices

__all__ = ["MatrixModel", "read_matrices"]
