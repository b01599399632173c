"""What the figures of an update are drawn from: its result document, its predicted FRFs and the measured ones beside them."""

from __future__ import annotations

import io
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any
from uuid import UUID

import numpy as np
from sqlalchemy.orm import Session

from fecore.arrays import ComplexArray, FloatArray
from fecore.frf import Dof
from service.errors import Conflict
from service.frfs.data import FrfTable
from service.frfs.operations import frfs_of
from service.updating.operations import result_document
from service.updating.predictions import used_frfs
from service.updating.tables import UpdateJob, UpdateResult

if TYPE_CHECKING:
    from service.frfs.tables import Frf


@dataclass(frozen=True)
class UpdateFigures:
    """A job whose figures are drawn; everything is read when a figure asks for it.

    Attributes:
        session: of the request.
        job: the update.
    """

    session: Session
    job: UpdateJob

    @cached_property
    def document(self) -> dict[str, Any]:
        """The result document.

        Raises:
            Conflict: the job has no result, yet or ever.
        """
        return result_document(self.session, self.job)

    @cached_property
    def arrays(self) -> dict[str, Any]:
        """Arrays that were stored beside the document: predicted FRFs and what belongs to them.

        Raises:
            Conflict: the job has no result, yet or ever.
        """
        result_document(self.session, self.job)
        with np.load(io.BytesIO(self.session.get_one(UpdateResult, self.job.id).prediction)) as stored:
            return dict(stored)

    def require_prediction(self) -> None:
        """Make sure that FRFs were predicted.

        Raises:
            Conflict: none were; the message says why.
        """
        if self.arrays["frequency_hz"].size == 0:
            damping = next((o for o in self.document["outcomes"] if o["stage"] == "damping"), None)
            why = f": {damping['message']}" if damping and damping["message"] else ""
            raise Conflict(f"this update predicts no FRF, as its damping was not fitted to any{why}")

    @cached_property
    def dofs(self) -> list[tuple[Dof, Dof]]:
        """Response and reference of each predicted FRF, in the specimen's frame."""
        pairs = zip(self.arrays["responses"].tolist(), self.arrays["references"].tolist(), strict=True)
        return [(Dof(*response), Dof(*reference)) for response, reference in pairs]

    @cached_property
    def rows(self) -> list[Frf]:
        """The measured FRF that each prediction belongs to."""
        ids = [UUID(frf["id"]) for frf in self.document["provenance"]["frfs"]]
        return used_frfs(self.session, self.job, frfs_of(self.session, ids), self.dofs)

    def measured(self, rows: list[int]) -> tuple[ComplexArray, list[FloatArray | None]]:
        """(n, L) measured FRFs at these places, and the coherence of each, or None where none was stored."""
        frequency = self.arrays["frequency_hz"]
        table = FrfTable(self.session, [self.rows[row] for row in rows], frequency, slice(None))
        found = [(values, coherence) for _, values, coherence in table.both()]
        return np.array([values for values, _ in found], dtype=complex), [coherence for _, coherence in found]

    @property
    def held_points(self) -> frozenset[int]:
        """Points of FRFs that were held out of the fit."""
        held = self.document["correlation"]["held_out"]["frfs"]
        return frozenset() if held is None else frozenset(held["points"])
