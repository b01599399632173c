"""Estimates with what their uncertainty is made of: standard deviation, 95 % interval, and a budget (GUM, JCGM 100:2008).

The variance of an estimate is the sum of those of independent sources: the noise of the measurement, the discrepancy of the
model, every prior, every input of the laboratory. Inputs that are believed to be nothing (`excursions`) add to one side of the
interval only; their part of the variance is their mean square. Reaches of independent parts add as squares.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray
from fecore.updating.damping_stage import AGAINST_MODES, OF_LAW, DampingResult
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.excursions import REACH_95, Excursion
from fecore.updating.held_inputs import hold_inputs
from fecore.updating.inputs import Inputs, tolerance_of
from fecore.updating.law_ranking import RankedLaw
from fecore.updating.result import BudgetEntry, Comparable, ParameterEstimate
from fecore.updating.sampling import Posterior

OTHER_PARTNERS = "partners of the modes"
"""The budget's source for pairings of the modes that are nearly as likely as the chosen one."""

_SMALLEST_SHARE = 1e-4  # of the variance that is worth a line of the budget
_DIFFERENT = 0.25  # relative difference of two standard deviations of one posterior that is worth a warning


@dataclass(frozen=True)
class _Spread:
    """Standard deviation, reaches of the 95 % interval below and above, and variance by source, in one coordinate."""

    sd: float
    below: float
    above: float
    variance: Mapping[str, float]


def constant_estimates(elastic: ElasticResult, inputs: Inputs, sampled: Posterior | None) -> list[ParameterEstimate]:
    """Constants that the recipe asked for, free and tied; a tied one follows its master in everything."""
    prior = elastic.updated.forward.parametrisation
    initial, estimate = prior.constants(prior.prior_mean), prior.constants(elastic.theta)
    centre, held = elastic.coordinates.of(elastic.theta), hold_inputs(elastic)
    at_stated = prior.constants(np.concatenate([held.theta, elastic.theta[held.theta.size :]]))
    found = []
    for column, master in enumerate(prior.reported):
        samples = None if sampled is None else sampled.xi[:, column]
        spread = _constant_spread(elastic, column, samples)
        state = elastic.identifiability[column]
        for row in np.flatnonzero(prior.spread[:, column]):
            ratio = float(prior.spread[row, column])
            ends = np.tile(centre, (2, 1))
            ends[:, column] += [-spread.below, spread.above]
            slope = ratio * elastic.coordinates.slope(elastic.theta)[column]
            low, high = sorted(float(v) for v in ratio * elastic.coordinates.values(ends)[:, column])
            found.append(
                ParameterEstimate(
                    name=prior.constant_names[row],
                    unit=prior.units[row],
                    initial=float(initial[row]),
                    estimate=float(estimate[row]),
                    standard_deviation=float(abs(slope) * spread.sd),
                    noise_standard_deviation=abs(ratio) * float(np.sqrt(elastic.noise_covariance[column, column])),
                    interval_95=(low, high),
                    identifiable=state.identifiable,
                    prior_mean=float(initial[row]),
                    prior_sd=abs(ratio) * float(prior.prior_sd[column]),
                    comparable=Comparable(
                        float(at_stated[row]), abs(ratio) * float(held.noise_standard_deviation[column])
                    ),
                    budget=_budget(spread, abs(slope), _provenance(elastic, inputs)),
                    confounded_with=tuple(name for name in state.confounded_with if name != master),
                    tied_to=None if prior.constant_names[row] == master else master,
                )
            )
    order = {name: place for place, name in enumerate(prior.constant_names)}
    return sorted(found, key=lambda each: order[each.name])


