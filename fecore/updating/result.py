"""What an update returns: frozen, in SI, with both uncertainties of every estimate.

Each class states once what its members are: by name, in this order and with these words they stand
in the result's document. A member that is marked `BESIDE` is none of the document's: it is kept in
arrays beside it, or serves the core alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from fecore.arrays import ComplexArray, FloatArray
from fecore.body.mesh import Mesh
from fecore.frf import Dof
from fecore.modal import Identification
from fecore.normal import Z_95

BESIDE = {"document": False}
"""Metadata of a member that no document states."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """Something that a user must know."""

    kind: str = ""
    """its id, the same in every result"""
    level: Literal["with_care", "do_not_use"] | None = None
    """what it means for the use of the result; null where it means nothing for it"""
    text: str
    """what was found and what to do"""
    weight: float = field(default=0.0, metadata=BESIDE)
    """within a level, more comes first"""


@dataclass(frozen=True)
class Verdict:
    """Whether the result may be used."""

    level: Literal["usable", "with_care", "do_not_use"]
    """may it be used?"""
    sentence: str
    """the same in one sentence"""
    reasons: tuple[str, ...]
    """the decisive ones, the gravest first"""


@dataclass(frozen=True)
class StageOutcome:
    """How a stage ended; stages fail alone."""

    stage: Literal["elastic", "damping"]
    """`elastic` or `damping`"""
    status: Literal["succeeded", "failed", "skipped"]
    """skipped: there was nothing to work on"""
    message: str = ""
    """why, where it did not succeed"""


@dataclass(frozen=True)
class BudgetEntry:
    """One source's part in a parameter's uncertainty."""

    source: str
    """noise, discrepancy, a prior, or an input of the laboratory"""
    standard_deviation: float
    """that it alone would give, in the parameter's unit"""
    share: float
    """of the parameter's variance, 0 to 1"""
    provenance: str
    """where the source's own standard deviation comes from"""


@dataclass(frozen=True)
class Comparable:
    """A parameter with every input held at what was stated, to compare with other tests of the same
    body, which share the errors of these inputs.
    """

    estimate: float
    """in the parameter's unit"""
    standard_deviation: float
    """by measurement noise alone, in the parameter's unit"""


@dataclass(frozen=True)
class ParameterEstimate:
    """An updated parameter."""

    name: str
    """Ex Ey Gxy Gxz Gyz a0 a1 …"""
    unit: str
    """Pa, 1/s, s, or the unit of a spring"""
    initial: float | None
    """value of the model before, in its unit; null for damping, which starts from the measured
    ratios
    """
    estimate: float
    """value after, in its unit"""
    standard_deviation: float
    """root mean square error, the model's discrepancy and the inputs' errors included, in its
    unit
    """
    noise_standard_deviation: float
    """under measurement noise alone, in its unit"""
    interval_95: tuple[float, float]
    """95 % interval, everything included, in its unit; not about the estimate's middle where it is
    not
    """
    identifiable: bool
    """whether the data say more than half of what is known of it; of a tied one, of what it is tied
    to
    """
    prior_mean: float | None
    """in its unit; null without a prior"""
    prior_sd: float | None
    """in its unit; null without a prior"""
    comparable: Comparable
    """what to compare with other tests of the same body"""
    budget: tuple[BudgetEntry, ...] = ()
    """what its variance is made of, the largest first"""
    confounded_with: tuple[str, ...] = ()
    """parameters with which it moves where the data see nothing"""
    tied_to: str | None = None
    """the parameter whose ratio to it the recipe fixes, so that its estimate and interval hold
    where the ratio does; null where it is estimated itself
    """

    @property
    def deviations(self) -> tuple[float, float]:
        """Standard deviations above and below the estimate, as its 95 % interval reaches."""
        low, high = self.interval_95
        return (high - self.estimate) / Z_95, (self.estimate - low) / Z_95


