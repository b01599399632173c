"""Where to hit next: what a test that nobody has made yet would add to what is known (Lindley, Ann.
Math. Stat. 27, 1956).

At the present posterior the problem is linear, so a test's frequencies, whatever they will be,
change the precision of all unknowns from H to H + SᵀC⁻¹S, S = ∂ln f/∂x and C = noise + s². With the
test's own nuisances integrated out, the expected information about the material is the fall of its
posterior's entropy,

    I = ½ ln |C_now| - ½ ln |C_then|        (nats; C the covariance of the material's parameters alone).

A test of another specimen brings the scatter between specimens with it, as the joint update of all
of them will: I and the variances are means over the scatter's probabilities, as the campaigns so
far leave them.

The noise of a frequency follows from the FRFs that are to be measured. Near its resonance ∂H/∂ln
ω_k ≈ 2 ω_k⁴ A/D², and its square summed over lines Δf apart gives, for accelerances with noise of
variance σ²,

    1/var(ln ω_k) = Σ_p ω_k (φ_kp φ_kr)² / (8 ζ_k³ Δf σ²)

over points p hit against the sensor r. A mode with a node at the sensor is not seen, and a test's
points are chosen by the same
sum: one after the other, then by exchanges (Fedorov 1972), to the least posterior volume.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.constants import Body, Parameter
from fecore.body.supports import PointMass
from fecore.errors import InputError, within
from fecore.frf import along_z
from fecore.modes import MeasuredModes
from fecore.updating.campaigns import MATERIAL_PARAMETERS, Campaign, as_updated, lay_out, yielding
from fecore.updating.elastic import fit_elastic, settled
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.forward import ForwardModel
from fecore.updating.inputs import Inputs, by_shear_correction
from fecore.updating.layout import Coupon, Layout, Unknown
from fecore.updating.mesh import meshed
from fecore.updating.parameters import Parametrisation, by_name, parametrise
from fecore.updating.posterior import DISCREPANCY, SCATTER, prior_of_scatter

_FAINT = 1e4  # noise variance of ln f, over the discrepancy's, from which a mode counts as not seen


@dataclass(frozen=True)
class PlannedTest:
    """A test that could be made."""

    name: str  # in the plan
    body: Body  # as it would stand, added masses included
    highest_hz: float  # of the band
    # (x, y), or (x, y, z) on a body in space, in m of the points that can be hit
    points: tuple[tuple[float, ...], ...]
    sensor: int  # number of the point, among these, where the sensor would stand
    sensor_mass: float = 0.0  # kg; it loads the body
    # standard deviation of an FRF's noise, as a share of the root mean square of the FRF at the
    # sensor
    noise: float = 0.02
    damping_ratio: float = 0.01  # of all modes, as expected
    lines_hz: float = 0.5  # spacing of the lines
    # name of the specimen; tests and campaigns of one specimen share its dimensions
    specimen: str = "specimen"
    # how well the laboratory will know what it hands in
    inputs: Inputs = field(default_factory=Inputs)
    hit: tuple[int, ...] | None = None  # numbers of the points that may be hit; None: all
    # directions at points by their numbers, as rows, where the third, along which they are hit, is
    # not z
    axes: Mapping[int, FloatArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not 0 <= self.sensor < len(self.points):
            raise InputError(
                "sensor", f"is point {self.sensor}, expected one of the {len(self.points)} points"
            )
        for name in ("highest_hz", "noise", "damping_ratio", "lines_hz"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise InputError(name, f"is {value}, expected a positive number")


@dataclass(frozen=True)
class PlannedCoupons:
    """Coupons that could be tested: pieces of the material, of which the body is one more."""

    name: str  # in the plan
    constants: tuple[str, ...]  # names of the parameters that they give
    # with which they will say what one more piece's are (`fecore.coupons.batch.prior`)
    relative_sd: float
    pieces: int  # that are tested

    def tested(self, theta: Mapping[str, float]) -> tuple[Coupon, ...]:
        """What they will say where the parameters are these, SI."""
        of_one = [(name, theta[name], self.relative_sd * theta[name]) for name in self.constants]
        return tuple(Coupon(*values, self.name, self.pieces) for values in of_one)


@dataclass(frozen=True)
class TestGain:
    """What a test would bring."""

    name: str  # of the test
    information: float  # expected, about the material or the parameter asked for, nats
    standard_deviations: dict[str, float]  # expected afterwards, by parameter, SI
    frequencies_hz: FloatArray  # of the modes that it would see
    # numbers of the points to hit, in the order of what they add; all that can be hit where no
    # number was asked for
    points: tuple[int, ...]
    share: float  # of the information of hitting every point that these points keep


@dataclass(frozen=True)
class Plan:
    """Tests by their expected information, the best first, and what is known now, by parameter,
    SI.
    """

    known: dict[str, float]
    gains: tuple[TestGain, ...]


def plan_tests(
    tests: Sequence[PlannedTest],
    campaigns: Sequence[Campaign] = (),
    parameters: Sequence[Parameter] = MATERIAL_PARAMETERS,
    count: int | None = None,
    coupons: Sequence[PlannedCoupons] = (),
    about: str | None = None,
) -> Plan:
    """Rank tests by what they would add to the campaigns so far.

    Args:
        tests: that could be made.
        campaigns: that were made, with their modes; none: the parameters' priors are what is known.
        parameters: the material's.
        count: how many points are to be hit in each test; None: all.
        coupons: that could be tested.
        about: the parameter that tests are ranked and points chosen for; None: all of the
            material's.

    Raises:
        InputError: tests contradict themselves, or see no mode in their band, or nothing of that
            name is updated.
        UpdatingError: the campaigns so far have no common estimate.
    """
    if not tests:
        raise InputError("tests", "is empty, expected at least one that could be made")
    reported = parametrise(tests[0].body, parameters).reported
    named = {f"coupons.{number}": each.constants for number, each in enumerate(coupons)}
    for field_name, names in {"about": (about,) if about else (), **named}.items():
        if unknown := set(names).difference(reported):
            raise InputError(
                field_name,
                f"names {', '.join(sorted(unknown))}; expected some of {', '.join(reported)}",
            )
    campaigns = as_updated(campaigns)
    fitted = settled(fit_elastic(lay_out(campaigns, parameters, SCATTER))) if campaigns else None
    theta = (
        {} if fitted is None else by_name(fitted.layout.shared, fitted.layout.material(fitted.x))
    )
    simulated = []
    for number, test in enumerate(tests):
        with within(f"tests.{number}"):
            simulated.append(_Simulated.of(test, parameters, theta))
    now = lay_out(campaigns or [simulated[0].campaign], parameters, SCATTER)
    known = _Known(tuple(campaigns), tuple(parameters), fitted, now)
    prior = simulated[0].prior
    slope = prior.slope(_at(prior, theta))[: len(reported)]
    gains = [_gain(each, known, slope, count=count, about=about) for each in simulated]
    gains += [_gain_of_coupons(each, known, simulated[0], slope, about) for each in coupons]
    return Plan(
        by_name(reported, known.beside(now).standard_deviations() * slope),
        tuple(sorted(gains, key=lambda each: -each.information)),
    )


@dataclass(frozen=True)
class _Known:
    """What the campaigns so far say, as the update states it whose data they are: of one specimen
    nothing of a scatter.
    """

    # campaigns, parameters: as they came in
    campaigns: tuple[Campaign, ...]
    parameters: tuple[Parameter, ...]
    fitted: ElasticResult | None  # their update; None where there are none
    now: Layout  # the unknowns of an update of them, or of one test

    @property
    def discrepancy(self) -> float:
        """That of the next test's frequencies: as the campaigns so far show it, else its prior's
        scale.
        """
        return DISCREPANCY if self.fitted is None else self.fitted.discrepancy

    def layout(self, campaign: Campaign) -> Layout:
        """The unknowns of an update with one more campaign, the last of the layout's."""
        return lay_out([*self.campaigns, campaign], self.parameters, SCATTER)

    def scatters(self, layout: Layout) -> tuple[FloatArray, FloatArray]:
        """(t,) values of the scatter and their probabilities: its prior's, or as far as the
        campaigns say more theirs.
        """
        if self.fitted is None or self.fitted.layout.scatter != layout.scatter:
            return prior_of_scatter(layout.scatter)
        mixture, scatters = self.fitted.problem.mixture(layout.scatter)
        values = np.unique(scatters)
        return values, np.array([mixture.weight[scatters == value].sum() for value in values])

    def informed(self, layout: Layout) -> FloatArray:
        """(X, X) precision that the campaigns bring."""
        size, fitted = len(layout.unknowns), self.fitted
        if fitted is None:
            return np.zeros((size, size))
        variance = fitted.problem.noise + fitted.discrepancy**2 * np.eye(
            fitted.problem.residual.size
        )
        S = np.zeros((fitted.problem.residual.size, size))
        at = [layout.labels.index(label) for label in fitted.layout.labels]
        S[:, at] = np.sqrt(fitted.problem.weights)[:, None] * fitted.problem.sensitivity
        for place, unknown in enumerate(
            layout.unknowns
        ):  # a specimen that is the only one so far does not scatter there
            if (
                unknown.is_scatter
                and unknown.label not in fitted.layout.labels
                and self._is_made(unknown)
            ):
                S[:, place] = S[:, layout.labels.index(unknown.constant)]
        precision: FloatArray = S.T @ np.linalg.solve(variance, S)
        return precision

    def _is_made(self, unknown: Unknown) -> bool:
        return any(campaign.specimen == unknown.owner for campaign in self.campaigns)

    def beside(self, layout: Layout) -> _Beside:
        """What is known of the material beside more that is brought."""
        scatters, probabilities = self.scatters(layout)
        return _Beside(
            self.informed(layout),
            tuple(layout.precision(float(scatter)) for scatter in scatters),
            probabilities,
            len(layout.shared),
        )


