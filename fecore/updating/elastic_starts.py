"""Stage 1 from several starts, where one may end with modes paired wrongly.

Where a prior is far off, modes that lie close together in the model stand in another order than in the body, and an update that
pairs them in the wrong order ends in a point of its own. So where the first result looks doubtful, and always where there are
no shapes to say so, draws from the prior are paired with the measured modes, and the update starts again from the best draw of
each different pairing. The best of the points with other partners stands in the result as its rival.

Without shapes a pairing need not be where the alignment comes to rest: a mode that nobody measured may be tuned onto a measured
one beside its true partner, and the alignment may go to and fro between two. So the fit is also made with partners held: those
at the prior means, those that a fit went to and fro between, and those of good results with a mode's other candidate in place
of its partner. Every pairing whose evidence is near the best one's then takes part in the intervals (`ElasticResult.spanning`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from fecore.arrays import FloatArray
from fecore.errors import UpdatingError
from fecore.modes import MeasuredModes
from fecore.updating.coordinates import Coordinates
from fecore.updating.draws import even_draws
from fecore.updating.elastic import NoPartnersError, SwingingError, update_elastic
from fecore.updating.elastic_result import REFUTED, ElasticResult, Rival, Start
from fecore.updating.excursions import Excursion
from fecore.updating.forward import ForwardModel, ForwardState
from fecore.updating.pairing import (
    Partners,
    exchanged,
    has_shapes,
    missed_cost,
    pair_with,
    partners_of,
    probability_seen,
)
from fecore.updating.posterior import DISCREPANCY, DISCREPANCY_DOF, spread_over

_DOUBTFUL = 5.0  # misfit over the discrepancy's prior from which a result is doubted
_FAR = 1.5  # and prior standard deviations that a parameter has moved
_DRAWS, _REACH = 64, 2.0  # from the prior, within so many of its standard deviations
_STARTS, _VERIFIED = 6, 2  # pairings from which the fit starts anew; results that are fitted anew on a verified basis
_HELD = 6  # pairings that are held
_PRICE_ALONE = 8.0  # in log evidence, of a measured mode without a partner, beside another pairing


def update_from_several_starts(
    forward: ForwardModel,
    modes: MeasuredModes,
    progress: Callable[[float], None],
    *,
    use_shapes: bool,
    seek_excursions: Callable[[ForwardState], tuple[Excursion, ...]],
    seed: int,
) -> ElasticResult:
    """`update_elastic`, from the prior means and, where that is doubtful, from draws that pair the modes otherwise.

    Where no draw has a mode that is like a measured one, the likest are paired, so that a result can show how unlike they are.

    The draws and the fits from them use the reduced basis unverified; the best two with different partners are fitted anew.

    Raises:
        UpdatingError: no start converged.
    """

    def run(
        model: ForwardModel, start: FloatArray | None, first: float, last: float, held: Partners | None = None
    ) -> ElasticResult | UpdatingError:
        seek = seek_excursions if model.verified else (lambda _: ())
        try:
            return update_elastic(
                model,
                modes,
                lambda share: progress(first + (last - first) * share),
                use_shapes=use_shapes,
                start=start,
                seek_excursions=seek,
                held=held,
            )
        except UpdatingError as error:
            return error

    found = [run(forward, None, 0.0, 0.5)]
    by_shapes = has_shapes(modes)
    done = not isinstance(found[0], UpdatingError) and not is_doubtful(found[0]) and by_shapes
    if not done:
        loose = forward.unverified()
        starts = _other_starts(loose, modes, seed)
        steps = np.linspace(0.5, 0.8, len(starts) + 1)
        searched = [run(loose, start, *between) for start, between in zip(starts, pairwise(steps), strict=True)]
        if not by_shapes:
            to_hold = _to_hold([*found, *searched], modes, forward)
            searched += [run(loose, start, 0.8, 0.8, partners) for partners, start in to_hold]
        worth = _worth_verifying([each for each in [*found, *searched] if isinstance(each, ElasticResult)], modes)
        found += [each for each in searched if not any(each is chosen for chosen in worth)]
        found += [
            run(forward, each.theta, 0.8 + 0.1 * place, 0.9 + 0.1 * place, each.held)
            for place, each in enumerate(worth)
        ]
    tried = tuple(_as_start(each) for each in found)
    verified = [each for each in found if isinstance(each, ElasticResult) and each.updated.forward.verified]
    if not verified:
        first = next(each for each in found if isinstance(each, UpdatingError))
        if not all(isinstance(each, NoPartnersError) for each in found) or not by_shapes:
            raise first
        try:
            return update_elastic(forward, modes, seek_excursions=seek_excursions, likest=True)
        except UpdatingError as error:
            raise first from error
    best = min(verified, key=lambda result: evidence(result, modes))
    torn = found[0].torn if isinstance(found[0], SwingingError) and not by_shapes else ()
    best = replace(best, starts=tried, rivals=_rivals(best, found, modes), torn=torn)
    if not best.standing:
        return best
    return replace(best, identifiability=spread_over(best.identifiability, best.spanning.total, best.coordinates.sd))


def _ranked(found: Sequence[ElasticResult | UpdatingError], modes: MeasuredModes) -> list[ElasticResult]:
    """Those that are results, the best supported first."""
    results = [each for each in found if isinstance(each, ElasticResult)]
    return sorted(results, key=lambda result: evidence(result, modes))


def _to_hold(
    found: list[ElasticResult | UpdatingError], modes: MeasuredModes, forward: ForwardModel
) -> list[tuple[Partners, FloatArray]]:
    """Pairings that no fit came to rest at but may be as likely, each with the parameters to start from."""
    results = _ranked(found, modes)
    prior = forward.solve(forward.parametrisation.prior_mean)
    candidates = [(partners_of(pair_with(modes, prior), prior.kinds), prior.theta)]
    candidates += [pair for each in found if isinstance(each, SwingingError) for pair in each.between]
    least = evidence(results[0], modes)[1] if results else np.inf
    for result in results:
        if evidence(result, modes)[1] <= least + REFUTED:
            candidates += [(partners, result.theta) for partners in exchanged(result.pairing, result.updated.kinds)]
    known = {_partners(result) for result in results}
    fresh = {partners: start for partners, start in reversed(candidates) if partners and partners not in known}
    return list(reversed(fresh.items()))[:_HELD]


def _worth_verifying(found: list[ElasticResult], modes: MeasuredModes) -> list[ElasticResult]:
    """Those that are better than every verified result, or the best two where there is none; one of each pairing."""
    best: dict[Partners, ElasticResult] = {}
    for result in _ranked(found, modes):
        if result.updated.forward.verified:
            break
        best.setdefault(_partners(result), result)
    return list(best.values())[:_VERIFIED]


def _as_start(found: ElasticResult | UpdatingError) -> Start:
    if isinstance(found, UpdatingError):
        return Start((), found.history, found.message)
    return Start(found.history, tuple(iterate.cost for iterate in found.history))


def _rivals(best: ElasticResult, found: list[ElasticResult | UpdatingError], modes: MeasuredModes) -> tuple[Rival, ...]:
    """The best point of each pairing other than the chosen one, the likest first."""
    others: dict[Partners, ElasticResult] = {}
    for each in _ranked(found, modes):
        if _partners(each) != _partners(best):
            others.setdefault(_partners(each), each)
    chosen = evidence(best, modes)
    return tuple(_as_rival(each, chosen, evidence(each, modes)) for each in others.values())


def _as_rival(other: ElasticResult, chosen: tuple[int, float], rival: tuple[int, float]) -> Rival:
    behind = rival[1] - chosen[1] + _PRICE_ALONE * (rival[0] - chosen[0])
    state = other.updated
    return Rival(other.theta, other.pairing.pairs, state.frequency_hz, tuple(state.kinds), float(behind), other.mixture)


def _partners(result: ElasticResult) -> Partners:
    return partners_of(result.pairing, result.updated.kinds)


def is_doubtful(result: ElasticResult) -> bool:
    """Whether another start may do better: modes without a partner, a large misfit, or a parameter far from its prior."""
    coordinates = result.coordinates
    away = np.abs(coordinates.of(result.theta) - coordinates.mean) / coordinates.sd
    return bool(
        result.pairing.unpaired_measured or result.misfit > _DOUBTFUL * DISCREPANCY or away.max(initial=0.0) > _FAR
    )


def evidence(result: ElasticResult, modes: MeasuredModes) -> tuple[int, float]:
    """What less is better of: modes without a partner; then the misfit of residuals and prior, the discrepancy marginalised.

    Where there are no shapes, modes of the model that were not seen count too, and how much a pairing narrows the prior: one
    that meets the frequencies only where a constant is tuned to a per cent has a smaller part of the prior for it (MacKay,
    Neural Comput. 4, 1992; the Occam factor ½ ln |C_p| - ½ ln |H⁻¹|).
    """
    coordinates, n = result.coordinates, result.residual.size
    away = (coordinates.of(result.theta) - coordinates.mean) / coordinates.sd
    squares = DISCREPANCY_DOF + float(result.residual @ result.residual) / DISCREPANCY**2
    misfit = (DISCREPANCY_DOF + n) / 2 * np.log(squares) + float(away @ away) / 2
    if has_shapes(modes):
        return len(result.pairing.unpaired_measured), misfit
    covariance = sum(part @ part.T for part in result.sources.values())
    narrowed = np.log(coordinates.sd).sum() - np.linalg.slogdet(covariance)[1] / 2
    missed = missed_cost(result.pairing, probability_seen(modes, result.updated), result.updated.frequency_hz)
    return 0, float(misfit + narrowed + missed)


def _other_starts(forward: ForwardModel, modes: MeasuredModes, seed: int) -> list[FloatArray]:
    """Draws from the prior that pair the modes differently, the best of each pairing, the best first."""
    coordinates = Coordinates(forward.parametrisation)
    free = len(forward.parametrisation.reported)
    draws = even_draws(free, _DRAWS, seed)
    best: dict[tuple[tuple[int, int, str], ...], tuple[tuple[int, float], FloatArray]] = {}
    for draw in draws:
        xi = coordinates.mean.copy()
        xi[:free] += _REACH * (2 * draw - 1) * coordinates.sd[:free]
        if not coordinates.are_believable(xi[None])[0]:
            continue
        state = forward.solve(coordinates.values(xi))
        pairing = pair_with(modes, state)
        if not pairing.pairs:
            continue
        rows, columns = (list(side) for side in zip(*pairing.pairs, strict=True))
        miss = float(np.mean(np.log(modes.frequency_hz[rows] / state.frequency_hz[columns]) ** 2))
        score = len(pairing.unpaired_measured), miss
        key = tuple((row, column, state.kinds[column]) for row, column in pairing.pairs)
        if key not in best or score < best[key][0]:
            best[key] = score, state.theta
    ranked = sorted(best.values(), key=lambda each: each[0])
    return [theta for _, theta in ranked[:_STARTS]]
