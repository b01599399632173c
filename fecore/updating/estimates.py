"""Estimates with what their uncertainty is made of: standard deviation, 95 % interval, and a budget (GUM, JCGM 100:2008).

The variance of an estimate is the sum of those of independent sources: the noise of the measurement, the discrepancy of the
model, every prior, every input of the laboratory. Inputs that are believed to be nothing (`excursions`) add to one side of the
interval only; their part of the variance is their mean square. Reaches of independent parts add as squares.

Two tests of one body share its thickness, length and density, however wrong these are: the errors move both estimates alike,
but each test's own noise moves its estimate of the inputs, and with it the constants. So tests are compared with the inputs
held at their prior means (`Comparable`): the estimate of the reported unknowns x_p given the inputs x_n = 0 is

    x_p + T_n x_n,     T_n = H_pp⁻¹H_pn,     and its noise that of x times T = [1, T_n],

from the Hessian H of stage 1 (Gelman et al., Bayesian Data Analysis, 3rd ed., A.1): exact where the misfit is a square.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fecore.arrays import FloatArray
from fecore.updating.damping_stage import AGAINST_MODES, OF_LAW, DampingResult
from fecore.updating.elastic_result import DISCREPANCY_OF_MODEL, NOISE, ElasticResult
from fecore.updating.excursions import REACH_95, Excursion
from fecore.updating.findings import found
from fecore.updating.inputs import Inputs, tolerance_of
from fecore.updating.laws import RankedLaw
from fecore.updating.result import BudgetEntry, Comparable, Finding, ParameterEstimate
from fecore.updating.sampling import Posterior

OTHER_PARTNERS = "partners of the modes"
"""The budget's source for pairings of the modes that are nearly as likely as the chosen one."""

_SMALLEST_SHARE = 1e-4  # of the variance that is worth a line of the budget
_DIFFERENT = 0.25  # relative difference of two standard deviations of one posterior that is worth a warning
_ASSUMED = "assumed: a careful laboratory's"


@dataclass(frozen=True)
class Spread:
    """Of one coordinate: standard deviation, that by noise alone, reaches of its 95 % interval, and variance by source."""

    sd: float
    noise_sd: float
    below: float
    above: float
    variance: Mapping[str, float]

    def tied(self, master: str, doubt: float) -> Spread:
        """The same of a constant that is tied to the coordinate's, `doubt` the standard deviation of the tie."""
        if not doubt:
            return self
        below, above = (float(np.hypot(reach, REACH_95 * doubt)) for reach in (self.below, self.above))
        variance = {**self.variance, f"tie to {master}": doubt**2}
        return Spread(float(np.hypot(self.sd, doubt)), self.noise_sd, below, above, variance)

    def budget(self, slope: float, provenance: Mapping[str, str]) -> tuple[BudgetEntry, ...]:
        """The sources by their share of the variance, largest first, for a value that has this slope by the coordinate."""
        total = self.sd**2 or 1.0
        rows = sorted(self.variance.items(), key=lambda row: -row[1])
        return tuple(
            BudgetEntry(name, slope * float(np.sqrt(part)), part / total, provenance.get(name, ""))
            for name, part in rows
            if part > _SMALLEST_SHARE * total
        )


def coordinate_spread(elastic: ElasticResult, place: int, samples: FloatArray | None = None) -> Spread:
    """Of one of stage 1's unknowns; what the marginalised discrepancy adds to the estimated one's part is the discrepancy's.

    Where other pairings of the modes are not ruled out, what they add is a source of its own. The samples are those of one
    pairing, so the mixture over the pairings gives the interval then.
    """
    along = np.eye(elastic.x.size)[place]
    total = float(elastic.mixture.total[place, place])
    variance = {name: float(part[place] @ part[place]) for name, part in elastic.sources.items()}
    noise_sd = float(np.sqrt(variance[NOISE]))
    variance[DISCREPANCY_OF_MODEL] = max(variance[DISCREPANCY_OF_MODEL] + total - sum(variance.values()), 0.0)
    centred = None if samples is None else samples - (elastic.coordinates.mean + elastic.x)[place]
    core = _sampled_or(centred, float(np.sqrt(total)), *elastic.mixture.reach(along))
    if elastic.standing:
        spanned = float(elastic.spanning.total[place, place])
        variance = {name: part * min(spanned / total, 1.0) for name, part in variance.items()}
        variance[OTHER_PARTNERS] = max(spanned - total, 0.0)
        core = float(np.sqrt(spanned)), *elastic.spanning.reach(along)
    return _with_excursions(noise_sd, *core, variance, elastic.every_excursion, elastic.pulls[place])


