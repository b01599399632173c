"""What may have caused an alarm: the frequencies of a monitor's campaigns, explained by `fecore.trend.explanations`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fecore.arrays import BoolArray, FloatArray
from fecore.trend.explanations import Effects, Explanation, change_of, explanations, in_words
from service.compute.observations import Observation, same_mode

_CLIMATE = ("temperature_c", "humidity_percent")
_FEWEST_MODES = 3  # of which a change has a pattern


@dataclass(frozen=True)
class Moves:
    """What would move the frequencies of one campaign's m modes (`fecore.updating.effects.FrequencyEffects`)."""

    campaign: str  # its id
    # stiffness, support: (m,) by name
    stiffness: Mapping[str, FloatArray]
    support: Mapping[str, FloatArray]
    sites: FloatArray  # (P, 3), m
    mass: FloatArray  # (m, P)


def explained(
    observations: Sequence[Observation],
    moves: Moves,
    baseline: Sequence[str],
    later: Sequence[str],
    covariates: Sequence[str],
) -> dict[str, Any] | None:
    """Explanations of a change, ranked, and in words; None where too few modes or campaigns say something.

    Args:
        observations: of the series.
        moves: at a campaign of the baseline.
        baseline: campaigns of the baseline.
        later: campaigns since the change.
        covariates: that are regressed out.
    """
    by = {o.campaign: o for o in observations}
    row = _rows(by[moves.campaign], observations)
    paired = np.array([at >= 0 and np.isfinite(moves.mass[at]).all() for at in row])
    table = {name: _numbers(by[name], observations) for name in (*baseline, *later)}
    modes = paired & np.all([np.isfinite(table[name][:-1]) for name in later], axis=0)
    based = [name for name in baseline if np.isfinite(table[name][:-1][modes]).all()]
    if modes.sum() < _FEWEST_MODES or len(based) < len(covariates) + 3:
        return None
    scaled = all(np.isfinite(table[name][-1]) for name in (*based, *later))
    first, last = (
        np.array([table[name][np.append(modes, scaled)] for name in names]).reshape(len(names), -1)
        for names in (based, later)
    )
    at = _regressors([by[name] for name in based], [by[name] for name in later], covariates)
    change, slopes = change_of(first, last, *at)
    not_given = tuple(name for name in _CLIMATE if name not in covariates)
    ranked = explanations(change, _effects(moves, row[modes], covariates, slopes[1:, : modes.sum()], not_given))
    return {"ranked": [_described(each, ranked[0].evidence) for each in ranked], "text": in_words(ranked, not_given)}


def _described(each: Explanation, most: float) -> dict[str, Any]:
    """An explanation to the digits that mean something, its evidence over that of the likeliest."""
    return {
        "kind": each.kind,
        "probability": round(each.probability, 3),
        "evidence": _three_digits(each.evidence - most),
        "sizes": {name: [*map(_three_digits, size)] for name, size in each.sizes.items()},
    }


def _three_digits(value: float) -> float:
    return float(f"{value:.3g}")


def _rows(observation: Observation, everyone: Sequence[Observation]) -> Any:
    """(k,) the campaign's mode, from 0, that is each of the earliest campaign's; -1 where it has none."""
    count = len(min(everyone, key=lambda o: o.performed_at).values["modes"])
    found = (same_mode(number, observation, everyone) for number in range(1, count + 1))
    return np.array([-1 if at is None else at for at in found], dtype=int)


def _numbers(observation: Observation, everyone: Sequence[Observation]) -> FloatArray:
    """(k + 1,) logarithms of the frequencies of the earliest campaign's modes, and of the FRFs' scale; NaN where unknown."""
    hz = np.array([*(row[0] for row in observation.values["modes"]), np.nan])
    scale = observation.values.get("frf_scale")
    found: FloatArray = np.log(np.append(hz[_rows(observation, everyone)], np.nan if scale is None else scale))
    return found


def _regressors(
    based: Sequence[Observation], later: Sequence[Observation], covariates: Sequence[str]
) -> tuple[FloatArray, FloatArray]:
    """Ones and covariates about the baseline's mean, which stands for what was not measured."""
    measured = [
        np.array([[o.covariates.get(name, np.nan) for name in covariates] for o in group]).reshape(len(group), -1)
        for group in (based, later)
    ]
    centre = measured[0].mean(axis=0)
    first, last = (np.column_stack([np.ones(len(c)), np.nan_to_num(c - centre)]) for c in measured)
    return first, last


def _effects(
    moves: Moves, rows: BoolArray, covariates: Sequence[str], slopes: FloatArray, not_given: tuple[str, ...]
) -> Effects:
    return Effects(
        stiffness={name: each[rows] for name, each in moves.stiffness.items()},
        support={name: each[rows] for name, each in moves.support.items()},
        sites=moves.sites,
        mass=moves.mass[rows],
        covariates=dict(zip(covariates, slopes, strict=True)),
        not_given=not_given,
    )
