"""Whether halves of the data find each pole again: halves of the FRFs, or of the lines where there are few FRFs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from fecore.arrays import BoolArray, FloatArray
from fecore.identification.compression import compress
from fecore.identification.error_model import ErrorModel
from fecore.identification.gains import in_band
from fecore.identification.orders import BROADER, MOVED
from fecore.identification.refinement import Fit, refine
from fecore.identification.search import Search

_FEWEST = 4  # FRFs that are parted; of fewer, the lines are
_STEPS = 6  # of the fit to a half


@dataclass(frozen=True)
class Again:
    """What two halves of the data make of each pole of a series.

    Attributes:
        halves: what was halved, in words.
        frequency_hz: (2, n) natural frequencies by halves.
        damping_ratio: (2, n) damping ratios by halves.
        found: (n,) True where both agree.
    """

    halves: str
    frequency_hz: FloatArray
    damping_ratio: FloatArray
    found: BoolArray

    def words(self, k: int) -> str:
        """Where the halves find pole k."""
        f, zeta = self.frequency_hz[:, k], 100 * self.damping_ratio[:, k]
        return f"{f[0]:.2f} Hz with {zeta[0]:.2f} % and {f[1]:.2f} Hz with {zeta[1]:.2f} %"


def halves(search: Search, fit: Fit) -> Again:
    """Refine the series on each half, from where the whole has it."""
    parts = [refine(half.arrangement, fit.terms, half.variance(fit), steps=_STEPS) for half in _parts(search, fit)]
    f = np.array([p.terms.frequency_hz for p in parts])
    zeta = np.array([p.terms.damping_ratio for p in parts])
    width = np.maximum((f * zeta).mean(axis=0), search.arrangement.spacing_hz / 2)
    same = (np.abs(f[0] - f[1]) < MOVED * width) & (zeta.max(axis=0) < BROADER * zeta.min(axis=0))
    inside = np.all(in_band(search.arrangement, f), axis=0)
    words = "halves of the lines" if len(search.small.source.pairs) < _FEWEST else "halves of the FRFs"
    return Again(words, f, zeta, np.asarray(same & inside))


@dataclass(frozen=True)
class _Half(Search):
    """A half, whose drift is taken from the series of the whole."""

    slopes: FloatArray | None = None

    def slope(self, fit: Fit) -> FloatArray:
        del fit  # the half's own series is not to be trusted with it
        assert self.slopes is not None
        return self.slopes


def _parts(search: Search, fit: Fit) -> Iterator[_Half]:
    source, errors = search.small.source, search.errors
    slope = search.slope(fit)
    rows = len(source.pairs)
    for first in (0, 1):
        if rows < _FEWEST:
            measured = search.arrangement.measured.copy()
            measured[:, 1 - first :: 2] = False
            values = np.where(measured, search.arrangement.values, 0)
            whole = replace(search.small, arrangement=replace(search.arrangement, measured=measured, values=values))
            yield _Half(whole, errors, slope)
            continue
        half = source.without(list(range(1 - first, rows, 2)))
        # the errors of the combinations, shared out to FRFs of one scale
        scale = np.mean(np.abs(half.values) ** 2, axis=1, keepdims=True) / np.mean(errors.level)
        noise, level = (scale * part.mean(axis=0) for part in (errors.noise, errors.level))
        small = compress(half, noise)
        lean = ErrorModel(small.squares(noise), small.squares(level), errors.relative, errors.drift)
        yield _Half(small, lean, small.squares(scale * slope.mean(axis=0)))