def constant_estimates(
    elastic: ElasticResult, inputs: Inputs | None, sampled: Posterior | None = None
) -> list[ParameterEstimate]:
    """Constants that were asked for, free and tied; a tied one follows its master, and its interval has the doubt of the tie.

    Args:
        elastic: stage 1, of one campaign or of several.
        inputs: what the laboratory of one campaign says of its inputs; None of several.
        sampled: samples of the posterior of one campaign.
    """
    layout = elastic.layout
    prior, coordinates = layout.campaigns[0].forward.parametrisation, layout.campaigns[0].coordinates
    theta, held = layout.material(elastic.x), _with_inputs_held(elastic)
    provenance = {} if inputs is None else _provenance(elastic, inputs)
    estimates = []
    for column, master in enumerate(layout.shared):
        samples = None if sampled is None else sampled.xi[:, column]
        spread, state = coordinate_spread(elastic, column, samples), elastic.identifiability[column]
        others = tuple(n for n in state.confounded_with if n != master and (inputs is not None or n in layout.shared))
        for row in np.flatnonzero(prior.spread[:, column]):
            ratio, name = float(prior.spread[row, column]), prior.constant_names[row]
            value, log = ratio * float(theta[column]), bool(coordinates.logarithmic[column])
            mean, tie = ratio * float(prior.prior_mean[column]), prior.ties.get(name, 0.0)
            base = _estimate(
                name,
                prior.units[row],
                value,
                spread.tied(master, float(np.sqrt(np.log1p(tie**2))) if log else tie * abs(float(theta[column]))),
                slope=value if log else ratio,
                log=log,
                provenance={**provenance, f"tie to {master}": f"{tie:.2g} of the ratio"},
            )
            estimates.append(
                replace(
                    base,
                    initial=mean,
                    identifiable=state.identifiable,
                    prior_mean=mean,
                    prior_sd=float(np.hypot(ratio * prior.prior_sd[column], tie * mean)),
                    comparable=Comparable(ratio * float(held.theta[column]), abs(ratio) * float(held.noise_sd[column])),
                    confounded_with=others,
                    tied_to=None if name == master else master,
                )
            )
    order = {name: place for place, name in enumerate(prior.constant_names)}
    return sorted(estimates, key=lambda each: order[each.name])


def own_estimates(elastic: ElasticResult, number: int) -> list[ParameterEstimate]:
    """The unknowns that are one campaign's and its specimen's own; scatter is a ratio to the material's constant."""
    layout, campaign = elastic.layout, elastic.layout.campaigns[number]
    prior, theta, sds = campaign.forward.parametrisation, campaign.theta(elastic.x), layout.sd(elastic.scatter)
    estimates = []
    for place in range(len(layout.shared), len(layout.unknowns)):
        if not campaign.pick[:, place].any():
            continue
        unknown, spread = layout.unknowns[place], coordinate_spread(elastic, place)
        unit, value, mean, sd, log = "1", float(np.exp(elastic.x[place])), 1.0, float(sds[place]), True
        if not unknown.is_scatter:
            row = int(np.flatnonzero(campaign.pick[:, place])[0])
            unit = prior.units[prior.constant_names.index(unknown.name)]
            value, mean, sd = float(theta[row]), float(prior.prior_mean[row]), float(prior.prior_sd[row])
            log = bool(campaign.coordinates.logarithmic[row])
        base = _estimate(unknown.name, unit, value, spread, slope=value if log else 1.0, log=log, provenance={})
        informed = 1 - (spread.sd / float(sds[place])) ** 2
        estimates.append(replace(base, initial=mean, identifiable=informed > 0.5, prior_mean=mean, prior_sd=sd))
    return estimates