@dataclass(frozen=True)
class ModeComparison:
    """A measured mode beside the model's; null where there is no partner, or nothing was measured
    or stated.
    """

    number: int
    """of the measured mode, from 1"""
    kind: str | None
    """the model's motion: bending or torsion"""
    measured_hz: float
    """measured natural frequency, Hz"""
    initial_hz: float | None
    """of the initial model, Hz"""
    updated_hz: float | None
    """of the updated model, Hz"""
    error_percent: float | None
    """of the updated frequency, % of the measured one"""
    mac: float | None
    """of measured and updated shape, 0 to 1"""
    measured_damping: float | None
    """measured damping ratio ζ, not per cent"""
    predicted_damping: float | None
    """of the updated model, not per cent; a mode on the supports' springs has none"""
    measured_damping_sd: float | None = None
    """standard deviation of the measured ratio"""
    motion: Mapping[str, float] | None = None
    """shares of the updated model's motion, by kind, 0 to 1"""
    energy: Mapping[str, float] | None = None
    """shares of its strain energy, by set and spring, 0 to 1"""
    own_mesh_hz: float | None = None
    """of the updated model on the structure's own mesh, Hz; null where a finer one was not
    needed
    """


@dataclass(frozen=True)
class FrfCorrelation:
    """Agreement of measured and predicted FRFs: (N,) SAC and FRAC, (L,) CSAC and CSF."""

    sac: FloatArray
    frac: FloatArray
    csac: FloatArray
    csf: FloatArray


@dataclass(frozen=True)
class HeldOut:
    """Validation on data that no fit has seen."""

    points: tuple[int, ...]  # points of held-out FRFs; empty for a held-out band of the fitted FRFs
    band_hz: tuple[float, float]  # lines compared, Hz
    agreement: FrfCorrelation  # measured against predicted
    # share of real and imaginary parts that lie in their 95 % prediction intervals
    coverage_95: float


@dataclass(frozen=True)
class Correlation:
    """Agreement before and after."""

    # initial, updated: over the fitted FRFs and band; the initial model has the damping that the
    # measured ratios give. None without FRFs or without damping.
    initial: FrfCorrelation | None
    updated: FrfCorrelation | None
    held_out_frfs: HeldOut | None  # over FRFs kept from the fit, or None
    held_out_band: HeldOut | None  # over lines kept from it, or None
    # (measured, model) MAC of the updated model, or None without shapes
    mac_matrix: FloatArray | None


@dataclass(frozen=True)
class LawCurve:
    """A damping law over the range of the measured modes, (m,) each."""

    frequency_hz: FloatArray
    """Hz; of a law by mechanism those of the model's modes"""
    damping_ratio: FloatArray
    """of the law there"""


@dataclass(frozen=True)
class DampingModelFit:
    """A damping law of the recipe, ranked."""

    name: str
    """as the recipe names it"""
    coefficients: dict[str, float]
    """by name, SI; the first law's are from the FRFs, where there are any, the others' from the
    modal damping ratios
    """
    bic: float
    """Bayesian information criterion on the damping ratios; the least is preferred; null where the
    law cannot be had
    """
    preferred: bool
    """whether it has the least of all"""
    missed: FloatArray
    """relative miss of the ratio of each paired mode that the law damps"""
    standard_deviations: dict[str, float]
    """of the coefficients, by name, SI, the law's discrepancy included"""
    curve: LawCurve
    """its damping ratios over the range of the modes"""
    by_mechanism: bool
    """whether it damps the shares of strain energy"""


@dataclass(frozen=True)
class CommonLaw:
    """A damping law with one set of coefficients for all campaigns, ranked.

    Where campaigns have several temperatures, `coefficients` has `a0.per_K` of each after them.
    """

    name: str
    """of the law"""
    coefficients: dict[str, float]
    """by name, SI"""
    standard_deviations: dict[str, float]
    """of the coefficients, by name, SI, the law's discrepancy included"""
    bic: float
    """Bayesian information criterion on the damping ratios; the least is preferred; null where the
    law cannot be had
    """
    preferred: bool
    """whether it has the least of all"""
    missed_by: dict[str, float]
    """root mean square of the relative misses of each campaign's ratios"""
    units: tuple[str, ...] = field(metadata=BESIDE)
    """(p,) of its coefficients"""
    joint: FloatArray | None = field(metadata=BESIDE)
    """(2p, 2p) covariance of these and of their coefficients of temperature, or None"""