@dataclass(frozen=True)
class _Beside:
    """The precision of the unknowns at each scatter, as the campaigns so far say."""

    informed: FloatArray  # (X, X) that the campaigns bring
    priors: tuple[FloatArray, ...]  # (X, X) of the prior at each scatter
    probabilities: FloatArray  # (t,) of the scatters
    shared: int  # how many unknowns are the material's, the first

    def covariances(self, more: FloatArray | float = 0.0) -> FloatArray:
        """(t, q, q) of the material's parameters at each scatter, (X, X) information `more`
        included.
        """
        information = self.informed + more
        precisions = [prior + information for prior in self.priors]
        covariances: FloatArray = np.linalg.inv(precisions)[:, : self.shared, : self.shared]
        return covariances

    def standard_deviations(self, more: FloatArray | float = 0.0) -> FloatArray:
        """(q,) of the material's parameters, whatever the scatter is."""
        variances = np.diagonal(self.covariances(more), axis1=1, axis2=2)
        deviations: FloatArray = np.sqrt(self.probabilities @ variances)
        return deviations

    def volume(self, rows: Sequence[int], more: FloatArray | float = 0.0) -> float:
        """Mean of ½ ln |C| of some of the material's parameters."""
        logs = np.linalg.slogdet(self.covariances(more)[:, rows][:, :, rows])[1]
        return float(self.probabilities @ logs) / 2


