"""A result in space: its mesh with the measured points, and shapes on it, those of the model and
the measured ones expanded.

A measured shape φ at the points is expanded by the model's shapes (SEREP: O'Callahan, Avitabile and
Riemer, IMAC VII, 1989): with Ψ those of the model at the points and Φ those on its mesh, φ_mesh = Φ
Ψ⁺ φ. Of the model's modes those nearest in frequency take part, at most one for two measured
values, so that what they miss says how well they describe the measurement; and combinations of them
that the points hardly see are left out of the pseudo-inverse.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Literal, Protocol

import numpy as np
from fastapi import Request, Response
from pydantic import Field

from fecore.arrays import ComplexArray, FloatArray, IntArray
from modalbase.client.results import motion_words
from modalbase.formats.cell_types import CELL_TYPES
from modalbase.formats.meshes import Cells, MeshFile, columns
from modalbase.formats.uff.content import ModeShape
from service.figures.marks import counted
from service.figures.modes import joined_as, turned
from service.nouns.structures.model_routes import MeshBlockOut, PlacesOut, mesh_answer
from service.platform.errors import Conflict, NotFound
from service.platform.web import StrictModel
from service.platform.web.routing import require_used

UNSEEN = 0.03
"""Share of the best seen combination of modes below which the points leave open how much there is
of one.
"""

DIGITS = 5


class InSpace(Protocol):
    """What is drawn: the result of an update, or a model that was solved."""

    @property
    def document(self) -> Mapping[str, Any]:
        """With `modes`, measured, and `model_modes`."""
        ...

    @property
    def arrays(self) -> Mapping[str, Any]:
        """With mesh and shapes, by the names of a result's."""
        ...

    @property
    def trace_lines(self) -> Sequence[Sequence[int]]:
        """How files join the points."""
        ...


class MeasuredPointOut(StrictModel):
    """A measured point in the structure's frame."""

    label: int = Field(description="of the grid point")
    x_m: float = Field(description="m")
    y_m: float = Field(description="m")
    z_m: float = Field(description="m")
    response: list[list[float]] = Field(
        description="unit vectors along which shapes are known there"
    )
    held_out: bool = Field(description="whether no measured shape is known there")


class MeasuredModeOut(StrictModel):
    """A measured mode."""

    number: int = Field(description="as rows of the MAC count them, from 1")
    frequency_hz: float
    model: int | None = Field(description="number of its partner in the model")


class ModelModeOut(StrictModel):
    """A mode of the model."""

    number: int = Field(description="as columns of the MAC count them, from 1")
    frequency_hz: float
    kind: str = Field(description="in words: bending, torsion, in-plane, with its shares")


class ResultMeshOut(StrictModel):
    """The mesh of the updated model, the measured points, and the modes that have shapes."""

    nodes: PlacesOut = Field(description="by column")
    blocks: list[MeshBlockOut] = Field(description="elements of one kind and set each")
    points: list[MeasuredPointOut]
    joined: list[tuple[int, int]] = Field(
        description=(
            "rows of `points` from 0: along the files' trace lines, else neighbours; none that is"
            " held out"
        )
    )
    measured: list[MeasuredModeOut] = Field(description="measured modes with shapes")
    model: list[ModelModeOut] = Field(description="modes of the updated model")


class MotionOut(StrictModel):
    """Displacements x, y, z of one place after the other: real · cos ωt − imag · sin ωt."""

    real: list[float]
    imag: list[float]


class ShapeOut(StrictModel):
    """A shape; its largest displacement is 1."""

    nodes: MotionOut = Field(
        description="of the mesh; of a measured mode expanded by the model's shapes"
    )
    points: MotionOut = Field(
        description="of the measured points along their directions: as measured, not expanded"
    )
    missed_percent: float | None = Field(
        description="of a measured shape that the expansion misses at its points, rms"
    )
    words: str = Field(description="what was measured and what expanded")


