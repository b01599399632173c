"""Search: from linear candidates to the poles that the data need, in a few combinations of the
FRFs.

The residual of FRF i is taken as Gaussian with a variance that follows the local misfit, v_il = g_i
p_l, at least the noise. A pole that is not in the series, all other coefficients fitted anew,
lowers χ² by rᵀE(EᵀE)⁻¹Eᵀr, E its two columns less their projection on the series: a 2x2 problem.
The candidate of the largest gain is taken, its columns leave all others and the residual, and so on
(orthogonal matching pursuit) while Akaike's price of 2 for each unknown is paid. Then all poles are
refined together, poles that no longer pay leave, and the residual offers new candidates, a few
rounds in all.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fecore.arrays import BoolArray, ComplexArray, FloatArray
from fecore.modal.arrangement import Arrangement
from fecore.modal.basis import BESIDE, DAMPING_RANGE, ONE, Terms, columns
from fecore.modal.error_model import RELATIVE
from fecore.modal.evidence import evidence_of
from fecore.modal.linear import stacked
from fecore.modal.lscf import NARROW, clusters, linear_poles
from fecore.modal.noise import local_variance
from fecore.modal.probability import probability
from fecore.modal.refinement import Level, gains, level_at, refine

EXPONENTS = (-3, -2, -1, 0, 1, 2)
"""Powers of iω of the receptance that stand for the modes outside the band and for rigid body
motion with its damping.
"""

ROUNDS = 5
"""Of growth on the residual."""

_RESIDUAL_ORDER = 10  # of the linear stage on the residual
STEPS = 8
"""Of the refinement in each round."""

ENOUGH = 1.0
"""Decrease of χ² that a step is worth before the last round."""

_SAME = 0.03  # summed half bandwidths within which a candidate is a pole that is there
_FIRST = 2  # steps after which new poles are looked at
_LESS = 1.0  # fall of the mean ln v from which poles are refined again under what is left
_SPARE = 6  # poles beside twice those that are not refused, from which a search must find more
_SETTLES = (
    # times that a variance follows a fit and a fit the variance: the first fit's own is too large
    # for clean data
    2
)
REFUSED = 0.1
"""Probability below which a pole is refused."""

HARDLY = 0.02
"""Probability below which a pole is not refined."""

HOPELESS = 0.001
"""... where it is new."""

_STRONG = 30.0  # times its price that a pole gains which may stay all the same
PRICE = 2.0
"""Of an unknown (Akaike)."""

# FRFs up to which the first round looks at groups: where more differ by a drift, doubles would pay
# too
_FEW = 2


def grow(
    arrangement: Arrangement,
    noise: FloatArray,
    most: int,
    step: Callable[[int], None],
    start: Terms,
    pool: ComplexArray,
    rounds: int = ROUNDS,
    beside: int = 0,
) -> Level:
    """The poles that FRFs, or combinations of them, need.

    Args:
        arrangement: the FRFs.
        noise: (N, L) variance of their noise.
        most: largest number of poles.
        step: called after every round with the number of poles.
        start: the series to start from.
        pool: candidates, rad/s; in every round those that the residual shows are added.
        rounds: most rounds.
        beside: FRFs more than the combinations that stand for them.
    """
    first = np.append(pool, _beyond(arrangement))
    fit = local_level(arrangement, start, noise)
    count = _count(arrangement, fit)
    for number in range(rounds):
        pairs = fit.terms.pairs
        candidates = np.append(_in_residual(arrangement, fit), first) if fit.terms.pairs else first
        if not fit.terms.pairs and len(fit.residual) <= _FEW:
            fit = _as_all_leave(arrangement, fit, candidates[:most], noise)
        candidates = candidates[~_near(candidates, fit.terms.poles, _SAME)]
        room = most - fit.terms.pairs
        added = _chosen(arrangement, fit, candidates, room, beside)
        if not fit.terms.pairs and not added.size:
            # A first pole that most of the FRFs' own variance is gains no more than that: it pays
            # for the combinations alone.
            added = _chosen(arrangement, fit, candidates, room, 0)
        if not added.size:
            break
        larger = level_at(arrangement, with_poles(fit.terms, added), fit.variance)
        larger = settled(arrangement, larger, _FIRST, HOPELESS)
        for _ in range(_SETTLES):
            larger = settled(arrangement, larger)
            # Not before there are poles, as residual terms would take the place of a broad one;
            # then all of them again, as a better fit may need what a poor one did without.
            terms, variance = with_residual_terms(arrangement, larger.terms), larger.variance
            whole = level_at(arrangement, terms, variance, larger.weights)
            own = local_variance(arrangement, whole.residual, noise)
            larger = level_at(arrangement, terms, own)
            if np.mean(np.log(variance / own)) < _LESS:
                break
        fit = pruned(arrangement, larger, beside)
        step(fit.terms.pairs)
        before, count = count, _count(arrangement, fit)
        more = count > before or fit.terms.pairs <= _SPARE + 2 * count
        if (number and fit.terms.pairs <= pairs) or not more:
            break
    return fit


def settled(
    arrangement: Arrangement,
    fit: Level,
    steps: int = STEPS,
    least: float = HARDLY,
    enough: float = ENOUGH,
) -> Level:
    """The fit with its poles refined under its own variance, but for those of a probability below
    the least: they stay as they are meanwhile.
    """
    free = np.flatnonzero(likely(arrangement, fit, least))
    return refine(arrangement, fit.terms, fit.variance, steps=steps, enough=enough, free=free)


def _near(pole: ComplexArray, others: ComplexArray, most: float = ONE) -> BoolArray:
    """(n,) whether a pole may be one with another, or within so many summed half bandwidths."""
    reach = most * -(pole.real[:, None] + others.real)
    return np.asarray((np.abs(pole[:, None] - others) <= reach).any(axis=1))


def likely(arrangement: Arrangement, fit: Level, least: float = HARDLY) -> BoolArray:
    """(n,) poles that may be modes, stand out of band, or hide most of what is beside them: of the
    last as many as there are others.
    """
    p, poor = _probability(arrangement, fit)
    poor &= p < least
    worth = np.where(poor, fit.gains / pole_price(fit), 0.0)
    strong = np.argsort(-worth, kind="stable")[: int(np.sum(p >= least))]
    poor[strong[worth[strong] > _STRONG]] = False
    return ~poor


def _count(arrangement: Arrangement, fit: Level) -> int:
    """Number of the poles that are not refused."""
    return int(np.sum(_probability(arrangement, fit)[0] >= REFUSED))


def _probability(arrangement: Arrangement, fit: Level) -> tuple[FloatArray, BoolArray]:
    """(n,) P of each pole, and which ones it is asked of: those in band but for tones."""
    evidence = evidence_of(arrangement, fit)
    asked = arrangement.in_band(fit.terms.frequency_hz) & ~evidence.tone
    return np.where(asked, probability(evidence, fit.terms.damping_ratio), 0.0), asked


def _in_residual(arrangement: Arrangement, fit: Level) -> ComplexArray:
    """Candidates that the residual shows, rad/s."""
    return clusters(
        linear_poles(arrangement.omega, fit.residual, fit.weight, _RESIDUAL_ORDER, (NARROW,))
    )


def local_level(arrangement: Arrangement, terms: Terms, noise: FloatArray) -> Level:
    """The fit at given poles under the variance of its own misfit, at least the noise (N, L)."""
    fit = level_at(arrangement, terms, local_variance(arrangement, arrangement.values, noise))
    for _ in range(_SETTLES):
        fit = level_at(arrangement, terms, local_variance(arrangement, fit.residual, noise))
    return fit


def linear_weight(arrangement: Arrangement, noise: FloatArray) -> FloatArray:
    """(N, L) weights of the linear stage: noise, and errors that grow with the FRF; alike for all
    where nothing is missing.
    """
    weight = np.where(
        arrangement.measured, 1 / (noise + RELATIVE**2 * np.abs(arrangement.values) ** 2), 0.0
    )
    return (
        np.broadcast_to(weight.mean(axis=0), weight.shape) if arrangement.measured.all() else weight
    )


def exponents_for(arrangement: Arrangement) -> tuple[int, ...]:
    """The residual terms, fewer where lines are few."""
    lines = int(arrangement.measured.sum(axis=1).min())
    return EXPONENTS if lines >= 8 * len(EXPONENTS) else (-2, 0)


def with_residual_terms(arrangement: Arrangement, terms: Terms) -> Terms:
    """The terms with all residual terms that the lines carry."""
    return replace(terms, exponents=exponents_for(arrangement))


def with_poles(terms: Terms, pole: ComplexArray) -> Terms:
    """The terms with more poles, rad/s."""
    hz = np.abs(pole) / (2 * np.pi)
    return replace(
        terms,
        frequency_hz=np.append(terms.frequency_hz, hz),
        damping_ratio=np.append(
            terms.damping_ratio, np.clip(-pole.real / np.abs(pole), *DAMPING_RANGE)
        ),
    )


def pole_price(fit: Level, beside: int = 0) -> float:
    """Akaike's price of a pole, of two unknowns an FRF and two for the pole, and that of having
    looked for it at every line.

    Combinations stand for more FRFs, `beside` them. In each of these a pole has two unknowns too,
    that gain 1 each from noise.
    """
    own = PRICE * (2 * len(fit.residual) + 2) + 2 * float(np.log(fit.residual.shape[1]))
    return own + (PRICE - 1) * 2 * beside


def pruned(arrangement: Arrangement, fit: Level, beside: int = 0) -> Level:
    """The fit without poles that do not pay, the broadest of them first: what a narrower one
    explains must not outlive it.

    Residual terms that do not pay go after the poles, the least worth first.
    """
    terms, c, C, share = fit.terms, fit.linear.coefficients, fit.linear.spread, fit.linear.share
    price = pole_price(fit, beside)
    while terms.pairs:
        poor = gains(c, C, share, terms.pairs) < price
        if not poor.any():
            break
        k = int(np.argmax(np.where(poor, terms.half_bandwidth_hz, -1.0)))
        c, C = _left_out(c, C, [2 * k, 2 * k + 1])
        terms = terms.some(np.arange(poor.size) != k)
    while len(terms.exponents) > 1:
        spread = np.einsum("nii->ni", C)[:, 2 * terms.pairs :]
        gain = share @ (c[:, 2 * terms.pairs :] ** 2 / np.maximum(spread, np.finfo(float).tiny))
        least = int(np.argmin(gain))
        if gain[least] > PRICE * len(fit.residual) + (PRICE - 1) * beside:
            break
        c, C = _left_out(c, C, [2 * terms.pairs + least])
        terms = replace(terms, exponents=terms.exponents[:least] + terms.exponents[least + 1 :])
    return fit if terms is fit.terms else level_at(arrangement, terms, fit.variance, fit.weights)


def _left_out(c: FloatArray, C: FloatArray, gone: list[int]) -> tuple[FloatArray, FloatArray]:
    """Coefficients (N, q) and their covariance, or one for all, without some columns, the others fitted anew: c -
    C_g C_gg⁻¹ c_g.
    """
    own = C[:, :, gone]
    back = np.matmul(own, np.linalg.pinv(own[:, gone], hermitian=True))
    c = c - np.matmul(back, c[:, gone, None])[:, :, 0]
    C = C - np.matmul(back, own.transpose(0, 2, 1))
    return np.delete(c, gone, axis=1), np.delete(np.delete(C, gone, axis=1), gone, axis=2)


def _beyond(arrangement: Arrangement) -> ComplexArray:
    """Candidates outside the band, for modes whose skirts reach into it."""
    low, high = arrangement.omega[0], arrangement.omega[-1]
    at = np.append(high * np.array([1.03, 1.1, 1.25, 1.6]), low * np.array([0.6, 0.8, 0.95]))
    return np.asarray((np.array([[-0.01], [-0.05]]) + 1j) * at).ravel()


def _as_all_leave(
    arrangement: Arrangement, fit: Level, pool: ComplexArray, noise: FloatArray
) -> Level:
    """The fit under the variance that it would leave with all candidates in it.

    Under its own, which follows what it misses, no mode of a group of overlapping ones can gain
    more than two for each line of the group, and none pays alone.
    """
    whole = level_at(arrangement, with_poles(fit.terms, pool), fit.variance)
    return level_at(arrangement, fit.terms, local_variance(arrangement, whole.residual, noise))


def _chosen(
    arrangement: Arrangement, fit: Level, pool: ComplexArray, room: int, beside: int
) -> ComplexArray:
    """The candidates that pay, most gain first, each on top of those before it."""
    if not pool.size or room <= 0:
        return pool[:0]
    root = np.sqrt(fit.weight.mean(axis=0))
    scaled = fit.residual * np.sqrt(fit.weight)
    target = np.concatenate([scaled.real, scaled.imag], axis=1)
    frame = stacked(fit.linear.frame, root)
    extra = stacked(
        columns(
            arrangement.omega,
            with_poles(Terms(np.empty(0), np.empty(0), ()), pool),
            arrangement.power,
        ),
        root,
    )
    extra = extra / np.maximum(np.linalg.norm(extra, axis=0), np.finfo(float).tiny)
    frame = np.linalg.qr(frame)[0]
    extra = extra - frame @ (frame.T @ extra)
    right = target @ extra
    one, two = extra[:, 0::2], extra[:, 1::2]
    gram = [np.einsum("lc,lc->c", a, b) for a, b in ((one, one), (one, two), (two, two))]
    price, basis = pole_price(fit, beside), np.empty((len(extra), 0))
    # of a candidate's power: what the series leaves below it is round-off, or a pole that it has
    new = np.where(_near(pool, fit.terms.poles, BESIDE), 1e-6, 1e-10)
    taken: list[int] = []
    open_ = np.ones(pool.size, dtype=bool)
    while len(taken) < room:
        gain = np.where(open_, _two_by_two(right, gram, new), 0.0)
        k = int(np.argmax(gain))
        if gain[k] < price:
            break
        taken.append(k)
        own = extra[:, 2 * k : 2 * k + 2]
        own = np.linalg.qr(own - basis @ (basis.T @ own))[0]
        basis = np.concatenate([basis, own], axis=1)
        along = own.T @ extra  # (2, 2C)
        right = right - (target @ own) @ along
        a, b = along[:, 0::2], along[:, 1::2]
        gram = [
            g - np.sum(x * y, axis=0)
            for g, (x, y) in zip(gram, ((a, a), (a, b), (b, b)), strict=True)
        ]
        open_ &= ~_near(pool, pool[[k]])
    return pool[taken]


def _two_by_two(right: FloatArray, gram: list[FloatArray], new: FloatArray) -> FloatArray:
    """(C,) gain of each pair of columns from their products with the residuals (M, 2C) and with one
    another, 0 where less than `new` (C,) is left of them.
    """
    (a, b, d), one, two = gram, right[:, 0::2], right[:, 1::2]
    determinant = a * d - b**2
    alone = (a > new) & (d > new) & (determinant > new * a * d)
    total = (
        d * np.sum(one**2, axis=0) - 2 * b * np.sum(one * two, axis=0) + a * np.sum(two**2, axis=0)
    )
    return np.asarray(np.where(alone, total / np.where(alone, determinant, 1.0), 0.0))
