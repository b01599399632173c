"""Updating several campaigns of one material together: the entry point, and what it returns."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.oriented import OrientedSpecimen
from fecore.errors import InputError
from fecore.updating.campaigns.contradictions import CONTRADICTS, Agreement, agreements, odd_one_out
from fecore.updating.campaigns.damping import CommonLaw, common_damping
from fecore.updating.campaigns.fit import Coupon, Fitted, fit_campaigns
from fecore.updating.campaigns.layout import (
    MATERIAL_PARAMETERS,
    Campaign,
    Layout,
    clamped,
    is_scatter,
    lay_out,
)
from fecore.updating.campaigns.posterior import SCATTER
from fecore.updating.campaigns.spread import Spread, spreads
from fecore.updating.discretisation import discretise
from fecore.updating.edges import points_beyond
from fecore.updating.elastic_findings import FAR, USUAL_MISS
from fecore.updating.parameters import Parameter
from fecore.updating.posterior import identifiability
from fecore.updating.result import BudgetEntry, Comparable, ParameterEstimate, Verdict
from fecore.updating.verdict import Finding, judge, notes, warnings


@dataclass(frozen=True)
class CampaignsRecipe:
    """How several campaigns are updated together.

    Attributes:
        parameters: the material's, with their priors.
        scatter: scale of the moduli's relative deviations between specimens; 0: all specimens are of exactly one material.
    """

    parameters: tuple[Parameter, ...] = MATERIAL_PARAMETERS
    scatter: float = SCATTER


@dataclass(frozen=True)
class CampaignMode:
    """One measured mode of a campaign beside the model's; None where it has no partner."""

    number: int
    kind: str | None
    measured_hz: float
    initial_hz: float | None
    updated_hz: float | None
    error_percent: float | None
    mac: float | None


@dataclass(frozen=True)
class CampaignPart:
    """What one campaign has to do with the result.

    Attributes:
        name, specimen: as they came in.
        modes: measured beside updated.
        own: its own nuisances and its specimen's: length, clamp_compliance, width, thickness, density, fibre_angle, and the
            specimen's scatter as ratios to the material.
        alone: the material's constants by this campaign alone: estimate, standard deviation, and z of the difference from all
            together, by name.
        predictive_p: of its frequencies, given the other campaigns; None of a single campaign.
        contradicts: whether that is too small to be chance.
    """

    name: str
    specimen: str
    modes: tuple[CampaignMode, ...]
    own: tuple[ParameterEstimate, ...]
    alone: Mapping[str, Mapping[str, float]]
    predictive_p: float | None
    contradicts: bool


@dataclass(frozen=True)
class CampaignsResult:
    """One material from several campaigns.

    Attributes:
        verdict: whether it may be used.
        parameters: the material's constants, in its own axes.
        correlation: (q, q) of the free ones' posterior, in their coordinates; names of them in `free`.
        free: names of the free parameters.
        campaigns: each one's part.
        odd_one_out: name of the campaign without which the others agree best, where some contradict; None else.
        discrepancy: relative model error of a frequency.
        scatter: relative deviation of a modulus between specimens, root of its posterior mean; None where it is not modelled.
        warnings: what a user must know.
        damping: laws with one set of coefficients for all campaigns, ranked; none where no mode has a damping ratio.
    """

    verdict: Verdict
    parameters: tuple[ParameterEstimate, ...]
    correlation: FloatArray
    free: tuple[str, ...]
    campaigns: tuple[CampaignPart, ...]
    odd_one_out: str | None
    discrepancy: float
    scatter: float | None
    warnings: tuple[str, ...]
    damping: tuple[CommonLaw, ...] = ()


def update_campaigns(
    campaigns: Sequence[Campaign],
    recipe: CampaignsRecipe | None = None,
    coupons: Sequence[Coupon] = (),
    progress: Callable[[str, float], None] = lambda *_: None,
) -> CampaignsResult:
    """One posterior of a material from several campaigns of its specimens.

    Args:
        campaigns: tests of specimens of the material, with their modes.
        recipe: the material's parameters and whether specimens scatter.
        coupons: what static tests say of its constants.
        progress: called with the stage and the share of the whole that is done; raise from it to cancel.

    Raises:
        InputError: campaigns, parameters or coupons contradict themselves.
        UpdatingError: a campaign has nothing in common with its model, or the estimate does not come to rest.
    """
    recipe = recipe or CampaignsRecipe()
    if not (np.isfinite(recipe.scatter) and 0 <= recipe.scatter <= 1):
        raise InputError("scatter", f"is {recipe.scatter}, expected a share from 0 to 1")
    progress("laying out the campaigns", 0.0)
    meshed = [replace(campaign, body=_meshed(campaign)) for campaign in campaigns]
    scatter = recipe.scatter if len({campaign.specimen for campaign in meshed}) > 1 else 0.0
    layout = lay_out(meshed, recipe.parameters, scatter=scatter > 0)
    fitted = fit_campaigns(layout, coupons, scatter, lambda share: progress("updating the material", 0.1 + 0.6 * share))
    progress("comparing the campaigns", 0.7)
    found = agreements(fitted, scatter)
    odd = odd_one_out(fitted, found, scatter)
    progress("making intervals", 0.9)
    known = spreads(fitted)
    parameters = _material(fitted, known)
    parts = tuple(_part(fitted, known, number, found[number]) for number in range(len(meshed)))
    findings = [*_contradictions(parts, odd), *_findings(fitted, parts), *notes(_points_beyond(layout), "with_care", 9)]
    q = len(layout.shared)
    total = fitted.mixture.total[:q, :q]
    sd = np.sqrt(np.diag(total))
    progress("done", 1.0)
    return CampaignsResult(
        verdict=judge(findings, parameters),
        parameters=parameters,
        correlation=total / np.outer(sd, sd),
        free=layout.shared,
        campaigns=parts,
        odd_one_out=None if odd is None else parts[odd].name,
        discrepancy=fitted.spread,
        scatter=fitted.scatter if scatter else None,
        warnings=warnings(findings),
        damping=common_damping(fitted),
    )


