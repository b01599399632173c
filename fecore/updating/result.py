"""What an update returns: frozen, in SI, with both uncertainties of every estimate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from fecore.arrays import ComplexArray, FloatArray
from fecore.body.mesh import Mesh
from fecore.correlation import Agreement
from fecore.frf import Dof
from fecore.modal import Identification
from fecore.normal import Z_95

if TYPE_CHECKING:
    from fecore.updating.effects import FrequencyEffects


@dataclass(frozen=True)
class Finding:
    """Something that a user must know."""

    text: str  # in words: what was found and what to do
    # what it means for the use of the result; None where it means nothing for it
    level: Literal["with_care", "do_not_use"] | None = None
    weight: float = 0.0  # within a level, more comes first
    kind: str = ""  # id of its row in `fecore.updating.findings`


@dataclass(frozen=True)
class Verdict:
    """Whether a result may be used: `level`, one sentence, and the decisive reasons, the gravest
    first.
    """

    level: Literal["usable", "with_care", "do_not_use"]
    sentence: str
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class StageOutcome:
    """How a stage ended; stages fail alone."""

    stage: Literal["elastic", "damping"]  # `elastic` or `damping`
    # `succeeded`; `failed`; `skipped` where there was nothing for it to work on
    status: Literal["succeeded", "failed", "skipped"]
    message: str = ""  # why, where it did not succeed


@dataclass(frozen=True)
class BudgetEntry:
    """One source's part in the uncertainty of a parameter."""

    source: str  # its name: noise, discrepancy, a prior, or an input of the laboratory
    standard_deviation: float  # that it alone would give, in the parameter's unit
    share: float  # of the parameter's variance
    provenance: str  # where the source's own standard deviation comes from


@dataclass(frozen=True)
class Comparable:
    """A parameter for the comparison of tests of one body, which share the errors of the
    laboratory's inputs.
    """

    estimate: float  # with every input held at what the laboratory stated
    standard_deviation: float  # of it, under measurement noise alone


@dataclass(frozen=True)
class ParameterEstimate:
    """One updated parameter."""

    # name, unit: such as Ex in Pa, a0 in 1/s
    name: str
    unit: str
    # value of the model before; None for damping, which starts from the measured ratios
    initial: float | None
    estimate: float  # value after
    # root mean square error, the model's discrepancy and the inputs' errors included
    standard_deviation: float
    noise_standard_deviation: float  # under measurement noise alone
    # 95 % interval, everything included; not about the estimate's middle where it is not
    interval_95: tuple[float, float]
    # whether the data supply more than half of what is known of it; of a tied one, of what it is
    # tied to
    identifiable: bool
    # prior_mean, prior_sd: None where the parameter had no prior
    prior_mean: float | None
    prior_sd: float | None
    comparable: Comparable  # what to compare with another test of the same body
    budget: tuple[BudgetEntry, ...] = ()  # what its variance is made of, the largest first
    # parameters with which it moves in a direction that the data do not see
    confounded_with: tuple[str, ...] = ()
    # the parameter that it follows in a fixed ratio, so that nothing here is its own: its estimate
    # and interval hold where the ratio does. None where it is its own.
    tied_to: str | None = None

    @property
    def deviations(self) -> tuple[float, float]:
        """Standard deviations above and below the estimate, as its 95 % interval reaches."""
        low, high = self.interval_95
        return (high - self.estimate) / Z_95, (self.estimate - low) / Z_95


@dataclass(frozen=True)
class ModeComparison:
    """One measured mode beside the model's; None where there is no partner or nothing was measured
    or stated.

    `kind` is the model's word for its motion: bending or torsion; `motion` and `energy` are the
    shares of the model's mode by kind of motion, and of its strain energy by set and spring. A mode
    on the supports' springs has no predicted damping.
    """

    number: int
    kind: str | None
    measured_hz: float
    initial_hz: float | None
    updated_hz: float | None
    error_percent: float | None
    mac: float | None
    measured_damping: float | None
    predicted_damping: float | None
    measured_damping_sd: float | None = None
    motion: Mapping[str, float] | None = None
    energy: Mapping[str, float] | None = None
    own_mesh_hz: float | None = (
        None  # of the updated model on the body's own mesh, where a finer one gives `updated_hz`
    )


