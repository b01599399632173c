"""Files that readers refuse: each a call, and how the `FormatError` begins that ends it."""

import io
from collections.abc import Callable

import numpy as np

from modalbase.formats.machine_csv import Column, read_machine_csv
from modalbase.formats.models.bdf import read_bdf
from modalbase.formats.models.inp import read_inp
from modalbase.formats.models.matrices import read_matrices
from modalbase.formats.models.meshes import read_vtk
from modalbase.formats.models.model import FiniteElementModel
from tests.unit.formats.models.decks import GRIDS, SQUARE
from tests.unit.formats.models.decks import PLATE as INP

BAR = GRIDS + "CBAR,1,1,1,2,0.,1.,0.\nPBAR,1,1,1.-4,1.-9,1.-9,1.-9{}\nMAT1,1,7.+10,,.3,2700.\n"
CHAIN = {f"f{k}.bdf": f"INCLUDE 'f{k + 1}.bdf'\n".encode() for k in range(3000)} | {
    "f3000.bdf": b""
}
LOAD = {"time": Column("Time", "time"), "load": Column("Load", "force")}
VTK = b"""# vtk DataFile Version 3.0
a triangle
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 3 float
0 0 0 1 0 0 0 1 0
CELLS 1 4
3 0 1 2
CELL_TYPES 1
5
"""
THIN_BEAM = (
    "*ELEMENT,TYPE=B31,ELSET=B\n9,1,2\n*BEAM"
    " SECTION,ELSET=B,MATERIAL=GFRP,SECTION=RECT\n1e-200,1e-200\n0,1,0\n"
)
ONES = np.ones(1)
NODES = b"node,x,y,z\n10,0,0,0\n7,1,0,.5\n30,2,0,0\n"
MARKET = b"%%MatrixMarket matrix coordinate real symmetric\n18 18 "
TABLE = np.column_stack([[10.0, 7.0, 30.0], np.eye(3)])
PUNCH = "DMIG,KAAX,0,6,2,0\nDMIG,KAAX,10,1,,7,1,3.\nDMIG,KAAX,7,1,,10,1,3.\n"
PUNCHED_NODES = "GRID,10,,0.,0.,0.\nGRID,7,,1.,0.,0.\n"


def bdf(text: str, included: dict[str, bytes] | None = None) -> FiniteElementModel:
    return read_bdf(text.encode(), included)


def matrices(**changed: bytes) -> object:
    whole = {
        "K_0_mtx": MARKET + b"1\n1 1 5\n",
        "M_0_mtx": MARKET + b"1\n1 1 5\n",
        "nodes_csv": NODES,
    } | changed
    return read_matrices(
        {name[:-4] + "." + name[-3:]: content for name, content in whole.items() if content}
    )


def plate(before_step: str) -> FiniteElementModel:
    return read_inp(INP.replace("*STEP", before_step + "*STEP", 1).encode())


def folded_over() -> FiniteElementModel:
    deck = INP.replace("5, 0.1, 0.1, 0.", "5, 0.02, 0.02, 0.").replace(
        "1, 1, 2, 5, 4\n", "*INCLUDE, INPUT=a.inp\n"
    )
    return read_inp(deck.encode(), {"a.inp": b"** one\n1, 1, 2, 5, 4\n"})


def npz(**arrays: object) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


NO_WHOLE = "has a row, column, node or dof that is not a whole number of at most 12 digits"

