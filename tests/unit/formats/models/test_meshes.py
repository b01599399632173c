"""Meshes without properties: files that gmsh and VTK wrote, what is wrong with others, and what is
stated of their sets.
"""

import io
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modalbase.formats.errors import FormatError
from modalbase.formats.meshes import Cells, MeshFile, uff_of, write_vtu
from modalbase.formats.models.inp import read_inp
from modalbase.formats.models.meshes import read_vtk
from modalbase.formats.uff import Element, GridPoint, ModeShape
from modalbase.formats.uff.write import encode, write_file
from service.compute.models.bodies import body_of_model
from service.compute.models.meshes import MESHES, mesh_in_si
from tests.support.places import ROOT
from tests.support.profiles import ANGLE, deck
from tests.support.stored_solids import frequencies
from tests.support.uff import load

FILES = {path.name: path.read_bytes() for path in sorted((ROOT / "tests/corpus/meshes").iterdir())}
"""By gmsh 4.15 and VTK 9.7: a flange of two quadrilaterals with a web of four triangles, clamped at
x = 0, in mm.
"""

ISOTROPIC = {"E_Pa": 7e10, "nu": 0.3, "density_kg_m3": 2700.0}
WALL = {"thickness_m": 0.002, "isotropic": ISOTROPIC}


def read(name: str, content: bytes) -> MeshFile:
    return MESHES[Path(name).suffix](content)


@pytest.mark.parametrize("name", FILES)
def test_files_of_other_programs(name: str) -> None:
    mesh = read(name, FILES[name])
    assert len(mesh.nodes) == 23
    kinds = Counter(cells.kind for cells in mesh.cells for _ in cells.numbers)
    assert kinds == {"quad8": 2, "tri6": 4, "beam3": 2}
    for cells in mesh.cells:
        x = mesh.nodes[cells.nodes]
        if cells.kind == "beam3":
            np.testing.assert_allclose(x[:, :, 0], 0)
            continue
        n = cells.nodes.shape[1] // 2
        np.testing.assert_allclose(
            x[:, n:], (x[:, :n] + np.roll(x[:, :n], -1, axis=1)) / 2, atol=1e-6
        )
        np.testing.assert_allclose(x[:, :, 2 if cells.kind == "quad8" else 1], 0)


def test_a_grid_without_cells_has_no_element() -> None:
    head = b"# vtk DataFile Version 3.0\nnothing\nASCII\nDATASET UNSTRUCTURED_GRID\n"
    assert not read_vtk(head + b"POINTS 0 float\nCELLS 0 0\nCELL_TYPES 0\n").cells


def sections(**more: Any) -> dict[str, Any]:
    return {"flange": WALL, "the_web": WALL, **more}


@pytest.mark.parametrize("name", ["gmsh-2.2.msh", "gmsh-4.1.msh"])
def test_a_line_of_nodes_holds_the_body(name: str) -> None:
    model = mesh_in_si(
        FILES[name], name, "mm-N-t", sections(clamp={"held_dofs": [1, 2, 3, 4, 5, 6]})
    )
    (support,) = model.supports
    np.testing.assert_allclose(model.nodes[support.nodes, 0], 0)
    assert (len(support.nodes), model.ignored) == (5, ())
    assert np.ptp(model.nodes, axis=0) == pytest.approx([0.04, 0.02, 0.01])
    free = mesh_in_si(FILES[name], name, "mm-N-t", sections())
    ((card, changes),) = [(each.card, each.changes) for each in free.ignored]
    assert (card, changes) == ("clamp", True)


def test_a_deck_as_a_mesh_is_the_same_body() -> None:
    model = read_inp(deck())
    cells = [Cells(each.kind, each.set, each.numbers, each.nodes) for each in model.elements]
    mesh = MeshFile(model.numbers, model.nodes, cells)
    material = {**ANGLE["shape"]["material"], "density_kg_m3": 1850.0}
    wall = {"thickness_m": 0.004, "material": material, "axis": [1.0, 0.0, 0.0]}
    vtu = mesh_in_si(b"".join(write_vtu(mesh)), "a.vtu", "m-N-kg", {"flange": wall, "web": wall})
    uff = mesh_in_si(b"".join(encode(uff_of(mesh))), "a.unv", None, {"set_1": wall, "set_2": wall})
    for other_model in (vtu, uff):
        for one, other in zip(other_model.elements, model.elements, strict=True):
            np.testing.assert_allclose(
                other_model.nodes[one.nodes], model.nodes[other.nodes], atol=1e-9
            )
            np.testing.assert_array_equal(one.axes, other.axes)
            section, stated = other_model.sections[one.set], model.sections[other.set]
            constants, expected = (
                m.materials[x.materials[0]].constants
                for m, x in ((other_model, section), (model, stated))
            )
            assert constants == {name: pytest.approx(expected[name]) for name in constants}
    np.testing.assert_allclose(
        frequencies(body_of_model(uff), 4), frequencies(body_of_model(model), 4), rtol=1e-6
    )


