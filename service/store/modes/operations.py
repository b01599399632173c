"""Mode sets: typed in, from a file or identified; stored by ascending frequency."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import datetime
from typing import TYPE_CHECKING, Any
from uuid import UUID

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import insert, select
from sqlalchemy.dialects.postgresql import distinct_on
from sqlalchemy.orm import Session

from fecore.arrays import ComplexArray
from fecore.frf import Dof
from fecore.modes import MeasuredModes
from modalbase.formats.uff import ModeShape
from service.access import Lookup, User, audit
from service.store.campaigns.operations import campaign_for
from service.store.modes.schemas import ModeIn, ModeOut, ModeSetIn, ModeSetOut, ShapeValue
from service.store.modes.tables import Mode, ModeSet
from service.store.storage import StorageOwner, book

if TYPE_CHECKING:
    from service.store.campaigns.tables import Campaign

EVIDENCE = ("probability", "features")
"""What the details of a mode set have for each of its modes, in their order, as `evidence`."""

mode_set_for = Lookup(ModeSet, "mode set", "campaign_id", campaign_for)
"""The mode set, if the user has at least a role in its project."""


def create_mode_set(session: Session, user: User, campaign: Campaign, body: ModeSetIn) -> ModeSet:
    """Store modes that a person or a script knows, sorted by frequency and numbered from 1.

    Args:
        session: the request's transaction.
        user: who asks, for the audit trail.
        campaign: whose modes.
        body: name, and for each mode frequency in Hz, damping ratio, perhaps standard deviations and a shape.

    Raises:
        QuotaExceeded: the project has no room for them.
    """
    project_id = campaign_for.project_of(session, campaign)
    book(session, StorageOwner(project_id, campaign.id), "modes", len(body.model_dump_json()))
    mode_set = ModeSet(campaign_id=campaign.id, name=body.name, origin="typed", details={})
    session.add(mode_set)
    session.flush()
    modes = sorted(body.modes, key=lambda mode: mode.frequency_hz)
    session.execute(insert(Mode), [_row(mode_set.id, number, mode) for number, mode in enumerate(modes, 1)])
    session.refresh(mode_set)
    audit(
        session,
        user,
        "mode_set.create",
        "mode_set",
        mode_set.id,
        project_id,
        name=body.name,
    )
    return mode_set


def store_identified(
    session: Session, campaign_id: UUID, name: str, modes: MeasuredModes, *, job_id: UUID, details: dict[str, Any]
) -> ModeSet:
    """Store modes that a job has identified, with their covariance.

    Args:
        session: the job's transaction.
        campaign_id: whose modes.
        name: of the mode set.
        modes: with directions in the file's coordinates.
        job_id: the job that found them.
        details: how they were found.
    """
    mode_set = ModeSet(
        campaign_id=campaign_id,
        job_id=job_id,
        name=name,
        origin="identified",
        covariance=None if modes.covariance is None else modes.covariance.tolist(),
        details=details,
    )
    session.add(mode_set)
    session.flush()
    sd_f, sd_z = modes.frequency_sd_hz, modes.damping_sd
    session.execute(
        insert(Mode),
        [
            {
                "mode_set_id": mode_set.id,
                "number": k + 1,
                "frequency_hz": float(modes.frequency_hz[k]),
                "damping_ratio": _finite(modes.damping_ratio[k]),
                "frequency_sd_hz": None if sd_f is None else _finite(sd_f[k]),
                "damping_sd": None if sd_z is None else _finite(sd_z[k]),
                "shape": None if modes.shapes is None else _columns(modes.dofs, modes.shapes[k]),
            }
            for k in range(len(modes))
        ],
    )
    return mode_set


def load_modes(session: Session, mode_set_id: UUID) -> MeasuredModes:
    """A mode set as the core wants it, directions in the file's coordinates.

    Rigid-body modes of a file (0 Hz) are left out. Shapes are given where every mode has one, at the degrees of freedom
    that all of them share. Typed-in standard deviations become a diagonal covariance where every mode has them.
    """
    mode_set = session.get_one(ModeSet, mode_set_id)
    rows = [row for row in modes_of(session, [mode_set.id])[mode_set.id] if row.frequency_hz > 0]
    dofs = _shared_dofs(rows)
    return MeasuredModes(
        frequency_hz=np.array([row.frequency_hz for row in rows]),
        damping_ratio=np.array([np.nan if row.damping_ratio is None else row.damping_ratio for row in rows]),
        shapes=np.array([_values_at(row, dofs) for row in rows]) if dofs else None,
        dofs=tuple(dofs),
        covariance=_covariance(mode_set, rows),
        probability=_probability(mode_set, rows),
    )


def describe_all(session: Session, mode_sets: Sequence[ModeSet]) -> list[ModeSetOut]:
    """Mode sets as clients see them, in the order given, with all modes and shapes; one query for all modes."""
    modes = modes_of(session, [mode_set.id for mode_set in mode_sets])
    return [
        ModeSetOut(
            id=s.id,
            campaign_id=s.campaign_id,
            name=s.name,
            origin=s.origin,  # type: ignore[arg-type]  # written by this module and by intake alone
            import_id=s.import_id,
            job_id=s.job_id,
            modes=[_mode(row, _evidence(s, row.number)) for row in modes[s.id]],
            details=s.details,
            created_at=s.created_at,
        )
        for s in mode_sets
    ]


def _file_shape(points: NDArray[np.integer], values: ComplexArray) -> dict[str, Any]:
    """The shape of a mode in a file, as it is stored: point, direction, real and imaginary part, a list each.

    Args:
        points: (p,) labels.
        values: (p, 3) along x, y, z, or (p, 6) with the rotations about them.
    """
    count, axes = values.shape
    return {
        "point": np.repeat(points, axes).tolist(),
        "direction": np.tile(np.arange(1, axes + 1), count).tolist(),
        "real": values.real.ravel().tolist(),
        "imag": values.imag.ravel().tolist(),
    }


def _columns(dofs: Sequence[Dof], values: ComplexArray) -> dict[str, Any]:
    return {
        "point": [dof.point for dof in dofs],
        "direction": [dof.direction for dof in dofs],
        "real": values.real.tolist(),
        "imag": values.imag.tolist(),
    }


def _row(mode_set_id: UUID, number: int, mode: ModeIn) -> dict[str, Any]:
    shape = mode.shape and {
        column: [getattr(value, column) for value in mode.shape] for column in ("point", "direction", "real", "imag")
    }
    return {"mode_set_id": mode_set_id, "number": number, **mode.model_dump(exclude={"shape"}), "shape": shape}


def _evidence(mode_set: ModeSet, number: int) -> dict[str, Any]:
    """Probability and features of a mode; nothing of those that no job identified."""
    known = mode_set.details.get("evidence", [])
    return dict(known[number - 1]) if number <= len(known) else {}


def _probability(mode_set: ModeSet, rows: Sequence[Mode]) -> NDArray[np.float64] | None:
    if "evidence" not in mode_set.details:
        return None
    return np.array([_evidence(mode_set, row.number).get("probability", 1.0) for row in rows], dtype=np.float64)


def _mode(row: Mode, evidence: dict[str, Any]) -> ModeOut:
    shape = row.shape and [
        ShapeValue(point=p, direction=d, real=re, imag=im)
        for p, d, re, im in zip(
            row.shape["point"], row.shape["direction"], row.shape["real"], row.shape["imag"], strict=True
        )
    ]
    return ModeOut(
        number=row.number,
        frequency_hz=row.frequency_hz,
        damping_ratio=row.damping_ratio,
        frequency_sd_hz=row.frequency_sd_hz,
        damping_sd=row.damping_sd,
        shape=shape or None,
        probability=evidence.get("probability"),
        features=evidence.get("features", []),
    )


def modes_of(session: Session, ids: Sequence[UUID]) -> dict[UUID, list[Mode]]:
    """The modes of each of these mode sets, in the order of their numbers; an empty list for a set without modes."""
    found: dict[UUID, list[Mode]] = {i: [] for i in ids}
    for row in session.scalars(select(Mode).where(Mode.mode_set_id.in_(ids)).order_by(Mode.mode_set_id, Mode.number)):
        found[row.mode_set_id].append(row)
    return found


def shape_of(row: Mode) -> dict[tuple[int, int], complex]:
    """The shape of a mode: (point, axis) to its complex value along the positive axis, 1 to 6; empty where the mode has
    none.
    """
    shape = row.shape or {"point": [], "direction": [], "real": [], "imag": []}
    return {
        (p, abs(d)): complex(re, im) * (1 if d > 0 else -1)
        for p, d, re, im in zip(shape["point"], shape["direction"], shape["real"], shape["imag"], strict=True)
    }


def _shared_dofs(rows: Sequence[Mode]) -> list[Dof]:
    """Degrees of freedom that every mode has; axes along which no mode moves anywhere were not measured."""
    if not rows or any(row.shape is None for row in rows):
        return []
    shapes = [shape_of(row) for row in rows]
    moving = {axis for shape in shapes for (_, axis), value in shape.items() if value != 0}
    shared = set.intersection(*(set(shape) for shape in shapes))
    return [Dof(point, axis) for point, axis in sorted(shared) if axis in moving]


def _values_at(row: Mode, dofs: Sequence[Dof]) -> list[complex]:
    shape = shape_of(row)
    return [shape[dof.point, dof.axis] for dof in dofs]


def _covariance(mode_set: ModeSet, rows: Sequence[Mode]) -> NDArray[np.float64] | None:
    if mode_set.covariance is not None:
        return np.array(mode_set.covariance, dtype=np.float64)
    sds = [row.frequency_sd_hz for row in rows] + [row.damping_sd for row in rows]
    if any(sd is None for sd in sds):
        return None
    return np.diag(np.square(np.array(sds, dtype=np.float64)))


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def store_read_modes(
    session: Session, campaign_id: UUID, import_id: UUID, name: str, modes: Iterable[ModeShape]
) -> None:
    """Store the mode shapes of a file as a set."""
    mode_set = ModeSet(campaign_id=campaign_id, import_id=import_id, name=name, origin="file", details={})
    session.add(mode_set)
    session.flush()
    rows = [
        {
            "mode_set_id": mode_set.id,
            "number": number,
            "frequency_hz": mode.frequency_hz,
            "damping_ratio": _finite(mode.damping_ratio),
            "shape": _file_shape(mode.points, mode.values),
        }
        for number, mode in enumerate(sorted(modes, key=lambda m: m.frequency_hz), 1)
    ]
    session.execute(insert(Mode), rows)


def newest_stated(session: Session, campaign_ids: Sequence[UUID]) -> dict[UUID, tuple[UUID, datetime]]:
    """Key and time of each campaign's newest mode set that no job has identified; those without one are left out."""
    query = (
        select(ModeSet.campaign_id, ModeSet.id, ModeSet.created_at)
        .where(ModeSet.campaign_id.in_(campaign_ids), ModeSet.origin.in_(("typed", "file", "edited")))
        .ext(distinct_on(ModeSet.campaign_id))
        .order_by(ModeSet.campaign_id, ModeSet.id.desc())
    )
    return {campaign: (key, at) for campaign, key, at in session.execute(query)}