def _meshed(campaign: Campaign) -> OrientedSpecimen:
    """The body with a mesh for its modes and a clamp that may yield, where nothing else was asked for."""
    body = clamped(campaign.body, campaign.inputs) if not campaign.body.clamp_compliance else campaign.body
    if body.divisions is not None:
        return body
    found = discretise(replace(campaign.body, clamp_compliance=0.0), 1.05 * float(campaign.modes.frequency_hz[-1]))
    return replace(body, divisions=found.divisions)


def _material(fitted: Fitted, known: Sequence[Spread]) -> tuple[ParameterEstimate, ...]:
    """The material's constants, free and tied; a tied one follows its master in everything."""
    layout = fitted.layout
    prior, coordinates = layout.forwards[0].parametrisation, layout.coordinates[0]
    q = len(layout.shared)
    _, inverse, _ = fitted.problem.solve(fitted.spread, fitted.scatter)
    states = identifiability(layout.labels, inverse, layout.sd(fitted.scatter))
    theta = layout.material(fitted.x)
    found = []
    for column, master in enumerate(layout.shared):
        spread, log = known[column], bool(coordinates.logarithmic[column])
        for row in np.flatnonzero(prior.spread[:, column]):
            ratio = float(prior.spread[row, column])
            name = prior.constant_names[row]
            mean = ratio * float(prior.prior_mean[column])
            base = _estimate(name, prior.units[row], ratio * float(theta[column]), mean, log=log, spread=spread)
            state = states[column]
            others = tuple(name for name in state.confounded_with if name in layout.shared[:q] and name != master)
            found.append(
                replace(
                    base,
                    identifiable=state.identifiable,
                    confounded_with=others,
                    tied_to=None if name == master else master,
                    prior_mean=mean,
                    prior_sd=abs(ratio) * float(prior.prior_sd[column]),
                )
            )
    order = {name: place for place, name in enumerate(prior.constant_names)}
    return tuple(sorted(found, key=lambda each: order[each.name]))


def _estimate(name: str, unit: str, value: float, initial: float, *, log: bool, spread: Spread) -> ParameterEstimate:
    """An estimate from the spread of its coordinate: its logarithm, or itself."""
    slope = value if log else 1.0
    low, high = (value * np.exp(-spread.below), value * np.exp(spread.above)) if log else (
        value - spread.below, value + spread.above
    )  # fmt: skip
    return ParameterEstimate(
        name=name,
        unit=unit,
        initial=initial,
        estimate=value,
        standard_deviation=abs(slope) * spread.sd,
        noise_standard_deviation=abs(slope) * spread.noise_sd,
        interval_95=(float(low), float(high)),
        identifiable=True,
        prior_mean=initial,
        prior_sd=None,
        comparable=Comparable(value, abs(slope) * spread.noise_sd),
        budget=tuple(
            BudgetEntry(source, abs(slope) * float(np.sqrt(part)), part / spread.sd**2, "")
            for source, part in spread.largest()
        ),
    )


def _part(fitted: Fitted, known: Sequence[Spread], number: int, agreement: Agreement) -> CampaignPart:
    layout = fitted.layout
    campaign, q = layout.campaigns[number], len(layout.shared)
    coordinates = layout.coordinates[0]
    alone = {}
    for place, name in enumerate(layout.shared):
        xi = coordinates.mean.copy()
        xi[place] += agreement.alone[place]
        value = float(coordinates.values(xi)[place])
        slope = value if coordinates.logarithmic[place] else 1.0
        alone[name] = {
            "estimate": value,
            "standard_deviation": abs(slope) * float(agreement.alone_sd[place]),
            "z": float(agreement.z[place]),
        }
    p, count = agreement.predictive_p, len(layout.campaigns)
    return CampaignPart(
        name=campaign.name,
        specimen=campaign.specimen,
        modes=_modes(fitted, number),
        own=tuple(
            _own(fitted, known[place], number, place)
            for place in range(q, len(layout.unknowns))
            if layout.picks[number][:, place].any()
        ),
        alone=alone,
        predictive_p=p,
        contradicts=p is not None and p < CONTRADICTS / count,
    )


