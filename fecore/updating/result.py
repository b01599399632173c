"""What an update returns, and what a user must know of it.

Sources of data that contradict each other, and what may be the cause: the values that
`contradictions` gives.

What an update returns: frozen, in SI, with both uncertainties of every estimate.

These classes are the document of a result, too: their docstrings describe its members to readers of
the OpenAPI document, and `__pydantic_config__` says so to pydantic, which the core does not import.

Constants and their errors as sentences have them.

What a user must know of a result: one table of all that can be found, the verdict that follows,
and the warnings.

`finding` makes a finding of a row of `FINDINGS` and of its numbers.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from fecore.arrays import ComplexArray, Drawn, FloatArray, Numbers, Unbounded
from fecore.body.mesh import Mesh
from fecore.correlation import Agreement
from fecore.findings import Finding, Level, alike, likewise, make
from fecore.frf import Dof
from fecore.modal import Identification
from fecore.normal import Z_95
from fecore.quantities import WRITTEN, quantity_of
from fecore.updating.known_findings import FINDINGS, PASSED_ON
from fecore.updating.parameters import constant_of
from fecore.updating.posterior import LinearProblem

if TYPE_CHECKING:
    from fecore.updating.forecasts import FrequencyEffects


@dataclass(frozen=True)
class SourceStatement:
    """What a source says of one constant, and what the rest says of it: values with standard
    deviations, SI.
    """

    constant: str
    stated: float
    stated_sd: float
    rest: float
    rest_sd: float


@dataclass(frozen=True)
class Check:
    """A source beside all others."""

    # `input`, `coupons`, `campaign`, `scatter` of the specimens, or what a body has: `mass`,
    # `foot`, `support` that gives way or `stiffness` that is lost
    kind: str
    name: str  # of the source, as a sentence names it
    p: float  # probability of a difference from the rest that is larger than the one found
    # logarithm of how much likelier the data are where this source is off by a slip
    evidence: float
    # the campaign or specimen that an input belongs to, as `campaign A`; empty where all share it
    owner: str = ""
    said: tuple[SourceStatement, ...] = ()  # of each constant that it says; nothing of a campaign
    place: tuple[float, ...] = ()  # m, where a mass, a foot or a support likeliest is
    # where stiffness is lost, in words: of what, and between which places
    stretch: tuple[str, ...] = ()
    level: float = 0.0  # probability at most that it is said to be lost where it is not


@dataclass(frozen=True)
class Conflict:
    """A source that contradicts the others."""

    cause: Check  # the likeliest
    # other explanations that the data do not rule out, the likeliest first
    rivals: tuple[Check, ...]
    # names of sources that contradict no more once the cause is allowed for
    cleared: tuple[str, ...]
    moved: float  # how far a constant then moves at most, in its stated standard deviations
    # logarithm of how much likelier the cause is than the next explanation, ruled out or not; None
    # where there is none
    odds: float | None = None


@dataclass(frozen=True)
class CampaignAgreement:
    """One campaign beside the others."""

    # probability of frequencies further from the others' prediction than measured; None of a single
    # campaign
    predictive_p: float | None
    # (q,) coordinates' deviations of the material's parameters by this campaign alone
    own: FloatArray
    own_sd: FloatArray  # (q,) their standard deviations
    # (q,) of own against all together, in standard deviations of the difference; 0 where the
    # campaign says nothing
    z: FloatArray


@dataclass(frozen=True)
class Statement:
    """A source that says what k combinations (k, X) of the unknowns are: values, with standard
    deviations.

    The first unknown of each is that whose value it is about.
    """

    kind: str
    name: str
    owner: str
    rows: FloatArray
    values: FloatArray
    sds: FloatArray

    @property
    def places(self) -> list[int]:
        """(k,) unknowns that the values are about."""
        return [int(place) for place in self.rows.argmax(axis=1)]


def loosened_by(problem: LinearProblem, source: Statement, slip: float) -> LinearProblem:
    """The problem where a source may be off by a slip."""
    if source.kind == "input":
        wider = np.where(source.rows[0], slip, 1.0)
        return replace(
            problem, prior=lambda scatter: problem.prior(scatter) / np.outer(wider, wider)
        )
    less, off = (1 - slip**-2) / source.sds**2, source.values - source.rows @ problem.x
    return replace(
        problem,
        others={
            **problem.others,
            "coupons": problem.others["coupons"] - source.rows.T * less @ source.rows,
        },
        other_descent=problem.other_descent - source.rows.T @ (less * off),
        other_cost=problem.other_cost - float(less @ off**2) / 2,
    )


DESCRIBED: dict[str, Any] = {
    "use_attribute_docstrings": True,
    "json_schema_serialization_defaults_required": True,
}
"""What pydantic reads of a class here."""


@dataclass(frozen=True)
class Verdict:
    """Whether the result may be used."""

    __pydantic_config__: ClassVar = DESCRIBED

    level: Literal["usable", "with_care", "do_not_use"]
    """may it be used?"""
    sentence: str
    """the same in one sentence"""
    reasons: tuple[str, ...]
    """the decisive ones, the gravest first"""


@dataclass(frozen=True)
class StageOutcome:
    """How a stage ended; stages fail alone."""

    __pydantic_config__: ClassVar = DESCRIBED

    stage: Literal["elastic", "damping"]
    """`elastic` or `damping`"""
    status: Literal["succeeded", "failed", "skipped"]
    """skipped: there was nothing to work on"""
    message: str = ""
    """why, where it did not succeed"""


@dataclass(frozen=True)
class BudgetEntry:
    """One source's part in a parameter's uncertainty."""

    __pydantic_config__: ClassVar = DESCRIBED

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
    body, which share the errors of the laboratory's inputs.
    """

    __pydantic_config__: ClassVar = DESCRIBED

    estimate: float
    """in the parameter's unit"""
    standard_deviation: float
    """by measurement noise alone, in the parameter's unit"""


