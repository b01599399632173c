"""Which poles of a fitted series are modes, and what else must be told of them.

A pole is a mode when it lies in the band, is physical, is determined by the data, pays by the Bayesian criterion, and
would still pay without the line that it stands on. What fails is named with its reason, and is no mode.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from fecore.arrays import FloatArray, IntArray
from fecore.identification.arrangement import Arrangement
from fecore.identification.basis import columns
from fecore.identification.refinement import Fit, evaluate
from fecore.identification.result import RefusedPole
from fecore.identification.selection import in_band, price, worth
from fecore.identification.shapes import Shapes, residue_matrix

_OVERDAMPED = 0.6  # a pole damped more than this is a trend of the record, not a resonance
_FIRST_LINES = 3.0
_VAGUE_FREQUENCY = 0.03
_VAGUE_DAMPING = 0.5
_FEW_LINES = 2.0  # lines in the half-power bandwidth below which the damping is not resolved
_COMPLEX = 0.8  # modal phase collinearity below which a mode is called complex
_WEAK_PRICE = 10.0  # times the Bayesian price that a weak mode must be worth
_WEAK = 0.5  # share of an FRF at its own frequency below which a mode is called weak
_SECOND_SHAPE = 0.1  # second singular value of the residues over the first from which there are two modes
_UNEXPLAINED = 4.0  # mean square of the residual over the noise, over five lines, that is worth telling
_CLOSE = 1.5  # distance of two modes in their mean bandwidth from which their shapes mix little


@dataclass(frozen=True)
class Verdict:
    """Poles that are modes (indices into the terms, ascending in frequency), their significance, and the others.

    `spoilt` are the numbers of the lines that interference stands on.
    """

    kept: IntArray
    significance: FloatArray
    refused: tuple[RefusedPole, ...]
    spoilt: IntArray


def judge(arrangement: Arrangement, fit: Fit) -> Verdict:
    """Decide which poles of the series are modes."""
    terms = fit.terms
    n = terms.pairs
    sd = np.sqrt(np.maximum(np.diag(fit.parameter_covariance), 0))
    significance = worth(fit)[0] / price(fit, 2, 2)[1]
    kept, refused, spoilt = [], [], []
    for k in np.argsort(terms.frequency_hz):
        f, zeta = float(terms.frequency_hz[k]), float(terms.damping_ratio[k])
        if not in_band(arrangement, terms.frequency_hz[[k]])[0]:
            continue
        reason = None
        if f < _FIRST_LINES * arrangement.spacing_hz:
            reason = f"it lies within {_FIRST_LINES:g} lines of 0 Hz, as drift and rigid-body motion do"
        elif zeta > _OVERDAMPED:
            reason = f"damping of {100 * zeta:.0f} % is a trend of the record, not a resonance"
        elif significance[k] < 1:
            reason = "it lowers the misfit by less than its unknowns are worth"
        elif sd[k] > _VAGUE_FREQUENCY or sd[n + k] > _VAGUE_DAMPING * max(zeta, arrangement.spacing_hz / f):
            vague = f"± {100 * sd[k]:.1f} % in frequency, ± {100 * sd[n + k] / zeta:.0f} % of its damping"
            reason = f"the data hardly determine it ({vague})"
        elif len(seeing := _seen_in(fit, int(k))) < min(2, (len(arrangement.pairs) + 1) // 2):
            which = f"only {arrangement.label(seeing[0])} shows" if seeing else "no single FRF shows"
            reason = f"{which} it: a fault of that record rather than a mode of the structure"
        elif _rests_on_one_line(arrangement, fit, int(k)):
            reason = "it rests on one line and its neighbours: interference rather than a resonance"
            spoilt += _lines_about(arrangement, f)
        elif significance[k] < _WEAK_PRICE and _largest_share(arrangement, fit, int(k)) < _WEAK:
            reason = "it is weak in every FRF and hardly pays: more likely a misfit than a mode"
        if reason is None:
            kept.append(int(k))
        else:
            refused.append(RefusedPole(f, zeta, reason))
    chosen = np.array(kept, dtype=np.int64)
    return Verdict(chosen, significance[chosen], tuple(refused), np.unique(np.array(spoilt, dtype=np.int64)))


def remarks(arrangement: Arrangement, fit: Fit, verdict: Verdict, shapes: Shapes) -> list[str]:
    """What a user should know of the modes that were kept."""
    f, zeta = fit.terms.frequency_hz[verdict.kept], fit.terms.damping_ratio[verdict.kept]
    sd = np.sqrt(np.diag(fit.parameter_covariance))[fit.terms.pairs + verdict.kept]
    notes = []
    for k in range(f.size):
        name = f"mode {k + 1} ({f[k]:.2f} Hz)"
        lines = 2 * zeta[k] * f[k] / max(arrangement.spacing_hz, 1e-300)
        if lines < _FEW_LINES:
            notes.append(
                f"{name}: its half-power bandwidth covers {lines:.1f} lines, so its damping rests on the window and on"
                " leakage; measure with a finer line spacing"
            )
        if (share := _largest_share(arrangement, fit, int(verdict.kept[k]))) < _WEAK:
            notes.append(f"{name}: weak, at most {100 * share:.0f} % of any FRF at its own frequency")
        if shapes.collinearity[k] < _COMPLEX:
            notes.append(f"{name}: complex shape (modal phase collinearity {shapes.collinearity[k]:.2f})")
        if sd[k] > 0.1 * zeta[k]:
            notes.append(f"{name}: damping is known to ± {100 * sd[k] / zeta[k]:.0f} % only")
        if k and (f[k] - f[k - 1]) < _CLOSE * (zeta[k] * f[k] + zeta[k - 1] * f[k - 1]) / 2:
            notes.append(f"modes {k} and {k + 1} ({f[k - 1]:.2f} and {f[k]:.2f} Hz) overlap: a close pair")
    return notes + _rank_two(arrangement, fit, verdict) + _driving_points(arrangement, fit, verdict)


def _largest_share(arrangement: Arrangement, fit: Fit, k: int) -> float:
    """Largest magnitude of the mode in an FRF, at the mode's own frequency, over that FRF's magnitude there."""
    omega = 2 * np.pi * fit.terms.frequency_hz[[k]]
    own = columns(omega, replace(fit.terms, exponents=(), decay=np.empty(0)), arrangement.power)[0, 2 * k : 2 * k + 2]
    line = int(np.argmin(np.abs(arrangement.omega - omega)))
    whole = np.abs(fit.model(arrangement)[:, line])
    mode = np.abs(fit.linear.coefficients[:, 2 * k : 2 * k + 2] @ own)
    return float(np.max(mode / np.maximum(whole, np.sqrt(fit.variance[:, line]))))


def _seen_in(fit: Fit, k: int) -> list[int]:
    """FRFs in which the residue of pole k pays for itself."""
    part = slice(2 * k, 2 * k + 2)
    c, V = fit.linear.coefficients[:, part], fit.linear.covariance[:, part, part]
    worth_of = np.einsum("ni,ni->n", c, np.linalg.solve(V, c[:, :, None])[:, :, 0])
    return [int(r) for r in np.flatnonzero(worth_of > price(fit, 2, 2)[1] / len(c))]


def unexplained(arrangement: Arrangement, fit: Fit, rough: FloatArray) -> list[str]:
    """Where the residual of all FRFs together is far above the noise that their own roughness states."""
    square = np.where(arrangement.measured, np.abs(fit.residual) ** 2 / rough, 0.0).sum(axis=0)
    level = uniform_filter1d(square / np.maximum(arrangement.measured.sum(axis=0), 1), 5, mode="nearest")
    at: list[int] = []
    for line in np.argsort(-level)[:50]:
        if level[line] > _UNEXPLAINED and len(at) < 4 and all(abs(line - other) > 10 for other in at):
            at.append(int(line))
    if not at:
        return []
    where = ", ".join(f"{arrangement.frequency_hz[line]:g} Hz ({np.sqrt(level[line]):.1f} times)" for line in at)
    return [
        f"the residual stands above the noise near {where}: a mode that the lines do not separate, a non-linear one,"
        " leakage or interference; try a finer line spacing"
    ]


def _rests_on_one_line(arrangement: Arrangement, fit: Fit, k: int) -> bool:
    """True where the pole, narrower than the lines lie apart, does not pay without the three lines nearest to it.

    A true resonance has tails that fall with the distance; a tone has what the window makes of it, three lines.
    """
    f, zeta = float(fit.terms.frequency_hz[k]), float(fit.terms.damping_ratio[k])
    if 2 * zeta * f > arrangement.spacing_hz:
        return False
    variance = fit.variance.copy()
    variance[:, _lines_about(arrangement, f)] *= 1e12
    others = evaluate(arrangement, fit.terms, variance)
    return bool(worth(others)[0][k] < price(fit, 2, 2)[1])


def _lines_about(arrangement: Arrangement, frequency_hz: float) -> list[int]:
    """Numbers of the three lines nearest to a frequency."""
    nearest = int(np.argmin(np.abs(arrangement.frequency_hz - frequency_hz)))
    return list(range(max(0, nearest - 1), min(nearest + 2, arrangement.frequency_hz.size)))


def _rank_two(arrangement: Arrangement, fit: Fit, verdict: Verdict) -> list[str]:
    """Poles whose residues against several fixed dofs are not one shape: two modes at one frequency."""
    if len(arrangement.roving) * len(arrangement.fixed) != len(arrangement.pairs) or len(arrangement.fixed) < 2:
        return []
    residues, variance = fit.residues()
    size = np.sqrt(len(arrangement.roving)) + np.sqrt(len(arrangement.fixed))
    notes = []
    for number, k in enumerate(verdict.kept, start=1):
        singular = np.linalg.svd(residue_matrix(arrangement, residues[:, k]), compute_uv=False)
        noise = size * np.sqrt(np.mean(variance[:, k]))  # about the largest singular value of noise alone
        if singular[1] > 5 * noise and singular[1] > _SECOND_SHAPE * singular[0]:
            notes.append(
                f"mode {number} ({fit.terms.frequency_hz[k]:.2f} Hz): its residues against the fixed dofs are of rank two:"
                " two modes at one frequency, of which the stronger shape is given"
            )
    return notes


def _driving_points(arrangement: Arrangement, fit: Fit, verdict: Verdict) -> list[str]:
    """A driving point has positive modal masses; where most come out negative, one of its signs is wrong."""
    notes = []
    f, zeta = fit.terms.frequency_hz[verdict.kept], fit.terms.damping_ratio[verdict.kept]
    damped = 2 * np.pi * f * np.sqrt(1 - zeta**2)
    for row, (a, b) in enumerate(arrangement.pairs):
        if a != b:
            continue
        c = fit.linear.coefficients[row]
        modal = (2j * damped * (c[2 * verdict.kept] + 1j * c[2 * verdict.kept + 1])).real
        if modal.size and np.sum(modal[modal < 0]) < -0.5 * np.sum(np.abs(modal)):
            notes.append(
                f"driving point {arrangement.label(row)}: {int(np.sum(modal < 0))} of {modal.size} modes have a negative"
                " modal mass there, so the sign of hammer or sensor is wrong (a hit along -Z entered as +Z?); all shapes"
                " of this fixed dof are turned if it is the sensor, one entry if it is the hit"
            )
    return notes