def coefficient_estimates(
    elastic: ElasticResult, damping: DampingResult, inputs: Inputs, sampled: Posterior | None
) -> list[ParameterEstimate]:
    """Coefficients of the fitted damping law."""
    fit, excursions = damping.fit, (*elastic.excursions, *_window(damping, inputs))
    pulls = (
        np.column_stack([damping.pulls, damping.window]) if len(excursions) > len(elastic.excursions) else damping.pulls
    )
    found = []
    for i, (name, unit) in enumerate(zip(fit.law.coefficient_names, fit.law.coefficient_units, strict=True)):
        variance = {source: float(part[i] @ part[i]) for source, part in damping.sources.items()}
        sd = float(np.sqrt(sum(variance.values())))
        samples = None if sampled is None else sampled.damping[:, i] - fit.coefficients[i]
        reach = damping.deviations.reach(sd**2 - variance[OF_LAW], variance[OF_LAW])
        core = _sampled_or(samples, sd, reach, reach)
        spread = _with_excursions(*core, variance, excursions, pulls[i])
        value = float(fit.coefficients[i])
        found.append(
            ParameterEstimate(
                name=name,
                unit=unit,
                initial=float(damping.start[i]),
                estimate=value,
                standard_deviation=spread.sd,
                noise_standard_deviation=float(np.sqrt(fit.noise_covariance[i, i])),
                interval_95=(value - spread.below, value + spread.above),
                identifiable=spread.sd < abs(value) / 2,
                prior_mean=None,
                prior_sd=None,
                comparable=Comparable(value, float(np.sqrt(fit.noise_covariance[i, i]))),
                budget=_budget(spread, 1.0, _provenance(elastic, inputs, damping)),
            )
        )
    return found


def ratio_estimates(ranked: RankedLaw) -> list[ParameterEstimate]:
    """Coefficients of a law from the modes' damping ratios alone: the laboratory typed them in and sent no FRFs."""
    rows = zip(ranked.law.coefficient_names, ranked.law.coefficient_units, strict=True)
    found = []
    for i, (name, unit) in enumerate(rows):
        value, sd = float(ranked.coefficients[i]), float(np.sqrt(ranked.covariance[i, i]))
        found.append(
            ParameterEstimate(
                name=name,
                unit=unit,
                initial=None,
                estimate=value,
                standard_deviation=sd,
                noise_standard_deviation=float(np.sqrt(ranked.noise_covariance[i, i])),
                interval_95=(value - REACH_95 * sd, value + REACH_95 * sd),
                identifiable=sd < abs(value) / 2,
                prior_mean=None,
                prior_sd=None,
                comparable=Comparable(value, float(np.sqrt(ranked.noise_covariance[i, i]))),
            )
        )
    return found


def disagreements(elastic: ElasticResult, sampled: Posterior | None) -> list[str]:
    """Where the samples and the Gaussian approximation of one posterior differ, in words."""
    if sampled is None:
        return []
    gaussian, chain = np.sqrt(np.diag(elastic.mixture.total)), np.std(sampled.xi, axis=0)
    names = elastic.updated.forward.parametrisation.reported
    return [
        f"the sampled posterior of {name} is {chain[i] / gaussian[i]:.2f} times as wide as its Laplace approximation: "
        "trust the samples"
        for i, name in enumerate(names)
        if abs(np.log(chain[i] / gaussian[i])) > _DIFFERENT
    ]


def _constant_spread(elastic: ElasticResult, column: int, samples: FloatArray | None) -> _Spread:
    """Of one of stage 1's coordinates; what the marginalised discrepancy adds to the mean one's part is the discrepancy's.

    Where other pairings of the modes are not ruled out, what they add is a source of its own. The samples are those of one
    pairing, so the mixture over the pairings gives the interval then.
    """
    along = np.eye(elastic.theta.size)[column]
    total = float(elastic.mixture.total[column, column])
    variance = {name: float(part[column] @ part[column]) for name, part in elastic.sources.items()}
    variance["model discrepancy"] = max(variance["model discrepancy"] + total - sum(variance.values()), 0.0)
    centred = None if samples is None else samples - elastic.coordinates.of(elastic.theta)[column]
    core = _sampled_or(centred, float(np.sqrt(total)), *elastic.mixture.reach(along))
    if elastic.standing:
        spanned = float(elastic.spanning.total[column, column])
        variance = {name: part * min(spanned / total, 1.0) for name, part in variance.items()}
        variance[OTHER_PARTNERS] = max(spanned - total, 0.0)
        core = float(np.sqrt(spanned)), *elastic.spanning.reach(along)
    return _with_excursions(*core, variance, elastic.excursions, elastic.pulls[column])


