"""Stage 1 from several starts, where one may end with modes paired wrongly.

Where a prior is far off, modes that lie close together in the model stand in another order than in
the body, and an update that pairs them in the wrong order ends in a point of its own. So where the
first result looks doubtful, and always where there are no shapes to say so, draws from the prior
are paired with the measured modes, and the update starts again from the best draw of each different
pairing. The best of the points with other partners stands in the result as its rival.

Without shapes a pairing need not be where the alignment comes to rest: a mode that nobody measured
may be tuned onto a measured one beside its true partner. So the fit is also made with partners
held: those at the prior means, and those of good results with a mode's other candidate in place of
its partner. With shapes and without, two close modes may exchange their partners for ever: then the
fit is made with each of the pairings that it went to and fro between held. Every pairing whose
evidence is near the best one's then takes part in the intervals
(`ElasticResult.model_averaged_posterior`).

Other constants may meet the same frequencies with the same partners (`other_optima`): the fit starts
again where the shapes lead to or, where there are none, from constants exchanged.

Where no modes can be identified, the FRFs say where to start (`starts_by_frfs`): their misfit has
one narrow valley for each way in which model and measured resonances can be matched, and the
logarithms of their magnitudes on few lines, where valleys are wide, rank draws from the prior.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Protocol

import numpy as np

from fecore.arrays import ComplexArray, FloatArray
from fecore.dynamics.damping_laws import DampingLaw
from fecore.frf import FrfSet
from fecore.quantities import kind_of
from fecore.updating.elastic import Unsettled, fit_elastic, settled
from fecore.updating.elastic_result import REFUTED, ElasticResult, Rival, prior_inclusion
from fecore.updating.forward import (
    UNPAIRED,
    ForwardModel,
    Partners,
    detection_cost,
    exchanged,
    pair_with,
    partners_of,
    probability_seen,
    unpaired_cost,
)
from fecore.updating.laws import nearest_positive
from fecore.updating.layout import Layout
from fecore.updating.measurement import Recipe
from fecore.updating.other_optima import are_one, by_shapes_too, with_constants_exchanged
from fecore.updating.posterior import DISCREPANCY, DISCREPANCY_DOF, spurious_mode_penalty
from fecore.updating.result import StartHistory

_DOUBTFUL = 5.0  # misfit over the discrepancy's prior from which a result is doubted
_FAR = 1.5  # and prior standard deviations that a parameter has moved
_DRAWS, _REACH = 64, 2.0  # from the prior, within so many of its standard deviations
# pairings from which the fit starts anew; results that are fitted anew on a verified basis
_STARTS, _VERIFIED = 6, 2
_FIXED = 6  # pairings that are held
# 1 - MAC of a shape that was measured well
_UNLIKE = 0.01
# relative error of a frequency by a mesh from which how it goes with the constants matters
_OF_MESH = 0.003

Outcome = ElasticResult | Unsettled


class _Run(Protocol):
    """A fit of a layout from a start, with the share of progress before and after, and partners
    that are held.
    """

    def __call__(
        self,
        place: Layout,
        start: FloatArray | None,
        first: float,
        last: float,
        fixed_pairing: tuple[Partners, ...] | None = None,
    ) -> Outcome: ...


def update_from_several_starts(
    layout: Layout,
    progress: Callable[[float], None] = lambda _: None,
    *,
    use_shapes: bool = False,
    seed: int = 0,
) -> ElasticResult:
    """Stage 1 from the prior means and, where that is doubtful, from draws that pair the modes
    otherwise.

    1. `fit_elastic` from the prior means.
    2. Where its result is doubtful, and always without shapes: from the best draw of each different
       pairing, on the reduced basis as it is.
    3. From where the partners may be exchanged for ones as likely, with these held; and from where
       constants may be exchanged.
    4. The best two with different partners are fitted anew, with the basis verified.
    5. The result is the best supported of those that are verified, with the others as its rivals.
       Where no start has a mode that is like a measured one, the likest are paired, so that a
       result can show how unlike they are.

    Raises:
        UpdatingError: no start converged.
    """

    def run(
        place: Layout,
        start: FloatArray | None,
        first: float,
        last: float,
        fixed_pairing: tuple[Partners, ...] | None = None,
    ) -> Outcome:
        return fit_elastic(
            place,
            lambda share: progress(first + (last - first) * share),
            use_shapes=use_shapes,
            start=start,
            fixed_pairing=fixed_pairing,
        )

    # 1. The prior means.
    outcomes = [_first(layout, run)]
    doubtful = isinstance(outcomes[0], Unsettled) or is_doubtful(outcomes[0])
    search_layout, elsewhere = layout.with_unverified_basis(), list[FloatArray]()
    if layout.by_shapes and not use_shapes:
        elsewhere = by_shapes_too(outcomes[0], search_layout)
    if doubtful or elsewhere or not layout.by_shapes:
        # 2. Draws from the prior.
        starts = (
            _other_starts(search_layout, seed, _most_unpaired(outcomes[0]))
            if doubtful or not layout.by_shapes
            else []
        )
        steps = np.linspace(0.5, 0.8, len(starts) + 1)
        searched = [
            run(search_layout, start, *between)
            for start, between in zip(starts, pairwise(steps), strict=True)
        ]
        # 3. Partners held, and constants exchanged.
        to_fix = _to_fix([*outcomes, *searched], layout)
        searched += [run(search_layout, start, 0.8, 0.8, partners) for partners, start in to_fix]
        known = _ranked([*outcomes, *searched])
        if known and not layout.by_shapes:
            elsewhere = with_constants_exchanged(known[0], search_layout)
        ends = _ranked([run(search_layout, start, 0.8, 0.8) for start in elsewhere])
        searched += [end for end in ends if not any(are_one(end, other) for other in known)]
        # 4. The best on a verified basis.
        worth = _worth_verifying([*outcomes, *searched])
        outcomes += [each for each in searched if not any(each is chosen for chosen in worth)]
        outcomes += [
            _verified(each, layout, run, 0.8 + 0.1 * place) for place, each in enumerate(worth)
        ]
        if layout.is_large and not any(map(_is_verified, outcomes)):
            outcomes.append(run(layout, None, 0.9, 1.0))
    # 5. The best supported, and its rivals.
    verified = [each for each in outcomes if isinstance(each, ElasticResult) and _is_verified(each)]
    if not verified:
        return _best_match(layout, outcomes)
    progress(1.0)
    best = min(verified, key=evidence)
    oscillating = outcomes[0].oscillating_modes if isinstance(outcomes[0], Unsettled) else ()
    starts_tried = tuple(_as_start(each, layout, chosen=each is best) for each in outcomes)
    return replace(
        best, starts=starts_tried, rivals=_rivals(best, outcomes), oscillating_modes=oscillating
    )


def update_on_finest_mesh(
    layout: Layout, update: Callable[[Layout], ElasticResult]
) -> ElasticResult:
    """An update with what each body's own mesh misses as it is at the estimate, where it is enough
    to go with the constants.
    """
    elastic = update(layout)
    moved = [
        np.abs(state.by_mesh[0][[column for _, column in pairing.pairs]]).max(initial=0.0)
        for state, pairing in zip(elastic.states, elastic.pairings, strict=True)
        if state.by_mesh is not None
    ]
    if max(moved, default=0.0) < _OF_MESH:
        return elastic
    return update(layout.with_mesh_errors_at(elastic.x))


def _first(layout: Layout, run: _Run) -> Outcome:
    """The fit from the prior means; of a large body on the basis as it is, and verified where that
    ends.
    """
    if not layout.is_large:
        return run(layout, None, 0.0, 0.5)
    return _verified(run(layout.with_unverified_basis(), None, 0.0, 0.3), layout, run, 0.3)


def _verified(outcome: Outcome, layout: Layout, run: _Run, share: float) -> Outcome:
    """A fit on bases as they were, where these hold at its end; else it goes on from there on those
    that have grown.

    A path that is verified at each of its points costs a solution of the full model at most of
    them.
    """
    for _ in range(3):  # bases may grow where a fit ended, before each of its points is verified
        if isinstance(outcome, Unsettled):
            return outcome
        states = layout.solved(outcome.x)
        if all(was.basis is now.basis for was, now in zip(outcome.states, states, strict=True)):
            return replace(outcome, layout=layout, states=states)
        fresh = run(
            layout.with_unverified_basis(), outcome.x, share, share + 0.1, outcome.fixed_pairing
        )
        outcome = (
            fresh
            if isinstance(fresh, Unsettled)
            else replace(fresh, history=(*outcome.history, *fresh.history))
        )
    return (
        outcome
        if isinstance(outcome, Unsettled)
        else run(layout, outcome.x, share, share + 0.1, outcome.fixed_pairing)
    )


def _most_unpaired(outcome: Outcome) -> float:
    """How many modes may stay alone at a start that is fitted: fewer than in a result that only
    this makes doubtful.
    """
    if isinstance(outcome, Unsettled) or not outcome.layout.by_shapes or _is_far(outcome):
        return np.inf
    return sum(len(pairing.unpaired_measured) for pairing in outcome.pairings) - 1


def _best_match(layout: Layout, outcomes: Sequence[Outcome]) -> ElasticResult:
    """The likest modes in pairs, where no start found one that is like a measured one; else the
    first start's error.
    """
    ends = [each for each in outcomes if isinstance(each, Unsettled)]
    if layout.by_shapes and len(ends) == len(outcomes) and all(e.without_partners for e in ends):
        forced = fit_elastic(layout, force_best_match=True)
        return settled(ends[0] if isinstance(forced, Unsettled) else forced)
    raise ends[0].error


def _is_verified(outcome: Outcome) -> bool:
    return isinstance(outcome, ElasticResult) and all(
        campaign.forward.verified for campaign in outcome.layout.campaigns
    )


def _ranked(outcomes: Sequence[Outcome]) -> list[ElasticResult]:
    """Those that are results, the best supported first."""
    return sorted((each for each in outcomes if isinstance(each, ElasticResult)), key=evidence)


def _to_fix(
    outcomes: Sequence[Outcome], layout: Layout
) -> list[tuple[tuple[Partners, ...], FloatArray]]:
    """Pairings that no fit came to rest at but may be as likely, each with the x to start from.

    Where shapes distinguish the modes, these are the ones that a fit went to and fro between.
    """
    results = _ranked(outcomes)
    candidates = [pair for each in outcomes if isinstance(each, Unsettled) for pair in each.between]
    if not layout.by_shapes:
        origin: FloatArray = np.zeros(len(layout.unknowns))
        seen = zip(layout.campaigns, layout.solved(origin), strict=True)
        own = tuple(
            partners_of(pair_with(campaign.modes, state), state.kinds) for campaign, state in seen
        )
        candidates.insert(0, (own, origin))
        least = evidence(results[0])[1] if results else np.inf
        for result in results:
            if evidence(result)[1] <= least + REFUTED:
                candidates += [(partners, result.x) for partners in _exchanged(result)]
    known = {result.partners for result in results}
    fresh = {
        partners: start
        for partners, start in reversed(candidates)
        if all(partners) and partners not in known
    }
    return list(reversed(fresh.items()))[:_FIXED]


def _exchanged(result: ElasticResult) -> list[tuple[Partners, ...]]:
    """The partners of a result, with one mode's other candidate in place of its own."""
    partners, own = [], result.partners
    for number, (pairing, state) in enumerate(zip(result.pairings, result.states, strict=True)):
        partners += [
            (*own[:number], other, *own[number + 1 :]) for other in exchanged(pairing, state.kinds)
        ]
    return partners