@dataclass(frozen=True)
class _Simulated:
    """A test on its model: the modes that it would see, and how loud each is at each point."""

    test: PlannedTest
    campaign: Campaign
    prior: Parametrisation
    theta: dict[str, float]
    loudness: FloatArray

    @classmethod
    def of(
        cls, test: PlannedTest, parameters: Sequence[Parameter], theta: dict[str, float]
    ) -> _Simulated:
        body = yielding(test.body, test.inputs)
        if test.sensor_mass:
            x, y, z = (*test.points[test.sensor], 0.0)[:3]
            body = body.carrying([PointMass(x, y, test.sensor_mass, z=z)])
        body, _ = meshed(body, test.highest_hz)
        prior = parametrise(body, parameters)
        forward = ForwardModel.of_dofs(
            prior,
            along_z(range(len(test.points))),
            dict(enumerate(test.points)),
            test.highest_hz,
            axes=test.axes,
        )
        state = forward.solve(_at(prior, theta))
        hz = state.frequency_hz[state.frequency_hz < test.highest_hz]
        if not hz.size:
            raise InputError(
                "highest_hz",
                f"is {test.highest_hz:g} Hz, below the first mode of the model of {test.name}",
            )
        campaign = Campaign(
            test.name,
            test.specimen,
            body,
            MeasuredModes(hz, np.full(hz.size, np.nan)),
            inputs=test.inputs,
        )
        return cls(
            test,
            campaign,
            prior,
            by_name(prior.names, state.theta),
            _loudness(test, state.shapes[: hz.size], hz),
        )

    def noise(self, points: Sequence[int]) -> FloatArray:
        """(n,) variance of ln f by noise when these points are hit."""
        variance: FloatArray = 1 / np.maximum(self.loudness[:, list(points)].sum(axis=1), 1e-300)
        return variance


def _at(prior: Parametrisation, theta: dict[str, float]) -> FloatArray:
    """(p,) parameters: known ones by name, the others at their prior means."""
    return np.array(
        [theta.get(name, mean) for name, mean in zip(prior.names, prior.prior_mean, strict=True)]
    )


