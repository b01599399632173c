"""A result's mesh or measured points with all shapes, as what a VTU or UFF file says."""

from __future__ import annotations

from typing import Literal

import numpy as np

from modalbase.formats.meshes import Cells, MeshFile, columns
from modalbase.formats.uff.content import ModeShape
from service.show.results.space import InSpace, MotionOut, ShapeOut, measured_shape, mesh_of_result, model_shape

At = Literal["nodes", "points"]


def file_of_result(data: InSpace, at: At) -> MeshFile:
    """The mesh with the model's shapes and the measured ones expanded; or the measured points with both as they are there.

    Raises:
        Conflict: as of `mesh_of_result`.
    """
    found = mesh_of_result(data)
    if at == "nodes":
        nodes = columns(found.nodes.model_dump())
        numbers = data.arrays["mesh_numbers"] if "mesh_numbers" in data.arrays else np.arange(1, len(nodes) + 1)
        cells = [Cells(block.kind, block.set, np.array(block.numbers), np.array(block.nodes)) for block in found.blocks]
    else:
        nodes = np.array([(point.x_m, point.y_m, point.z_m) for point in found.points])
        numbers = np.array([point.label for point in found.points])
        cells = [Cells("point", "points", numbers, np.arange(len(numbers))[:, None])]
    damping = {mode["number"]: mode.get("measured_damping") for mode in data.document["modes"]}
    expanded = ", expanded" if at == "nodes" else ""
    shapes = [
        _mode(
            model_shape(data, mode.number),
            at,
            f"model mode {mode.number}",
            mode.number,
            mode.frequency_hz,
            points=numbers,
        )
        for mode in found.model
    ]
    for mode in found.measured:
        label = f"measured mode {mode.number}{expanded}"
        shape = measured_shape(data, mode.number)
        zeta = damping.get(mode.number)
        shapes.append(_mode(shape, at, label, mode.number, mode.frequency_hz, points=numbers, damping=zeta))
    return MeshFile(numbers, nodes, cells, shapes)


def _mode(
    shape: ShapeOut, at: At, label: str, number: int, hz: float, *, points: np.ndarray, damping: float | None = None
) -> ModeShape:
    motion: MotionOut = getattr(shape, at)
    values = np.array(motion.real).reshape(-1, 3) + 1j * np.array(motion.imag).reshape(-1, 3)
    return ModeShape(
        dataset=0,
        label=f"{label}, {hz:.6g} Hz",
        mode=number,
        frequency_hz=hz,
        damping_ratio=np.nan if damping is None else damping,
        points=points,
        values=values,
        kind="complex" if values.imag.any() else "normal",
    )