def _worth_verifying(outcomes: Sequence[Outcome]) -> list[ElasticResult]:
    """Those that are better than every verified result, or the best two where there is none; one of
    each pairing.
    """
    best: dict[tuple[Partners, ...], ElasticResult] = {}
    for result in _ranked(outcomes):
        if _is_verified(result):
            break
        best.setdefault(result.partners, result)
    return list(best.values())[:_VERIFIED]


def _as_start(outcome: Outcome, layout: Layout, *, chosen: bool) -> StartHistory:
    steps = outcome.history if isinstance(outcome, ElasticResult) else ()
    names = layout.parameters(np.zeros(len(layout.unknowns)))
    parameters = {name: np.array([step.parameters[name] for step in steps]) for name in names}
    if isinstance(outcome, ElasticResult):
        return StartHistory(chosen, None, tuple(step.cost for step in outcome.history), parameters)
    return StartHistory(chosen, outcome.message, outcome.history, parameters)


def _rivals(best: ElasticResult, outcomes: Sequence[Outcome]) -> tuple[Rival, ...]:
    """The best point of each pairing, and other constants with the same, but for the chosen one;
    the likest first.
    """
    others: list[ElasticResult] = []
    for each in _ranked(outcomes):
        if not any(are_one(each, known) for known in (best, *others)):
            others.append(each)
    chosen = evidence(best)
    return tuple(Rival(each, _behind(evidence(each), chosen)) for each in others)