@dataclass(frozen=True)
class ParameterEstimate:
    """An updated parameter."""

    __pydantic_config__: ClassVar = DESCRIBED

    name: str
    """Ex Ey Gxy Gxz Gyz a0 a1 …"""
    unit: str
    """Pa, 1/s, s, or the unit of a spring"""
    initial: float | None
    """value of the model before, in its unit; null for damping"""
    estimate: float
    """value after, in its unit"""
    standard_deviation: float
    """everything included, in its unit"""
    noise_standard_deviation: float
    """under measurement noise alone, in its unit"""
    # not about the estimate's middle where it is not
    interval_95: tuple[float, float]
    """95 % interval, everything included, in its unit"""
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
    # nothing of a tied one is its own: estimate and interval hold where the ratio does
    tied_to: str | None = None
    """the parameter whose ratio to it the recipe fixes; null where it is estimated itself"""

    @property
    def deviations(self) -> tuple[float, float]:
        """Standard deviations above and below the estimate, as its 95 % interval reaches."""
        low, high = self.interval_95
        return (high - self.estimate) / Z_95, (self.estimate - low) / Z_95


@dataclass(frozen=True)
class ModeComparison:
    """A measured mode beside the model's; null where there is no partner or nothing was
    measured.
    """

    __pydantic_config__: ClassVar = DESCRIBED

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
    # a mode on the supports' springs has none
    predicted_damping: float | None
    """of the updated model, not per cent"""
    measured_damping_sd: float | None = None
    """standard deviation of the measured ratio"""
    motion: Mapping[str, float] | None = None
    """shares of the updated model's motion, by kind, 0 to 1"""
    energy: Mapping[str, float] | None = None
    """shares of its strain energy, by set and spring, 0 to 1"""
    own_mesh_hz: float | None = None
    """of the updated model on the structure's own mesh, Hz; null where a finer one was not needed"""


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

    __pydantic_config__: ClassVar = DESCRIBED

    name: str  # of the law
    # by name, SI: of an update of one campaign the first law's are from the FRFs, where there are
    # any, the others' from the modal damping ratios; the law's discrepancy is included
    coefficients: dict[str, float]
    standard_deviations: dict[str, float]  # of the coefficients
    # Bayesian information criterion on the damping ratios; infinite where the law cannot be had
    bic: Unbounded
    preferred: bool  # whether it has the least of all


@dataclass(frozen=True)
class LawCurve:
    """A damping law over the range of the modes."""

    __pydantic_config__: ClassVar = DESCRIBED

    frequency_hz: Drawn
    """Hz; of a law by mechanism those of the model's modes"""
    damping_ratio: Drawn
    """of the law there"""


@dataclass(frozen=True)
class DampingModelFit(LawFit):
    """A damping law of the recipe."""

    __pydantic_config__: ClassVar = DESCRIBED

    missed: Numbers
    """relative miss of the ratio of each paired mode"""
    curve: LawCurve
    """its damping ratios over the range of the modes"""
    by_mechanism: bool
    """whether it damps the shares of strain energy"""


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
    """A constant, or a coefficient of a damping law, over temperature."""

    __pydantic_config__: ClassVar = DESCRIBED

    name: str
    """of the constant or the coefficient"""
    unit: str
    """SI"""
    estimate: Drawn
    """at each temperature"""
    low: Drawn
    """lower end of its 95 % interval"""
    high: Drawn
    """upper end of its 95 % interval"""
    law: str | None = None
    """whose coefficient it is; null of an elastic constant"""


