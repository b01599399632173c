"""Which poles of a series are needed: each is taken away in turn, and the others may move to stand in for it.

The evidence for a pole is that of the whole refined series against the refined series without it. What another pole can replace
by moving a little, a half of a mode that drifts between sessions or a wide pole on the chain's error, shows so; the gain at
fixed
poles does not show it. Poles that do not pay are dropped, least first.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from fecore.arrays import ComplexArray
from fecore.identification.arrangement import Arrangement
from fecore.identification.drift import session_of
from fecore.identification.error_model import memory
from fecore.identification.gains import Worth, evidence, in_band, pole_power, price
from fecore.identification.refinement import Fit, refine
from fecore.identification.search import Search
from fecore.identification.selection import same_pole, without_pole

_STEPS = 6  # of a trial without one pole
_SETTLE = 12  # steps of the fit that is left
_ENOUGH = 0.05  # of a pole's price: what a step of a trial must gain to be taken
_NEED = 2.0  # misfit without a pole over the errors: a pole beside another needs more, or it is a part of it
_SURE = 1.5  # ... and evidence in units of its price
_NEAR = 1.5  # summed half bandwidths within which two poles may be one mode
_NARROWER = 4.0  # ... which lie no further apart than so many half bandwidths of the narrower one (and a line)
_PLACE = 0.25  # of the distance between two poles: one that comes so near to where the other was has taken its place
_OWN_SHAPE = 0.8  # MAC of two poles within the sessions below which one is no split of the other
_FEW = 4  # FRFs of which the residues of two near poles cannot be distinguished
_REACH = 5.0  # ... and within which a dropped pole changes what the others are worth


@dataclass(frozen=True)
class Need:
    """How much a pole is needed.

    Attributes:
        evidence: twice the logarithm of the likelihood ratio, in units of the pole's price.
        misfit: mean square of the residual over the errors, on the lines of the pole, with it.
        misfit_without: ... and without it.
        without: the refined series without it.
    """

    evidence: float
    misfit: float
    misfit_without: float
    without: Fit

    @property
    def ratio(self) -> float:
        """How many times the errors the misfit is that the pole explains."""
        return self.misfit_without / max(1.0, self.misfit)


@dataclass(frozen=True)
class Sifted:
    """A series whose poles in band all pay, how much each is needed, and what was dropped (Hz, ratio, reason)."""

    fit: Fit
    needs: dict[int, Need]
    dropped: tuple[tuple[float, float, str], ...]


def sift(search: Search, fit: Fit, step: Callable[[], None]) -> Sifted:
    """Drop the poles in band that are not needed; `step` is called between the trials."""
    fit = refine(search.arrangement, fit.terms, search.variance(fit), steps=_SETTLE)
    needs: dict[int, Need] = {}
    dropped: list[tuple[float, float, str]] = []
    while True:
        for k in np.flatnonzero(in_band(search.arrangement, fit.terms.frequency_hz)):
            step()
            if int(k) not in needs:
                needs[int(k)] = need(search, fit, int(k))
        failing = {k: why for k in needs if (why := _fails(search, fit, k, needs[k]))}
        if not failing:
            return Sifted(fit, needs, tuple(dropped))
        worst = min(failing, key=lambda k: needs[k].evidence)
        terms = fit.terms
        dropped.append((float(terms.frequency_hz[worst]), float(terms.damping_ratio[worst]), failing[worst]))
        reach = _apart(search, fit, worst) > _REACH
        kept = {k - (k > worst): needs[k] for k in needs if k != worst and reach[k]}
        without = needs[worst].without
        fit = refine(search.arrangement, without.terms, search.variance(without), steps=_STEPS)
        needs = kept


def need(search: Search, fit: Fit, k: int) -> Need:
    """Refine the series without pole k and compare."""
    arrangement, records = search.arrangement, len(search.small.source.pairs)
    hz, zeta = fit.terms.frequency_hz[[k]], fit.terms.damping_ratio[[k]]
    far = _apart(search, fit, k) > _REACH
    steps = _STEPS if np.sum(~far) > 1 else 2
    bare = replace(fit.terms, held=fit.terms.held | far)
    enough = _ENOUGH * price(fit, records, 2, 2)[1]
    without = refine(arrangement, without_pole(bare, k), fit.variance, steps, enough)
    moved = np.insert(without.terms.frequency_hz, k, hz[0])
    replaced = np.abs(moved - hz[0]) < _PLACE * np.abs(fit.terms.frequency_hz - hz[0])
    # A pole that has taken the place of this one leaves its own: what is lost so is the other's worth.
    if replaced.any():
        bare = replace(bare, held=bare.held | replaced)
        without = refine(arrangement, without_pole(bare, k), fit.variance, steps, enough)
    power = pole_power(arrangement, hz, zeta)
    share = power[:, 0] / power.sum()
    with_it, without_it = (
        float(np.sum(np.abs(f.residual) ** 2 / f.variance, axis=0) @ share) / records for f in (fit, without)
    )
    scale = Worth(records, memory(fit.residual, fit.variance, arrangement.measured))
    gain = np.array([without.chi_squared - fit.chi_squared])
    pays = float(evidence(gain, arrangement, fit, power, scale, gained=True)[0])
    without = replace(without, terms=replace(without.terms, held=np.delete(fit.terms.held, k)))
    return Need(pays / price(fit, records, 2, 2)[1], with_it, without_it, without)


def _fails(search: Search, fit: Fit, k: int, need_of: Need) -> str | None:
    if need_of.evidence < 1:
        return "it lowers the misfit by less than its unknowns are worth"
    apart = np.where(in_band(search.arrangement, fit.terms.frequency_hz), _apart(search, fit, k), np.inf)
    apart[k] = np.inf
    nearest = int(np.argmin(apart))
    width = fit.terms.frequency_hz * fit.terms.damping_ratio
    off = abs(fit.terms.frequency_hz[k] - fit.terms.frequency_hz[nearest])
    if off > _NARROWER * min(width[k], width[nearest]) + search.arrangement.spacing_hz:
        return None
    weak = need_of.ratio < _NEED or need_of.evidence < _SURE
    if apart[nearest] < _NEAR and weak and not _is_another(search, fit, k, nearest):
        return _merged(float(fit.terms.frequency_hz[nearest]))
    return None


def _is_another(search: Search, fit: Fit, k: int, other: int) -> bool:
    """`has_own_shape` of two poles of a series that is fitted to combinations of the FRFs."""
    residues = _residues(fit, (k, other))
    whole = search.small.expand(residues.real.astype(complex)) + 1j * search.small.expand(residues.imag.astype(complex))
    return has_own_shape(search.small.source, whole)


def _merged(other_hz: float) -> str:
    return f"it is a part of the mode at {other_hz:.2f} Hz, split by drift or scatter between the FRFs: merged with it"


def _residues(fit: Fit, poles: tuple[int, ...]) -> ComplexArray:
    """(r, k) coefficients of some poles of a fit, as complex numbers."""
    at = 2 * np.array(poles)
    return np.asarray(fit.linear.coefficients[:, at] + 1j * fit.linear.coefficients[:, at + 1])


def has_own_shape(arrangement: Arrangement, residues: ComplexArray) -> bool:
    """Whether two near poles, with residues (N, 2), move the sensors of a session in different ratios.

    What drifts between sessions scales and turns the residues of a whole session alike: a half that splits off keeps the ratios
    within the session, u, so its residues (sessions, sensors) are c uᵀ with the mode's own u. Another mode has its own.
    """
    groups = session_of(arrangement)
    columns = np.zeros(groups.size, dtype=np.int64)
    for session in range(int(groups.max()) + 1):
        at = np.flatnonzero(groups == session)
        columns[at] = np.arange(at.size)
    if columns.max() == 0:
        return False
    shapes = []
    for own in residues.T:
        table = np.zeros((int(groups.max()) + 1, int(columns.max()) + 1), dtype=complex)
        table[groups, columns] = own
        shapes.append(np.linalg.svd(table, full_matrices=False)[2][0])
    return bool(np.abs(np.vdot(shapes[0], shapes[1])) ** 2 < _OWN_SHAPE)


def without_twins(search: Search, sifted: Sifted, arrangement: Arrangement, fit: Fit, drift: float) -> Sifted | None:
    """What is left where two poles have come together in the fit to all FRFs, as one mode without its drift does; else None.

    Args:
        search: combinations of the FRFs.
        sifted: the series that was fitted.
        arrangement: all FRFs.
        fit: the series fitted to them.
        drift: standard deviation of the sessions' relative drifts, 0 where there is none.
    """
    if len(arrangement.pairs) < _FEW:
        return None
    pair = same_pole(arrangement, fit) or _within_drift(arrangement, fit, drift)
    if pair is None:
        return None
    gone, kept = pair
    terms = sifted.fit.terms
    why = _merged(float(fit.terms.frequency_hz[kept]))
    merged = refine(search.arrangement, without_pole(terms, gone), search.variance(sifted.fit), steps=_SETTLE)
    needs = {k - (k > gone): each for k, each in sifted.needs.items() if k not in pair}
    kept -= kept > gone
    needs[kept] = need(search, merged, kept)
    dropped = (float(terms.frequency_hz[gone]), float(terms.damping_ratio[gone]), why)
    return Sifted(merged, needs, (*sifted.dropped, dropped))


def _within_drift(arrangement: Arrangement, fit: Fit, drift: float) -> tuple[int, int] | None:
    """(pole to drop, pole to keep) nearer to each other than the sessions drift, with the same shape within the sessions."""
    hz = fit.terms.frequency_hz
    order = np.argsort(hz)
    for low, high in pairwise(map(int, order)):
        if in_band(arrangement, hz[[low, high]]).all() and hz[high] - hz[low] < drift * hz[low]:
            residues = _residues(fit, (low, high))
            if not has_own_shape(arrangement, residues):
                size = np.linalg.norm(residues, axis=0)
                return (low, high) if size[0] < size[1] else (high, low)
    return None


def _apart(search: Search, fit: Fit, k: int) -> np.ndarray:
    """(n,) distance of each pole from pole k in their summed half bandwidths (and half a line)."""
    hz = fit.terms.frequency_hz
    width = hz * fit.terms.damping_ratio
    return np.asarray(np.abs(hz - hz[k]) / (width + width[k] + search.arrangement.spacing_hz / 2))