def _behind(rival: tuple[int, float], chosen: tuple[int, float]) -> float:
    """Log evidence by which a pairing is behind the chosen one."""
    return float(rival[1] - chosen[1] + UNPAIRED * (rival[0] - chosen[0]))


def is_doubtful(result: ElasticResult) -> bool:
    """Whether another start may do better: modes without a partner, a large misfit, or a parameter
    far from its prior.
    """
    unpaired = any(pairing.unpaired_measured for pairing in result.pairings)
    return unpaired or _is_far(result)


def _is_far(result: ElasticResult) -> bool:
    """Whether a result misses the frequencies, or lies far from the prior."""
    return bool(
        result.misfit > _DOUBTFUL * DISCREPANCY
        or np.abs(result.prior_z_score).max(initial=0.0) > _FAR
    )


def evidence(result: ElasticResult) -> tuple[int, float]:
    """What less is better of: modes without a partner; then the misfit of residuals and prior, the
    discrepancy marginalised.

    Shapes that were not fitted have their part: of what they lack of a MAC of 1 the scale is
    marginalised too, so that they decide where frequencies do not. Where there are none, modes of
    the model that were not seen count too, and how much a
    pairing narrows the prior: one that meets the frequencies only where a constant is tuned to a
    per cent has a smaller part of the prior for it (MacKay, Neural Comput. 4, 1992; the Occam
    factor ½ ln |C_p| - ½ ln |H⁻¹|).
    """
    problem, z_scores = result.problem, result.prior_z_score
    squares = DISCREPANCY_DOF + float(problem.weights @ problem.residual**2) / DISCREPANCY**2
    misfit = (DISCREPANCY_DOF + float(problem.weights.sum())) / 2 * np.log(squares) + float(
        z_scores @ z_scores
    ) / 2
    misfit += spurious_mode_penalty(
        problem.weights, *prior_inclusion(result.layout, result.pairings), DISCREPANCY
    )
    if result.layout.by_shapes:
        each = zip(result.layout.campaigns, result.pairings, strict=True)
        unpaired = sum(float(c.probability(p.unpaired_measured).sum()) for c, p in each)
        squares = DISCREPANCY_DOF + float(problem.weights @ _lacking(result)) / _UNLIKE
        misfit += (DISCREPANCY_DOF + float(problem.weights.sum())) / 2 * np.log(squares)
        return round(unpaired), misfit
    narrowed = (
        -(
            np.linalg.slogdet(result.layout.precision(result.scatter))[1]
            + np.linalg.slogdet(result.inverse)[1]
        )
        / 2
    )
    parts = zip(result.layout.campaigns, result.pairings, result.states, strict=True)
    undetected = sum(
        detection_cost(
            p, probability_seen(c.modes, state), state.frequency_hz, unpaired_cost(c.modes)
        )
        for c, p, state in parts
    )
    return 0, float(misfit + narrowed + undetected)


