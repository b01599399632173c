"""What a processing is asked, and what it answers."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from fecore.arrays import FloatArray, IntArray
from fecore.errors import InputError
from fecore.findings import Finding, texts
from fecore.frf import Dof, FrfSet
from fecore.signal.coupling import Coupling
from fecore.signal.delay import Delay
from fecore.signal.estimators import Estimator, check_estimator
from fecore.signal.frf_scale import Strip
from fecore.signal.hit_location import Position
from fecore.signal.judgement import FALSE_DISCOVERY, HitVerdict
from fecore.signal.windows import Windows

MOST_REFUSED = 0.9
"""Largest `false_discovery`: a hit that nothing is said against, and none is beside, has little
more.
"""


@dataclass(frozen=True)
class Processing:
    """All choices of a processing; None is chosen from the hits and stated in the result.

    Attributes:
        estimator: H1, H2 or Hv.
        windows: force and exponential window.
        band_hz: lines that are kept, both ends included; None: from the first line above 0 Hz to
            the sampling rate
        over 2.56.
        delay_s: time by which the response lags the force, to be taken out of the FRFs.
        false_discovery: largest probability of being good that a refused hit may have, 0 to 0.9; 0
            refuses none.
        overrules: a user's decisions by hit (force dof, number): True uses it, False leaves it out.
        strip: what is known of the body, where it is a strip: its FRFs' height is then checked.
        positions: where the grid's points lie, by label, m, x and y along the body's edges: hits
            are then located in mm.
    """

    estimator: Estimator = "H1"
    windows: Windows | None = None
    band_hz: tuple[float, float] | None = None
    delay_s: float = 0.0
    false_discovery: float = FALSE_DISCOVERY
    overrules: Mapping[tuple[Dof, int], bool] = field(default_factory=dict)
    strip: Strip | None = None
    positions: Mapping[int, Position] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_estimator(self.estimator)
        if not 0 <= self.false_discovery <= MOST_REFUSED:
            raise InputError(
                "false_discovery", f"is {self.false_discovery}, expected 0 to {MOST_REFUSED}"
            )
        if not abs(self.delay_s) < 1:
            raise InputError("delay_s", f"is {self.delay_s}, expected less than a second")
        if self.band_hz is not None and not 0 <= self.band_hz[0] < self.band_hz[1]:
            raise InputError(
                "band_hz", f"is {self.band_hz}, expected two increasing frequencies in Hz"
            )


@dataclass(frozen=True)
class Carried:
    """The exponential window that FRFs carry.

    Attributes:
        rate_per_s: its rate, with the analyser's own; `remove_window` corrects poles.
        rate_sd_per_s: its standard deviation, 0 where the hits state one; None where nothing shows
            whether there was another.
    """

    rate_per_s: float
    rate_sd_per_s: float | None


@dataclass(frozen=True)
class Averages(Carried):
    """FRFs of some or all points.

    Attributes:
        frfs: the FRFs with their variance, one a point and response.
        coherence: (N, L) γ².
        hits: (N,) hits that each FRF is the mean of.
        used: the numbers of those hits, for each FRF.
    """

    frfs: FrfSet
    coherence: FloatArray
    hits: IntArray
    used: tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class Findings(Carried):
    """What was found about the hits of a campaign and done with them.

    Attributes:
        verdicts: one a hit, in the order of the hits.
        processing: the choices, with those that were made here filled in.
        coupling: the tail of the AC coupled force channel that stands behind the force window; None
            for none.
        delay: how much later the response is than the force, where resonances show it.
        excited_hz: highest frequency at which the hammer still has a tenth of its amplitude.
        strong_hz: the same for half of its amplitude.
        notes: what a user should know.
    """

    verdicts: tuple[HitVerdict, ...]
    processing: Processing
    coupling: Coupling | None
    delay: Delay | None
    excited_hz: float
    strong_hz: float
    notes: tuple[Finding, ...]

    @property
    def warnings(self) -> tuple[str, ...]:
        """The notes, in words."""
        return texts(self.notes)


@dataclass(frozen=True)
class Processed(Findings, Averages):
    """What hits became: the FRFs of all points, and what was found."""
