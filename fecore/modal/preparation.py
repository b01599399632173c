"""FRFs as they come, to what modes can be sought in: what can be used, with a noise that the
records bear out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fecore.arrays import FloatArray
from fecore.findings import Finding
from fecore.frf import FrfSet
from fecore.modal.arrangement import FEW, Arrangement
from fecore.modal.findings import finding
from fecore.modal.leakage import leakage
from fecore.modal.noise import excess, scatter_of
from fecore.modal.screening import Refused, screen

# stated noise over the scatter of lines from which most of it is alike on neighbouring lines
_ALIKE_ON_LINES = 4.0


@dataclass(frozen=True)
class Prepared:
    """FRFs to seek modes in."""

    arrangement: Arrangement  # the FRFs that can be used, without what leaked from below the band
    # (N, L) variance of their noise, as stated where it is, and as seen from line to line elsewhere
    noise: FloatArray
    refused: tuple[Refused, ...]  # FRFs that cannot be used
    # what the screening has to say of all FRFs, and then of the noise and the leakage
    notes: tuple[Finding, ...]


def prepare(frfs: FrfSet | Sequence[FrfSet], band_hz: tuple[float, float] | None) -> Prepared:
    """Screen FRFs, and find out how large their noise is.

    Args:
        frfs: of one campaign: one set, or several with different axes or quantities.
        band_hz: lines to use; all where None.

    Raises:
        InputError: the FRFs cannot be read as such.
        IdentificationError: none of them can be used.
    """
    screened = screen(frfs, band_hz)
    arrangement, left_out = leakage(screened.arrangement)
    scatter = scatter_of(arrangement)
    arrangement, doubts = _doubt_variance(arrangement, scatter)
    arrangement = _of_lines(arrangement, scatter)
    notes = (*screened.notes, *doubts, *left_out)
    return Prepared(arrangement, _known_or(arrangement, scatter), screened.refused, notes)


def noise_of(arrangement: Arrangement) -> FloatArray:
    """(N, L) variance of the noise: as stated where it is, and as seen from line to line
    elsewhere.
    """
    return _known_or(arrangement, scatter_of(arrangement))


def _known_or(arrangement: Arrangement, scatter: FloatArray) -> FloatArray:
    return np.where(np.isfinite(arrangement.variance), arrangement.variance, scatter)


def _doubt_variance(
    arrangement: Arrangement, scatter: FloatArray
) -> tuple[Arrangement, list[Finding]]:
    """Enlarge a stated noise that the records themselves contradict by more than a factor 2, and
    say so.

    Coherence that was averaged over few hits, or stated for the wrong estimator, is often too good
    by far.
    """
    factor = excess(arrangement.variance, scatter, arrangement.measured)
    factor = np.where(factor > 2, factor, 1.0)
    if np.all(factor == 1):
        return arrangement, []
    worst = int(np.argmax(factor))
    note = finding(
        "noise_understated",
        count=int(np.sum(factor > 1)),
        frf=arrangement.label(worst),
        times=np.sqrt(factor[worst]),
    )
    return replace(arrangement, variance=arrangement.variance * factor[:, None]), [note]


def _of_lines(arrangement: Arrangement, scatter: FloatArray) -> Arrangement:
    """The stated noise, no larger than what changes from line to line, where there are FRFs enough
    to learn other errors.

    Hits beside the point scatter from hit to hit, but alike on all lines of a resonance: that is no
    noise of a line. The residues take it up, and as noise it would hide one line and overrate the
    next. Its size is learnt with the relative error.
    """
    with np.errstate(invalid="ignore"):
        over = arrangement.variance[arrangement.measured] / scatter[arrangement.measured]
    over = over[np.isfinite(over)]
    if len(arrangement.pairs) < FEW or not over.size or np.median(over) < _ALIKE_ON_LINES:
        return arrangement
    # NaN, not known, stays so
    return replace(arrangement, variance=np.minimum(arrangement.variance, scatter))