def _lacking(result: ElasticResult) -> FloatArray:
    """(n,) what the paired shapes lack of a MAC of 1."""
    each = [[p.mac[i, j] for i, j in p.pairs] for p in result.pairings if p.mac is not None]
    return np.asarray(1 - np.concatenate(each))


def _other_starts(layout: Layout, seed: int, most_unpaired: float = np.inf) -> list[FloatArray]:
    """Draws from the prior of the shared parameters that pair the modes differently, the best of
    each pairing first.

    Those that leave more than so many modes alone are left out.
    """
    free, sd = len(layout.shared), layout.sd(layout.scatter)
    best: dict[tuple[object, ...], tuple[tuple[int, float], FloatArray]] = {}
    for draw in even_draws(free, _DRAWS, seed):
        x: FloatArray = np.zeros(sd.size)
        x[:free] = _REACH * (2 * draw - 1) * sd[:free]
        if not layout.are_believable(x):
            continue
        states = layout.solved(x)
        key: list[object] = []
        pairings = [
            pair_with(campaign.modes, state)
            for campaign, state in zip(layout.campaigns, states, strict=True)
        ]
        unpaired, misses = sum(len(pairing.unpaired_measured) for pairing in pairings), []
        if unpaired > most_unpaired:
            continue
        for campaign, state, pairing in zip(layout.campaigns, states, pairings, strict=True):
            key.append(tuple((row, column, state.kinds[column]) for row, column in pairing.pairs))
            misses += [
                np.log(campaign.modes.frequency_hz[i] / state.frequency_hz[j])
                for i, j in pairing.pairs
            ]
        if not all(key):
            continue
        score = unpaired, float(np.mean(np.square(misses)))
        if tuple(key) not in best or score < best[tuple(key)][0]:
            best[tuple(key)] = score, x
    ranked = sorted(best.values(), key=lambda each: each[0])
    return [x for _, x in ranked[:_STARTS]]