@dataclass(frozen=True)
class HeldOut:
    """Validation on data that no fit has seen."""

    points: tuple[int, ...]  # points of held-out FRFs; empty for a held-out band of the fitted FRFs
    band_hz: tuple[float, float]  # lines compared, Hz
    agreement: Agreement  # measured against predicted
    # share of real and imaginary parts that lie in their 95 % prediction intervals
    coverage_95: float


@dataclass(frozen=True)
class Correlation:
    """Agreement before and after."""

    # initial, updated: over the fitted FRFs and band; the initial model has the damping that the
    # measured ratios give. None without FRFs or without damping.
    initial: Agreement | None
    updated: Agreement | None
    held_out_frfs: HeldOut | None  # over FRFs kept from the fit, or None
    held_out_band: HeldOut | None  # over lines kept from it, or None
    # (measured, model) MAC of the updated model, or None without shapes
    mac_matrix: FloatArray | None
    # of the paired shapes, measured and of the updated model; None of fewer than two pairs
    shapes: Agreement | None


@dataclass(frozen=True)
class LawFit:
    """One damping law, ranked."""

    name: str  # of the law
    # coefficients, standard_deviations: by name, SI, the law's discrepancy included; of an update
    # of one campaign the first law's are from the FRFs, where there are any, the others' from the
    # modal damping ratios
    coefficients: dict[str, float]
    standard_deviations: dict[str, float]
    # Bayesian information criterion on the damping ratios; infinite where the law cannot be had
    bic: float
    preferred: bool  # whether it has the least of all


@dataclass(frozen=True)
class DampingModelFit(LawFit):
    """A law of the recipe."""

    missed: FloatArray  # (n,) relative miss of the ratio of each paired mode that the law damps
    # (2, m) frequencies in Hz over the range of the measured modes, and the law's damping ratios
    # there: of a law of frequency a curve, of a law by mechanism the model's modes
    curve: FloatArray
    by_mechanism: bool  # whether it is one by mechanism


@dataclass(frozen=True)
class CommonLaw(LawFit):
    """A law with one set of coefficients for all campaigns; `missed_by`: root mean square of each
    one's relative misses.

    Where campaigns have several temperatures, `coefficients` has `a0.per_K` of each after them.
    """

    missed_by: dict[str, float]
    units: tuple[str, ...]  # (p,) of its coefficients
    # (2p, 2p) covariance of these and of their coefficients of temperature, or None
    joint: FloatArray | None


@dataclass(frozen=True)
class CurveOf:
    """A constant, or a coefficient of a damping law, over temperature: (n,) estimates and 95 %
    intervals.
    """

    name: str
    unit: str
    estimate: FloatArray
    low: FloatArray
    high: FloatArray
    law: str | None = None  # of a law's coefficient


@dataclass(frozen=True)
class Curve:
    """What campaigns at several temperatures show of each constant between these, and a little
    beyond.
    """

    reference_c: float  # at which the result is given, °C
    temperature_c: FloatArray  # (n,) ascending, °C
    constants: tuple[CurveOf, ...]


@dataclass(frozen=True)
class Prediction:
    """Measured and predicted FRFs on all lines, for figures and export: (N, L) each."""

    frequency_hz: FloatArray
    responses: tuple[Dof, ...]
    references: tuple[Dof, ...]
    measured: ComplexArray
    initial: ComplexArray
    updated: ComplexArray
    # (N, L) standard deviations of the updated ln|H|, and of its phase in radians
    spread: tuple[FloatArray, FloatArray]
    # fitted, held: rows of the FRFs that were fitted, and of those that were held out
    fitted: tuple[int, ...]
    held: tuple[int, ...]


