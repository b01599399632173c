"""Estimates with what their uncertainty is made of: standard deviation, 95 % interval, and a budget
(GUM, JCGM 100:2008).

The variance of an estimate is the sum of those of independent sources: the noise of the
measurement, the discrepancy of the model, every prior, every input of the laboratory. Inputs that
are believed to be nothing (`systematic_effects`) add to one side of the interval only; their part
of the variance is their mean square. Reaches of independent parts add as squares.

Two tests of one body share its thickness, length and density, however wrong these are: the errors
move both estimates alike, but each test's own noise moves its estimate of the inputs, and with it
the constants. So tests are compared with the inputs held at their prior means (`Comparable`): the
estimate of the reported unknowns x_p given the inputs x_n = 0 is

    x_p + T_n x_n,     T_n = H_pp⁻¹H_pn,     and its noise that of x times T = [1, T_n],

from the Hessian H of stage 1 (Gelman et al., Bayesian Data Analysis, 3rd ed., A.1): exact where the
misfit is a square.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fecore.arrays import FloatArray
from fecore.findings import Finding
from fecore.normal import Z_95
from fecore.updating.damping_stage import AGAINST_MODES, OF_LAW, WINDOW, DampingResult
from fecore.updating.elastic_result import (
    DISCREPANCY_OF_MODEL,
    MODEL_OF_JOINTS,
    NOISE,
    ElasticResult,
)
from fecore.updating.inputs import MESH, Inputs, SystematicEffect, tolerance_of
from fecore.updating.laws import RankedLaw
from fecore.updating.parameters import DAMPING_PER_K, PER_K, Warmth, constant_of
from fecore.updating.posterior import Mixture
from fecore.updating.result import BudgetEntry, Comparable, ParameterEstimate, finding
from fecore.updating.sampling import Posterior

IN_DOUBT = "which modes are real"
"""The budget's source for measured modes that may be none."""

OTHER_PARTNERS = "partners of the modes"
"""The budget's source for pairings of the modes that are nearly as likely as the chosen one."""

CHANGED_WHERE = "where the stiffness has changed"
"""The budget's source for stretches of another stiffness that the modes do not distinguish."""

_SMALLEST_SHARE = 1e-4  # of the variance that is worth a line of the budget
# relative difference of two standard deviations of one posterior that is worth a warning
_DIFFERENT = 0.25
_ASSUMED = "assumed: a careful laboratory's"