def test_plies_and_materials_of_sets() -> None:
    ply = {**ANGLE["shape"]["material"], "density_kg_m3": 1850.0, "thickness_m": 0.001}
    plies = {"plies": [{**ply, "angle_deg": 45.0}, {**ply, "angle_deg": -45.0}]}
    model = mesh_in_si(FILES["gmsh.unv"], "a.unv", "mm-N-t", {"set_1": plies, "set_2": WALL})
    assert [ply.angle_deg for ply in model.sections["set_1"].plies] == [45.0, -45.0]  # type: ignore[union-attr]
    assert model.sections["set_1"].materials == ("set_1",)
    assert model.materials["set_2"].constants["G"] == pytest.approx(7e10 / 2.6)


FOUR = "".join(
    f"{k + 1} {x} {y} 0\n"
    for k, (x, y) in enumerate([(0, 0), (1, 0), (1, 1), (0, 1), (2, 0), (2, 1)])
)


def msh(elements: str, nodes: str = FOUR, count: int | None = None) -> bytes:
    lines = elements.count("\n") if count is None else count
    return (
        f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{nodes.count(chr(10))}\n{nodes}$EndNodes\n"
        f"$Elements\n{lines}\n{elements}$EndElements\n"
    ).encode()


NAMES = b'$PhysicalNames\n2\n2 7 "a b"\n2 8 "A_b"\n$EndPhysicalNames\n'


def vtk(types: str = "9", cells: str = "4 0 1 2 3", more: str = "") -> bytes:
    return (
        "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 double\n0 0 0 1"
        f" 0 0 1 1 0 0 1 0\nCELLS 1 5\n{cells}\nCELL_TYPES 1\n{types}\n{more}"
    ).encode()