@dataclass(frozen=True)
class ModeShapes:
    """Shapes at the measured dofs, measured beside those of the updated model."""

    # (P,) labels of the dofs' points; those of the measured shapes come first
    points: tuple[int, ...]
    places: FloatArray  # (P, 3) their coordinates, m
    # (n, p) complex shapes of the measured modes at the first p points; (n, 0) where they have none
    measured: ComplexArray
    updated: FloatArray  # (m, P) real shapes of the model
    # frequency_hz, kinds, shares: (m,) of the model's modes; shares are `motion` and `energy`, as
    # of `ModeComparison`
    frequency_hz: FloatArray
    kinds: tuple[str, ...]
    shares: tuple[Mapping[str, Mapping[str, float]], ...]
    # number of a measured mode and of its model mode, both from 0
    pairs: tuple[tuple[int, int], ...]
    directions: FloatArray  # (P, 3) unit vectors along which the points' shapes are
    # mesh, everywhere: of the model, and (m, nodes, 3) its shapes at the mesh's nodes
    mesh: Mesh
    everywhere: FloatArray


@dataclass(frozen=True)
class StartHistory:
    """One start of stage 1: parameters by name and cost, iterate by iterate; `failure` says why it
    did not converge.
    """

    parameters: dict[str, FloatArray]
    cost: tuple[float, ...]
    chosen: bool
    failure: str


@dataclass(frozen=True)
class Partner:
    """A measured mode and its partner among the model's, numbered from 1, with the latter's
    frequency and kind of motion.
    """

    measured: int
    model: int
    frequency_hz: float
    kind: str


@dataclass(frozen=True)
class RivalPairing:
    """Other partners at the best point that a start of stage 1 came to with them."""

    partners: tuple[Partner, ...]  # of the measured modes
    parameters: dict[str, float]  # at that point, by name, SI
    log_evidence: float  # logarithm of how much more the chosen pairing is supported


@dataclass(frozen=True)
class PairingSummary:
    """Which mode is which."""

    # what decided: `shapes` (MAC), or `order` where fewer than three dofs, or none, say nothing of
    # shapes
    by: Literal["shapes", "order"]
    partners: tuple[Partner, ...]  # of the measured modes; one that is not named has none
    # the next best pairing that was found; None where there was no other, or none was looked for
    rival: RivalPairing | None


@dataclass(frozen=True)
class ConvergenceStep:
    """One iterate of stage 1: parameters by name, frequencies of the measured modes, cost."""

    parameters: dict[str, float]
    frequency_hz: FloatArray
    cost: float


@dataclass(frozen=True)
class PosteriorSummary:
    """How the posterior was had."""

    method: str  # "laplace" or "mcmc"
    # effective_samples, autocorrelation_time, acceptance: of the chain of the constants; empty for
    # Laplace
    effective_samples: tuple[float, ...] = ()
    autocorrelation_time: tuple[float, ...] = ()
    acceptance: tuple[float, ...] = ()
    # of the free constants, and of the first law's coefficients where they were fitted
    names: tuple[str, ...] = ()
    samples: FloatArray | None = None  # (n, p) thinned samples of `names`, or None
    correlation: FloatArray | None = None  # (p, p) of these


@dataclass(frozen=True)
class UpdateResult:
    """Everything an update found. Without FRFs, or where damping failed, what depends on it is
    empty or None.
    """

    verdict: Verdict
    outcomes: tuple[StageOutcome, ...]
    parameters: tuple[ParameterEstimate, ...]
    modes: tuple[ModeComparison, ...]
    correlation: Correlation
    damping_models: tuple[DampingModelFit, ...]
    damping_starts: int
    damping_optima: tuple[dict[str, float], ...]
    damping_history: FloatArray
    convergence: tuple[ConvergenceStep, ...]
    starts: tuple[StartHistory, ...]
    pairing: PairingSummary
    shapes: ModeShapes | None
    channel_delay_s: float | None
    null_directions: tuple[dict[str, float], ...]
    frequency_discrepancy: float
    damping_discrepancy: float | None
    band_hz: tuple[float, float] | None
    prediction: Prediction | None
    identification: Identification | None
    posterior: PosteriorSummary
    effects: FrequencyEffects
    warnings: tuple[str, ...]
    findings: tuple[Finding, ...] = ()
    # at which all of it is given, °C; None where nobody stated one
    reference_temperature_c: float | None = None
    # over temperature, where the reference is not that of the measurement
    curve: Curve | None = None
