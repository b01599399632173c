"""Mode sets and their modes: the tables, and what can be done with them: type in, store, read."""

from collections.abc import Iterable, Sequence
from datetime import datetime
from typing import Any
from uuid import UUID

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import ForeignKey, Index, Select, delete, insert, select, text, update
from sqlalchemy.dialects.postgresql import JSONB, distinct_on
from sqlalchemy.orm import Mapped, Session, mapped_column

from fecore.arrays import ComplexArray
from fecore.frf import Dof
from fecore.modes import MeasuredModes
from modalbase.formats.uff import ModeShape
from service.nouns.campaigns.operations import campaign_for, campaign_of, frame_of
from service.nouns.modes.schemas import ModeIn, ModeOut, ModeSetIn, ModeSetOut, ShapeValue
from service.nouns.storage import book
from service.platform.access import Lookup, User, present
from service.platform.db.base import Base, Identified, one_at_a_time
from service.platform.errors import Invalid
from service.platform.web import shown_as


class ModeSet(Identified, Base):
    """Modes of a campaign: typed in, from a file, or identified."""

    __tablename__ = "mode_sets"
    __table_args__ = (Index(None, "campaign_id", "id"),)

    campaign_id: Mapped[UUID] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"))
    import_id: Mapped[UUID | None] = mapped_column(ForeignKey("imports.id", deferrable=True))
    job_id: Mapped[UUID | None] = mapped_column(ForeignKey("jobs.id", ondelete="SET NULL"))
    name: Mapped[str]
    origin: Mapped[str]
    covariance: Mapped[list[Any] | None] = mapped_column(JSONB(none_as_null=True))
    # whether the loads were measured; shapes of unmeasured ones are unscaled
    excitation: Mapped[str] = mapped_column(server_default="measured", default="measured")
    # rate of the FRFs' exponential window that the identification took out of the poles, 1/s
    window_taken_out_per_s: Mapped[float] = mapped_column(server_default="0", default=0.0)
    details: Mapped[dict[str, Any]] = mapped_column(server_default=text("'{}'"))
    # by which a job identified it
    settings: Mapped[dict[str, Any] | None] = mapped_column(JSONB(none_as_null=True))
    # the mode set that a later job identified by the same settings
    superseded_by: Mapped[UUID | None]


class Mode(Base):
    """One mode of a set."""

    __tablename__ = "modes"
    __table_args__ = (Index(None, "frequency_hz"),)

    mode_set_id: Mapped[UUID] = mapped_column(
        ForeignKey("mode_sets.id", ondelete="CASCADE"), primary_key=True
    )
    number: Mapped[int] = mapped_column(primary_key=True)
    frequency_hz: Mapped[float]
    damping_ratio: Mapped[float | None]
    frequency_sd_hz: Mapped[float | None]
    damping_sd: Mapped[float | None]
    shape: Mapped[dict[str, Any] | None] = mapped_column(JSONB(none_as_null=True))


EVIDENCE = ("probability", "features")
"""What the details of a mode set have for each of its modes, in their order, as `evidence`."""

mode_set_for = Lookup(ModeSet, "mode set", "campaign_id", campaign_for)


def create_mode_set(session: Session, user: User, campaign_id: UUID, body: ModeSetIn) -> ModeSet:
    """Store modes that a person or a script knows, sorted by frequency and numbered from 1.

    Raises:
        QuotaExceeded: the project has no room for them.
    """
    campaign = campaign_for(session, user, campaign_id, "editor")
    book(session, campaign_for, campaign, "modes", len(body.model_dump_json()))
    mode_set = ModeSet(
        campaign_id=campaign.id,
        name=body.name,
        origin="typed",
        details={},
        excitation=body.excitation,
    )
    store(session, mode_set, map(_stated, sorted(body.modes, key=lambda mode: mode.frequency_hz)))
    session.refresh(mode_set)
    mode_set_for.note(session, user, mode_set, "create", name=body.name)
    return mode_set


DETAILS = ("warnings", "doubtful", "refused", "refused_poles", "harmonics_hz", "amplitude")
"""What of the document about an identification its mode set has too, so that nobody sees the modes
without it.
"""