QUAD = "1 3 2 7 1 1 2 3 4\n"
TWO = (
    vtk()
    .replace(b"CELLS 1 5\n", b"CELLS 2 10\n4 0 1 2 3\n")
    .replace(b"CELL_TYPES 1", b"CELL_TYPES 2\n9")
)
GMSH, VTU, UNV = (FILES[name] for name in ("gmsh-4.1.msh", "vtk-ascii.vtu", "gmsh.unv"))
BAD: dict[str, tuple[str, bytes, dict[str, Any], str]] = {
    "cut": ("a.msh", GMSH[: GMSH.index(b"40 9.99")], {}, r"line \d+: the file ends before .*cut"),
    "binary": ("a.msh", b"$MeshFormat\n4.1 1 8\n", {}, "line 2: says that the file is binary; save it as text"),
    "version": ("a.msh", b"$MeshFormat\n4 0 8\n$EndMeshFormat\n", {}, "line 2: says version 4; save it as 4.1 or 2.2"),
    "no gmsh": ("a.msh", b"solid\n", {}, r"line 1: is not \$MeshFormat"),
    "empty": ("a.msh", b"", {}, "the file ends before"),
    "count": ("a.msh", msh(QUAD, count=0), {}, r"line 15: is '1 3 2 7.*expected \$EndElements; a count before"),
    "node": ("a.msh", msh(QUAD.replace(" 4\n", " 9\n")), {}, "line 15: element 1 has the node 9, which is not there"),
    "twice": ("a.msh", msh(QUAD, FOUR + "1 0 0 1\n"), {}, "line 12: node 1 is there twice"),
    "text": ("a.msh", msh(QUAD, FOUR.replace("2 1 0 0", "2 1 x 0")), {}, "line 7: a coordinate: 'x' is no number"),
    "order": ("a.msh", msh("1 21 2 7 1 1 2 3\n"), {}, "line 15: is of the element type 21; shells of"),
    "short": ("a.msh", msh("1 3 2 7 1 1 2 3\n"), {}, "line 15: element 1 has 3 nodes, expected 4"),
    "folded": ("a.msh", msh("1 3 2 7 1 1 2 4 3\n"), {"set_7": WALL}, "line 15: element 1 of the set set_7 (folds|has no)"),
    "flat": ("a.msh", msh("1 2 2 7 1 1 2 2\n"), {"set_7": WALL}, "line 15: element 1 of the set set_7 has no size"),
    "layers": ("a.msh", msh(QUAD + "2 3 2 8 1 1 2 3 4\n"), {"set_7": WALL, "set_8": WALL}, "1 of the set set_7 and 2 of"),
    "solid": ("a.msh", msh("1 4 2 7 1 1 2 3 4\n"), {}, r"line 15: .*solid elements.*solid_7 \(1\).*matrices K and M"),
    "lacks": ("a.msh", msh(QUAD + "2 3 2 8 1 2 5 6 3\n"), {"set_8": WALL}, r"sections: lack set_7 \(1 elements\)"),
    "names": ("a.msh", msh(QUAD) + NAMES, {}, 'line 20: "a b" and "A_b" are one name'),
    "again": ("a.msh", msh(QUAD), {"set_7": WALL, "Set.7": WALL}, "sections: name a set twice"),
    "unknown": ("a.msh", msh(QUAD), {"set_7": WALL, "skin": WALL}, "sections.skin: there is no such set; there are set_7"),
    "axis": ("a.msh", msh(QUAD), {"set_7": {**WALL, "axis": [0, 0, 2]}}, "sections.set_7.axis: lies along the normal of"),
    "parts": ("a.msh", msh("1 2 2 7 1 1 2 4\n2 2 2 7 1 3 5 6\n"), {"set_7": WALL}, "falls into 2 parts.*line 15.*line 16"),
    "nothing": ("a.msh", msh(""), {}, "no shell or beam element"),
    "held": ("a.msh", msh(QUAD + "2 1 2 8 1 5 6\n"), {"set_7": WALL, "line_8": {"held_dofs": [1]}}, "line_8: holds nodes"),
    "line": ("a.msh", msh(QUAD + "2 1 2 8 1 1 2\n"), {"set_7": WALL, "line_8": WALL}, "line_8: is of lines or points"),
    "surface": ("a.vtk", vtk().replace(b"UNSTRUCTURED_GRID", b"POLYDATA"), {}, "line 4: .*save it as DATASET UNSTR"),
    "cells": ("a.vtk", vtk(cells="5 0 1 2 3"), {}, "line 8: 1 cells do not fill 5 numbers"),
    "type": ("a.vtk", vtk(types="42"), {}, "cell 1: is of type 42 with 4 points"),
    "point": ("a.vtk", vtk(cells="4 0 1 2 4"), {}, "connectivity: names points that are not among the 4"),
    "section": ("a.vtk", vtk(more="WHAT 3\n"), {}, "line 11: is 'WHAT', which begins no section"),
    "vtk cut": ("a.vtk", FILES["vtk-binary.vtk"][:300], {}, r"byte \d+: .*cut"),
    "which set": ("a.vtk", TWO + b"CELL_DATA 2\nFIELD f 2\na 1 2 int\n1 1\nb 1 2 int\n2 2\n", {},
        "cell data: a, b part the cells: call the array"),
    "xml": ("a.vtu", VTU[:600], {}, "is no XML that can be read: .*line"),
    "doctype": ("a.vtu", VTU.replace(b"<VTKFile", b"<!DOCTYPE a><VTKFile"), {}, "has a DOCTYPE"),
    "pieces": ("a.vtu", VTU.replace(b"Piece", b"Peace"), {}, "has 0 pieces, expected one"),
    "points": ("a.vtu", VTU.replace(b'NumberOfPoints="23"', b'NumberOfPoints="24"'), {},
        "NumberOfPoints: says 24, but Points has 23"),
    "types": ("a.vtu", VTU.replace(b'NumberOfCells="8"', b'NumberOfCells="7"'), {}, "says 7, but types has 8"),
    "words": ("a.vtu", VTU.replace(b"40 20 0", b"40 x 0"), {}, "Points: holds what is no number: .*'x'"),
    "packed": ("a.vtu", FILES["vtk-base64-zlib.vtu"].replace(b"ZLib", b"LZ4"), {}, "packed by vtkLZ4.*save it by zlib"),
    "uff": ("a.unv", UNV[:2000], {}, "byte 2000: the file ends inside dataset 1"),
    "descriptor": ("a.unv", UNV.replace(b"        95", b"        99"), {}, "line 58: element .* descriptor 99"),
    "damaged": ("a.unv", UNV.replace(b"2.0000000000000000D", b"2.00000000000000x0D"), {}, "dataset 1 .set 2411"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_meshes(name: str) -> None:
    file, content, stated, message = BAD[name]
    with pytest.raises(FormatError, match=message):
        mesh_in_si(content, file, "mm-N-t", stated)


def test_units_are_asked_for_once() -> None:
    with pytest.raises(FormatError, match="units: are not stated"):
        mesh_in_si(FILES["gmsh-2.2.msh"], "a.msh", None, sections())
    uff = b"".join(encode(uff_of(read("gmsh-2.2.msh", FILES["gmsh-2.2.msh"]))))
    with pytest.raises(
        FormatError, match=r"units: have the length 0.001 m, but set 164 of the file says 1 m"
    ):
        mesh_in_si(uff, "a.uff", "mm-N-t", {})


def harmless(name: str, content: bytes) -> None:
    try:
        mesh = read(name, content)
    except FormatError:
        return
    assert np.all(np.isfinite(mesh.nodes))
    for cells in mesh.cells:
        assert cells.nodes.size == 0 or cells.nodes.max() < len(mesh.nodes)


@pytest.mark.parametrize("name", FILES)
def test_files_cut_anywhere(name: str) -> None:
    for end in range(0, len(FILES[name]), 7):
        harmless(name, FILES[name][:end])


@given(
    st.sampled_from(sorted(FILES)),
    st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.binary(max_size=4)), max_size=6),
)
@settings(max_examples=300)
def test_damaged_files(name: str, changes: list[tuple[float, bytes]]) -> None:
    content = FILES[name]
    for share, put in changes:
        at = int(share * len(content))
        content = content[:at] + put + content[at + len(put) :]
    harmless(name, content)


