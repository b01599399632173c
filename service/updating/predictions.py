"""The FRFs that the updated model predicts, as tables that are written like measured ones.

A prediction has one FRF for each measured one that could be used, in the order in which the result's provenance names them.
Each is given the degrees of freedom of its measured FRF, in the file's coordinates.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal
from uuid import UUID

import numpy as np
from sqlalchemy import select
from sqlalchemy.orm import Session

from fecore.arrays import FloatArray, IntArray
from fecore.frf import Dof
from service.campaigns.frame import Frame
from service.campaigns.frf_data import Cut, FrfTable, Values
from service.campaigns.operations import frame_of
from service.campaigns.tables import Campaign, Frf
from service.problems import Conflict, NotFound
from service.updating.operations import result_document
from service.updating.tables import UpdateJob, UpdateResult

Model = Literal["updated", "initial"]


@dataclass(frozen=True)
class PredictedTable(FrfTable):
    """FRFs of a model on one frequency axis.

    Attributes:
        values: (N, L) on the lines that are wanted.
        origin: whose they are, in words.
    """

    values: Values
    origin: str

    @property
    def description(self) -> str:
        """Whose FRFs these are."""
        return self.origin

    def spectra(self, session: Session) -> Iterator[tuple[Frf, Values]]:  # noqa: ARG002  nothing is in the database
        """Each FRF with its (L,) values, in order."""
        yield from zip(self.frfs, self.values, strict=True)


@dataclass(frozen=True)
class Chosen:
    """Which of the predicted FRFs; None does not narrow."""

    point: int | None = None
    direction: int | None = None
    reference: int | None = None


def predicted_table(session: Session, job: UpdateJob, model: Model, chosen: Chosen, cut: Cut) -> PredictedTable:
    """The FRFs of a job's model.

    Raises:
        Conflict: the job has no result, yet or ever; or the campaign's frame was changed since.
        NotFound: none is at the chosen points.
        Invalid: the cut leaves no line.
    """
    document = result_document(session, job)
    with np.load(io.BytesIO(session.get_one(UpdateResult, job.id).prediction)) as arrays:
        frequency, values = arrays["frequency_hz"], arrays[model]
        dofs = list(zip(_dofs(arrays["responses"]), _dofs(arrays["references"]), strict=True))
    ids = [UUID(frf["id"]) for frf in document["provenance"]["frfs"]]
    rows = {frf.id: frf for frf in session.scalars(select(Frf).where(Frf.id.in_(ids)))}
    measured = _used(session, job, [rows[key] for key in ids], dofs)
    wanted = [i for i, frf in enumerate(measured) if _is_chosen(frf, chosen)]
    if not wanted:
        raise NotFound("predicted FRF that matches in this result")
    lines = cut.lines(frequency)
    return PredictedTable(
        frfs=[_row(measured[i], frequency, values.dtype) for i in wanted],
        frequency_hz=frequency[lines],
        lines=lines,
        values=values[wanted][:, lines],
        origin=f"predicted by the {model} model, update job {job.id}",
    )


def _dofs(table: IntArray) -> list[Dof]:
    return [Dof(int(point), int(direction)) for point, direction in table]


def _used(session: Session, job: UpdateJob, measured: list[Frf], dofs: list[tuple[Dof, Dof]]) -> list[Frf]:
    """The measured FRFs that the predictions at these degrees of freedom, in the specimen's frame, belong to.

    Raises:
        Conflict: FRFs were left out of the update and the campaign's frame was changed since, so none can say which.
    """
    if len(measured) == len(dofs):
        return measured
    frame = frame_of(session.get_one(Campaign, job.campaign_id))
    left, used = iter(measured), []
    for pair in dofs:
        match = next((frf for frf in left if _dofs_in(frame, frf) == pair), None)
        if match is None:
            raise Conflict("the campaign's frame is not the one of this result; restore it to tell the FRFs apart")
        used.append(match)
    return used


def _dofs_in(frame: Frame, frf: Frf) -> tuple[Dof, Dof]:
    return (
        frame.dof(Dof(frf.response_point, frf.response_direction)),
        frame.dof(Dof(frf.reference_point, frf.reference_direction)),
    )


def _is_chosen(frf: Frf, chosen: Chosen) -> bool:
    pairs = (
        (chosen.point, frf.response_point),
        (chosen.direction, frf.response_direction),
        (chosen.reference, frf.reference_point),
    )
    return all(wanted in (None, there) for wanted, there in pairs)


def _row(measured: Frf, frequency: FloatArray, dtype: np.dtype[np.complexfloating]) -> Frf:
    """A row that describes a prediction, and is never stored; its id is the measured FRF's."""
    return Frf(
        id=measured.id,
        campaign_id=measured.campaign_id,
        label=measured.label,
        response_point=measured.response_point,
        response_direction=measured.response_direction,
        reference_point=measured.reference_point,
        reference_direction=measured.reference_direction,
        quantity=measured.quantity,
        averages=None,
        start_hz=float(frequency[0]),
        end_hz=float(frequency[-1]),
        lines=frequency.size,
        dtype=f"<{dtype.kind}{dtype.itemsize}",
        coherence_sha256=None,
    )