@dataclass(frozen=True)
class Spread:
    """Of one coordinate: standard deviation, that by noise alone, reaches of its 95 % interval, and
    variance by source.
    """

    sd: float
    noise_sd: float
    below: float
    above: float
    variance: Mapping[str, float]

    def widened(self, sd: float, below: float, above: float, source: str) -> Spread:
        """Of another posterior: what is wider is a source of its own, and where it is narrower all
        sources are smaller.
        """
        left = sd**2 - self.sd**2
        variance = {
            name: part * min((sd / self.sd) ** 2, 1.0) for name, part in self.variance.items()
        }
        variance[source] = variance.get(source, 0.0) + max(left, 0.0)
        return Spread(sd, self.noise_sd, below, above, variance)

    def tied(self, master: str, doubt: float) -> Spread:
        """The same of a constant that is tied to the coordinate's, `doubt` the standard deviation
        of the tie.
        """
        if not doubt:
            return self
        below, above = (float(np.hypot(reach, Z_95 * doubt)) for reach in (self.below, self.above))
        variance = {**self.variance, f"tie to {master}": doubt**2}
        return Spread(float(np.hypot(self.sd, doubt)), self.noise_sd, below, above, variance)

    def sampled(self, samples: FloatArray) -> Spread:
        """With the root mean square and the reaches of (n,) samples about the estimate."""
        sd, (low, high) = (
            float(np.sqrt(np.mean(samples**2))),
            np.quantile(samples, [0.025, 0.975]).tolist(),
        )
        variance = {name: part * (sd / self.sd) ** 2 for name, part in self.variance.items()}
        return Spread(sd, self.noise_sd, max(-low, 0.0), max(high, 0.0), variance)

    def with_systematic_effects(
        self, effects: Sequence[SystematicEffect], sensitivities: FloatArray
    ) -> Spread:
        """With parts that lie on one side of the interval; reaches of independent parts add as
        squares.
        """
        squares = np.array([self.below**2, self.above**2])
        whole = dict(self.variance)
        total = self.sd**2
        for each, sensitivity in zip(effects, sensitivities, strict=True):
            part = float(each.rms * sensitivity) ** 2
            total += part
            whole[each.name] = whole.get(each.name, 0.0) + part
            sides = [True, True] if each.kind == "both" else [sensitivity < 0, sensitivity > 0]
            squares[sides] += (each.reach * sensitivity) ** 2
        below, above = np.sqrt(squares).tolist()
        return Spread(float(np.sqrt(total)), self.noise_sd, below, above, whole)

    def estimate(
        self,
        name: str,
        unit: str,
        value: float,
        *,
        slope: float = 1.0,
        log: bool = False,
        provenance: Mapping[str, str] | None = None,
    ) -> ParameterEstimate:
        """The estimate of a value that has a slope by its coordinate, which may be its logarithm;
        without a prior.
        """
        reach = np.array([-self.below, self.above])
        low, high = sorted(map(float, value * np.exp(reach) if log else value + slope * reach))
        slope, words, total = abs(slope), provenance or {}, self.sd**2 or 1.0
        budget = tuple(
            BudgetEntry(source, slope * float(np.sqrt(part)), part / total, words.get(source, ""))
            for source, part in sorted(self.variance.items(), key=lambda row: -row[1])
            if part > _SMALLEST_SHARE * total
        )
        return ParameterEstimate(
            name=name,
            unit=unit,
            initial=None,
            estimate=value,
            standard_deviation=slope * self.sd,
            noise_standard_deviation=slope * self.noise_sd,
            interval_95=(low, high),
            identifiable=bool(self.sd < abs(value) / 2),
            prior_mean=None,
            prior_sd=None,
            comparable=Comparable(value, slope * self.noise_sd),
            budget=budget,
        )


def coordinate_spread(
    elastic: ElasticResult, place: int, samples: FloatArray | None = None
) -> Spread:
    """Of one of stage 1's unknowns, or of its samples."""
    centred = None if samples is None else samples - (elastic.prior.xi_mean + elastic.x)[place]
    return spread_along(elastic, np.eye(elastic.x.size)[place], centred)


def spread_along(
    elastic: ElasticResult, along: FloatArray, samples: FloatArray | None = None
) -> Spread:
    """Of an (X,) combination of unknowns: its variance by source, the discrepancy marginalised, and
    what else may be.

    Where other pairings of the modes are not ruled out, what they add is a source of its own. The
    samples are those of one pairing, so the mixture over the pairings gives the interval then.
    """

    def of(mixture: Mixture) -> tuple[float, float, float]:
        return float(np.sqrt(along @ mixture.total @ along)), *mixture.reach(along)

    sd, below, above = of(elastic.conditional_posterior)
    noise_sd = float(np.linalg.norm(along @ elastic.sources[NOISE]))
    core = Spread(sd, noise_sd, below, above, elastic.variance_by_source(along))
    if elastic.has_uncertain_modes:
        core = core.widened(*of(elastic.mixture), IN_DOUBT)
    if elastic.model_averaged_posterior is not elastic.mixture:
        core = core.widened(
            *of(elastic.model_averaged_posterior),
            CHANGED_WHERE if elastic.damage_intervals else OTHER_PARTNERS,
        )
    elif samples is not None:
        core = core.sampled(samples)
    return core.with_systematic_effects(
        elastic.all_systematic_effects, along @ elastic.bias_sensitivity
    )


