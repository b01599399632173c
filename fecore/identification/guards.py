"""Which poles of a fitted series are modes, which are doubtful, and which are refused.

A pole is refused when it cannot be a mode: outside the band, within three lines of 0 Hz, overdamped, resting on one line, not
determined, or not worth its unknowns. What is left has several witnesses, and one that speaks against it makes it doubtful,
with its reason: how large it is beside the errors of the FRFs, how high beside the largest mode, whether halves of the data and
the orders of the stabilisation diagram find it again, whether its shape is that of a mode, how wide it is beside the line
spacing, and how near to the end of the band.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations_with_replacement

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.correlation import mac
from fecore.frf import MAINS_HZ
from fecore.identification.arrangement import Arrangement
from fecore.identification.basis import columns
from fecore.identification.gains import in_band, loss, price
from fecore.identification.refinement import Fit, evaluate
from fecore.identification.result import RefusedPole
from fecore.identification.search import Search
from fecore.identification.shapes import phase_collinearity
from fecore.identification.sifting import Need
from fecore.identification.subsets import Again

OVERDAMPED = 0.6  # a pole damped more than this is a trend of the record, not a resonance
FIRST_LINES = 3.0  # lines from 0 Hz where drift and rigid-body motion lie
VAGUE_FREQUENCY = 0.03  # standard deviation of ln ω from which a pole has no place
VAGUE_DAMPING = 0.5  # standard deviation of ζ, over ζ, from which a pole has no width
_LARGE = 3.0  # misfit without the mode over the errors, below which it is within their reach
WEAK = 0.5  # share of any FRF (half as much of all together) at its own frequency below which a mode is doubtful
_WEAK_PRICE = 10.0  # ... unless the evidence is so many times its price
_SURE = 5.0  # ... unless the evidence is so many times its price
_LEAST_ERROR = 1e-6  # relative error of the FRFs that is always supposed
_CLEAR = 50.0  # times the errors that a small mode explains, from which it is believed
_CLEAR_PRICE = 20.0  # evidence of a small mode over its price from which it is believed
_ORDERS = 0.5  # share of the orders in which a pole comes back, below which it is not stable
_COLLINEAR = 0.6  # modal phase collinearity below which a shape is hardly that of a mode
_STRONG = 100.0  # ratio from which a complex shape is believed
_FEW_POINTS = 4  # FRFs below which heights and shapes say little
_NARROW = 1.0  # lines in the half-power bandwidth below which a mode is no wider than a tone
_MAINS_WANDER = 0.001  # of the mains frequency: 50 mHz of 50 Hz, the band of ordinary operation in Europe
_ON_A_LINE = 0.2  # lines between a tone and a line of the transform up to which it is faint two lines off
_PRODUCT = 0.8  # MAC with the product of two shapes from which a pole at their sum is their distortion
_FEWEST_OF_A_PRODUCT = 6  # FRFs in which shapes and their products are distinguished
_EDGE = 0.5  # half bandwidths (and lines) from the end of the band


@dataclass(frozen=True)
class Verdict:
    """Poles that are modes or doubtful (indices into the terms, ascending in frequency), and the others.

    Attributes:
        kept: their numbers in the terms.
        significance: evidence in units of the price.
        doubt: why each is doubtful, None where it is not.
        refused: the others in band, with reasons.
        spoilt: numbers of the lines that interference stands on.
    """

    kept: IntArray
    significance: FloatArray
    doubt: tuple[str | None, ...]
    refused: tuple[RefusedPole, ...]
    spoilt: IntArray


@dataclass(frozen=True)
class Witnesses:
    """What is known of each pole beside the fit: how much each in band is needed, where halves of the data find it, and in
    which share of the orders it comes back.
    """

    needs: dict[int, Need]
    again: Again
    stable: FloatArray


def judge(arrangement: Arrangement, fit: Fit, search: Search, witnesses: Witnesses) -> Verdict:
    """Decide which poles of the series are modes.

    Args:
        arrangement: all FRFs.
        fit: the series fitted to them.
        search: their combinations, for what must be tried in many ways.
        witnesses: what is known of the poles beside the fit.
    """
    needs = witnesses.needs
    high, small = heights(arrangement, fit), hidden_distortion(search)
    kept, doubts, refused, spoilt = [], [], [], []
    for k in np.argsort(fit.terms.frequency_hz):
        f, zeta = float(fit.terms.frequency_hz[k]), float(fit.terms.damping_ratio[k])
        if not in_band(arrangement, fit.terms.frequency_hz[[k]])[0]:
            continue
        reason = _impossible(arrangement, fit, int(k), needs)
        if reason is None and _rests_on_one_line(search, fit, int(k)):
            reason = "it rests on one line and its neighbours: interference rather than a resonance"
            spoilt += _lines_about(arrangement, f)
        if reason is None:
            kept.append(int(k))
            doubts.append(
                _doubt(arrangement, fit, int(k), witnesses, float(high[k]) / small)
                or _distortion(arrangement, fit, int(k), high)
            )
        else:
            refused.append(RefusedPole(f, zeta, reason))
    return Verdict(
        np.array(kept, dtype=np.int64),
        np.array([needs[k].evidence for k in kept]),
        tuple(doubts),
        tuple(refused),
        np.unique(np.array(spoilt, dtype=np.int64)),
    )


def _impossible(arrangement: Arrangement, fit: Fit, k: int, needs: dict[int, Need]) -> str | None:
    f, zeta = float(fit.terms.frequency_hz[k]), float(fit.terms.damping_ratio[k])
    sd = np.sqrt(np.maximum(np.diag(fit.parameter_covariance), 0))
    of_f, of_zeta = float(sd[k]), float(sd[fit.terms.pairs + k])
    if f < FIRST_LINES * arrangement.spacing_hz:
        return f"it lies within {FIRST_LINES:g} lines of 0 Hz, as drift and rigid-body motion do"
    if zeta > OVERDAMPED:
        return f"damping of {100 * zeta:.0f} % is a trend of the record, not a resonance"
    if k not in needs or needs[k].evidence < 1:
        return "it lowers the misfit by less than its unknowns are worth"
    if of_f > VAGUE_FREQUENCY or of_zeta > VAGUE_DAMPING * max(zeta, arrangement.spacing_hz / f):
        vague = f"± {100 * of_f:.1f} % in frequency, ± {100 * of_zeta / zeta:.0f} % of its damping"
        return f"the data hardly determine it ({vague})"
    seeing = _seen_in(fit, k)
    if len(seeing) < min(2, (len(arrangement.pairs) + 1) // 2):
        which = f"only {arrangement.label(seeing[0])} shows" if seeing else "no single FRF shows"
        return f"{which} it: a fault of that record rather than a mode of the structure"
    return None


def _doubt(arrangement: Arrangement, fit: Fit, k: int, witnesses: Witnesses, size: float) -> str | None:
    """Why a pole that pays may still be no mode, or None; `size` is its height over that of a hidden distortion."""
    need, again, stable = witnesses.needs[k], witnesses.again, float(witnesses.stable[k])
    f, zeta = float(fit.terms.frequency_hz[k]), float(fit.terms.damping_ratio[k])
    line = arrangement.spacing_hz
    low, high = arrangement.frequency_hz[[0, -1]]
    largest, share = shares(arrangement, fit, k)
    residues = fit.linear.coefficients[:, 2 * k] + 1j * fit.linear.coefficients[:, 2 * k + 1]
    collinear = phase_collinearity(residues)
    if need.ratio < _LARGE and need.evidence < _SURE:
        return (
            f"what it explains is {need.ratio:.1f} times the errors of the FRFs on its lines: a misfit may look like it"
        )
    few = len(arrangement.pairs) < _FEW_POINTS
    if (2 * share if few else min(largest, 2 * share)) < WEAK and need.evidence < _WEAK_PRICE:
        return f"it is weak, {100 * share:.0f} % of the FRFs at its own frequency"
    if not few and collinear < _COLLINEAR and need.ratio < _STRONG:
        return f"its shape is hardly that of a mode (modal phase collinearity {collinear:.2f})"
    if not again.found[k]:
        return f"{again.halves} do not both find it again ({again.words(k)})"
    if stable < _ORDERS and need.evidence < _WEAK_PRICE:
        return f"it is not stable: {100 * stable:.0f} % of the orders of the stabilisation diagram find it again"
    if not few and size < 1 and need.ratio < _CLEAR and need.evidence < _CLEAR_PRICE:
        return (
            f"it is small, {100 * size:.0f} % as high as a distortion of the largest mode that its own errors would hide, and"
            f" explains {need.ratio:.0f} times the errors of the FRFs: a weak non-linearity may look like it (it comes back in"
            f" {100 * stable:.0f} % of the orders)"
        )
    if 2 * zeta * f < _NARROW * line and (tone := _hum(arrangement, f)) is not None:
        return f"it is as narrow as a tone and lies at {tone:g} Hz, a multiple of the mains frequency"
    if min(f - low, high - f) < _EDGE * max(zeta * f, line) and need.evidence < _WEAK_PRICE:
        return "it lies at the end of the band, where half of its resonance is missing"
    return None


def _hum(arrangement: Arrangement, frequency_hz: float) -> float | None:
    """The multiple of the mains frequency that may look like a narrow pole, Hz, or None.

    It lies within half a line of the pole. A tone on a line of the transform is seen on that line and its neighbours alone,
    whatever the window, and a pole that rests on them is refused; so what is left to look like a resonance, with tails, is a
    tone between the lines.
    """
    line = arrangement.spacing_hz
    for base in MAINS_HZ:
        tone = base * round(frequency_hz / base)
        off = float(np.min(np.abs(arrangement.frequency_hz - tone)))
        if tone and abs(frequency_hz - tone) < line / 2 and off + _MAINS_WANDER * tone > _ON_A_LINE * line:
            return float(tone)
    return None


def _distortion(arrangement: Arrangement, fit: Fit, k: int, high: FloatArray) -> str | None:
    """Whether a pole is what a weak quadratic non-linearity makes of two higher modes, in words, or None.

    Joints and bearings that work answer modes i and j at f_i + f_j with the product of their shapes (Worden, Tomlinson 2001).
    """
    if len(arrangement.pairs) < _FEWEST_OF_A_PRODUCT:
        return None
    f, zeta = fit.terms.frequency_hz, fit.terms.damping_ratio
    pairs = fit.linear.coefficients[:, : 2 * fit.terms.pairs]
    residues = pairs[:, 0::2] + 1j * pairs[:, 1::2]
    above = np.flatnonzero(in_band(arrangement, f) & (high > high[k]) & (f < f[k]))
    for i, j in combinations_with_replacement(map(int, above), 2):
        near = abs(f[k] - f[i] - f[j]) < max(zeta[k] * f[k], arrangement.spacing_hz)
        if near and mac(residues[:, k], residues[:, i] * residues[:, j])[0, 0] > _PRODUCT:
            return (
                f"it lies at the sum of {f[i]:.2f} and {f[j]:.2f} Hz with the product of their shapes, as a weak non-linearity"
                " makes of them"
            )
    return None


def hidden_distortion(search: Search) -> float:
    """Height, over the largest mode's, up to which a distortion does not show at the large modes themselves: √ε.

    A weak quadratic spring of relative size κ, u'' + 2ζu' + u + κu² = p, answers at sums and multiples of natural frequencies
    with κ, to first order, and changes the response at these frequencies themselves with κ², to second order (Nayfeh and Mook
    1979, Nonlinear Oscillations, 4.2). The relative errors ε of the FRFs hide the latter as long as κ² < ε.
    """
    return float(np.sqrt(max(search.errors.relative, _LEAST_ERROR)))


def heights(arrangement: Arrangement, fit: Fit) -> FloatArray:
    """(n,) height of each resonance, all FRFs together, over that of the highest in the band."""
    residues = fit.linear.coefficients[:, : 2 * fit.terms.pairs]
    size = np.linalg.norm(residues[:, 0::2] + 1j * residues[:, 1::2], axis=0)
    f = fit.terms.frequency_hz
    high = size * f ** (arrangement.power - 1) / fit.terms.damping_ratio
    inside = in_band(arrangement, f)
    return np.asarray(high / max(float(high[inside].max(initial=0.0)), 1e-300))


def shares(arrangement: Arrangement, fit: Fit, k: int) -> tuple[float, float]:
    """Magnitude of the mode over that of the FRFs at the mode's own frequency: the largest of any FRF, and of all together."""
    omega = 2 * np.pi * fit.terms.frequency_hz[[k]]
    own = columns(omega, replace(fit.terms, exponents=(), decay=np.empty(0)), arrangement.power)[0, 2 * k : 2 * k + 2]
    line = int(np.argmin(np.abs(arrangement.omega - omega)))
    every = columns(arrangement.omega, fit.terms, arrangement.power)[line]
    whole = np.abs(fit.linear.coefficients @ every)
    mode = np.abs(fit.linear.coefficients[:, 2 * k : 2 * k + 2] @ own)
    return float(np.max(mode / np.maximum(whole, np.sqrt(fit.variance[:, line])))), float(
        np.linalg.norm(mode) / np.linalg.norm(whole)
    )


