"""What a judgement is made of."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from fecore.arrays import FloatArray
from fecore.trend import Acknowledgement, Shape, Watch, Window
from fecore.trend.assessment import ALL


@dataclass(frozen=True)
class Observation:
    """One campaign of the series."""

    campaign: str  # its id
    performed_at: datetime  # when it was measured
    values: Mapping[str, Any]  # of `service.nouns.monitors.runs`
    covariates: Mapping[str, float]  # by name; NaN where not measured
    shapes: Sequence[Shape] = ()  # of the modes, of a monitor of modes
    run: str = ""  # id of its run
    chain: str = ""  # digest of the run and all before it
    # numbers of its modes' tracks and their identity standard deviations; None of one that is not
    # followed yet
    tracks: tuple[Sequence[int], Sequence[float]] | None = None


@dataclass(frozen=True)
class ModeEffects:
    """What would move the frequencies of one campaign's m modes
    (`fecore.updating.forecasts.FrequencyEffects`).
    """

    campaign: str  # its id
    # stiffness, support: (m,) by name
    stiffness: Mapping[str, FloatArray]
    support: Mapping[str, FloatArray]
    sites: FloatArray  # (P, 3), m
    mass: FloatArray  # (m, P)


@dataclass(frozen=True)
class JudgementInputs:
    """A series as it is to be judged."""

    # in the order in which they came in, so that late ones can be recognised
    observations: tuple[Observation, ...]
    watch: Watch  # what is watched, and how
    as_of: datetime  # now
    acknowledged: tuple[Acknowledgement, ...]  # parameter and time of acknowledgements, by time
    notes: tuple[str, ...]  # what is known to say already
    # what would move the frequencies, of one campaign of the baseline; None where no result says it
    mode_effects: ModeEffects | None = None
    # standard deviations of a relative change of all stiffness over a season by conditions that are
    # no covariates, by name
    not_given: Mapping[str, float] = field(default_factory=dict)
    # whether tracks of modes are watched: then `watch` has directions by `frequency` of all modes
    # or `frequency_2` of one
    of_modes: bool = False
    # of a monitor of modes, what is known before the first run that is not followed yet
    # (`fecore.trend.Following`), and how many runs are
    following: Mapping[str, Any] | None = None
    place: int = 0
    window: Window = ALL  # which campaigns are judged
    # by parameter, the campaign before the window that raised the alarm that stands
    raised: Mapping[str, str] = field(default_factory=dict)
    # the last campaign whose points stay as they are stored; None where all are new
    after: datetime | None = None
    end: datetime | None = None  # the last campaign, where others are still to be judged
