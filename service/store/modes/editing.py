"""Mode sets edited by hand: a person keeps or drops poles, and says why."""

from __future__ import annotations

import bisect
from datetime import UTC, datetime
from typing import Any

import numpy as np
from sqlalchemy.orm import Session

from fecore.errors import InputError
from service.access import User
from service.store.modes.operations import ModeSet, mode_set_for, modes_of, store
from service.store.modes.schemas import DecisionIn, EditIn
from service.store.storage import book

_SAME = 1e-3
"""Relative distance within which a frequency names a pole, as tables round it."""

_BESIDE = ("doubtful", "refused_poles")
_MODE = ("frequency_hz", "damping_ratio", "frequency_sd_hz", "damping_sd", "shape")


def edit_mode_set(session: Session, user: User, mode_set: ModeSet, body: EditIn) -> ModeSet:
    """A new mode set with the modes of another one, less those dropped, and with the poles beside it that were kept.

    Args:
        session: the request's transaction.
        user: who decides.
        mode_set: the set to start from; it stays as it is.
        body: a name, and for each pole in question whether it is kept, and why.

    Raises:
        InputError: a decision names no pole, or one twice, or no mode is left.
        QuotaExceeded: the project has no room for the set.
    """
    modes = modes_of(session, [mode_set.id])[mode_set.id]
    rows = [{part: getattr(mode, part) for part in _MODE} for mode in modes]
    evidence = list(mode_set.details.get("evidence", [{}] * len(rows)))
    places: list[int | None] = list(range(len(rows)))
    beside = {part: list(mode_set.details.get(part, [])) for part in _BESIDE}
    decided = []
    for number, decision in enumerate(body.decisions):
        pole = _pole(f"decisions[{number}].frequency_hz", decision, rows, *beside.values())
        if decision.keep and pole not in rows:
            place = bisect.bisect([row["frequency_hz"] for row in rows], pole["frequency_hz"])
            rows.insert(place, {part: pole.get(part) for part in _MODE})
            evidence.insert(place, {part: pole[part] for part in ("probability", "features") if part in pole})
            places.insert(place, None)
            beside = {part: [one for one in poles if one is not pole] for part, poles in beside.items()}
        elif not decision.keep and pole in rows:
            place = rows.index(pole)
            del rows[place], evidence[place], places[place]
        decided.append(_record(user, decision, pole))
    if not rows:
        raise InputError("decisions", "drop every mode of the set; keep at least one")
    details = {**mode_set.details, **beside, "evidence": evidence}
    details["edited_from"] = str(mode_set.id)
    details["decisions"] = [*mode_set.details.get("decisions", []), *decided]
    covariance = _covariance(mode_set, places)
    edited = ModeSet(
        campaign_id=mode_set.campaign_id, name=body.name, origin="edited", covariance=covariance, details=details
    )
    project_id = mode_set_for.project_of(session, mode_set)
    book(session, project_id, "modes", len(str(rows)) + len(str(details)), campaign_id=mode_set.campaign_id)
    store(session, edited, rows)
    session.refresh(edited)
    mode_set_for.note(session, user, edited, "edit", name=body.name, edited_from=str(mode_set.id))
    return edited


def _pole(field: str, decision: DecisionIn, *where: list[dict[str, Any]]) -> dict[str, Any]:
    """The pole that a decision names.

    Raises:
        InputError: there is none at that frequency.
    """
    poles = [pole for rows in where for pole in rows]
    near = min(poles, key=lambda pole: abs(pole["frequency_hz"] - decision.frequency_hz), default=None)
    if near is None or abs(near["frequency_hz"] / decision.frequency_hz - 1) > _SAME:
        there = ", ".join(f"{pole['frequency_hz']:.6g}" for pole in poles[:30])
        raise InputError(field, f"is {decision.frequency_hz:g}, and no pole of the set is there; it has {there} Hz")
    return near


def _record(user: User, decision: DecisionIn, pole: dict[str, Any]) -> dict[str, Any]:
    return {
        "frequency_hz": pole["frequency_hz"],
        "keep": decision.keep,
        "reason": decision.reason,
        "by": user.name,
        "at": datetime.now(UTC).isoformat(),
    }


def _covariance(mode_set: ModeSet, places: list[int | None]) -> list[Any] | None:
    """The covariance of the modes that stay; None where the set has none, or one was added."""
    if mode_set.covariance is None or any(place is None for place in places):
        return None
    whole, at = np.array(mode_set.covariance), np.array(places, dtype=int)
    both = np.concatenate([at, len(whole) // 2 + at])
    kept: list[Any] = whole[np.ix_(both, both)].tolist()
    return kept