def _seen_in(fit: Fit, k: int) -> list[int]:
    """FRFs in which the residue of pole k pays for itself."""
    part = slice(2 * k, 2 * k + 2)
    c, V = fit.linear.coefficients[:, part], fit.linear.covariance[:, part, part]
    worth_of = np.einsum("ni,nij,nj->n", c, np.linalg.pinv(V, hermitian=True), c)
    return [int(r) for r in np.flatnonzero(worth_of > price(fit, len(c), 2, 2)[1] / len(c))]


def _rests_on_one_line(search: Search, fit: Fit, k: int) -> bool:
    """True where the pole, narrower than the lines lie apart, does not pay without the three lines nearest to it.

    A true resonance has tails that fall with the distance; a tone has what the window makes of it, three lines.
    """
    arrangement = search.arrangement
    f, zeta = float(fit.terms.frequency_hz[k]), float(fit.terms.damping_ratio[k])
    if 2 * zeta * f > arrangement.spacing_hz:
        return False
    variance = np.array(search.variance(None))
    variance[:, _lines_about(arrangement, f)] *= 1e12
    others = evaluate(arrangement, fit.terms, variance)
    return bool(loss(others)[0][k] < price(others, len(search.small.source.pairs), 2, 2)[1])


def _lines_about(arrangement: Arrangement, frequency_hz: float) -> list[int]:
    """Numbers of the three lines nearest to a frequency."""
    nearest = int(np.argmin(np.abs(arrangement.frequency_hz - frequency_hz)))
    return list(range(max(0, nearest - 1), min(nearest + 2, arrangement.frequency_hz.size)))
