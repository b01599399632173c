"""Meshes with shapes as files that others read."""

import io
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from modalbase.formats.meshes import Cells, MeshFile, uff_of, write_vtu
from modalbase.formats.uff import Element, GridPoint, ModeShape
from modalbase.formats.uff.write import write_file
from tests.support.uff import load

NODES = np.array(
    [[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0], [1, 0, 0], [2, 0.5, 0], [1, 1, 0], [0, 0.5, 0], [3, 0, 0.25]]
)
NUMBERS = np.array([11, 12, 13, 14, 15, 16, 17, 18, 30])
MESH = MeshFile(
    NUMBERS,
    NODES.astype(float),
    [
        Cells("quad8", "skin", np.array([1]), np.arange(8)[None]),
        Cells("tri6", "skin", np.array([2]), np.array([[0, 1, 2, 4, 5, 7]])),
        Cells("beam2", "rib <a>", np.array([7]), np.array([[1, 8]])),
    ],
    [
        ModeShape(0, "model mode 1, 12 Hz", 1, 12.0, 0.01, NUMBERS, np.arange(27.0).reshape(9, 3) + 0j, "normal"),
        ModeShape(0, "measured mode 1, 13 Hz", 1, 13.0, 0.02, NUMBERS, np.full((9, 3), 1 - 2j), "complex"),
    ],
)


def test_a_vtu_has_nodes_cells_sets_and_shapes() -> None:
    root = ET.parse(io.BytesIO(write_vtu(MESH))).getroot()
    arrays = {each.get("Name"): np.array((each.text or "").split(), float) for each in root.iter("DataArray")}
    np.testing.assert_allclose(arrays["Points"].reshape(-1, 3), NODES)
    assert arrays["connectivity"].tolist() == [*range(8), 0, 1, 2, 4, 5, 7, 1, 8]
    assert (arrays["offsets"].tolist(), arrays["types"].tolist()) == ([8, 14, 16], [23, 22, 3])
    assert arrays["set"].tolist() == [0, 0, 1]
    assert arrays["model mode 1, 12 Hz"].tolist() == list(range(27))
    assert set(arrays["measured mode 1, 13 Hz, imaginary"]) == {-2.0}
    assert b"set 1: rib <a>" in write_vtu(MESH)


def test_a_uff_reads_back(tmp_path: Path) -> None:
    write_file(tmp_path / "mesh.uff", uff_of(MESH))
    found = load(tmp_path / "mesh.uff")
    assert set(found.outcomes) == {"read"}, found.reasons
    points = [each for each in found.contents if isinstance(each, GridPoint)]
    assert [(each.number, each.xyz_m) for each in points] == [
        (number, tuple(xyz)) for number, xyz in zip(NUMBERS.tolist(), MESH.nodes.tolist(), strict=True)
    ]
    assert [each for each in found.contents if isinstance(each, Element)] == [
        Element(1, 45, (11, 15, 12, 16, 13, 17, 14, 18)),
        Element(2, 42, (11, 15, 12, 16, 13, 18)),
        Element(7, 21, (12, 30), 2),
    ]
    normal, complex_ = (each for each in found.contents if isinstance(each, ModeShape))
    np.testing.assert_allclose(normal.values, MESH.shapes[0].values)
    np.testing.assert_allclose(complex_.values, MESH.shapes[1].values)
    assert complex_.frequency_hz == pytest.approx(13.0, rel=1e-9)  # of an eigenvalue in 12 characters
