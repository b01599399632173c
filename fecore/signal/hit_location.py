"""Where each hit landed beside the other hits of its point, in metres.

A hit at x + δ has the shares a_k(x + δ) = a_k(x) + ∇a_k(x)·δ (`participation`), and the tour of all points
says how each share changes from place to place (`slopes`). With ā_k the median of the point's hits,
δ of each hit is the minimum of

    Σ_k ρ((a_k - ā_k - ∇a_k·δ)/σ_k) + |δ|²/(2 τ²),    σ_k² = (e a_k)² + δ₀² var ∇a_k,

ρ Huber's function, which lets single shares be wrong; e what second order and noise leave; δ₀ the
displacement that an unknown slope is charged with; τ keeps δ near zero along an axis of which the
shares say nothing. The normal equations give its covariance.

The place of the point is where most of its hits lie: the mean of those within `_TOGETHER` of the
hit that lies nearest to all others.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from fecore.arrays import FloatArray
from fecore.normal import SD_OF_MAD
from fecore.signal.slopes import plane, slopes

FEWEST_POINTS = 5
"""Points under the same sensors below which slopes are not asked for."""

_FEWEST_HITS = 3  # of a point, below which nobody can say which is wrong
_KNOWN_M = 0.003  # standard deviation along the best known direction up to which a hit is located
_PRIOR_M = 0.006  # τ: displacements are not expected to be many times that
_CHARGED_M = 0.003  # δ₀: displacement that an unknown slope is charged with
# of the hit nearest to all others, up to which hits lie at one place: 3 sd of two hits' distance
_TOGETHER_M = 0.007
_SHARE_ERROR = 0.007  # e: of a share, what second order and noise leave
_LEAST_SHARE = 0.05  # of the mean square of a point's shares, that each is at least taken for
_USUAL_M = 0.0029  # median of how far good hits land from the others of their point, at most
_HUBER = 2.0  # standard deviations beyond which a share counts less


Position = tuple[float, float, float]


Located = tuple[float, int]
"""How far a hit landed from the others of its point, m, and along how many directions that is
known.
"""


def locate(
    places: Sequence[Position | None], participation: Sequence[Mapping[int, FloatArray]]
) -> list[dict[int, Located]]:
    """Where the hits that can be located landed, by point and number of the hit.

    Args:
        places: of each point, m; None for a point of unknown place.
        participation: of each point, those of its comparable hits, all of one length K.
    """
    located: list[dict[int, Located]] = [{} for _ in places]
    known = [
        i
        for i, (place, own) in enumerate(zip(places, participation, strict=True))
        if place is not None and own
    ]
    if len({places[i] for i in known}) < FEWEST_POINTS:
        return located
    grid = plane(np.array([places[i] for i in known]))
    middle = np.array([np.median(np.array(list(participation[i].values())), axis=0) for i in known])
    for row, i in enumerate(known):
        if len(participation[i]) < _FEWEST_HITS:
            continue
        own = np.array(list(participation[i].values())) - middle[row]
        slope, unknown = slopes(grid, middle, row)
        size = middle[row] ** 2
        sigma = np.sqrt(
            _SHARE_ERROR**2 * (size + _LEAST_SHARE * size.mean())
            + _CHARGED_M**2 * unknown.sum(axis=0)
            + 1e-300
        )
        placed = [_displacement(slope / sigma, values / sigma) for values in own]
        off = _from_most(np.array([d for d, _ in placed]))
        if off is None:
            continue
        directions = [
            int((np.linalg.eigvalsh(covariance) <= _KNOWN_M**2).sum()) for _, covariance in placed
        ]
        located[i] = {
            number: (float(np.linalg.norm(d)), known_along)
            for number, d, known_along in zip(participation[i], off, directions, strict=True)
            if known_along
        }
    return _over_usual(located)


def _displacement(slope: FloatArray, off: FloatArray) -> tuple[FloatArray, FloatArray]:
    """δ of one hit and its (2, 2) covariance, from (2, K) slopes and (K,) shares in standard
    deviations.
    """
    weight = np.ones(off.size)
    for _ in range(6):  # reweighting comes nearer by a factor of several each time
        normal = (slope * weight) @ slope.T + np.eye(2) / _PRIOR_M**2
        delta = np.linalg.solve(normal, (slope * weight) @ off)
        left = np.abs(off - delta @ slope)
        scale = max(SD_OF_MAD * float(np.median(left)), 0.5)
        weight = 1 / np.maximum(1.0, left / (_HUBER * scale))
    return delta, np.linalg.inv(normal)


def _from_most(placed: FloatArray) -> FloatArray | None:
    """(h, 2) each of the places less the mean of the others that lie together; None where as many
    lie together elsewhere.
    """
    apart = np.linalg.norm(placed[:, None] - placed[None], axis=2)
    most = int(np.argmin(np.minimum(apart, 2 * _TOGETHER_M).sum(axis=1)))
    together = apart[most] < _TOGETHER_M
    elsewhere = (apart[~together][:, ~together] < _TOGETHER_M).sum(axis=1)
    if elsewhere.size and elsewhere.max() >= together.sum():
        return None
    offsets = np.empty_like(placed)
    for i, place in enumerate(placed):
        others = together.copy()
        others[i] = False
        offsets[i] = place - placed[others if others.any() else together].mean(axis=0)
    return offsets


def _over_usual(located: list[dict[int, Located]]) -> list[dict[int, Located]]:
    """The same, scaled down where the hits of the whole campaign land farther off than usual: an
    unsteady hand is no fault of one hit.
    """
    every = [offset for point in located for offset, _ in point.values()]
    if not every:
        return located
    share = min(_USUAL_M / max(float(np.median(every)), 1e-9), 1.0)
    return [
        {number: (share * offset, along) for number, (offset, along) in point.items()}
        for point in located
    ]