def _loudness(test: PlannedTest, shapes: FloatArray, hz: FloatArray) -> FloatArray:
    """(n, p) 1/var(ln ω) that hitting each point brings for each mode."""
    omega, zeta = 2 * np.pi * hz, test.damping_ratio
    driving = shapes[:, test.sensor] ** 2
    # Mean square of the sensor's own accelerance, by its resonances: Σ_k π ω A²/4ζ over the width
    # of the band in rad/s.
    power = float(np.sum(driving**2 * omega / zeta)) * np.pi / 4 / (2 * np.pi * test.highest_hz)
    residues = (shapes * shapes[:, [test.sensor]]) ** 2
    loud: FloatArray = (
        omega[:, None]
        * residues
        / (8 * zeta**3 * test.lines_hz * test.noise**2 * max(power, 1e-300))
    )
    return loud


def _information(known: _Known, layout: Layout, about: str | None) -> Callable[[FloatArray], float]:
    """The expected information that (X, X) more precision brings: of one parameter, or of all of
    the material's.
    """
    rows = [row for row, name in enumerate(layout.shared) if about in (None, name)]

    base, beside = known.beside(known.now).volume(rows), known.beside(layout)
    return lambda brought: base - beside.volume(rows, brought)


def _gain_of_coupons(
    coupons: PlannedCoupons, known: _Known, beside: _Simulated, slope: FloatArray, about: str | None
) -> TestGain:
    """What coupons would bring to an update of the campaigns so far, or of a test where there are
    none.
    """
    campaigns = known.campaigns or (beside.campaign,)
    layout = lay_out(campaigns, known.parameters, SCATTER, coupons.tested(beside.theta))
    combinations, _, sds = layout.of_coupons
    brought = combinations.T @ (combinations / sds[:, None] ** 2)
    expected = by_name(layout.shared, known.beside(layout).standard_deviations(brought) * slope)
    return TestGain(
        coupons.name, _information(known, layout, about)(brought), expected, np.zeros(0), (), 1.0
    )


def _gain(
    each: _Simulated, known: _Known, slope: FloatArray, *, count: int | None, about: str | None
) -> TestGain:
    layout = known.layout(each.campaign)
    campaign = layout.campaigns[-1]
    state = campaign.forward.solve(_at(campaign.prior, each.theta))
    # each mode is taken for the model's of its number
    rows = min(len(campaign.modes), state.frequency_hz.size)
    by = state.frequency_jacobian[:rows] / state.frequency_hz[:rows, None]
    S = by * campaign.prior.slope(state.theta) @ campaign.pick
    gained = _information(known, layout, about)
    error = (
        known.discrepancy**2
        + each.test.body.model_error**2
        + by_shear_correction(state)[:rows] ** 2
    )

    def brought(points: Sequence[int]) -> FloatArray:
        return np.asarray(S.T @ ((1 / (each.noise(points) + error))[:, None] * S))

    def information(points: Sequence[int]) -> float:
        return gained(brought(points))

    everywhere = tuple(range(each.loudness.shape[1])) if each.test.hit is None else each.test.hit
    chosen = everywhere if count is None else best_points(information, everywhere, count)
    seen = each.noise(chosen) < _FAINT * DISCREPANCY**2
    whole = information(everywhere)
    return TestGain(
        name=each.test.name,
        information=information(chosen),
        standard_deviations=by_name(
            layout.shared, known.beside(layout).standard_deviations(brought(chosen)) * slope
        ),
        frequencies_hz=each.campaign.modes.frequency_hz[seen],
        points=tuple(chosen),
        share=information(chosen) / whole if whole > 0 else 1.0,
    )


def best_points(
    information: Callable[[Sequence[int]], float], points: Sequence[int], count: int
) -> tuple[int, ...]:
    """So many of some points with the most information: greedily, then by exchanges of one against
    another.

    Args:
        information: of a set of points; it grows with the set.
        points: to choose from.
        count: how many.
    """
    if count >= len(points):
        return tuple(points)
    chosen: list[int] = []
    while len(chosen) < count:
        left = [point for point in points if point not in chosen]
        chosen.append(max(left, key=lambda point: information([*chosen, point])))
    best = information(chosen)
    for _ in range(5):  # rounds of exchanges
        before = best
        for place in range(count):
            for other in points:
                if other in chosen:
                    continue
                trial = [*chosen[:place], other, *chosen[place + 1 :]]
                value = information(trial)
                if value > best + 1e-9:
                    chosen, best = trial, value
        if best <= before:
            break
    return tuple(chosen)
