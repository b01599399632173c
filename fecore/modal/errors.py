"""The errors of what a fit of the modal series gives.

A series leaves more of measured FRFs than noise. Hits beside the point, cables and slight
non-linearity make errors that grow with the FRF and are smooth over some lines. A line is then
worth less than one: with the correlation ρ_j of the standardised residual j lines apart, n lines
are worth n/τ, τ = 1 + 2 Σ_j ρ_j.

Errors that all FRFs share do not become less by their number: a joint that high hits open, a spring
that is not linear. In the shape of mode k, m_ik its part in FRF i, they are the relative error of
its curve,

    e_k(l) = Σ_i w_i m̄_ik r_i / Σ_i w_i |m_ik|².

A pole takes up most of such an error as a shift. Where a spring makes the frequency of a mode
depend on its amplitude, which falls as e^{-σt}, its curve gains iδ/2 (1/(σ + iΔ) - 1/(3σ + iΔ)), Δ
the distance in frequency and δ half bandwidths the shift at first. By least squares on the lines
about it the pole shifts by 0.19 δ and leaves an rms e of 0.047 δ: a shift of 4 e.

The mass of a sensor that roves pulls each mode by the square of its shape where it stands, so that a
fit counts those tests most that are pulled most. The pulled tests may have a pole of their own, R_k
beside R_j of the others: t_s = Re R_k Ā/|A|², A = R_k + R_j in test s, rises with |A|² then, by a
correlation r that is no chance where (1 - r²)^(S/2 - 1) <= 0.001; of pairs of random shapes one in
20,000 is taken so. One pole stands for both.

A test s alone has ln f at δ_s = g_s/h_s from the fit's, g_s its score and h_s its information, with
variance v_s = 1/h_s, both over the excess of the residual. Where δ_s falls with the power of the mode
in the test, the frequency that is stated is the mean over tests: that of δ_s by the weights
1/(t² + v_s), t² their scatter, with the variance
1/Σ 1/(t² + v_s). By the moments of Σ_s δ_s²/v_s (DerSimonian and Laird 1986)

    t² = max(0, (Σ δ²/v - (S - 1))/(Σ 1/v - Σ 1/v²/Σ 1/v)).

Weak tests err more by other causes, so without such a fall the fit's own frequency stands.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from fecore.arrays import BoolArray, FloatArray, IntArray
from fecore.modal.arrangement import MANY, Arrangement
from fecore.modal.series import PRICE, VAGUE, Terms, shared_error

if TYPE_CHECKING:
    from fecore.modal.judge import Growth
    from fecore.modal.refine import LinearFit, PoleFit

SHIFT = 4.0
"""Half bandwidths by which a pole is off over the relative error that all FRFs share."""

_CHANCE = 1e-3  # below which a fall over the power is none
_KNOWN = 0.3  # standard deviation of t up to which it is known
# of a session in the information: of a mode that one session shows alone nothing scatters
_LARGEST_SHARE = 0.9


@dataclass(frozen=True)
class MeanOverTests:
    """Natural frequencies as the mean over tests that do not share them."""

    move: FloatArray  # (n,) from ln f of the fit to the mean
    variance: FloatArray  # (n,) of the mean of ln f


@dataclass(frozen=True)
class ErrorModel:
    """What is known of the errors of a fit's poles, beside the variance of the values."""

    memory: float  # number of lines that count as one independent line
    sessions: IntArray  # (N,) number of the test that each FRF belongs to
    shared: FloatArray  # (n,) relative error of each mode's curve that all FRFs share
    # (parameters,) change of ln ω and ζ where the values are weighted in another way, and with the
    # height of the hits where that is known
    change: FloatArray
    shift: FloatArray | None = None
    mean: MeanOverTests | None = None  # frequencies, where the fit states their mean over the tests
    # (S, parameters) share of each test in the information; all the same where it is not known
    leverage: FloatArray | None = None


def with_errors(
    arrangement: Arrangement, fit: PoleFit, start: Terms, doubted: BoolArray, growth: Growth | None
) -> PoleFit:
    """The fit with its errors: from its residual, its tests, what all FRFs share, the change since the
    poles of its start, and what harder hits change. It states the mean over tests where these know
    it. What poles that are doubted take up, and a background, is error too.
    """
    shared = shared_error(arrangement, fit)
    if doubted.any() or np.any(fit.background):
        others = shared_error(arrangement, fit.without(arrangement, doubted))
        shared[~doubted] = np.maximum(shared[~doubted], others)
    drawn = np.log(fit.terms.frequency_hz / start.frequency_hz)
    change = np.concatenate([drawn, fit.terms.damping_ratio - start.damping_ratio])
    information = _by_test(arrangement, fit.by_frf)
    whole = np.maximum(information.sum(axis=0), np.finfo(float).tiny)
    mean = mean_over_tests(arrangement, fit, information)
    errors = ErrorModel(
        memory=fit.residual_memory,
        sessions=arrangement.session,
        shared=shared,
        change=change,
        shift=None if growth is None else growth.shift,
        mean=mean,
        leverage=information / whole,
    )
    if mean is None:
        return replace(fit, errors=errors)
    move = np.concatenate([mean.move, np.zeros(fit.terms.pairs)])
    return replace(fit, errors=errors, terms=fit.terms.moved(move))