def constant_estimates(
    elastic: ElasticResult, inputs: Inputs | None, sampled: Posterior | None = None
) -> list[ParameterEstimate]:
    """Constants that were asked for, free and tied; a tied one follows its master, and its interval
    has the doubt of the tie.

    Args:
        elastic: stage 1, of one campaign or of several.
        inputs: what the laboratory of one campaign says of its inputs; None of several.
        sampled: samples of the posterior of one campaign.
    """
    layout, prior = elastic.layout, elastic.layout.prior
    theta, (held, held_sd) = layout.material(elastic.x), _with_inputs_held(elastic)
    provenance = {} if inputs is None else _provenance(elastic, inputs)
    estimates, coefficients = {}, []
    for column, master in enumerate(layout.shared):
        spread = coordinate_spread(
            elastic, column, None if sampled is None else sampled.xi[:, column]
        )
        state, log = elastic.identifiability[column], bool(prior.logarithmic[column])
        others = tuple(
            n
            for n in state.confounded_with
            if n != master and (inputs is not None or n in layout.shared)
        )
        if constant_of(master) is not None:
            unit, mean = prior.unit_of(master), float(prior.prior_mean[column])
            coefficients.append(
                replace(
                    spread.estimate(master, unit, float(theta[column]), provenance=provenance),
                    initial=mean,
                    prior_mean=mean,
                    prior_sd=float(prior.prior_sd[column]),
                    identifiable=state.identifiable,
                    comparable=Comparable(float(held[column]), float(held_sd[column])),
                    confounded_with=others,
                )
            )
        for row in np.flatnonzero(prior.spread[:, column]):
            ratio, name = float(prior.spread[row, column]), prior.constant_names[row]
            value, mean = ratio * float(theta[column]), ratio * float(prior.prior_mean[column])
            tie = prior.ties.get(name, 0.0)
            doubt = float(np.sqrt(np.log1p(tie**2))) if log else tie * abs(float(theta[column]))
            words = {**provenance, f"tie to {master}": f"{tie:.2g} of the ratio"}
            own = spread.tied(master, doubt)
            estimates[row] = replace(
                own.estimate(
                    name,
                    prior.units[row],
                    value,
                    slope=value if log else ratio,
                    log=log,
                    provenance=words,
                ),
                initial=mean,
                # What is known of a constant that may be off its tie by more than the data leave
                # open is the tie.
                identifiable=bool(state.identifiable and doubt < own.sd / np.sqrt(2)),
                prior_mean=mean,
                prior_sd=float(np.hypot(ratio * prior.prior_sd[column], tie * mean)),
                comparable=Comparable(
                    ratio * float(held[column]), abs(ratio) * float(held_sd[column])
                ),
                confounded_with=others,
                tied_to=None if name == master else master,
            )
    return [*(estimates[row] for row in sorted(estimates)), *coefficients]


def own_estimates(elastic: ElasticResult, number: int) -> list[ParameterEstimate]:
    """The unknowns that are one campaign's and its specimen's own; scatter is a ratio to the
    material's constant.
    """
    layout, campaign = elastic.layout, elastic.layout.campaigns[number]
    prior, theta, sds = campaign.prior, campaign.theta(elastic.x), layout.sd(elastic.scatter)
    estimates = []
    for place in np.flatnonzero(campaign.pick.any(axis=0)).tolist():
        if place < len(layout.shared):
            continue
        unknown, spread = layout.unknowns[place], coordinate_spread(elastic, place)
        unit = "1"
        value = float(np.exp(elastic.x[place]))
        mean = 1.0
        sd = float(sds[place])
        log = True
        if not unknown.is_scatter:
            row = prior.names.index(unknown.name)
            unit = prior.unit_of(unknown.name)
            value = float(theta[row])
            mean = float(prior.prior_mean[row])
            sd = float(prior.prior_sd[row])
            log = bool(prior.logarithmic[row])
        base = spread.estimate(unknown.name, unit, value, slope=value if log else 1.0, log=log)
        informed = 1 - (spread.sd / float(sds[place])) ** 2
        estimates.append(
            replace(
                base, initial=mean, identifiable=bool(informed > 0.5), prior_mean=mean, prior_sd=sd
            )
        )
    return estimates


