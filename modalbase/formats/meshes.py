"""Meshes with motions of their nodes as files: VTU for viewers, UFF (sets 2411, 2412, 55) for
programs of modal analysis.

VTU is VTK's unstructured grid in XML (Kitware, The VTK User's Guide, 11th ed., 19), written as
text. Its corners and middles of sides are ordered as ours; set 2412 goes around an element instead,
a middle between two corners.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import TypeVar
from xml.sax.saxutils import quoteattr

import numpy as np

from modalbase.formats.cell_types import CELL_TYPES
from modalbase.formats.types import FloatArray, IntArray
from modalbase.formats.uff.content import Content, Element, GridPoint, ModeShape

Values = TypeVar("Values", bound=FloatArray | IntArray)
ROWS = 4096  # of an array that are text at a time


@dataclass(frozen=True)
class Cells:
    """Elements of one kind and set.

    Attributes:
        kind: of elements, or `point`.
        set: name.
        numbers: (e,) the elements' own.
        nodes: (e, k) rows of the table of nodes: corners in order, then middles of sides.
        lines: (e,) of the file in which each begins, from 1; None where it has no lines.
    """

    kind: str
    set: str
    numbers: IntArray
    nodes: IntArray
    lines: IntArray | None = None


@dataclass(frozen=True)
class Group:
    """Elements and nodes under a name, beside the sets of elements; groups may overlap."""

    name: str
    elements: IntArray  # their own numbers
    nodes: IntArray  # rows of the table of nodes, besides those of the elements


@dataclass(frozen=True)
class MeshFile:
    """What is written or read.

    Attributes:
        numbers: (n,) of the nodes.
        nodes: (n, 3) m; of a file that was read, in its own unit of length.
        cells: elements.
        shapes: modes whose points are these numbers.
        length_m: the unit of length, where the file that was read states one.
        groups: named by a file that was read.
    """

    numbers: IntArray
    nodes: FloatArray
    cells: Sequence[Cells]
    shapes: Sequence[ModeShape] = ()
    length_m: float | None = None
    groups: Sequence[Group] = ()


def write_vtu(mesh: MeshFile) -> Iterator[bytes]:
    """The bytes of a VTU file, some lines at a time: `set` of each cell counts the names in the
    file's comment; a shape is an array of its nodes, a complex one two.
    """
    lines = (f"{line}\n" for line in _vtu(mesh))
    while text := "".join(islice(lines, ROWS)):
        yield text.encode()


def _vtu(mesh: MeshFile) -> Iterator[str]:
    sets = list(dict.fromkeys(block.set for block in mesh.cells))
    ends = np.cumsum(
        np.concatenate([np.full(len(block.nodes), block.nodes.shape[1]) for block in mesh.cells])
    )
    kinds = np.concatenate(
        [np.full(len(block.nodes), next(iter(CELL_TYPES[block.kind].vtk))) for block in mesh.cells]
    )
    owner = np.concatenate(
        [np.full(len(block.nodes), sets.index(block.set)) for block in mesh.cells]
    )
    own = np.concatenate([block.numbers for block in mesh.cells])
    yield '<?xml version="1.0"?>'
    yield from (f"<!-- set {k}: {name.replace('--', '- -')} -->" for k, name in enumerate(sets))
    yield (
        '<VTKFile type="UnstructuredGrid" version="0.1"'
        ' byte_order="LittleEndian"><UnstructuredGrid>'
    )
    yield f'<Piece NumberOfPoints="{len(mesh.nodes)}" NumberOfCells="{len(ends)}">'
    flat = np.concatenate([block.nodes.ravel() for block in mesh.cells])
    parts = {
        "Points": [("Points", mesh.nodes)],
        "Cells": [("connectivity", flat), ("offsets", ends), ("types", kinds)],
        "CellData": [("set", owner), ("number", own)],
        "PointData": [("number", mesh.numbers), *_shapes(mesh.shapes)],
    }
    for part, arrays in parts.items():
        yield f"<{part}>"
        for name, values in arrays:
            yield from _array(name, values)
        yield f"</{part}>"
    yield "</Piece></UnstructuredGrid></VTKFile>"


def _shapes(shapes: Iterable[ModeShape]) -> Iterator[tuple[str, FloatArray]]:
    for shape in shapes:
        yield shape.label, shape.values.real[:, :3]
        if shape.kind == "complex":
            yield f"{shape.label}, imaginary", shape.values.imag[:, :3]


def _array(name: str, values: FloatArray | IntArray) -> Iterator[str]:
    """The lines of one array."""
    real = np.issubdtype(values.dtype, np.floating)
    columns = f' NumberOfComponents="{values.shape[1]}"' if values.ndim > 1 else ""
    kind = "Float64" if real else "Int64"
    yield f'<DataArray type="{kind}" Name={quoteattr(name)}{columns} format="ascii">'
    for part in pieces(values):
        for row in part.reshape(len(part), -1).tolist():
            yield " ".join(f"{value:.9g}" if real else str(value) for value in row)
    yield "</DataArray>"


def pieces(values: Values) -> Iterator[Values]:
    """The rows of an array, `ROWS` at a time."""
    return (values[first : first + ROWS] for first in range(0, len(values), ROWS))  # type: ignore[misc]  # of the same kind


def uff_of(mesh: MeshFile) -> Iterator[Content]:
    """Contents of a UFF file: grid points, elements, and the shapes. Cells that are points are grid
    points alone; those of the k-th set have the property table k.
    """
    for labels, places in zip(pieces(mesh.numbers), pieces(mesh.nodes), strict=True):
        for number, (x, y, z) in zip(labels.tolist(), places.tolist(), strict=True):
            yield GridPoint(number, (x, y, z))
    sets = list(dict.fromkeys(block.set for block in mesh.cells))
    for block in mesh.cells:
        cell_type = CELL_TYPES[block.kind]
        if descriptor := cell_type.uff:
            for labels, rows in zip(pieces(block.numbers), pieces(block.nodes), strict=True):
                for number, row in zip(
                    labels.tolist(), mesh.numbers[rows[:, cell_type.around]].tolist(), strict=True
                ):
                    yield Element(number, descriptor, tuple(row), 1 + sets.index(block.set))
    yield from mesh.shapes


def columns(nodes: Mapping[str, Sequence[float]]) -> FloatArray:
    """(n, 3) coordinates of `x_m`, `y_m` and `z_m`."""
    return np.column_stack([nodes[f"{axis}_m"] for axis in "xyz"]).reshape(-1, 3)
