"""A model as matrices of any solver: K_0, K_k, M_0, M_j, a table of nodes, and which dof each row is.

model      the matrices, checked
texts      Matrix Market; what CalculiX and Abaqus write; tables of nodes and dofs
dmig       Nastran's DMIG punch
archive    npz
read       files to the model
"""

from modalbase.formats.models.matrices.model import MatrixModel
from modalbase.formats.models.matrices.read import read_matrices

__all__ = ["MatrixModel", "read_matrices"]