def keep_identified(
    session: Session,
    campaign_id: UUID,
    name: str,
    modes: MeasuredModes,
    document: dict[str, Any],
    *,
    job_id: UUID,
    settings: dict[str, Any],
    decisions: Sequence[dict[str, Any]] = (),
) -> ModeSet:
    """Store modes that a job found in the specimen's frame, with their directions in the file's
    coordinates, as all stored shapes are, with covariance and how they were found. Those that an
    earlier job found by the same settings leave.
    """
    details = {part: document[part] for part in DETAILS}
    if decisions:  # on the poles that a person stated
        details["decisions"] = [*decisions]
    by_frequency = {row["frequency_hz"]: row for row in (*document["modes"], *document["doubtful"])}
    details["evidence"] = [
        {part: by_frequency[float(hz)][part] for part in EVIDENCE} for hz in modes.frequency_hz
    ]
    covariance = None if modes.covariance is None else modes.covariance.tolist()
    own = {
        "job_id": job_id,
        "origin": "identified",
        "excitation": document["excitation"],
        "window_taken_out_per_s": document["window_taken_out_per_s"],
        "covariance": covariance,
        "details": details,
        "settings": settings,
    }
    mode_set = ModeSet(campaign_id=campaign_id, name=name, **own)
    sd_f, sd_z = modes.frequency_sd_hz, modes.damping_sd
    frame = frame_of(campaign_of(session, campaign_id))
    dofs = [frame.file_dof(dof) for dof in modes.dofs]
    points, directions = [dof.point for dof in dofs], [dof.direction for dof in dofs]
    rows = (
        {
            "frequency_hz": float(modes.frequency_hz[k]),
            "damping_ratio": _finite(modes.damping_ratio[k]),
            "frequency_sd_hz": None if sd_f is None else _finite(sd_f[k]),
            "damping_sd": None if sd_z is None else _finite(sd_z[k]),
            "shape": None if modes.shapes is None else _shape(points, directions, modes.shapes[k]),
        }
        for k in range(len(modes))
    )
    one_at_a_time(session, f"mode sets of {campaign_id}")
    store(session, mode_set, rows)
    same = (
        ModeSet.campaign_id == campaign_id,
        ModeSet.settings == settings,
        ModeSet.id != mode_set.id,
    )
    session.execute(
        update(ModeSet).where(*same, *present(ModeSet)).values(superseded_by=mode_set.id),
        execution_options={"synchronize_session": False},
    )
    return mode_set


def store_read_modes(
    session: Session, campaign_id: UUID, import_id: UUID, name: str, modes: Iterable[ModeShape]
) -> None:
    """Store the mode shapes of a file as a set."""
    mode_set = ModeSet(
        campaign_id=campaign_id, import_id=import_id, name=name, origin="file", details={}
    )
    store(session, mode_set, map(_read, sorted(modes, key=lambda mode: mode.frequency_hz)))


def remove_mode_sets(session: Session, import_id: UUID) -> None:
    """Remove the mode sets that an import brought."""
    session.execute(delete(ModeSet).where(ModeSet.import_id == import_id))


def store(session: Session, mode_set: ModeSet, modes: Iterable[dict[str, Any]]) -> None:
    """Store a set with its modes, numbered from 1."""
    session.add(mode_set)
    session.flush()
    rows = [
        {"mode_set_id": mode_set.id, "number": number, **mode}
        for number, mode in enumerate(modes, 1)
    ]
    session.execute(insert(Mode), rows)


def _stated(mode: ModeIn) -> dict[str, Any]:
    shape = mode.shape and {part: [getattr(value, part) for value in mode.shape] for part in _PARTS}
    return {**mode.model_dump(exclude={"shape"}), "shape": shape}


def _read(mode: ModeShape) -> dict[str, Any]:
    """A mode of a file; its values are along x, y, z of each point, and about them where it has
    rotations.
    """
    count, axes = mode.values.shape
    points, directions = (
        np.repeat(mode.points, axes).tolist(),
        np.tile(np.arange(1, axes + 1), count).tolist(),
    )
    shape = _shape(points, directions, mode.values.ravel())
    return {
        "frequency_hz": mode.frequency_hz,
        "damping_ratio": _finite(mode.damping_ratio),
        "shape": shape,
    }


_PARTS = ("point", "direction", "real", "imag")


def _shape(points: list[int], directions: list[int], values: ComplexArray) -> dict[str, Any]:
    """A shape as it is stored, a list each."""
    return dict(
        zip(_PARTS, (points, directions, values.real.tolist(), values.imag.tolist()), strict=True)
    )


def load_modes(session: Session, mode_set_id: UUID) -> MeasuredModes:
    """A mode set as the core wants it, directions in the file's coordinates.

    Rigid-body modes of a file (0 Hz) are left out. Shapes are given where every mode has one, at
    the degrees of freedom that all of them share. Typed-in standard deviations become a diagonal
    covariance where every mode has them.
    """
    mode_set = session.get_one(ModeSet, mode_set_id)
    rows = [row for row in modes_of(session, [mode_set.id])[mode_set.id] if row.frequency_hz > 0]
    dofs = _shared_dofs(rows)
    return MeasuredModes(
        frequency_hz=np.array([row.frequency_hz for row in rows]),
        damping_ratio=np.array(
            [np.nan if row.damping_ratio is None else row.damping_ratio for row in rows]
        ),
        shapes=np.array([_values_at(row, dofs) for row in rows]) if dofs else None,
        dofs=tuple(dofs),
        covariance=_covariance(mode_set, rows),
        probability=_probability(mode_set, rows),
    )


def amplitude_of(session: Session, mode_set_id: UUID) -> dict[str, float]:
    """Root mean square of the responses of the recordings that gave a set, by its name as a
    covariate; empty of one without.
    """
    amplitude: dict[str, float] = session.get_one(ModeSet, mode_set_id).details.get("amplitude", {})
    return amplitude