_DRAWN_BY_FRFS = 512  # draws, within one standard deviation of the prior to either side
_COARSE_LINES = 150  # of an FRF that they are compared on
_RATIOS = (0.01, 0.03, 0.08)  # damping ratios that are tried with each


def starts_by_frfs(
    forward: ForwardModel,
    frfs: FrfSet,
    law: DampingLaw,
    seed: int,
    progress: Callable[[float], None],
) -> list[tuple[FloatArray, float]]:
    """The best three draws from the prior and damping ratios, none next to another, by the least
    mean difference of the logarithms of the FRFs' magnitudes.

    The draws use the reduced basis unverified, as they only rank starts.
    """
    prior = forward.parametrisation
    free = len(prior.reported)
    thetas = np.tile(prior.prior_mean, (_DRAWN_BY_FRFS, 1))
    draws = even_draws(free, _DRAWN_BY_FRFS, seed)
    thetas[:, :free] += (2 * draws - 1) * prior.prior_sd[:free]
    coarse = slice(None, None, max(1, frfs.frequency_hz.size // _COARSE_LINES))
    measured, known = _log_magnitude(frfs.values[:, coarse]), frfs.measured[:, coarse]
    search_model = forward.on_basis().with_unverified_basis()
    ranked: list[tuple[float, FloatArray, float]] = []
    for done, theta in enumerate(thetas):
        progress(done / len(thetas))
        if not prior.is_physical(theta):
            continue
        model = search_model.solve(theta).frf_model(
            frfs.responses, frfs.references, with_strain=bool(law.groups)
        )
        moving = model.omega > 0
        omega = model.omega[moving]
        strain = None if model.strain is None else model.strain[moving]
        # A law is linear in its coefficients, so these go with the ratio.
        of_unit = nearest_positive(law, omega, np.ones(omega.size), strain=strain)
        unit = law.basis(model.omega, model.strain) @ of_unit
        if not np.all(unit[moving] > 0):
            continue
        for ratio in _RATIOS:
            predicted = model.synthesise(frfs.frequency_hz[coarse], ratio * unit, frfs.quantity)
            off = measured - _log_magnitude(predicted)
            ranked.append((float(np.mean(np.abs(off[known]))), theta, ratio))
    ranked.sort(key=lambda row: row[0])
    kept: list[tuple[FloatArray, float]] = []
    for _, theta, ratio in ranked:
        if len(kept) < 3 and all(
            np.max(np.abs(theta - other) / prior.prior_sd) > 0.1 for other, _ in kept
        ):
            kept.append((theta, ratio))
    return kept


def _log_magnitude(values: ComplexArray) -> FloatArray:
    magnitude: FloatArray = np.log(np.maximum(np.abs(values), 1e-300))
    return magnitude


def even_draws(dimensions: int, count: int, seed: int) -> FloatArray:
    """Scrambled Sobol points of [0, 1)^d (Owen 1998), which cover it more evenly than random ones.

    Args:
        dimensions: d.
        count: of points; a power of two keeps their balance.
        seed: of the scrambling.

    Returns:
        (count, d).
    """
    from scipy.stats import qmc  # only here: the import takes 0.3 s

    points: FloatArray = qmc.Sobol(dimensions, seed=seed).random(count)
    return points


LEAST_FACTOR_SD = 0.003  # relative: a factor that is held more firmly is 1

# of γ, so that one round changes a standard deviation by no more than sevenfold its share
_KNOWN_AT_LEAST = 0.02
_SAME = 0.1  # relative change of every standard deviation that changes nothing


def with_sparse_factors(first: ElasticResult, recipe: Recipe) -> ElasticResult:
    """The elastic update of one campaign with sparse factors of sets; as it is where none is
    updated.

    Args:
        first: the update with the recipe's priors.
        recipe: of the update.
    """
    prior = first.prior
    factors = [c for c, name in enumerate(prior.names) if kind_of(name) == "factor"]
    if not factors or prior.body.in_space is None:
        return first
    largest, result = prior.prior_sd[factors], first
    for _ in range(8):  # turns of the priors of factors, at most
        now = result.prior.xi_sd[factors]
        known = np.clip(1 - _variance(result, factors) / now**2, _KNOWN_AT_LEAST, 1.0)
        updated = np.clip(np.sqrt(result.x[factors] ** 2 / known), LEAST_FACTOR_SD, largest)
        if np.all(np.abs(np.log(updated / now)) < _SAME):
            break
        sds = prior.prior_sd.copy()
        sds[factors] = updated
        layout = first.layout.with_prior(replace(prior, prior_sd=sds))
        fitted = fit_elastic(
            layout, use_shapes=recipe.use_shapes, start=result.x, fixed_pairing=result.fixed_pairing
        )
        result = settled(fitted)
    if result is first:
        return first
    starts = tuple(replace(start, chosen=False) for start in first.starts)
    return replace(
        result, starts=starts, rivals=first.rivals, oscillating_modes=first.oscillating_modes
    )


def _variance(result: ElasticResult, factors: list[int]) -> FloatArray:
    """(z,) posterior variances of the factors' logarithms."""
    variance: FloatArray = sum(
        (np.sum(part[factors] ** 2, axis=1) for part in result.sources.values()),
        np.zeros(len(factors)),
    )
    return variance
