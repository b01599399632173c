"""A mesh as a page draws it, written as JSON in pieces: 200,000 nodes as lists of Python would take
half a gigabyte.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import IO

from fecore.arrays import FloatArray, IntArray
from modalbase.formats.cell_types import CELL_TYPES
from modalbase.formats.meshes import Cells, MeshFile, pieces

ROW_BYTES = 100
"""About what a node or an element takes."""


@dataclass(frozen=True)
class Held:
    """Nodes that are held alike."""

    nodes: IntArray  # rows of the mesh's nodes
    dofs: Sequence[int]  # from 0


@dataclass(frozen=True)
class DrawnMesh:
    """Nodes and elements of a structure, with what holds and loads it."""

    numbers: IntArray  # (n,) of the nodes
    nodes: FloatArray  # (n, 3) m
    blocks: Sequence[Cells]
    supports: Sequence[Held]
    masses: Sequence[int]  # rows of nodes that carry masses

    def file(self) -> MeshFile:
        """What a file says of it: nodes and elements alone."""
        return MeshFile(self.numbers, self.nodes, self.blocks)

    def size(self) -> int:
        """About how many bytes its JSON has."""
        return ROW_BYTES * (len(self.nodes) + sum(len(block.nodes) for block in self.blocks))

    def write_json(self, file: IO[bytes]) -> None:
        """`{nodes: {numbers, x_m, y_m, z_m}, blocks, supports, masses}`, as `MeshOut` has it."""
        for text in self._json():
            file.write(text.encode())

    def _json(self) -> Iterator[str]:
        yield '{"nodes": {"numbers": '
        yield from _listed(self.numbers)
        for axis, column in zip("xyz", self.nodes.T, strict=True):
            yield f', "{axis}_m": '
            yield from _listed(column)
        yield '}, "blocks": ['
        for number, block in enumerate(self.blocks):
            head = json.dumps(
                {
                    "set": block.set,
                    "kind": block.kind,
                    "corners": CELL_TYPES[block.kind].corners,
                }
            )
            yield f'{", " if number else ""}{head[:-1]}, "numbers": '
            yield from _listed(block.numbers)
            yield ', "nodes": '
            yield from _listed(block.nodes)
            yield "}"
        yield '], "supports": ['
        for number, each in enumerate(self.supports):
            yield f'{", " if number else ""}{{"nodes": '
            yield from _listed(each.nodes)
            yield f', "dofs": {json.dumps([dof + 1 for dof in each.dofs])}}}'
        yield f'], "masses": {json.dumps(list(self.masses))}}}'


def _listed(values: FloatArray | IntArray) -> Iterator[str]:
    """An array as JSON, some rows at a time."""
    yield "["
    for number, part in enumerate(pieces(values)):
        yield (", " if number else "") + json.dumps(part.tolist(), allow_nan=False)[1:-1]
    yield "]"