def _sampled_or(samples: FloatArray | None, sd: float, below: float, above: float) -> tuple[float, float, float]:
    """Standard deviation and reaches: of samples about the estimate where there are any, else as given."""
    if samples is None:
        return sd, below, above
    low, high = np.quantile(samples, [0.025, 0.975])
    return float(np.std(samples)), max(float(-low), 0.0), max(float(high), 0.0)


def _with_excursions(
    sd: float,
    below: float,
    above: float,
    variance: Mapping[str, float],
    excursions: Sequence[Excursion],
    pulls: FloatArray,
) -> _Spread:
    squares, whole = np.array([below**2, above**2]), dict(variance)
    total = sd**2
    for each, pull in zip(excursions, pulls, strict=True):
        part = float(each.rms * pull) ** 2
        total += part
        whole[each.name] = whole.get(each.name, 0.0) + part
        sides = [True, True] if each.kind == "both" else [pull < 0, pull > 0]
        squares[sides] += (each.reach * pull) ** 2
    return _Spread(float(np.sqrt(total)), float(np.sqrt(squares[0])), float(np.sqrt(squares[1])), whole)


def _window(damping: DampingResult, inputs: Inputs) -> list[Excursion]:
    """The exponential window, where it may have been more than was stated."""
    if not np.any(damping.window):
        return []
    stated = inputs.window_rate is not None
    return [Excursion("window", np.zeros(0), "both" if stated else "one-sided", stated, "")]


def _provenance(elastic: ElasticResult, inputs: Inputs, damping: DampingResult | None = None) -> dict[str, str]:
    """Where the standard deviation of each source comes from, in words."""
    prior = elastic.updated.forward.parametrisation
    words = {
        "measurement noise": "covariance of the measured modes",
        "model discrepancy": f"{100 * elastic.discrepancy:.2g} % of a frequency, from the residuals and its prior",
    }
    if elastic.standing:
        words[OTHER_PARTNERS] = f"{len(elastic.standing)} other pairings that the frequencies do not rule out"
    for column, name in enumerate(prior.names):
        sd = f"{prior.prior_sd[column]:.3g} {prior.units[prior.constant_names.index(name)]}"
        if name in prior.reported:
            words[f"prior of {name}"] = sd
        else:
            stated = inputs.is_stated(tolerance_of(name) or name)
            words[name] = f"{sd}, {'stated' if stated else _ASSUMED}"
    for each in elastic.excursions:
        words[each.name] = f"{each.amount}, {'stated' if each.stated else _ASSUMED}"
    if damping is not None:
        words["measurement noise of FRFs"] = "noise of the FRFs, measured or from their residual"
        words[OF_LAW] = f"{100 * damping.discrepancy:.2g} % of a damping ratio, from the modes and its prior"
        words[AGAINST_MODES] = (
            "law from the FRFs against that of the identified modes: errors of the model's shapes, delay"
        )
        words["modes not measured"] = "tails of modes that nobody measured"
        words["window"] = "stated" if inputs.window_rate is not None else f"no window was stated, {_ASSUMED}"
    return words


_ASSUMED = "assumed: a careful laboratory's"


def _budget(spread: _Spread, slope: float, provenance: Mapping[str, str]) -> tuple[BudgetEntry, ...]:
    """The sources by their share of the variance, largest first."""
    total = spread.sd**2 or 1.0
    rows = sorted(spread.variance.items(), key=lambda row: -row[1])
    return tuple(
        BudgetEntry(name, slope * float(np.sqrt(part)), part / total, provenance.get(name, ""))
        for name, part in rows
        if part > _SMALLEST_SHARE * total
    )
