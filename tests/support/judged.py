"""Observations of a watched structure, one every thirty days, and what a judgement says of them."""

import json
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from fecore.trend import Acknowledgement, Watch
from service.nouns.campaigns.climate import stiffness_sds
from service.tasks.judge.compute import Judgement, judge
from service.tasks.judge.inputs import JudgementInputs, ModeEffects, Observation

START = datetime(2025, 1, 1, tzinfo=UTC)
MODES = [[25.0, 0.01, 0.02, None], [160.0, 0.02, 0.01, None], [400.0, 0.05, 0.01, None]]


def day(number: float) -> datetime:
    return START + timedelta(days=30 * number)


def observe(
    number: int, ex: float, modes: Sequence[Any] = MODES, **covariates: float
) -> Observation:
    noise = 0.001 * np.random.default_rng(number).standard_normal()
    return Observation(
        str(number),
        day(number),
        {"parameters": {"Ex": [ex + noise, 0.001]}, "modes": list(modes)},
        covariates,
    )


def judged(
    observations: Sequence[Observation],
    watch: Watch | None = None,
    as_of: datetime | None = None,
    acknowledged: Sequence[Acknowledgement] = (),
    mode_effects: ModeEffects | None = None,
) -> Judgement:
    watch = watch or Watch({"Ex": "fall"}, baseline=6)
    latest = max(o.performed_at for o in observations)
    inputs = JudgementInputs(
        tuple(observations),
        watch,
        as_of or latest,
        tuple(acknowledged),
        (),
        mode_effects,
        stiffness_sds(watch.covariates),
    )
    (result,) = judge(inputs, lambda *_: None)
    json.dumps(result.document, allow_nan=False)
    for row in result.document["parameters"]:
        row["points"] = result.points[row["name"]][1]
    return result


def values(*levels: float) -> list[Observation]:
    return [observe(i, level) for i, level in enumerate(levels)]