def coefficient_estimates(
    elastic: ElasticResult, damping: DampingResult, inputs: Inputs
) -> list[ParameterEstimate]:
    """Coefficients of the fitted damping law.

    Their posterior is a mixture in closed form, with tails that make the standard deviation of its
    samples a poor one.
    """
    fit, provenance, estimates = damping.fit, _provenance(elastic, inputs, damping), []
    for i, (name, unit) in enumerate(
        zip(fit.law.coefficient_names, fit.law.coefficient_units, strict=True)
    ):
        variance = {source: float(part[i] @ part[i]) for source, part in damping.sources.items()}
        total, noise_sd = sum(variance.values()), float(np.sqrt(fit.noise_covariance[i, i]))
        reach = damping.deviations.reach(total - variance[OF_LAW], variance[OF_LAW])
        spread = Spread(float(np.sqrt(total)), noise_sd, reach, reach, variance)
        spread = spread.with_systematic_effects(
            damping.systematic_effects, damping.bias_sensitivity[i]
        )
        base = spread.estimate(name, unit, float(fit.coefficients[i]), provenance=provenance)
        estimates.append(replace(base, initial=float(damping.start[i])))
    return estimates


def ratio_estimates(ranked: RankedLaw) -> list[ParameterEstimate]:
    """Coefficients of a law from the modes' damping ratios alone: the laboratory typed them in and
    sent no FRFs.
    """
    rows = zip(
        ranked.law.coefficient_names,
        ranked.law.coefficient_units,
        map(float, ranked.coefficients),
        *(np.sqrt(np.diag(each)) for each in (ranked.covariance, ranked.noise_covariance)),
        strict=True,
    )
    return [
        Spread(float(sd), float(noise), Z_95 * float(sd), Z_95 * float(sd), {}).estimate(
            name, unit, value
        )
        for name, unit, value, sd, noise in rows
    ]


def at_reference(
    each: ParameterEstimate, warmth: Warmth | None, priors: Mapping[str, tuple[float, float]]
) -> ParameterEstimate:
    """A damping coefficient at the reference, by the prior of its coefficient of temperature.

    Args:
        each: at the temperature of the measurement.
        warmth: how much warmer than the reference that is; None where they are one.
        priors: stated ones of the coefficients of temperature.
    """
    if warmth is None or warmth.temperature is None:
        return each
    name, above = each.name + PER_K, warmth.temperature - warmth.reference
    mean, sd = priors.get(name, DAMPING_PER_K)
    ratio = 1 / (1 + mean * above)
    added = abs(each.estimate * ratio**2 * above) * sd
    reach = [
        float(np.hypot(ratio * (limit - each.estimate), Z_95 * added)) for limit in each.interval_95
    ]
    value, total = ratio * each.estimate, float(np.hypot(ratio * each.standard_deviation, added))
    share = (ratio * each.standard_deviation / total) ** 2
    budget = [
        replace(row, standard_deviation=ratio * row.standard_deviation, share=share * row.share)
        for row in each.budget
    ]
    budget.append(BudgetEntry(name, added, 1 - share, f"{sd:.3g} 1/K"))
    return replace(
        each,
        estimate=value,
        standard_deviation=total,
        noise_standard_deviation=ratio * each.noise_standard_deviation,
        interval_95=(value - reach[0], value + reach[1]),
        initial=None if each.initial is None else ratio * each.initial,
        identifiable=bool(total < abs(value) / 2),
        comparable=Comparable(
            ratio * each.comparable.estimate, ratio * each.comparable.standard_deviation
        ),
        budget=tuple(sorted(budget, key=lambda row: -row.share)),
    )