@dataclass(frozen=True)
class CurveOf:
    """A constant, or a coefficient of a damping law, over temperature, (n,) each."""

    name: str
    """of the constant or the coefficient"""
    unit: str
    """SI"""
    estimate: FloatArray
    """at each temperature"""
    low: FloatArray
    """lower end of its 95 % interval"""
    high: FloatArray
    """upper end of its 95 % interval"""
    law: str | None = None
    """whose coefficient it is; null of an elastic constant"""


@dataclass(frozen=True)
class Curve:
    """Constants and damping between the temperatures of the tests, and a little beyond."""

    reference_c: float
    """temperature at which the parameters are given, °C"""
    temperature_c: FloatArray
    """ascending, °C"""
    constants: tuple[CurveOf, ...]
    """of each that changes with temperature"""


@dataclass(frozen=True)
class FrequencyEffects:
    """Derivatives of the logarithms of n measured frequencies at the updated model; NaN where a
    mode has no partner.
    """

    # (n,) by name of a constant that was updated, the change of ln f by one prior standard
    # deviation of it
    parameter: dict[str, FloatArray]
    stiffness: dict[str, FloatArray]  # (n,) by name of a stiffness θ, ∂ln f/∂ln θ
    # (n,) by name of an input of the support, the change of ln f by one prior standard deviation of
    # it
    support: dict[str, FloatArray]
    sites: FloatArray  # (P, 3) nodes at which a mass is tried, m
    # (n, P) change of ln f by a mass at each of them, -φ²/2 with the mass-normalised displacement
    # φ, 1/kg
    mass: FloatArray
    # median ratio of the measured FRFs' magnitudes to the model's; None without FRFs
    frf_scale: float | None


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
class ModelMode:
    """A mode of the updated model."""

    number: int
    """from 1"""
    frequency_hz: float
    """Hz"""
    kind: str
    """its motion: bending or torsion"""
    motion: Mapping[str, float]
    """shares of its motion, by kind, 0 to 1"""
    energy: Mapping[str, float]
    """shares of its strain energy, by set and spring, 0 to 1"""


@dataclass(frozen=True)
class ModeShapes:
    """Shapes at the measured dofs, measured beside those of the updated model."""

    # (P,) labels of the dofs' points; those of the measured shapes come first
    points: tuple[int, ...]
    places: FloatArray  # (P, 3) their coordinates, m
    # (n, p) complex shapes of the measured modes at the first p points; (n, 0) where they have none
    measured: ComplexArray
    updated: FloatArray  # (m, P) real shapes of the model
    # number of a measured mode and of its model mode, both from 0
    pairs: tuple[tuple[int, int], ...]
    directions: FloatArray  # (P, 3) unit vectors along which the points' shapes are
    # mesh, everywhere: of the model, and (m, nodes, 3) its shapes at the mesh's nodes
    mesh: Mesh
    everywhere: FloatArray


@dataclass(frozen=True)
class DampingSearch:
    """How stage 2 came to its coefficients."""

    starts: int
    """from how many it was tried"""
    optima: tuple[dict[str, float], ...]
    """coefficients of each that was come to, by name, SI"""
    history: FloatArray
    """iterates of the one that is the result"""


@dataclass(frozen=True)
class StartHistory:
    """A start of stage 1, iterate by iterate."""

    chosen: bool
    """whether the result is its end"""
    failure: str | None
    """why it did not converge; null: it converged"""
    cost: tuple[float, ...]
    """of each iterate"""
    parameters: dict[str, FloatArray]
    """by name, of each iterate, SI"""


@dataclass(frozen=True)
class Partner:
    """A measured mode and its partner among the model's."""

    measured: int
    """number of the measured mode, from 1"""
    model: int
    """number of the model's elastic mode, from 1"""
    frequency_hz: float
    """of the model's mode, Hz"""
    kind: str
    """its motion: bending or torsion"""


@dataclass(frozen=True)
class RivalPairing:
    """Other partners, at the best point that a start came to with them."""

    partners: tuple[Partner, ...]
    """of the measured modes"""
    parameters: dict[str, float]
    """at that point, by name, SI"""
    log_evidence: float
    """logarithm of how much more the chosen pairing is supported"""