def mesh_of_result(data: InSpace) -> ResultMeshOut:
    """The mesh of a result.

    Raises:
        Conflict: an earlier version computed it and kept none, or there are no shapes.
    """
    arrays = _arrays(data)
    labels, first, _ = _points(data)
    places = arrays["shape_places_m"][first]
    known = arrays["shapes_measured"].shape[1]
    own = np.flatnonzero(first < (known or len(arrays["shape_points"])))
    partners = {int(i): int(j) + 1 for i, j in arrays["shape_pairs"].tolist()}
    nodes = arrays["mesh_nodes_m"].astype(float)
    blocks = zip(arrays["mesh_kinds"].tolist(), arrays["mesh_sets"].tolist(), strict=True)
    elements = [arrays[f"mesh_elements_{k}"].tolist() for k in range(len(arrays["mesh_kinds"]))]
    measured = data.document["modes"] if known else []
    return ResultMeshOut(
        nodes=PlacesOut(
            **{f"{axis}_m": np.round(nodes[:, k], 7).tolist() for k, axis in enumerate("xyz")}
        ),
        blocks=[
            MeshBlockOut(
                set=name,
                kind=kind,
                corners=CELL_TYPES[kind].corners,
                numbers=list(range(1, len(rows) + 1)),
                nodes=rows,
            )
            for (kind, name), rows in zip(blocks, elements, strict=True)
        ],
        points=[
            MeasuredPointOut(
                label=label,
                x_m=x,
                y_m=y,
                z_m=z,
                response=_directions(arrays, label),
                held_out=k not in own,
            )
            for k, (label, (x, y, z)) in enumerate(zip(labels, places.tolist(), strict=True))
        ],
        joined=[
            (int(own[i]), int(own[j]))
            for i, j in joined_as(data.trace_lines, [labels[k] for k in own], places[own])
        ],
        measured=[
            MeasuredModeOut(number=k + 1, frequency_hz=mode["measured_hz"], model=partners.get(k))
            for k, mode in enumerate(measured)
        ],
        model=[
            ModelModeOut(
                number=mode["number"],
                frequency_hz=mode["frequency_hz"],
                kind=motion_words(mode) or "",
            )
            for mode in data.document["model_modes"]
        ],
    )