@dataclass(frozen=True)
class Curve:
    """Constants and damping between the temperatures of the tests, and a little beyond."""

    __pydantic_config__: ClassVar = DESCRIBED

    reference_c: float
    """temperature at which the parameters are given, °C"""
    temperature_c: Drawn
    """°C"""
    constants: tuple[CurveOf, ...]
    """of each that changes with temperature"""


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
    """A mode of the updated model; `motion` and `energy` are shares, as of `ModeComparison`."""

    number: int  # from 1
    frequency_hz: float
    kind: str
    motion: Mapping[str, float]
    energy: Mapping[str, float]


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
class StartHistory:
    """A start of stage 1, iterate by iterate."""

    __pydantic_config__: ClassVar = DESCRIBED

    chosen: bool
    """whether the result is its end"""
    failure: str | None
    """null: it converged"""
    cost: tuple[float, ...]
    """of each iterate"""
    parameters: dict[str, Numbers]
    """by name, of each iterate, SI"""


@dataclass(frozen=True)
class Partner:
    """A measured mode and its partner among the model's."""

    __pydantic_config__: ClassVar = DESCRIBED

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
    """Other partners, at the best point that a start came to with them; or other constants with the
    same.
    """

    __pydantic_config__: ClassVar = DESCRIBED

    partners: tuple[Partner, ...]
    """of the measured modes"""
    parameters: dict[str, float]
    """at that point, by name, SI"""
    log_evidence: float
    """logarithm of how much more the chosen pairing is supported"""


@dataclass(frozen=True)
class PairingSummary:
    """Which measured mode is which of the model's."""

    __pydantic_config__: ClassVar = DESCRIBED

    by: Literal["shapes", "order"]
    """what decided: `order` with fewer than three dofs, or no shapes"""
    partners: tuple[Partner, ...]
    """of the measured modes; one that is not named has none"""
    rival: RivalPairing | None
    """the next best pairing that was found; null: none"""


@dataclass(frozen=True)
class ConvergenceStep:
    """An iterate of stage 1."""

    __pydantic_config__: ClassVar = DESCRIBED

    parameters: dict[str, float]
    """by name, SI"""
    frequency_hz: Numbers
    """of the measured modes' partners, Hz"""
    cost: float
    """of the fit, without unit"""


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
class DampingSearch:
    """How stage 2 came to its coefficients."""

    starts: int  # from how many it was tried
    optima: tuple[dict[str, float], ...]  # coefficients that they ended at, by name, SI
    history: FloatArray  # iterates of the one that is the result


@dataclass(frozen=True)
class UnseenDirections:
    """Directions that the data do not see, by name of a parameter, in prior standard deviations."""

    null_directions: tuple[dict[str, float], ...]


@dataclass(frozen=True)
class Discrepancy:
    """Relative standard deviation of what the model cannot say."""

    frequency: float
    damping: float | None  # of a damping ratio; None where no law was fitted


@dataclass(frozen=True, kw_only=True)
class CommonResult:
    """What every update says, of one campaign or of several. Members have the names and places that
    they have in the document of a result, but for `posterior`, which the document summarises.
    """

    verdict: Verdict
    warnings: tuple[str, ...]
    findings: tuple[Finding, ...] = ()
    parameters: tuple[ParameterEstimate, ...]  # of all campaigns, SI
    posterior: PosteriorSummary
    # at which all of it is given, °C; None where nobody stated one
    reference_temperature_c: float | None = None
    # over temperature, where the reference is not that of the measurement, or there are several
    curve: Curve | None = None


@dataclass(frozen=True, kw_only=True)
class UpdateResult(CommonResult):
    """Everything an update of one campaign found. Without FRFs, or where damping failed, what
    depends on it is empty or None.

    The document summarises `correlation` and `identification` too; what is kept in arrays beside it
    comes last.
    """

    outcomes: tuple[StageOutcome, ...]
    modes: tuple[ModeComparison, ...]
    correlation: Correlation
    damping_models: tuple[DampingModelFit, ...]
    damping_fit: DampingSearch
    convergence: tuple[ConvergenceStep, ...]
    starts: tuple[StartHistory, ...]
    pairing: PairingSummary
    model_modes: tuple[ModelMode, ...]
    identifiability: UnseenDirections
    discrepancy: Discrepancy
    band_hz: tuple[float, float] | None
    channel_delay_s: float | None
    identification: Identification | None
    # shapes, prediction, effects: in arrays beside the document
    shapes: ModeShapes | None
    prediction: Prediction | None
    effects: FrequencyEffects