def coefficient_estimates(
    elastic: ElasticResult, damping: DampingResult, inputs: Inputs, sampled: Posterior | None
) -> list[ParameterEstimate]:
    """Coefficients of the fitted damping law."""
    fit, excursions, pulls = damping.fit, elastic.every_excursion, damping.pulls
    if np.any(damping.window):  # it may have been more than was stated
        stated = inputs.window_rate is not None
        window = Excursion("window", np.zeros(0), "both" if stated else "one-sided", stated, "")
        excursions, pulls = (*excursions, window), np.column_stack([pulls, damping.window])
    provenance = _provenance(elastic, inputs, damping)
    estimates = []
    for i, (name, unit) in enumerate(zip(fit.law.coefficient_names, fit.law.coefficient_units, strict=True)):
        variance = {source: float(part[i] @ part[i]) for source, part in damping.sources.items()}
        sd = float(np.sqrt(sum(variance.values())))
        samples = None if sampled is None else sampled.damping[:, i] - fit.coefficients[i]
        reach = damping.deviations.reach(sd**2 - variance[OF_LAW], variance[OF_LAW])
        core = _sampled_or(samples, sd, reach, reach)
        noise_sd = float(np.sqrt(fit.noise_covariance[i, i]))
        spread = _with_excursions(noise_sd, *core, variance, excursions, pulls[i])
        base = _estimate(name, unit, float(fit.coefficients[i]), spread, provenance=provenance)
        estimates.append(replace(base, initial=float(damping.start[i])))
    return estimates


def ratio_estimates(ranked: RankedLaw) -> list[ParameterEstimate]:
    """Coefficients of a law from the modes' damping ratios alone: the laboratory typed them in and sent no FRFs."""
    rows = enumerate(zip(ranked.law.coefficient_names, ranked.law.coefficient_units, strict=True))
    estimates = []
    for i, (name, unit) in rows:
        sd, noise_sd = (float(np.sqrt(each[i, i])) for each in (ranked.covariance, ranked.noise_covariance))
        spread = Spread(sd, noise_sd, REACH_95 * sd, REACH_95 * sd, {})
        estimates.append(_estimate(name, unit, float(ranked.coefficients[i]), spread, provenance={}))
    return estimates


def disagreements(elastic: ElasticResult, sampled: Posterior | None) -> list[Finding]:
    """Where the samples and the Gaussian approximation of one posterior differ."""
    if sampled is None:
        return []
    ratio = np.std(sampled.xi, axis=0) / np.sqrt(np.diag(elastic.mixture.total))
    names = enumerate(elastic.layout.shared)
    return [found("samples_differ", name=n, ratio=ratio[i]) for i, n in names if abs(np.log(ratio[i])) > _DIFFERENT]


@dataclass(frozen=True)
class _Held:
    """The shared parameters with every input at its stated value: (q,) θ, and its (q,) standard deviations by noise, SI."""

    theta: FloatArray
    noise_sd: FloatArray


def _with_inputs_held(elastic: ElasticResult) -> _Held:
    layout, count = elastic.layout, len(elastic.layout.shared)
    turn = np.eye(count, elastic.x.size)
    if len(layout.campaigns) == 1:  # several have found out what their inputs are
        _, _, hessian = elastic.problem.at(elastic.discrepancy, elastic.scatter)
        turn[:, count:] = np.linalg.solve(hessian[:count, :count], hessian[:count, count:])
    theta = layout.material(turn @ elastic.x)
    noise = turn @ elastic.sources[NOISE]
    logarithmic = layout.campaigns[0].coordinates.logarithmic[:count]
    return _Held(theta, np.where(logarithmic, theta, 1.0) * np.sqrt(np.sum(noise**2, axis=1)))