def window_taken_out(session: Session, mode_set_id: UUID) -> float:
    """Rate of the FRFs' exponential window that was taken out of a set's poles, 1/s; 0: none."""
    return session.get_one(ModeSet, mode_set_id).window_taken_out_per_s


def loads_measured(session: Session, mode_set_id: UUID) -> bool:
    """Whether the loads were measured under which a set's modes were found."""
    return session.get_one(ModeSet, mode_set_id).excitation == "measured"


def describe_all(session: Session, mode_sets: Sequence[ModeSet]) -> list[ModeSetOut]:
    """Mode sets as clients see them, in the order given, with all modes and shapes; one query for
    all modes.
    """
    modes = modes_of(session, [mode_set.id for mode_set in mode_sets])
    return [
        shown_as(ModeSetOut, s, modes=[_mode(row, _evidence(s, row)) for row in modes[s.id]])
        for s in mode_sets
    ]


def _evidence(mode_set: ModeSet, row: Mode) -> dict[str, Any]:
    """Probability and features of a mode; nothing of those that no job identified."""
    known = mode_set.details.get("evidence", [])
    return dict(known[row.number - 1]) if row.number <= len(known) else {}


def _probability(mode_set: ModeSet, rows: Sequence[Mode]) -> NDArray[np.float64] | None:
    if "evidence" not in mode_set.details:
        return None
    return np.array(
        [_evidence(mode_set, row).get("probability", 1.0) for row in rows], dtype=np.float64
    )


def _mode(row: Mode, evidence: dict[str, Any]) -> ModeOut:
    values = zip(*(row.shape[part] for part in _PARTS), strict=True) if row.shape else ()
    shape = [ShapeValue(**dict(zip(_PARTS, value, strict=True))) for value in values]
    known = {"probability": evidence.get("probability"), "features": evidence.get("features", [])}
    return shown_as(ModeOut, row, shape=shape or None, **known)


def modes_of(session: Session, ids: Sequence[UUID]) -> dict[UUID, list[Mode]]:
    """The modes of each of these mode sets, in the order of their numbers; an empty list for a set
    without modes.
    """
    modes: dict[UUID, list[Mode]] = {i: [] for i in ids}
    for row in session.scalars(
        select(Mode).where(Mode.mode_set_id.in_(ids)).order_by(Mode.mode_set_id, Mode.number)
    ):
        modes[row.mode_set_id].append(row)
    return modes


def shape_of(row: Mode) -> dict[tuple[int, int], complex]:
    """The shape of a mode: (point, axis) to its complex value along the positive axis, 1 to 6;
    empty where the mode has none.
    """
    shape = row.shape or {"point": [], "direction": [], "real": [], "imag": []}
    return {
        (p, abs(d)): complex(re, im) * (1 if d > 0 else -1)
        for p, d, re, im in zip(
            shape["point"], shape["direction"], shape["real"], shape["imag"], strict=True
        )
    }


def _shared_dofs(rows: Sequence[Mode]) -> list[Dof]:
    """Degrees of freedom that every mode has; axes along which no mode moves anywhere were not
    measured.
    """
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


def mode_sets_from(first: UUID) -> Select[UUID]:
    """Campaigns to which mode sets came whose keys are at least this one, as part of a query."""
    return select(ModeSet.campaign_id).where(ModeSet.id >= first)


def newest_stated(
    session: Session, campaign_ids: Sequence[UUID]
) -> dict[UUID, tuple[UUID, datetime]]:
    """Key and time of each campaign's newest mode set that no job has identified; those without one
    are left out.
    """
    query = (
        select(ModeSet.campaign_id, ModeSet.id, ModeSet.created_at)
        .where(ModeSet.campaign_id.in_(campaign_ids), ModeSet.origin.in_(("typed", "file")))
        .ext(distinct_on(ModeSet.campaign_id))
        .order_by(ModeSet.campaign_id, ModeSet.id.desc())
    )
    return {campaign: (key, at) for campaign, key, at in session.execute(query)}


def newest_unmeasured(session: Session, campaign_id: UUID) -> ModeSet | None:
    """The newest mode set of a campaign that was found in responses alone."""
    query = select(ModeSet).where(
        ModeSet.campaign_id == campaign_id, ModeSet.excitation == "unmeasured", *present(ModeSet)
    )
    return session.scalars(query.order_by(ModeSet.id.desc()).limit(1)).first()


def identified_by(session: Session, job_ids: Sequence[UUID]) -> dict[UUID, UUID]:
    """The mode set that each of these jobs identified, by the job's key."""
    query = select(ModeSet.job_id, ModeSet.id).where(ModeSet.job_id.in_(job_ids))
    return {job: key for job, key in session.execute(query) if job is not None}


def check_mode_set(
    session: Session, user: User, key: UUID, campaign_id: UUID, pointer: str
) -> None:
    """A mode set that a request names must be the user's and of the campaign.

    Raises:
        Invalid: it is not; the pointer says where it is named.
    """
    if mode_set_for.named(session, user, key, pointer).campaign_id != campaign_id:
        raise Invalid(pointer, f"{key} belongs to another campaign")
