"""What the figures of an update are drawn from: its result, its predicted FRFs and the measured
ones; which FRF is meant.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any
from uuid import UUID

import numpy as np
from sqlalchemy.orm import Session

from fecore.arrays import ComplexArray, FloatArray
from fecore.frf import Dof
from service.figures.frfs import FrfCurves, Spread, dof_name, frf_figure
from service.figures.marks import Figure
from service.nouns.frfs.data import Cut, FrfTable, frequency_axis
from service.nouns.frfs.operations import frfs_of
from service.nouns.imports.operations import trace_lines_of
from service.nouns.structures.operations import describe_version, version_of
from service.nouns.updates.document import StoredArrays
from service.nouns.updates.operations import result_arrays, result_document, result_parts
from service.platform.errors import Conflict, NotFound
from service.reports.predictions import used_frfs

if TYPE_CHECKING:
    from service.nouns.frfs.operations import Frf
    from service.nouns.updates.tables import UpdateJob


@dataclass(frozen=True)
class UpdateFigures:
    """A job whose figures are drawn; everything is read when a figure asks for it."""

    session: Session  # of the request
    job: UpdateJob  # the update, of one campaign or of several

    @cached_property
    def document(self) -> dict[str, Any]:
        """The result document.

        Raises:
            Conflict: the job has no result, yet or ever.
        """
        return result_document(self.session, self.job)

    @cached_property
    def light(self) -> dict[str, Any]:
        """Band, and where the result came from: the members that a figure of FRFs needs, without
        reading the others.

        Raises:
            Conflict: the job has no result, yet or ever.
        """
        parts = result_parts(self.session, [self.job.id], ("band_hz", "provenance"))
        return parts[self.job.id] if parts else self.document

    @cached_property
    def arrays(self) -> StoredArrays:
        """Arrays that were stored beside the document: predicted FRFs and what belongs to them.

        Raises:
            Conflict: the job has no result, yet or ever.
        """
        return result_arrays(self.session, self.job)

    @property
    def trace_lines(self) -> list[list[int]]:
        """How the campaign's files join their points."""
        return trace_lines_of(self.session, self.job.campaign_id)

    def require_prediction(self) -> None:
        """Make sure that FRFs were predicted.

        Raises:
            Conflict: none were; the message says why.
        """
        if self.arrays["frequency_hz"].size == 0:
            damping = next((o for o in self.document["outcomes"] if o["stage"] == "damping"), None)
            why = f": {damping['message']}" if damping and damping["message"] else ""
            raise Conflict(
                f"this update predicts no FRFs, because its damping was not fitted to any{why}"
            )

    @cached_property
    def dofs(self) -> list[tuple[Dof, Dof]]:
        """Response and reference of each predicted FRF, in the specimen's frame."""
        pairs = zip(
            self.arrays["responses"].tolist(), self.arrays["references"].tolist(), strict=True
        )
        return [(Dof(*response), Dof(*reference)) for response, reference in pairs]

    def measured_frf(self, row: int) -> Frf:
        """The measured FRF that a prediction belongs to."""
        ids = [UUID(frf["id"]) for frf in self.light["provenance"]["frfs"]]
        if len(ids) == len(self.dofs):
            return frfs_of(self.session, [ids[row]])[0]
        return used_frfs(self.session, self.job, frfs_of(self.session, ids), self.dofs)[row]

    def measured(self, frf: Frf) -> tuple[ComplexArray, FloatArray | None]:
        """(L,) measured values on the predicted lines, and the coherence, or None where none was
        stored.
        """
        frequency = self.arrays["frequency_hz"]
        first = int(np.searchsorted(frequency_axis(self.session, frf), frequency[0] * (1 - 1e-9)))
        ((_, values, coherence),) = FrfTable(
            self.session, [frf], frequency, slice(first, first + frequency.size)
        ).both()
        return values.astype(complex), coherence

    def moving_point(self, row: int) -> int:
        """The point that distinguishes an FRF from the others: that of the side which moved; of
        both, the response's.
        """
        response, reference = self.dofs[row]
        return reference.point if self._responses_stay else response.point

    @cached_property
    def _responses_stay(self) -> bool:
        responses, references = ({pair[side] for pair in self.dofs} for side in (0, 1))
        return len(responses) < len(references)

    @property
    def plan(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """From where to where the specimen goes along x and y, m, as it was when the job was
        queued; of a model, the points.
        """
        structure = describe_version(version_of(self.session, self.job.structure_version_id), "")
        size = structure.geometry or structure.shape
        if size is not None:
            return (0, size.length_m), (-size.width_m / 2, size.width_m / 2)
        places = self.arrays["shape_places_m"]
        low, high = places.min(axis=0), places.max(axis=0)
        thin = 0.01 * float(np.max(high - low))
        x, y = ((float(a) - thin, float(b) + thin) for a, b in zip(low[:2], high[:2], strict=True))
        return x, y


@dataclass(frozen=True)
class FigureQuery:
    """What the query of a figure's route says."""

    point: int | None = None  # grid point whose FRF is drawn; None for the first one
    # the other point of the FRF, where one point alone does not say which; or None
    reference: int | None = None
    # fmin, fmax: lines that are drawn, Hz; None for all
    fmin: float | None = None
    fmax: float | None = None
    # measured, model: numbers from 1 of a measured mode and of one of the model, whose shapes are
    # drawn; None for all pairs
    measured: int | None = None
    model: int | None = None


def update_frf_figure(data: UpdateFigures, query: FigureQuery) -> Figure:
    """The overlay of one FRF of an update that predicted some. Its `meta` says which points there
    are.

    Raises:
        NotFound: there is no FRF at the points.
        Invalid: no line lies in the band.
    """
    row = _row_at(data, query)
    frequency = data.arrays["frequency_hz"]
    lines = Cut(query.fmin, query.fmax).lines(frequency)
    frf = data.measured_frf(row)
    measured, coherence = data.measured(frf)
    response, reference = data.dofs[row]
    held = row in data.arrays["held"] if "held" in data.arrays else False
    spread = None
    if "log_magnitude_sd" in data.arrays:
        sds = [data.arrays.row(name, row)[lines] for name in ("log_magnitude_sd", "phase_sd")]
        spread = Spread(*sds)
    curves = FrfCurves(
        title=(
            f"FRF {dof_name(response)} /"
            f" {dof_name(reference)}{', held out of the fit' if held else ''}"
        ),
        quantity=frf.quantity,
        frequency_hz=frequency[lines],
        measured=measured[lines],
        coherence=None if coherence is None else coherence[lines],
        models={name: data.arrays.row(name, row)[lines] for name in ("initial", "updated")},
        spread=spread,
        band_hz=_pair(data.light["band_hz"]),
        held_band_hz=_pair(data.light["provenance"]["recipe"]["hold_out"]["band_hz"]),
    )
    meta = {"response": response.point, "reference": reference.point, "points": _points(data)}
    return replace(frf_figure(curves), meta=meta)


def _row_at(data: UpdateFigures, query: FigureQuery) -> int:
    """Place of the FRF at a point: that between the two points where both are named."""
    pairs = [(response.point, reference.point) for response, reference in data.dofs]
    named = [point for point in (query.point, query.reference) if point is not None]
    rows = [row for row, pair in enumerate(pairs) if all(point in pair for point in named)]
    if query.point is not None and query.point == query.reference:
        rows = [row for row in rows if pairs[row][0] == pairs[row][1]]
    if not rows:
        raise NotFound(
            f"FRF at point {' and '.join(map(str, named))} in this result; there are points"
            f" {_listed(data)}"
        )
    # Of those that share a fixed point the one whose moving point is the requested one.
    moving = 1 if len({pair[1] for pair in pairs}) >= len({pair[0] for pair in pairs}) else 0
    return next((row for row in rows if pairs[row][moving] == query.point), rows[0])


def _points(data: UpdateFigures) -> list[int]:
    return sorted({dof.point for pair in data.dofs for dof in pair})


def _listed(data: UpdateFigures) -> str:
    points = _points(data)
    return ", ".join(map(str, points[:20])) + (" …" if len(points) > 20 else "")


def _pair(values: Any) -> tuple[float, float] | None:
    return None if values is None else (float(values[0]), float(values[1]))