def amount(name: str, value: float) -> str:
    """A constant's value as a laboratory writes it, or another number; to three digits.

    >>> amount("Ex", 33.05e9), amount("density", 2012), amount("", 0.16)
    ('33.1 GPa', '2010 kg/m³', '0.16')
    """
    factor, unit = _written(name)
    # without an exponent where there need be none
    return f"{float(f'{factor * value:.3g}'):g}{unit}"


def plus_minus(name: str, value: float, sd: float) -> str:
    """A constant's value with its standard deviation, to the digits that this leaves.

    >>> plus_minus("length", 0.2912, 0.0016), plus_minus("nu_xy", 0.3, 0.05)
    ('291.2 ± 1.6 mm', '0.3 ± 0.05')
    """
    factor, unit = _written(name)
    digits = 1 - int(np.floor(np.log10(factor * sd)))
    rounded, error = round(factor * value, digits), round(factor * sd, digits)
    return f"{rounded:.12g} ± {error:.12g}{unit}"


def _written(name: str) -> tuple[float, str]:
    quantity = quantity_of(name)
    factor, unit = (
        WRITTEN["1"] if quantity is None else WRITTEN.get(quantity.unit, (1.0, quantity.unit))
    )
    return factor, unit if unit in ("", "°") else f" {unit}"


MOST_WARNINGS = 12
"""That a result carries; what weighs less is counted in the last."""

SENTENCES = {
    "usable": "The result may be used: {numbers}.",
    "with_care": "Use the result with care: {numbers}.",
    "do_not_use": "Do not use the result: the model and the measurement do not belong together.",
}

_DECISIVE = 2  # reasons that a verdict names

SKEWED = 1.25
"""Ratio of the sides of an interval from which they are written as two: what the second digit of a
± would show.
"""

finding = partial(make, FINDINGS)
"""A finding of a row of the table, with its numbers; of a graver or a milder level where one is
given.
"""


def passed_on(kind: str, notes: Iterable[Finding]) -> list[Finding]:
    """Remarks on the data as a result says them, under one kind."""
    return [note.passed_on(kind, PASSED_ON[kind]) for note in notes]


def judge(findings: Sequence[Finding], parameters: Sequence[ParameterEstimate]) -> Verdict:
    """The worst level of the findings, with the two that weigh most as its reasons."""
    levels: tuple[Level, ...] = ("do_not_use", "with_care")
    level: Literal["usable", "with_care", "do_not_use"] = "usable"
    decisive: list[Finding] = []
    for worst in levels:
        decisive = sorted((f for f in findings if f.level == worst), key=lambda f: -f.weight)
        if decisive:
            level = worst
            break
    reasons = tuple(dict.fromkeys(f.text for f in decisive))[:_DECISIVE]
    return Verdict(level, SENTENCES[level].format(numbers=_numbers(parameters)), reasons)


def ordered(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """The gravest first."""
    rank = {"do_not_use": 2, "with_care": 1, None: 0}
    return tuple(sorted(findings, key=lambda f: (-rank[f.level], -f.weight)))


def warnings(findings: Sequence[Finding]) -> tuple[str, ...]:
    """A dozen warnings at most: the gravest first, those of one kind about several things folded
    into one.
    """
    folded = [first.text + likewise(others) for first, *others in alike(ordered(findings))]
    if len(folded) <= MOST_WARNINGS:
        return tuple(folded)
    left = len(folded) - MOST_WARNINGS + 1
    return (*folded[: MOST_WARNINGS - 1], f"{left} less important warnings are not listed")


def modes_of(unpaired: int, count: int) -> str:
    """Some of the measured modes, as the subject of a sentence."""
    return f"{unpaired} of {count} measured modes {'has' if unpaired == 1 else 'have'}"


def _in_percent(known: ParameterEstimate) -> str:
    """A standard deviation as a share of the estimate, or one to each side where the interval is
    not about its middle.
    """
    above, below = known.deviations
    if max(above, below) < SKEWED * min(above, below):
        return f"{100 * known.standard_deviation / abs(known.estimate):.2g} %"
    return (
        " ".join(
            f"{sign}{100 * each / abs(known.estimate):.2g}"
            for sign, each in (("+", above), ("−", below))
        )
        + " %"
    )


def _numbers(parameters: Sequence[ParameterEstimate]) -> str:
    """How well each parameter is known, and which the data do not determine; a tied one is
    neither.
    """
    constants = [p for p in parameters if p.tied_to is None and constant_of(p.name) is None]
    known = [p for p in constants if p.identifiable and p.estimate]
    unknown = [p.name for p in constants if not p.identifiable]
    if not known:
        return "no parameter is identifiable"
    words = ", ".join(f"{p.name} to {_in_percent(p)}" for p in known)
    return f"{words} (one standard deviation)" + (
        f"; not identifiable: {', '.join(unknown)}" if unknown else ""
    )
