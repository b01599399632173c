"""The FRFs that the updated model predicts, as tables that are written like measured ones.

A prediction has one FRF for each measured one that could be used, in the order in which the
result's provenance names them. Each is given the degrees of freedom of its measured FRF, in the
file's coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal
from uuid import UUID

from sqlalchemy.orm import Session

from fecore.arrays import IntArray
from fecore.frf import Dof
from modalbase.formats.frfs import FrfRow
from modalbase.formats.frfs.table import DOFS
from service.compute.frame import Frame
from service.nouns.campaigns.operations import campaign_of, frame_of, stored_points
from service.nouns.frfs.data import Cut, PredictedTable
from service.nouns.frfs.operations import frfs_of
from service.nouns.updates.operations import result_arrays, result_document
from service.platform.errors import Conflict, NotFound

if TYPE_CHECKING:
    from service.nouns.frfs.operations import Frf
    from service.nouns.updates.tables import UpdateJob

Model = Literal["updated", "initial"]


@dataclass(frozen=True)
class FrfQuery:
    """Which of the predicted FRFs; None does not narrow."""

    point: int | None = None
    direction: int | None = None
    reference: int | None = None


def predicted_table(
    session: Session, job: UpdateJob, model: Model, chosen: FrfQuery, cut: Cut
) -> PredictedTable:
    """The FRFs of a job's model.

    Raises:
        Conflict: the job has no result, yet or ever; or the result rests on modes alone; or the
            campaign's frame was changed since.
        NotFound: none is at the chosen points.
        Invalid: the cut leaves no line.
    """
    document = result_document(session, job)
    arrays = result_arrays(session, job)
    frequency, values = arrays["frequency_hz"], arrays[model]
    dofs = list(zip(_dofs(arrays["responses"]), _dofs(arrays["references"]), strict=True))
    if not dofs:
        raise Conflict(
            "the result has no predicted FRFs: it rests on modes alone, and the campaign had no"
            " measured FRF to predict"
        )
    ids = [UUID(frf["id"]) for frf in document["provenance"]["frfs"]]
    measured = used_frfs(session, job, frfs_of(session, ids), dofs)
    rows = [i for i, frf in enumerate(measured) if _is_chosen(frf, chosen)]
    if not rows:
        raise NotFound("predicted FRF at these points and in this direction in this result")
    lines = cut.lines(frequency)
    described = [
        {name: getattr(measured[i], name) for name in (*DOFS, "label")}
        | {"id": str(measured[i].id)}
        for i in rows
    ]
    return PredictedTable(
        frequency_hz=frequency[lines],
        values=values[rows][:, lines],
        frfs=tuple(FrfRow(**each) for each in described),
        quantity=measured[0].quantity,  # type: ignore[arg-type]  # the column holds what was checked on the way in
        description=f"predicted by the {model} model, update job {job.id}",
        points_of=lambda: stored_points(session, job.campaign_id),
    )


def _dofs(table: IntArray) -> list[Dof]:
    return [Dof(int(point), int(direction)) for point, direction in table]


def used_frfs(
    session: Session, job: UpdateJob, measured: list[Frf], dofs: list[tuple[Dof, Dof]]
) -> list[Frf]:
    """The measured FRFs that the predictions at these degrees of freedom, in the specimen's frame,
    belong to.

    Raises:
        Conflict: FRFs were left out of the update and the campaign's frame was changed since, so
            none can say which.
    """
    if len(measured) == len(dofs):
        return measured
    frame = frame_of(campaign_of(session, job.campaign_id))
    left, used = iter(measured), []
    for pair in dofs:
        match = next((frf for frf in left if _dofs_in(frame, frf) == pair), None)
        if match is None:
            raise Conflict(
                "the campaign's frame was changed after this update: restore it, or no prediction"
                " finds its FRF"
            )
        used.append(match)
    return used


def _dofs_in(frame: Frame, frf: Frf) -> tuple[Dof, Dof]:
    return (
        frame.dof(Dof(frf.response_point, frf.response_direction)),
        frame.dof(Dof(frf.reference_point, frf.reference_direction)),
    )


def _is_chosen(frf: Frf, chosen: FrfQuery) -> bool:
    pairs = (
        (chosen.point, frf.response_point),
        (chosen.direction, frf.response_direction),
        (chosen.reference, frf.reference_point),
    )
    return all(value in (None, there) for value, there in pairs)
