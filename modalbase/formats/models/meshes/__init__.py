"""Meshes without properties: nodes and elements by set, to which the user gives sections.

cells   elements as readers meet them, gathered by kind and set
gmsh    `.msh` of gmsh
vtk     points, connectivity and cell data of VTK to elements; its legacy files
vtu     VTK's unstructured grids in XML
uff     sets 2411, 2412 and 2420
groups  sets of elements that a Universal File names
body    a mesh and what is stated of its sets, to the neutral model
"""

from modalbase.formats.models.meshes.body import MeshSets, model_of_mesh
from modalbase.formats.models.meshes.gmsh import read_gmsh
from modalbase.formats.models.meshes.uff import read_uff_mesh
from modalbase.formats.models.meshes.vtk import read_vtk
from modalbase.formats.models.meshes.vtu import read_vtu

__all__ = ["MeshSets", "model_of_mesh", "read_gmsh", "read_uff_mesh", "read_vtk", "read_vtu"]
