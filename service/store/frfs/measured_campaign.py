"""A campaign as the updating core wants it: structure, points and FRFs in the specimen's frame, SI, with their digests."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING
from uuid import UUID

import numpy as np
from sqlalchemy import select
from sqlalchemy.orm import Session

from fecore.arrays import FloatArray
from fecore.frf import Dof, FrfSet
from service.compute.frame import Frame
from service.store.campaigns.grid_points import stored_points
from service.store.campaigns.operations import campaign_of, frame_of
from service.store.campaigns.schemas import AddedMass, CampaignInputs, Instruments
from service.store.frfs.data import Cut, FrfTable, make_tables
from service.store.frfs.operations import Frf
from service.store.structures.operations import present_structure
from service.store.structures.schemas import StructureIn

if TYPE_CHECKING:
    from service.store.campaigns.operations import Campaign


@dataclass(frozen=True)
class MeasuredFrfs:
    """FRFs of one quantity on one frequency axis.

    Attributes:
        frfs: in the specimen's frame; `variance` where every FRF has a coherence and a number of averages.
        ids: N ids of their rows.
        sha256s: N digests of their spectra, hexadecimal.
        window_rates: rates of the exponential windows that they state to carry, 1/s; None of those that state nothing.
    """

    frfs: FrfSet
    ids: tuple[UUID, ...]
    sha256s: tuple[str, ...]
    window_rates: frozenset[float | None]

    @property
    def window_rate(self) -> float | None:
        """The rate that all of them state, 1/s; None where they state none, or different ones."""
        return next(iter(self.window_rates)) if len(self.window_rates) == 1 else None

    @property
    def window_remark(self) -> list[str]:
        """What the windows mean for modes that are found from these FRFs, in words."""
        rates = sorted(rate for rate in self.window_rates if rate)
        if not rates:
            return []
        shown = ", ".join(f"{rate:g}" for rate in rates)
        return [
            f"FRFs carry an exponential window of {shown} per second: every decay rate ζω is seen too large by it, and so "
            "is the Rayleigh coefficient a0 by twice it"
        ]


@dataclass(frozen=True)
class MeasuredCampaign:
    """All that an update needs to know of a campaign.

    Attributes:
        campaign_id: its key.
        structure_version_id: key of the structure's version that this was read with.
        structure_version: its number.
        structure: what the structure is in that version.
        boundary: cantilever, free or simply_supported.
        sensor_mass_kg: mass of the sensor, 0 where none is stated.
        sensor_point: grid point where the sensor sits; None where it roves or is not stated.
        added_masses: what the specimen carried besides the sensor.
        inputs: how well is known what the test was done with.
        points: label to coordinates in the specimen's frame, m.
        frf_sets: one per quantity and frequency axis, the largest first.
        warnings: what was left out, and why.
    """

    campaign_id: UUID
    structure_version_id: UUID
    structure_version: int
    structure: StructureIn
    boundary: str
    sensor_mass_kg: float
    sensor_point: int | None
    added_masses: tuple[AddedMass, ...]
    inputs: CampaignInputs
    points: dict[int, tuple[float, float, float]]
    frf_sets: tuple[MeasuredFrfs, ...]
    warnings: tuple[str, ...]


def load_measured_campaign(session: Session, campaign_id: UUID) -> MeasuredCampaign:
    """Read a campaign with its spectra.

    Raises:
        InputError: the campaign's frame does not fit the directions of its FRFs.
    """
    campaign = campaign_of(session, campaign_id)
    version, structure = present_structure(session, campaign.structure_id)
    instruments = Instruments.model_validate(campaign.instruments)
    frame = frame_of(campaign)
    warnings: list[str] = []
    return MeasuredCampaign(
        campaign_id=campaign.id,
        structure_version_id=version.id,
        structure_version=version.number,
        structure=structure,
        boundary=campaign.boundary,
        sensor_mass_kg=instruments.sensor_mass_kg or 0.0,
        sensor_point=instruments.sensor_point,
        added_masses=tuple(instruments.added_masses),
        inputs=CampaignInputs.model_validate(campaign.inputs or {}),
        points=specimen_points(session, campaign),
        frf_sets=tuple(_frf_sets(session, campaign, frame, warnings)),
        warnings=tuple(warnings),
    )


def specimen_points(session: Session, campaign: Campaign) -> dict[int, tuple[float, float, float]]:
    """Label to coordinates in the specimen's frame, m."""
    stored = stored_points(session, campaign.id)
    if not stored:
        return {}
    moved = frame_of(campaign).points(np.array(list(stored.values())))
    return {label: (float(x), float(y), float(z)) for label, (x, y, z) in zip(stored, moved, strict=True)}


def _frf_sets(session: Session, campaign: Campaign, frame: Frame, warnings: list[str]) -> list[MeasuredFrfs]:
    rows = session.scalars(select(Frf).where(Frf.campaign_id == campaign.id).order_by(Frf.id)).all()
    usable = []
    for row in rows:
        if 0 in (row.response_point, row.response_direction, row.reference_point, row.reference_direction):
            warnings.append(f"FRF {row.id} ({row.label}) states no point or direction and is left out")
        else:
            usable.append(row)
    sets = [_measured(table, frame) for table in make_tables(session, usable, Cut())]
    return sorted(sets, key=lambda s: -s.frfs.values.size)


def _measured(table: FrfTable, frame: Frame) -> MeasuredFrfs:
    rows = list(table.frfs)
    values = np.array([spectrum for _, spectrum in table.spectra()], dtype=np.complex128)
    frfs = FrfSet(
        frequency_hz=table.frequency_hz,
        values=values,
        responses=tuple(frame.dof(Dof(row.response_point, row.response_direction)) for row in rows),
        references=tuple(frame.dof(Dof(row.reference_point, row.reference_direction)) for row in rows),
        quantity=rows[0].quantity,  # type: ignore[arg-type]  # the column holds what was checked on the way in
        variance=_variance(table, values),
    )
    return MeasuredFrfs(
        frfs=frfs,
        ids=tuple(row.id for row in rows),
        sha256s=tuple(row.sha256.hex() for row in rows),
        window_rates=frozenset(row.window_rate_per_s for row in rows),
    )


def _variance(table: FrfTable, values: np.ndarray) -> FloatArray | None:
    """E|n|² = |H|² (1 - γ²) / (γ² n_d) of an H1 estimate from n_d averages (Bendat & Piersol, Random Data, 9.2.4).

    FRFs made of time blocks carry the variance that the scatter of their hits showed, and it is used instead. NaN where the
    noise is not known: FRFs without a coherence or with fewer than two averages, lines that are zero or whose coherence is
    not strictly between 0 and 1, as analysers write it where rounding or a silent channel made it.

    None where nothing is known.
    """
    if all(row.variance_sha256 is not None for row in table.frfs):
        return np.array([variance for _, variance in table.variances()])
    variance = np.full(values.shape, np.nan)
    for i, (row, gamma) in enumerate(table.coherences()):
        averages = row.averages or 0
        if gamma is not None and averages > 1:
            known = (gamma > 0) & (gamma < 1) & (values[i] != 0)
            variance[i, known] = np.abs(values[i, known]) ** 2 * (1 - gamma[known]) / (gamma[known] * averages)
    return None if np.isnan(variance).all() else variance