def measured_shape(data: InSpace, number: int) -> ShapeOut:
    """A measured shape at its points, and expanded over the mesh.

    Raises:
        Conflict: as of `mesh_of_result`.
        NotFound: there is no such mode with a shape.
    """
    arrays = _arrays(data)
    measured = arrays["shapes_measured"].astype(complex)
    _require_mode(number, len(measured) if measured.shape[1] else 0, "measured")
    shape = turned(measured[number - 1])
    near = _nearest(
        data, data.document["modes"][number - 1]["measured_hz"], max(1, shape.size // 2)
    )
    at_points = arrays["shapes_updated"][near].astype(float)[:, : shape.size]
    share = np.linalg.pinv(at_points.T, rcond=UNSEEN) @ shape
    miss = 100 * float(np.linalg.norm(at_points.T @ share - shape) / np.linalg.norm(shape))
    everywhere = np.einsum(
        "m,mnk->nk",
        share * arrays["mesh_largest"][near],
        arrays["mesh_shapes"][near].astype(np.float32),
    )
    words = (
        f"{counted(shape.size, 'measured value')}, expanded over the mesh by"
        f" {counted(len(near), 'mode')} of the model"
    )
    words += f", which miss {miss:.1f} % of them"
    return _shape(data, shape, everywhere, miss, words)


def model_shape(data: InSpace, number: int) -> ShapeOut:
    """A shape of the updated model on its mesh, and at the measured points.

    Raises:
        Conflict: as of `mesh_of_result`.
        NotFound: there is no such mode.
    """
    arrays = _arrays(data)
    _require_mode(number, len(arrays["mesh_shapes"]), "model")
    scale = float(arrays["mesh_largest"][number - 1])
    everywhere = scale * arrays["mesh_shapes"][number - 1].astype(float)
    partner = next((i for i, j in arrays["shape_pairs"].tolist() if j == number - 1), None)
    at_points = arrays["shapes_updated"][number - 1].astype(float)
    measured = arrays["shapes_measured"]
    # in step with its partner, which is turned to be real
    if partner is not None and measured.shape[1]:
        against = float(
            turned(measured[partner].astype(complex)).real @ at_points[: measured.shape[1]]
        )
        everywhere, at_points = (
            (np.sign(against) or 1.0) * everywhere,
            (np.sign(against) or 1.0) * at_points,
        )
    return _shape(data, at_points, everywhere, None, "of the model")


def _nearest(data: InSpace, hz: float, most: int) -> IntArray:
    """Numbers from 0 of the model's modes that are nearest in frequency."""
    distance = np.abs(
        np.array([mode["frequency_hz"] for mode in data.document["model_modes"]]) - hz
    )
    return np.sort(np.argsort(distance, kind="stable")[:most])


def _arrays(data: InSpace) -> Any:
    arrays = data.arrays
    if "mesh_shapes" not in arrays:
        raise Conflict(
            "this result keeps no mesh: it has no shapes, or an earlier version computed it; run"
            " the update again"
        )
    return arrays


def _require_mode(number: int, count: int, side: str) -> None:
    if number > count:
        raise NotFound(f"shape of the {side} mode {number} in this result; there are {count}")


def _points(data: InSpace) -> tuple[list[int], IntArray, IntArray]:
    """Labels of the points, their first rows among those of the shapes, and the point of each
    row.
    """
    labels, first, of = np.unique(
        data.arrays["shape_points"], return_index=True, return_inverse=True
    )
    return labels.tolist(), first, of


def _directions(arrays: Any, label: int) -> list[list[float]]:
    mine = arrays["shape_directions"][arrays["shape_points"] == label].astype(float)
    return np.unique(np.round(mine, 6), axis=0).tolist()  # type: ignore[no-any-return]


def _shape(
    data: InSpace,
    values: ComplexArray | FloatArray,
    everywhere: Any,
    miss: float | None,
    words: str,
) -> ShapeOut:
    """Values along the directions of the first rows of the points, and displacements of the nodes,
    by one scale.
    """
    labels, _, of = _points(data)
    directions = data.arrays["shape_directions"].astype(float)[: values.size]
    at_points = np.zeros((len(labels), 3), dtype=complex)
    np.add.at(at_points, of[: values.size], values[:, None] * directions)
    scale = max(float(np.linalg.norm(np.abs(everywhere), axis=1).max(initial=0.0)), 1e-300)
    return ShapeOut(
        nodes=_motion(everywhere / scale),
        points=_motion(at_points / scale),
        missed_percent=miss,
        words=words,
    )


def _motion(moved: ComplexArray | FloatArray) -> MotionOut:
    real, imag = np.real(moved).ravel(), np.imag(moved).ravel()
    return MotionOut(real=np.round(real, DIGITS).tolist(), imag=np.round(imag, DIGITS).tolist())


At = Literal["nodes", "points"]


def answer_mesh(
    data: InSpace, request: Request, form: str, at: At, name: str
) -> ResultMeshOut | Response:
    """The mesh of what is drawn as JSON, or as a file with all shapes.

    Args:
        data: what is drawn.
        request: whose query is looked at.
        form: `json`, `vtu` or `uff`.
        at: of a file: shapes at the mesh's nodes, or at the points.
        name: of the file, without its suffix.

    Raises:
        Invalid: `at` is stated of JSON, which has both.
        Conflict: as of `mesh_of_result`.
    """
    if form == "json":
        require_used(
            request, "the mesh as JSON", {"at"}, "it has both; `mesh/shapes` answers its shapes"
        )
        return mesh_of_result(data)
    return mesh_answer(file_of_result(data, at), form, name)


def file_of_result(data: InSpace, at: At) -> MeshFile:
    """The mesh with the model's shapes and the measured ones expanded; or the measured points with
    both as they are there.

    Raises:
        Conflict: as of `mesh_of_result`.
    """
    mesh = mesh_of_result(data)
    if at == "nodes":
        nodes = columns(mesh.nodes.model_dump())
        numbers = (
            data.arrays["mesh_numbers"]
            if "mesh_numbers" in data.arrays
            else np.arange(1, len(nodes) + 1)
        )
        cells = [
            Cells(block.kind, block.set, np.array(block.numbers), np.array(block.nodes))
            for block in mesh.blocks
        ]
    else:
        nodes = np.array([(point.x_m, point.y_m, point.z_m) for point in mesh.points])
        numbers = np.array([point.label for point in mesh.points])
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
        for mode in mesh.model
    ]
    for mode in mesh.measured:
        label = f"measured mode {mode.number}{expanded}"
        shape = measured_shape(data, mode.number)
        zeta = damping.get(mode.number)
        shapes.append(
            _mode(shape, at, label, mode.number, mode.frequency_hz, points=numbers, damping=zeta)
        )
    return MeshFile(numbers, nodes, cells, shapes)


def _mode(
    shape: ShapeOut,
    at: At,
    label: str,
    number: int,
    hz: float,
    *,
    points: np.ndarray,
    damping: float | None = None,
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
