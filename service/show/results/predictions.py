"""The FRFs that the updated model predicts, as tables that are written like measured ones.

A prediction has one FRF for each measured one that could be used, in the order in which the result's provenance names them.
Each is given the degrees of freedom of its measured FRF, in the file's coordinates.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal
from uuid import UUID

from sqlalchemy.orm import Session

from fecore.arrays import IntArray
from fecore.frf import Dof
from service.compute.frame import Frame
from service.errors import Conflict, NotFound
from service.store.campaigns.operations import campaign_of, frame_of
from service.store.frfs.data import Cut, FrfTable, Values
from service.store.frfs.operations import frfs_of, row_of_prediction
from service.store.updating.operations import result_arrays, result_document

if TYPE_CHECKING:
    from service.store.frfs.operations import Frf
    from service.store.updating.tables import UpdateJob

Model = Literal["updated", "initial"]


@dataclass(frozen=True)
class PredictedTable(FrfTable):
    """FRFs of a model on one frequency axis."""

    values: Values  # (N, L) on the lines that are wanted
    origin: str  # whose they are, in words

    @property
    def description(self) -> str:
        """Whose FRFs these are."""
        return self.origin

    def spectra(self) -> Iterator[tuple[Frf, Values]]:
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
    arrays = result_arrays(session, job)
    frequency, values = arrays["frequency_hz"], arrays[model]
    dofs = list(zip(_dofs(arrays["responses"]), _dofs(arrays["references"]), strict=True))
    ids = [UUID(frf["id"]) for frf in document["provenance"]["frfs"]]
    measured = used_frfs(session, job, frfs_of(session, ids), dofs)
    wanted = [i for i, frf in enumerate(measured) if _is_chosen(frf, chosen)]
    if not wanted:
        raise NotFound("predicted FRF at these points and in this direction in this result")
    lines = cut.lines(frequency)
    return PredictedTable(
        session=session,
        frfs=[row_of_prediction(measured[i], frequency, values.dtype) for i in wanted],
        frequency_hz=frequency[lines],
        lines=lines,
        values=values[wanted][:, lines],
        origin=f"predicted by the {model} model, update job {job.id}",
    )


def _dofs(table: IntArray) -> list[Dof]:
    return [Dof(int(point), int(direction)) for point, direction in table]


def used_frfs(session: Session, job: UpdateJob, measured: list[Frf], dofs: list[tuple[Dof, Dof]]) -> list[Frf]:
    """The measured FRFs that the predictions at these degrees of freedom, in the specimen's frame, belong to.

    Raises:
        Conflict: FRFs were left out of the update and the campaign's frame was changed since, so none can say which.
    """
    if len(measured) == len(dofs):
        return measured
    frame = frame_of(campaign_of(session, job.campaign_id))
    left, used = iter(measured), []
    for pair in dofs:
        match = next((frf for frf in left if _dofs_in(frame, frf) == pair), None)
        if match is None:
            raise Conflict(
                "the campaign's frame was changed after this update: restore it, or no prediction finds its FRF"
            )
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
