"""Routes of mode sets; a mode set as a UFF file, and edited by hand: poles kept or dropped, and
why.
"""

import itertools
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from typing import IO, Annotated, Any
from uuid import UUID

import numpy as np
from fastapi import Response
from sqlalchemy.orm import Session

from fecore.errors import InputError
from modalbase.formats import uff
from modalbase.formats.uff.write import encode
from service.nouns.campaigns.operations import campaign_for, campaign_of, stored_points
from service.nouns.modes import operations
from service.nouns.modes.operations import (
    EVIDENCE,
    Mode,
    ModeSet,
    mode_set_for,
    modes_of,
    shape_of,
    store,
)
from service.nouns.modes.schemas import DecisionIn, EditIn, ModeSetIn, ModeSetOut
from service.nouns.storage import book
from service.platform.access import CurrentUser, SessionDep, User, api_router
from service.platform.access.nouns import NounRoutes
from service.platform.errors import Conflict
from service.platform.web.downloads import spooled
from service.platform.web.parameters import form_of

router = api_router(tags=["mode sets"], bulk=True)

MEDIA_TYPES = {"json": "application/json", "uff": "text/x-uff"}
UFF: dict[int | str, dict[str, Any]] = {200: {"content": {MEDIA_TYPES["uff"]: {}}}}


nouns = NounRoutes(
    router, operations.mode_set_for, ModeSetOut, operations.describe_all, "mode-sets", "mode_set_id"
)


nouns.creating(
    "create_mode_set",
    "Type in modes that were identified elsewhere: frequencies, and where known damping ratios and"
    " shapes.",
    ModeSetIn,
    operations.create_mode_set,
)


@router.post("/mode-sets/{mode_set_id}/edits", status_code=201)
def edit_mode_set(
    mode_set_id: UUID, body: EditIn, session: SessionDep, user: CurrentUser, response: Response
) -> ModeSetOut:
    """Keep or drop poles by hand: a new mode set that records who decided what and why; the old one
    stays as it is.
    """
    mode_set = operations.mode_set_for(session, user, mode_set_id, "editor")
    return nouns.made(session, keep_or_drop(session, user, mode_set, body), response)


nouns.listing("list_mode_sets", "Mode sets of a campaign.")


@router.get("/mode-sets/{mode_set_id}", response_model=ModeSetOut, responses=UFF)
def get_mode_set(
    mode_set_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    form: Annotated[str, form_of(MEDIA_TYPES, "uff is set 55; default: by Accept")],
) -> ModeSetOut | Response:
    """A mode set, as JSON or as a UFF file of grid points and mode shapes."""
    mode_set = operations.mode_set_for(session, user, mode_set_id)
    if form == "uff":
        media_type = MEDIA_TYPES["uff"]
        return spooled(
            lambda file: write_uff(session, mode_set, file),
            media_type,
            "modes.uff",
            {"Vary": "Accept"},
        )
    return nouns.shown(session, mode_set)


def write_uff(session: Session, mode_set: ModeSet, file: IO[bytes]) -> None:
    """Write the file, SI; shapes with 6 digits or more, 0 along axes that were not measured.

    Raises:
        Conflict: a mode has no shape, which set 55 cannot say.
    """
    rows = modes_of(session, [mode_set.id])[mode_set.id]
    bare = [str(row.number) for row in rows if not shape_of(row)]
    if bare:
        raise Conflict(
            f"mode {', '.join(bare)} has no shape, and set 55 holds nothing else; use ?format=json"
        )
    points: Iterator[uff.Content] = (
        uff.GridPoint(label, xyz)
        for label, xyz in stored_points(session, mode_set.campaign_id).items()
    )
    for block in encode(itertools.chain(points, (_shape(mode_set, row) for row in rows))):
        file.write(block)


def _shape(mode_set: ModeSet, row: Mode) -> uff.ModeShape:
    stored = shape_of(row)
    labels = sorted({point for point, _ in stored})
    axes = 6 if any(axis > 3 for _, axis in stored) else 3
    values = np.array(
        [[stored.get((point, axis), 0.0) for axis in range(1, axes + 1)] for point in labels],
        complex,
    )
    return uff.ModeShape(
        dataset=0,
        label=f"{mode_set.name}, mode {row.number}",
        mode=row.number,
        frequency_hz=row.frequency_hz,
        damping_ratio=float("nan") if row.damping_ratio is None else row.damping_ratio,
        points=np.array(labels),
        values=values,
        kind="complex" if np.any(values.imag) else "normal",
    )


_SAME = 1e-3
"""Relative distance within which a frequency names a pole, as tables round it."""

_BESIDE = ("doubtful", "refused_poles")
_MODE = ("frequency_hz", "damping_ratio", "frequency_sd_hz", "damping_sd", "shape")
_INTERNAL = ("place", "beside", "decision", "shape")