def disagreements(elastic: ElasticResult, sampled: Posterior | None) -> list[Finding]:
    """Where the samples and the Gaussian approximation of one posterior differ."""
    if sampled is None:
        return []
    ratio = np.std(sampled.xi, axis=0) / np.sqrt(np.diag(elastic.mixture.total))
    names = enumerate(elastic.layout.shared)
    return [
        finding("samples_differ", name=n, ratio=ratio[i])
        for i, n in names
        if abs(np.log(ratio[i])) > _DIFFERENT
    ]


def _with_inputs_held(elastic: ElasticResult) -> tuple[FloatArray, FloatArray]:
    """The shared parameters with every input at its stated value, (q,) θ, and (q,) standard
    deviations by noise, SI.
    """
    layout, count = elastic.layout, len(elastic.layout.shared)
    turn = np.eye(count, elastic.x.size)
    if len(layout.campaigns) == 1:  # several have found out what their inputs are
        _, _, hessian = elastic.problem.at(elastic.discrepancy, elastic.scatter)
        turn[:, count:] = np.linalg.solve(hessian[:count, :count], hessian[:count, count:])
    theta, noise = layout.material(turn @ elastic.x), turn @ elastic.sources[NOISE]
    slope = np.where(layout.prior.logarithmic[:count], theta, 1.0)
    return theta, slope * np.sqrt(np.sum(noise**2, axis=1))


def _provenance(
    elastic: ElasticResult, inputs: Inputs, damping: DampingResult | None = None
) -> dict[str, str]:
    """Where the standard deviation of each source comes from, in words."""
    prior = elastic.prior
    words = {
        NOISE: "covariance of the measured modes",
        DISCREPANCY_OF_MODEL: (
            f"{100 * elastic.discrepancy:.2g} % of a frequency, from the residuals and its prior"
        ),
    }
    if error := elastic.prior.body.model_error:
        words[MODEL_OF_JOINTS] = (
            f"{100 * error:.2g} % of a frequency, independent from mode to mode, fixed beforehand"
        )
    if elastic.admissible_rivals:
        others = (
            "1 other solution"
            if len(elastic.admissible_rivals) == 1
            else f"{len(elastic.admissible_rivals)} other solutions"
        )
        words[OTHER_PARTNERS] = f"{others} that the frequencies do not rule out"
    if elastic.has_uncertain_modes:
        words[IN_DOUBT] = "the probability of each measured mode, and how it fits the model"
    for column, name in enumerate(prior.names):
        sd = f"{prior.prior_sd[column]:.3g} {prior.unit_of(name)}".removesuffix(" 1")
        if name in prior.reported:
            words[f"prior of {name}"] = sd
        elif constant_of(name) is not None:
            own = any(each.name == name for each in prior.per_kelvin)
            words[name] = f"{sd}, {'stated' if own else 'usual of such materials'}"
        else:
            words[name] = f"{sd}, {_stated(inputs.is_stated(tolerance_of(name) or name))}"
    for each in elastic.all_systematic_effects:
        of_model = each.name == MESH
        words[each.name] = each.amount if of_model else f"{each.amount}, {_stated(each.stated)}"
    if damping is not None:
        words["measurement noise of FRFs"] = "noise of the FRFs, measured or from their residual"
        words[OF_LAW] = (
            f"{100 * damping.discrepancy:.2g} % of a damping ratio, from the modes and its prior"
        )
        words[AGAINST_MODES] = (
            "law from the FRFs against that of the identified modes: errors of the model's shapes,"
            " delay"
        )
        words["modes not measured"] = "tails of modes that nobody measured"
        words[WINDOW] = (
            "stated, or seen in the noise of hits"
            if inputs.window_known
            else f"no window was stated, {_ASSUMED}"
        )
    return words


def _stated(stated: bool) -> str:
    return "stated" if stated else _ASSUMED
