"""A model as matrices of any solver: K_0, K_k, M_0, M_j, a table of nodes, and which dof each row is.

model   the matrices, checked
files   npz; Matrix Market and what CalculiX and Abaqus write; Nastran's DMIG punch; tables of nodes and dofs
read    files to the model
"""

from modalbase.formats.models.matrices.model import MatrixModel
from modalbase.formats.models.matrices.read import read_matrices

__all__ = ["MatrixModel", "read_matrices"]