def widened(
    inverse: FloatArray,
    inflation: float,
    scores: FloatArray,
    sessions: IntArray,
    leverage: FloatArray | None = None,
) -> FloatArray:
    """The covariance H⁻¹ times the inflation, each standard deviation at
    least what the scatter between sessions shows,

    v_p = (S - 1)/S Σ_s ((H⁻¹ g_s)_p/(1 - l_sp))²,

    g_s the sessions' own gradients about the optimum and l_sp the share of the information on p
    that is theirs, 1/S where it is not known: without session s the fit is off by so much (White
    1980, for clusters Liang and Zeger 1986; the jackknife of MacKinnon and White 1985). It asks
    nothing of the errors within a session, so it holds where these last over lines, channels or
    modes. Of S sessions it is known to 1 ± 1/√(2(S - 1)).
    """
    factor = np.sqrt(inflation) * np.ones(len(inverse))
    if (count := int(sessions.max()) + 1) >= MANY:
        sums = np.zeros((count, scores.shape[1]))
        np.add.at(sums, sessions, scores)
        own = 1 / count if leverage is None else np.minimum(leverage, _LARGEST_SHARE)
        changes = (sums @ inverse) / (1 - own)
        between = np.sqrt(np.sum(changes**2, axis=0) * (count - 1) / count)
        usual = np.sqrt(np.maximum(np.diag(inverse), np.finfo(float).tiny))
        factor = np.maximum(factor, between / usual / (1 + 1 / np.sqrt(2 * count - 2)))
    return np.asarray(inverse * np.outer(factor, factor))


def _by_test(arrangement: Arrangement, each: FloatArray) -> FloatArray:
    """(S, ...) sums over the FRFs of each test."""
    out = np.zeros((arrangement.sessions, each.shape[1]))
    np.add.at(out, arrangement.session, each)
    return out


def _roves(arrangement: Arrangement) -> bool:
    """Whether each of eight or more tests has a point of its own."""
    count = arrangement.sessions
    return count >= MANY and len({pair[0] for pair in arrangement.pairs}) >= count


def pulled(arrangement: Arrangement, fit: LinearFit, larger: IntArray) -> BoolArray:
    """(n,) poles that are one mode with a larger one, whose numbers are given: the mode in those tests
    in which the mass of a sensor that roves pulls it most, or least.
    """
    n = fit.terms.pairs
    if not _roves(arrangement) or not n:
        return np.zeros(n, dtype=bool)
    own, both = fit.residues, fit.residues + fit.residues[:, larger]
    variance = fit.linear.variance[:, 0 : 2 * n : 2] + fit.linear.variance[:, 1 : 2 * n : 2]
    part, power, noise = (
        _by_test(arrangement, each)
        for each in ((own * both.conj()).real, np.abs(both) ** 2, np.abs(both) ** 2 * variance)
    )
    power = np.maximum(power, np.finfo(float).tiny)
    known = np.sqrt(noise) < _KNOWN * power
    t = part / power
    x, y = (each - np.mean(each, axis=0, where=known | ~known.any(axis=0)) for each in (power, t))
    xx, xy, yy = (np.sum(each, axis=0, where=known) for each in (x * x, x * y, y * y))
    low = fit.terms.frequency_hz < fit.terms.frequency_hz[larger]
    falls, count = np.where(low, xy, -xy) > 0, known.sum(axis=0)
    left = 1 - xy**2 / np.maximum(xx * yy, np.finfo(float).tiny)
    return np.asarray(falls & (count >= MANY) & (left ** (count / 2 - 1) <= _CHANCE))


def mean_over_tests(
    arrangement: Arrangement, fit: PoleFit, information: FloatArray
) -> MeanOverTests | None:
    """The mean of each natural frequency over the tests of a roving sensor, from eight on, where its
    mass shows: the fall of δ_s over the power pays the price of one unknown for each mode.

    Args:
        arrangement: the FRFs.
        fit: their fit.
        information: (S, parameters) of each test alone on ln ω and ζ of each pole.
    """
    count, n = arrangement.sessions, fit.terms.pairs
    if not _roves(arrangement):
        return None
    h = information[:, :n] / fit.excess
    h = np.maximum(h, VAGUE * h.max(axis=0))  # a test without a line there says nothing
    inside = arrangement.in_band(fit.terms.frequency_hz)
    power = _by_test(arrangement, np.abs(fit.residues) ** 2)
    off = _by_test(arrangement, fit.scores[:, :n]) / fit.excess / h
    total = h.sum(axis=0)
    about, beside = (each - np.sum(h * each, axis=0) / total for each in (off, power))
    bend = np.maximum(np.sum(h * beside**2, axis=0), np.finfo(float).tiny)
    fall = np.minimum(np.sum(h * beside * about, axis=0) / bend, 0.0)
    rest = np.sum(h * (about - fall * beside) ** 2, axis=0) / (count - 2)
    shown = (fall**2 * bend / np.maximum(rest, 1.0))[inside]
    if not inside.any() or np.sum(shown) < PRICE * shown.size:
        return None
    beyond = np.sum(h * about**2, axis=0) - (count - 1)
    scatter = np.maximum(beyond, 0.0) / (total - np.sum(h**2, axis=0) / total)
    weight = 1 / (scatter + 1 / h)
    move = np.where(inside, np.sum(weight * off, axis=0) / weight.sum(axis=0), 0.0)
    return MeanOverTests(move, 1 / weight.sum(axis=0))
