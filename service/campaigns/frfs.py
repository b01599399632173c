"""FRFs in the database: list, find, store. No spectrum is loaded here."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from uuid import UUID

import numpy as np
from sqlalchemy import Select, insert, select
from sqlalchemy.orm import Session

from fecore.arrays import FloatArray
from fecore.frf import FrfSet, Quantity
from service.access import Role, User, audit
from service.campaigns.frf_schemas import UNITS, FrfOut
from service.campaigns.operations import campaign_for, project_of
from service.campaigns.spectra import encode, encode_axis
from service.campaigns.tables import Campaign, Frf
from service.problems import NotFound, not_found_as


@dataclass(frozen=True)
class FrfFilter:
    """Which FRFs of a campaign; None does not narrow.

    Attributes:
        point: response point.
        direction: signed response direction.
        reference: reference point.
        quantity: accelerance, mobility or receptance.
        import_id: the import that they came with.
        fmin: at least one line at or above this, Hz.
        fmax: at least one line at or below this, Hz.
    """

    point: int | None = None
    direction: int | None = None
    reference: int | None = None
    quantity: Quantity | None = None
    import_id: UUID | None = None
    fmin: float | None = None
    fmax: float | None = None

    def query(self, campaign_id: UUID) -> Select[Frf]:
        """The rows, without order."""
        query = select(Frf).where(Frf.campaign_id == campaign_id)
        equal = {
            Frf.response_point: self.point,
            Frf.response_direction: self.direction,
            Frf.reference_point: self.reference,
            Frf.quantity: self.quantity,
            Frf.import_id: self.import_id,
        }
        for column, value in equal.items():
            if value is not None:
                query = query.where(column == value)
        if self.fmin is not None:
            query = query.where(Frf.end_hz >= self.fmin)
        if self.fmax is not None:
            query = query.where(Frf.start_hz <= self.fmax)
        return query


@dataclass(frozen=True)
class NewFrfs:
    """FRFs of a script, checked.

    Attributes:
        frfs: values in the precision that they came in.
        labels: N labels.
        averages: N numbers of averages, or None.
        coherence: (N, L) ordinary coherence γ², NaN rows where one FRF has none; None where none has.
    """

    frfs: FrfSet
    labels: tuple[str, ...]
    averages: tuple[int | None, ...]
    coherence: FloatArray | None


def frf_for(session: Session, user: User, frf_id: UUID, role: Role = "viewer") -> Frf:
    """The FRF, if the user has at least this role in its project.

    Raises:
        NotFound: there is none, it is other people's, or its campaign is deleted.
    """
    frf = session.get(Frf, frf_id)
    if frf is None:
        raise NotFound("FRF", frf_id)
    with not_found_as("FRF", frf_id):
        campaign_for(session, user, frf.campaign_id, role)
    return frf


def store_frfs(session: Session, user: User, campaign: Campaign, new: NewFrfs) -> list[Frf]:
    """Store FRFs of a script; all or none."""
    axis = encode_axis(new.frfs.frequency_hz).columns()
    rows: list[dict[str, Any]] = []
    for i, values in enumerate(new.frfs.values):
        response, reference = new.frfs.responses[i], new.frfs.references[i]
        rows.append(
            {
                "campaign_id": campaign.id,
                "label": new.labels[i],
                "response_point": response.point,
                "response_direction": response.direction,
                "reference_point": reference.point,
                "reference_direction": reference.direction,
                "quantity": new.frfs.quantity,
                "averages": new.averages[i],
                **axis,
                **encode(values).columns(),
                **_coherence_columns(None if new.coherence is None else new.coherence[i]),
            }
        )
    stored = session.scalars(insert(Frf).returning(Frf, sort_by_parameter_order=True), rows).all()
    audit(session, user, "frf.create", "campaign", campaign.id, project_of(session, campaign), count=len(rows))
    return list(stored)


def describe(frf: Frf) -> FrfOut:
    """An FRF as clients see it."""
    return FrfOut(
        id=frf.id,
        campaign_id=frf.campaign_id,
        import_id=frf.import_id,
        dataset=frf.dataset,
        label=frf.label,
        response_point=frf.response_point,
        response_direction=frf.response_direction,
        reference_point=frf.reference_point,
        reference_direction=frf.reference_direction,
        quantity=frf.quantity,  # type: ignore[arg-type]  # the column holds what was checked on the way in
        unit=UNITS[frf.quantity],  # type: ignore[index]
        averages=frf.averages,
        lines=frf.lines,
        start_hz=frf.start_hz,
        end_hz=frf.end_hz,
        step_hz=frf.step_hz,
        dtype=str(np.dtype(frf.dtype)),
        sha256=frf.sha256.hex(),
        has_coherence=frf.coherence_sha256 is not None,
        created_at=frf.created_at,
    )


def _coherence_columns(coherence: FloatArray | None) -> dict[str, Any]:
    if coherence is None or np.isnan(coherence).all():
        return {"coherence": None, "coherence_dtype": None, "coherence_sha256": None}
    spectrum = encode(coherence)
    return {
        "coherence": spectrum.data,
        "coherence_dtype": spectrum.dtype,
        "coherence_sha256": spectrum.sha256,
    }
