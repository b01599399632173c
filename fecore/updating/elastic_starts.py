"""Stage 1 from several starts, where one may end with modes paired wrongly.

Where a prior is far off, modes that lie close together in the model stand in another order than in the body, and an update that
pairs them in the wrong order ends in a point of its own. So where the first result looks doubtful, draws from the prior are
paired with the measured modes, and the update starts again from the best draw of each different pairing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fecore.arrays import FloatArray
from fecore.correlation import pair_modes
from fecore.errors import UpdatingError
from fecore.modes import MeasuredModes
from fecore.updating.coordinates import Coordinates
from fecore.updating.draws import even_draws
from fecore.updating.elastic import ElasticResult, Start, update_elastic
from fecore.updating.excursions import Excursion
from fecore.updating.forward import ForwardModel, ForwardState
from fecore.updating.posterior import DISCREPANCY, DISCREPANCY_DOF

_DOUBTFUL = 5.0  # misfit over the discrepancy's prior from which a result is doubted
_FAR = 1.5  # and prior standard deviations that a parameter has moved
_DRAWS, _REACH = 64, 2.0  # from the prior, within so many of its standard deviations
_STARTS = 4  # that are gone on with


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

    Raises:
        UpdatingError: no start converged.
    """

    def run(start: FloatArray | None, first: float, last: float) -> ElasticResult:
        def shown(share: float) -> None:
            progress(first + (last - first) * share)

        return update_elastic(
            forward, modes, shown, use_shapes=use_shapes, start=start, seek_excursions=seek_excursions
        )

    found: list[ElasticResult] = []
    tried: list[Start] = []
    failure: UpdatingError | None = None
    try:
        found.append(run(None, 0.0, 0.5))
        tried.append(_converged(found[0]))
    except UpdatingError as error:
        failure = error
        tried.append(Start((), error.history, error.message))
    if found and not is_doubtful(found[0]):
        return replace(found[0], starts=tuple(tried))
    starts = _other_starts(forward, modes, seed)
    for number, start in enumerate(starts):
        try:
            found.append(run(start, 0.5 + 0.5 * number / len(starts), 0.5 + 0.5 * (number + 1) / len(starts)))
            tried.append(_converged(found[-1]))
        except UpdatingError as error:
            failure = failure or error
            tried.append(Start((), error.history, error.message))
    if not found:
        assert failure is not None, "every start failed"
        raise failure
    return replace(min(found, key=evidence), starts=tuple(tried))


def _converged(result: ElasticResult) -> Start:
    return Start(result.history, tuple(iterate.cost for iterate in result.history))


def is_doubtful(result: ElasticResult) -> bool:
    """Whether another start may do better: modes without a partner, a large misfit, or a parameter far from its prior."""
    coordinates = result.coordinates
    away = np.abs(coordinates.of(result.theta) - coordinates.mean) / coordinates.sd
    return bool(
        result.pairing.unpaired_measured or result.misfit > _DOUBTFUL * DISCREPANCY or away.max(initial=0.0) > _FAR
    )


def evidence(result: ElasticResult) -> tuple[int, float]:
    """What less is better of: modes without a partner; then the misfit of residuals and prior, the discrepancy marginalised."""
    coordinates, n = result.coordinates, result.residual.size
    away = (coordinates.of(result.theta) - coordinates.mean) / coordinates.sd
    squares = DISCREPANCY_DOF + float(result.residual @ result.residual) / DISCREPANCY**2
    return len(result.pairing.unpaired_measured), (DISCREPANCY_DOF + n) / 2 * np.log(squares) + float(away @ away) / 2


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
        shapes = None if modes.shapes is None else state.shapes[:, : len(modes.dofs)]
        pairing = pair_modes(modes.shapes, shapes, modes.frequency_hz, state.frequency_hz)
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