@given(st.sampled_from(sorted(FILES)), st.floats(0, 1, exclude_max=True), st.integers(-9, 10**12))
@settings(max_examples=200)
def test_other_numbers(name: str, share: float, number: int) -> None:
    content = FILES[name]
    at = content.find(b" ", int(share * len(content))) + 1
    harmless(name, content[:at] + str(number).encode() + content[max(content.find(b" ", at), at) :])


# --- meshes with shapes as files that others read
# ---------------------------------------------------------------------


PLACES = np.array(
    [
        [0, 0, 0],
        [2, 0, 0],
        [2, 1, 0],
        [0, 1, 0],
        [1, 0, 0],
        [2, 0.5, 0],
        [1, 1, 0],
        [0, 0.5, 0],
        [3, 0, 0.25],
    ]
)
NUMBERS = np.array([11, 12, 13, 14, 15, 16, 17, 18, 30])
MESH = MeshFile(
    NUMBERS,
    PLACES.astype(float),
    [
        Cells("quad8", "skin", np.array([1]), np.arange(8)[None]),
        Cells("tri6", "skin", np.array([2]), np.array([[0, 1, 2, 4, 5, 7]])),
        Cells("beam2", "rib <a>", np.array([7]), np.array([[1, 8]])),
    ],
    [
        ModeShape(
            0,
            "model mode 1, 12 Hz",
            1,
            12.0,
            0.01,
            NUMBERS,
            np.arange(27.0).reshape(9, 3) + 0j,
            "normal",
        ),
        ModeShape(
            0, "measured mode 1, 13 Hz", 1, 13.0, 0.02, NUMBERS, np.full((9, 3), 1 - 2j), "complex"
        ),
    ],
)


def test_a_vtu_has_nodes_cells_sets_and_shapes() -> None:
    root = ET.parse(io.BytesIO(b"".join(write_vtu(MESH)))).getroot()
    arrays = {
        each.get("Name"): np.array((each.text or "").split(), float)
        for each in root.iter("DataArray")
    }
    np.testing.assert_allclose(arrays["Points"].reshape(-1, 3), PLACES)
    assert arrays["connectivity"].tolist() == [*range(8), 0, 1, 2, 4, 5, 7, 1, 8]
    assert (arrays["offsets"].tolist(), arrays["types"].tolist()) == ([8, 14, 16], [23, 22, 3])
    assert arrays["set"].tolist() == [0, 0, 1]
    assert arrays["model mode 1, 12 Hz"].tolist() == list(range(27))
    assert set(arrays["measured mode 1, 13 Hz, imaginary"]) == {-2.0}
    assert b"set 1: rib <a>" in b"".join(write_vtu(MESH))


def test_a_uff_reads_back(tmp_path: Path) -> None:
    write_file(tmp_path / "mesh.uff", uff_of(MESH))
    reading = load(tmp_path / "mesh.uff")
    assert set(reading.outcomes) == {"read"}, reading.reasons
    points = [each for each in reading.contents if isinstance(each, GridPoint)]
    assert [(each.number, each.xyz_m) for each in points] == [
        (number, tuple(xyz))
        for number, xyz in zip(NUMBERS.tolist(), MESH.nodes.tolist(), strict=True)
    ]
    assert [each for each in reading.contents if isinstance(each, Element)] == [
        Element(1, 45, (11, 15, 12, 16, 13, 17, 14, 18)),
        Element(2, 42, (11, 15, 12, 16, 13, 18)),
        Element(7, 21, (12, 30), 2),
    ]
    normal, complex_ = (each for each in reading.contents if isinstance(each, ModeShape))
    np.testing.assert_allclose(normal.values, MESH.shapes[0].values)
    np.testing.assert_allclose(complex_.values, MESH.shapes[1].values)
    # of an eigenvalue in 12 characters
    assert complex_.frequency_hz == pytest.approx(13.0, rel=1e-9)