def keep_or_drop(session: Session, user: User, mode_set: ModeSet, body: EditIn) -> ModeSet:
    """A new mode set with the modes of another one, less those dropped, and with the poles beside
    it that were kept.

    It is the set that was found, typed in or read, under all decisions up to now, of which the last
    on a pole counts: what an edit dropped can be kept again as it was.

    Args:
        session: the request's transaction.
        user: who decides.
        mode_set: the set to start from; it stays as it is.
        body: a name, and for each pole in question whether it is kept, and why.

    Raises:
        InputError: a decision names no pole, or one twice, or no mode is left.
        QuotaExceeded: the project has no room for the set.
    """
    origin, earlier = _origin(session, mode_set), mode_set.details.get("decisions", [])
    poles = _poles(session, origin)
    for one in earlier:
        if (k := _nearest(poles, one["frequency_hz"])) is not None:
            poles[k]["decision"] = one
    decided = _decided(poles, body.decisions, user)
    kept = [pole for pole in poles if pole.get("decision", {"keep": "place" in pole})["keep"]]
    if not kept:
        raise InputError("decisions", "drop every mode of the set; keep at least one")
    left = [pole for pole in poles if not any(pole is one for one in kept)]
    details = {
        **origin.details,
        **{
            part: [_described(pole) for pole in left if pole.get("beside") == part]
            for part in _BESIDE
        },
        "dropped": [
            {**_described(pole), "reason": pole["decision"]["reason"]}
            for pole in left
            if "place" in pole
        ],
        "edited_from": str(mode_set.id),
        "decisions": [*earlier, *decided],
    }
    if "evidence" in origin.details:
        details["evidence"] = [
            {part: pole[part] for part in EVIDENCE if part in pole} for pole in kept
        ]
    edited = ModeSet(
        campaign_id=mode_set.campaign_id,
        name=body.name,
        origin="edited",
        excitation=origin.excitation,
        window_taken_out_per_s=origin.window_taken_out_per_s,
        covariance=_covariance(origin, [pole.get("place") for pole in kept]),
        details=details,
    )
    written = [{part: pole.get(part) for part in _MODE} for pole in kept]
    book(
        session,
        campaign_for,
        campaign_of(session, mode_set.campaign_id),
        "modes",
        len(str(written)) + len(str(details)),
    )
    store(session, edited, written)
    session.refresh(edited)
    mode_set_for.note(session, user, edited, "edit", name=body.name, edited_from=str(mode_set.id))
    return edited


def _origin(session: Session, mode_set: ModeSet) -> ModeSet:
    """The set that an edited one was first made of, or the first that is still there."""
    while (key := mode_set.details.get("edited_from")) and (
        before := session.get(ModeSet, UUID(key))
    ):
        mode_set = before
    return mode_set


def _poles(session: Session, mode_set: ModeSet) -> list[dict[str, Any]]:
    """The modes of a set, with their place in it, and the poles beside them, each with the list
    that it stands in; by frequency.
    """
    rows = modes_of(session, [mode_set.id])[mode_set.id]
    known = mode_set.details.get("evidence", [{}] * len(rows))
    poles: list[dict[str, Any]] = [
        {**{part: getattr(row, part) for part in _MODE}, **seen, "place": k}
        for k, (row, seen) in enumerate(zip(rows, known, strict=True))
    ]
    poles += [
        {**pole, "beside": part} for part in _BESIDE for pole in mode_set.details.get(part, [])
    ]
    return sorted(poles, key=lambda pole: pole["frequency_hz"])


def _decided(
    poles: list[dict[str, Any]], decisions: Sequence[DecisionIn], user: User
) -> list[dict[str, Any]]:
    """The decisions as they are stored; each pole gets its own.

    Raises:
        InputError: one names no pole, or a pole twice.
    """
    at, taken, stored = datetime.now(UTC).isoformat(), set[int](), []
    for number, decision in enumerate(decisions):
        k = _pole(f"decisions.{number}.frequency_hz", decision, poles)
        hz = poles[k]["frequency_hz"]
        if k in taken:
            raise InputError(f"decisions.{number}", f"is a second one on {hz:.6g} Hz; expected one")
        taken.add(k)
        stated = decision.model_dump(include={"keep", "reason"})
        poles[k]["decision"] = {"frequency_hz": hz, **stated, "by": user.name, "at": at}
        stored.append(poles[k]["decision"])
    return stored


def _described(pole: dict[str, Any]) -> dict[str, Any]:
    """What the details of a set have of a pole beside its modes."""
    return {part: value for part, value in pole.items() if part not in _INTERNAL}


def _nearest(poles: list[dict[str, Any]], hz: float) -> int | None:
    """The number of the pole at a frequency; None where there is none."""
    off = [abs(pole["frequency_hz"] / hz - 1) for pole in poles]
    return off.index(min(off)) if off and min(off) <= _SAME else None


def _pole(field: str, decision: DecisionIn, poles: list[dict[str, Any]]) -> int:
    """The number of the pole that a decision names.

    Raises:
        InputError: there is none at that frequency.
    """
    near = _nearest(poles, decision.frequency_hz)
    if near is None:
        there = ", ".join(f"{pole['frequency_hz']:.6g}" for pole in poles[:30])
        raise InputError(
            field,
            f"is {decision.frequency_hz:g}, and no pole of the set is there; it has {there} Hz",
        )
    return near


def _covariance(mode_set: ModeSet, places: list[int | None]) -> list[Any] | None:
    """The covariance of the modes that stay; None where the set has none, or one was added."""
    if mode_set.covariance is None or any(place is None for place in places):
        return None
    whole, at = np.array(mode_set.covariance), np.array(places, dtype=int)
    both = np.concatenate([at, len(whole) // 2 + at])
    kept: list[Any] = whole[np.ix_(both, both)].tolist()
    return kept