def _own(fitted: Fitted, spread: Spread, number: int, place: int) -> ParameterEstimate:
    """One of a campaign's own unknowns; scatter is a ratio to the material's constant."""
    layout = fitted.layout
    unknown, coordinates = layout.unknowns[place], layout.coordinates[number]
    prior = layout.forwards[number].parametrisation
    sd = float(layout.sd(fitted.scatter)[place])
    if is_scatter(unknown):
        ratio = float(np.exp(fitted.x[place]))
        base = _estimate(unknown.name, "1", ratio, 1.0, log=True, spread=spread)
        return replace(base, identifiable=_tells(spread, sd), prior_sd=sd)
    row = int(np.flatnonzero(layout.picks[number][:, place])[0])
    theta = layout.theta(number, fitted.x)
    constant = prior.constant_names.index(unknown.name)
    mean, log = float(prior.prior_mean[row]), bool(coordinates.logarithmic[row])
    base = _estimate(unknown.name, prior.units[constant], float(theta[row]), mean, log=log, spread=spread)
    return replace(base, identifiable=_tells(spread, sd), prior_sd=float(prior.prior_sd[row]))


def _tells(spread: Spread, prior_sd: float) -> bool:
    """Whether the data supply more than half of what is known."""
    return 1 - (spread.sd / prior_sd) ** 2 > 0.5


def _modes(fitted: Fitted, number: int) -> tuple[CampaignMode, ...]:
    campaign, pairing = fitted.layout.campaigns[number], fitted.pairings[number]
    initial, updated = fitted.initial[number], fitted.states[number]
    first, last = dict(fitted.initial_pairings[number].pairs), dict(pairing.pairs)
    found = []
    for row, measured in enumerate(map(float, campaign.modes.frequency_hz)):
        before, after = first.get(row), last.get(row)
        hz = None if after is None else float(updated.frequency_hz[after])
        found.append(
            CampaignMode(
                number=row + 1,
                kind=None if after is None else updated.kinds[after],
                measured_hz=measured,
                initial_hz=None if before is None else float(initial.frequency_hz[before]),
                updated_hz=hz,
                error_percent=None if hz is None else 100 * (hz / measured - 1),
                mac=None if pairing.mac is None or after is None else float(pairing.mac[row, after]),
            )
        )
    return tuple(found)


def _contradictions(parts: Sequence[CampaignPart], odd: int | None) -> list[Finding]:
    """Campaigns whose frequencies the others do not foretell, in words; which one is odd where that can be said."""
    wrong = [part for part in parts if part.contradicts]
    if not wrong:
        return []
    cause = "another material, angle, thickness or boundary than stated, or specimens that scatter more"
    if odd is None:
        which = " and ".join(f"{part.name} (p = {part.predictive_p:.2g})" for part in wrong)
        text = f"the campaigns contradict each other: {which}; {cause}; a third campaign would show which one is odd"
        return [Finding(text, "do_not_use", 70)]
    part = parts[odd]
    worst = sorted(part.alone.items(), key=lambda item: -abs(item[1]["z"]))[:2]
    moved = ", ".join(f"{name} {values['z']:+.1f} standard deviations" for name, values in worst)
    text = (
        f"campaign {part.name} is the odd one out: given the others its frequencies have p = {part.predictive_p:.2g} "
        f"({moved} from all together): {cause}; correct it or leave it out"
    )
    return [Finding(text, "do_not_use", 70)]


def _points_beyond(layout: Layout) -> list[str]:
    each = zip(layout.campaigns, layout.forwards, strict=True)
    return [
        f"campaign {campaign.name}: {text}"
        for campaign, forward in each
        for text in points_beyond(forward, campaign.inputs)
    ]


def _findings(fitted: Fitted, parts: Sequence[CampaignPart]) -> list[Finding]:
    layout, found = fitted.layout, []
    for part, at, pairing in zip(parts, fitted.rows, fitted.pairings, strict=True):
        alone = len(pairing.unpaired_measured)
        if alone:
            found += notes(
                [f"campaign {part.name}: {alone} of {len(part.modes)} measured modes have no partner in the model"],
                "do_not_use" if 2 * alone > len(part.modes) else "with_care",
                30,
            )
        miss = float(np.sqrt(np.mean(fitted.problem.residual[at] ** 2)))
        if miss > USUAL_MISS:
            found += notes(
                [
                    f"campaign {part.name}: the material of all campaigns misses its frequencies by {100 * miss:.1f} % (rms)"
                ],
                "with_care",
                40,
            )
    away = fitted.x / layout.sd(max(fitted.scatter, 1e-12))
    texts = [
        f"{layout.labels[place]} ended {abs(away[place]):.1f} prior standard deviations from its prior mean: the prior is "
        "wrong, or it has taken up something else"
        for place in np.flatnonzero(np.abs(away) > FAR)
    ]
    return [*found, *notes(texts, "with_care", 20)]