def _estimate(
    name: str,
    unit: str,
    value: float,
    spread: Spread,
    *,
    slope: float = 1.0,
    log: bool = False,
    provenance: Mapping[str, str],
) -> ParameterEstimate:
    """The estimate of a value that has a slope by its coordinate; of a damping coefficient as it stands."""
    ends = (
        value * np.exp([-spread.below, spread.above])
        if log
        else value + slope * np.array([-spread.below, spread.above])
    )
    low, high = sorted(map(float, ends))
    noise = abs(slope) * spread.noise_sd
    return ParameterEstimate(
        name=name,
        unit=unit,
        initial=None,
        estimate=value,
        standard_deviation=abs(slope) * spread.sd,
        noise_standard_deviation=noise,
        interval_95=(low, high),
        identifiable=spread.sd < abs(value) / 2,
        prior_mean=None,
        prior_sd=None,
        comparable=Comparable(value, noise),
        budget=spread.budget(abs(slope), provenance),
    )


def _sampled_or(samples: FloatArray | None, sd: float, below: float, above: float) -> tuple[float, float, float]:
    """Standard deviation and reaches: of samples about the estimate where there are any, else as given."""
    if samples is None:
        return sd, below, above
    low, high = np.quantile(samples, [0.025, 0.975])
    return float(np.std(samples)), max(float(-low), 0.0), max(float(high), 0.0)


def _with_excursions(
    noise_sd: float,
    sd: float,
    below: float,
    above: float,
    variance: Mapping[str, float],
    excursions: Sequence[Excursion],
    pulls: FloatArray,
) -> Spread:
    """Parts that lie on one side of the interval; reaches of independent parts add as squares."""
    squares, whole, total = np.array([below**2, above**2]), dict(variance), sd**2
    for each, pull in zip(excursions, pulls, strict=True):
        part = float(each.rms * pull) ** 2
        total += part
        whole[each.name] = whole.get(each.name, 0.0) + part
        sides = [True, True] if each.kind == "both" else [pull < 0, pull > 0]
        squares[sides] += (each.reach * pull) ** 2
    return Spread(float(np.sqrt(total)), noise_sd, float(np.sqrt(squares[0])), float(np.sqrt(squares[1])), whole)


def _provenance(elastic: ElasticResult, inputs: Inputs, damping: DampingResult | None = None) -> dict[str, str]:
    """Where the standard deviation of each source comes from, in words."""
    prior = elastic.only.forward.parametrisation
    words = {
        NOISE: "covariance of the measured modes",
        DISCREPANCY_OF_MODEL: f"{100 * elastic.discrepancy:.2g} % of a frequency, from the residuals and its prior",
    }
    if elastic.standing:
        words[OTHER_PARTNERS] = f"{len(elastic.standing)} other pairings that the frequencies do not rule out"
    for column, name in enumerate(prior.names):
        sd = f"{prior.prior_sd[column]:.3g} {prior.units[prior.constant_names.index(name)]}"
        if name in prior.reported:
            words[f"prior of {name}"] = sd
        else:
            words[name] = f"{sd}, {_stated(inputs.is_stated(tolerance_of(name) or name))}"
    for each in elastic.every_excursion:
        words[each.name] = f"{each.amount}, {_stated(each.stated)}"
    if damping is not None:
        words["measurement noise of FRFs"] = "noise of the FRFs, measured or from their residual"
        words[OF_LAW] = f"{100 * damping.discrepancy:.2g} % of a damping ratio, from the modes and its prior"
        words[AGAINST_MODES] = (
            "law from the FRFs against that of the identified modes: errors of the model's shapes, delay"
        )
        words["modes not measured"] = "tails of modes that nobody measured"
        words["window"] = "stated" if inputs.window_rate is not None else f"no window was stated, {_ASSUMED}"
    return words


def _stated(stated: bool) -> str:
    return "stated" if stated else _ASSUMED
