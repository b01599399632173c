"""Meshes as answers: what is written, and that the memory it takes does not grow with the mesh."""

import io
import json
import tracemalloc
from collections.abc import Callable, Iterable
from typing import IO

import numpy as np
import pytest

from modalbase.formats.meshes import Cells, write_vtu
from modalbase.formats.meshes import uff_of as contents_of
from modalbase.formats.uff.write import encode
from service.nouns.structures.drawn import DrawnMesh, Held
from service.nouns.structures.model_routes import MeshOut
from tests.support.lengths import long


def grid(side: int) -> DrawnMesh:
    """A square of quads, held along a side."""
    x, y = np.meshgrid(np.arange(side) / 3, np.arange(side) / 7, indexing="ij")
    nodes = np.column_stack([x.ravel(), y.ravel(), np.zeros(side * side)])
    k = np.arange(side * side).reshape(side, side)
    quads = np.column_stack(
        [each.ravel() for each in (k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:])]
    )
    walls = [Cells("quad4", 'a "wall"', np.arange(len(quads)) + 10, quads)]
    return DrawnMesh(np.arange(side * side) + 1, nodes, walls, [Held(k[0], (0, 1, 2))], [3, 4])


def test_a_mesh_is_written_as_its_schema_has_it() -> None:
    mesh, file = grid(100), io.BytesIO()  # more rows than are written at a time
    mesh.write_json(file)
    shown = MeshOut.model_validate_json(file.getvalue())
    assert shown.nodes.numbers == mesh.numbers.tolist()
    np.testing.assert_array_equal(
        np.column_stack([shown.nodes.x_m, shown.nodes.y_m, shown.nodes.z_m]), mesh.nodes
    )
    (block,) = shown.blocks
    assert (block.set, block.kind, block.numbers) == (
        'a "wall"',
        "quad4",
        mesh.blocks[0].numbers.tolist(),
    )
    assert block.nodes == mesh.blocks[0].nodes.tolist()
    assert [(one.nodes, one.dofs) for one in shown.supports] == [(list(range(100)), [1, 2, 3])]
    assert shown.masses == [3, 4]
    empty = io.BytesIO()
    DrawnMesh(np.arange(0), np.zeros((0, 3)), [], [], []).write_json(empty)
    nothing: list[int] = []
    assert json.loads(empty.getvalue()) == {
        "nodes": {"numbers": nothing, "x_m": nothing, "y_m": nothing, "z_m": nothing},
        "blocks": nothing,
        "supports": nothing,
        "masses": nothing,
    }


class Counter(io.RawIOBase):
    """Counts what it is given, and keeps nothing."""

    size = 0

    def write(self, block: object) -> int:
        self.size += len(block)  # type: ignore[arg-type]
        return len(block)  # type: ignore[arg-type]

    def writelines(self, lines: Iterable[object]) -> None:
        for line in lines:
            self.write(line)


@pytest.mark.parametrize(
    "write",
    [
        lambda mesh, file: mesh.write_json(file),
        long(lambda mesh, file: file.writelines(encode(contents_of(mesh.file())))),
        long(lambda mesh, file: file.writelines(write_vtu(mesh.file()))),
    ],
    ids=["json", "uff", "vtu"],
)
def test_memory_does_not_grow_with_the_text(write: Callable[[DrawnMesh, IO[bytes]], None]) -> None:
    """The text of a mesh is sent while it is written: peaks of two meshes differ by less than a
    quarter of their texts.
    """
    (less, low), (more, high) = (traced(write, grid(side)) for side in (60, 120))
    # VTU has all connectivities as one array, another copy of the mesh's own.
    connectivities = 3 * (grid(120).blocks[0].nodes.nbytes - grid(60).blocks[0].nodes.nbytes)
    assert more - less > 600_000
    assert high - low < connectivities + (more - less) / 4


def traced(write: Callable[[DrawnMesh, IO[bytes]], None], mesh: DrawnMesh) -> tuple[int, int]:
    """Bytes of the text, and of memory at the most."""
    file = Counter()
    tracemalloc.start()
    write(mesh, file)  # type: ignore[arg-type]
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return file.size, peak