@dataclass(frozen=True)
class PairingSummary:
    """Which measured mode is which of the model's."""

    by: Literal["shapes", "order"]
    """what decided: `order` with fewer than three dofs, or no shapes"""
    partners: tuple[Partner, ...]
    """of the measured modes; one that is not named has none"""
    rival: RivalPairing | None
    """the next best pairing that was found; null: none"""


@dataclass(frozen=True)
class ConvergenceStep:
    """An iterate of stage 1."""

    parameters: dict[str, float]
    """by name, SI"""
    frequency_hz: FloatArray
    """of the measured modes' partners, Hz"""
    cost: float
    """of the fit, without unit"""


@dataclass(frozen=True)
class PosteriorSummary:
    """How the posterior was had, and how the parameters correlate."""

    method: Literal["laplace", "mcmc"]
    """laplace or mcmc"""
    names: tuple[str, ...]
    """of the free constants, and of the first law's coefficients where they were fitted: rows and
    columns of the correlation
    """
    correlation: FloatArray
    """of these parameters"""
    # effective_samples, autocorrelation_time, acceptance: of the chain of the constants; empty for
    # Laplace, where the document has none of them
    effective_samples: tuple[float, ...] = field(default=(), metadata=BESIDE)
    autocorrelation_time: tuple[float, ...] = field(default=(), metadata=BESIDE)
    acceptance: tuple[float, ...] = field(default=(), metadata=BESIDE)
    samples: FloatArray | None = field(default=None, metadata=BESIDE)
    """(n, p) thinned samples of `names`, or None"""


@dataclass(frozen=True)
class UnseenDirections:
    """What the data do not see."""

    null_directions: tuple[dict[str, float], ...]
    """directions along which they say little, by name of a parameter, in prior standard
    deviations
    """


@dataclass(frozen=True)
class Discrepancy:
    """Relative standard deviation of what the model cannot say."""

    frequency: float
    """of a frequency"""
    damping: float | None
    """of a damping ratio; null where no law was fitted"""


@dataclass(frozen=True, kw_only=True)
class UpdateResult:
    """Everything an update found. Without FRFs, or where damping failed, what depends on it is
    empty or None.
    """

    verdict: Verdict
    """whether the result may be used"""
    warnings: tuple[str, ...]
    """in words; read them first"""
    findings: tuple[Finding, ...] = ()
    """the update's warnings, each with its id"""
    outcomes: tuple[StageOutcome, ...]
    """how each stage ended"""
    parameters: tuple[ParameterEstimate, ...]
    """updated parameters, SI"""
    modes: tuple[ModeComparison, ...]
    """measured modes beside the model's"""
    correlation: Correlation
    """agreement of FRFs and shapes"""
    damping_models: tuple[DampingModelFit, ...]
    """damping laws, ranked"""
    damping_fit: DampingSearch
    """starts, optima and history of stage 2"""
    convergence: tuple[ConvergenceStep, ...]
    """iterates of stage 1; shown where they are asked for"""
    starts: tuple[StartHistory, ...]
    """every start of stage 1 that was tried"""
    pairing: PairingSummary
    """which measured mode is which of the model's, and the rival pairing"""
    model_modes: tuple[ModelMode, ...]
    """number, frequency, kind and shares of the model's modes; empty without points"""
    identifiability: UnseenDirections
    """directions that the data do not see"""
    discrepancy: Discrepancy
    """relative standard deviation of what the model cannot say"""
    reference_temperature_c: float | None = None
    """temperature at which the parameters are given, °C; null: nobody stated one"""
    curve: Curve | None = None
    """constants over temperature, where the reference is not the campaign's own"""
    band_hz: tuple[float, float] | None
    """lines of the damping update, Hz"""
    channel_delay_s: float | None
    """lag of the response that was found, s"""
    identification: Identification | None
    """how the modes were found; its `stabilisation` is shown where it is asked for"""
    posterior: PosteriorSummary
    """how the posterior was had"""
    shapes: ModeShapes | None = field(metadata=BESIDE)
    """at the measured dofs"""
    prediction: Prediction | None = field(metadata=BESIDE)
    """measured and predicted FRFs"""
    effects: FrequencyEffects = field(metadata=BESIDE)
    """what would move the measured frequencies"""