# fmt: off
FILES: list[tuple[Callable[[], object], str]] = [
    (lambda: bdf(SQUARE + "INCLUDE 'f0.bdf'\n", CHAIN), "f9.bdf line 1: INCLUDE 'f10.bdf' lies more than 10"),
    (lambda: bdf(SQUARE + "INCLUDE 'a.bdf'  $ rest\n", {"a.bdf": b"GRID,9,,x\n"}), "a.bdf line 1: GRID 9: X1 (field 4) is 'X'"),
    (lambda: bdf(SQUARE + "INCLUDE a.bdf  $ rest\n", {"a.bdf": b"GRID,9,,x\n"}), "a.bdf line 1: GRID 9: X1 (field 4) is 'X'"),
    (lambda: bdf(SQUARE.replace("1,,1\n", "1,,1,,-100.\n")), "line 6: the set pshell_1 weighs -73 with its non-structural"),
    (lambda: bdf(SQUARE + "NSM1,1,PSHELL,-100.,1\n"), "line 6: the set pshell_1 weighs -73 with its non-structural mass"),
    (lambda: bdf(BAR.format(",-1.")), "line 6: the set pbar_1 weighs -0.73 with its non-structural mass"),
    (lambda: bdf(SQUARE + "RBE3,7,,1,123,1.,123,4,THRU\n,2\n"), "line 9: RBE3 7: G (field 2) is '2', expected a number"),
    (lambda: bdf(GRIDS + "INCLUDE 'a.bdf'", {"a.bdf": b"$\nCQUAD4,1,1,1,2,3,X\n"}), "a.bdf line 2: CQUAD4 1: PID (field 3) is"),
    (lambda: bdf(GRIDS + "INCLUDE 'a.bdf'", {"a.bdf": b"INCLUDE 'b.bdf'", "b.bdf": b"INCLUDE 'a.bdf'"}),
     "b.bdf line 1: INCLUDE 'a.bdf' stands for the second time; its cards would be there twice"),
    (lambda: read_inp(b"*INCLUDE, INPUT=a.inp\n", {"a.inp": b"*NODE\n9, x\n"}), "a.inp line 2: *NODE x is 'x', expected"),
    (lambda: read_inp(b"*INCLUDE, INPUT=a.inp\n", {"a.inp": b"*INCLUDE, INPUT=b.inp\n", "b.inp": b"*INCLUDE, INPUT=a.inp\n"}),
     "b.inp line 1: *INCLUDE of 'a.inp' goes in a circle: a.inp → b.inp → a.inp"),
    (folded_over, "a.inp line 2: element 1 of the set plate folds over"),
    (lambda: plate("*MPC\n,\n"), "line 21: *MPC has no field, expected at least one"),
    (lambda: plate("*KINEMATIC COUPLING, REF NODE=1\n,\n"), "line 21: *KINEMATIC COUPLING has no field, expected at least one"),
    (lambda: plate("*BOUNDARY\n,\n"), "line 21: *BOUNDARY has no field, expected at least one"),
    (lambda: plate(THIN_BEAM), "line 23: *BEAM SECTION walls too small for a number"),
    (lambda: read_vtk(VTK + b"CELL_DATA 1\nSCALARS set int 0\nLOOKUP_TABLE default\n"), "line 13: the array set has no"),
    (lambda: read_vtk(VTK + b"CELL_DATA 1\nFIELD F 1\nset 0 1 int\n"), "line 13: the array set has no component"),
    (lambda: read_machine_csv(b"Time [s];Load [N]\n0;1\n1;1e999\n", LOAD), "line 3, column load: '1e999' is not a number"),
    (lambda: matrices(nodes_csv=NODES.replace(b"30,", b"99999999999999999999,")), f"nodes.csv: {NO_WHOLE}"),
    (lambda: matrices(dofs_csv=b"node,dof\n99999999999999999999,1\n"), f"dofs.csv: {NO_WHOLE}"),
    (lambda: matrices(K_0_mtx=MARKET + b"3\n1 1 9\n2 1 5\n1 2 5\n"), "K_0.mtx: says that it is symmetric, of which"),
    (lambda: matrices(nodes_csv=b"", a_npz=npz(nodes=TABLE + 0.5)), f"a.npz nodes: {NO_WHOLE}"),
    (lambda: matrices(a_npz=npz(dofs=np.array([[10, 1.5]]))), f"a.npz dofs: {NO_WHOLE}"),
    (lambda: matrices(a_npz=npz(K_1_data=ONES, K_1_indices=ONES / 2, K_1_indptr=[0, 1])), f"a.npz K_1: {NO_WHOLE}"),
    (lambda: read_matrices({"a.pch": (PUNCH + PUNCHED_NODES).encode()}), "KAAX: says that it is symmetric, of which"),
    (lambda: read_matrices({"a.pch": ("DMIG,KAAX,0,6,2,0\n" + PUNCHED_NODES).encode()}), "KAAX: has no row"),
]
# fmt: on
