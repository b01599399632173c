"""One record, one answer: the modes of overlapping bands, and of the two halves of the FRFs,
compared with those of the whole.

`python -m benchmarks calibrate agreement [words]`: made sets of `made_frfs`, and the open and
measured sets beside the project, those whose names contain a word. A mode with P >= 0.9 in one band
must have it in every other band that holds it, two per cent of the band from its ends on; this
needs no truth. Of each set the table gives the agreement of bands and of halves and the CPU seconds
of the whole, and names what differs.
"""

import itertools
import time
from collections.abc import Iterator, Sequence

import numpy as np

from benchmarks.made_frfs import GOOD, KINDS, Harsh
from benchmarks.tables import Table
from fecore.errors import IdentificationError
from fecore.frf import FrfSet
from fecore.modal import IdentifiedPoles, Options, identify
from tests.support.measured import with_coherence
from tests.support.places import SHARED

SURE = 0.9
# of the record: 2-200, 5-350, 10-400 Hz of 400 Hz
BANDS = ((0.005, 0.5), (0.0125, 0.875), (0.025, 1.0), (0.0, 1.0))
_EDGE = 0.02  # of a band at its ends, where a mode may be cut
# relative distance of two findings of one mode, or half a bandwidth where that is more
_NEAR = 0.004
_FEW = 4  # FRFs below which there are no halves
_SEEDS = (11, 12, 13)


def main(*words: str) -> None:
    """Print the table."""
    table = Table(
        "", "set:24", "FRFs:d", "lines:d", "modes:d", "bands:12", "halves:12", "CPU s:.2f"
    )
    total = np.zeros(4, dtype=int)
    for name, frfs in sets(words):
        total += _compared(name, frfs, table)
    print(f"agreement: bands {_share(total[:2])}, halves {_share(total[2:])}; the goal is 97 %")


def sets(words: Sequence[str]) -> Iterator[tuple[str, FrfSet]]:
    """Names with one of the words, of all where there are none, and FRFs: made ones, every other of
    a harsh laboratory, then those beside the project.
    """

    def meant(name: str) -> bool:
        return not words or any(word in name for word in words)

    for kind, seed in itertools.product(KINDS, _SEEDS):
        if kind != "quiet" and meant(f"{kind}-{seed}"):
            yield f"{kind}-{seed}", KINDS[kind](seed, Harsh.drawn(seed) if seed % 2 else GOOD).frfs
    beside = sorted((SHARED / "blind-open").glob("*.uff")) + sorted(
        (SHARED / "blind-open").glob("structures/*.uff")
    )
    for path in (
        *beside,
        SHARED / "measured" / "dam0.unv",
        SHARED / "uff-corpus" / "pyuff" / "measurement_v1.uff",
    ):
        if path.exists() and meant(path.stem):
            yield path.stem, with_coherence(path)


def _compared(name: str, frfs: FrfSet, table: Table) -> np.ndarray:
    """Modes that agree and all, of bands and then of halves; prints the row of the set."""
    end = float(frfs.frequency_hz[-1])
    bands = [(low * end, high * end) for low, high in BANDS]
    found = [_found(frfs, band) for band in bands]
    rows = len(frfs.responses)
    began = time.process_time()
    whole = _found(frfs, None)
    seconds = time.process_time() - began
    halves = (
        [_found(frfs.select(list(range(first, rows, 2))), None) for first in (0, 1)]
        if rows >= _FEW
        else []
    )
    limits = [(low + _EDGE * (high - low), high - _EDGE * (high - low)) for low, high in bands]
    pairs = itertools.permutations(zip(found, limits, strict=True), 2)
    by_band = [_missing(a, b, max(k[0], m[0]), min(k[1], m[1])) for (a, k), (b, m) in pairs]
    of_halves = (
        [_missing(a, b, 0, np.inf) for a, b in itertools.permutations([whole, *halves], 2)]
        if halves
        else []
    )
    counts = [sum(n for _, n in each) for each in (by_band, of_halves)]
    agree = [
        n - sum(len(m) for m, _ in each)
        for n, each in zip(counts, (by_band, of_halves), strict=True)
    ]
    modes = 0 if whole is None else int(np.sum(whole.probability >= SURE))
    shares = [_share(np.array(pair)) for pair in zip(agree, counts, strict=True)]
    table.row(name, rows, frfs.frequency_hz.size, modes, *shares, seconds)
    for title, each in (("bands", by_band), ("halves", of_halves)):
        if said := sorted({word for missing, _ in each for word in missing}):
            print(f"    {title} differ: {', '.join(said)}", flush=True)
    return np.array([agree[0], counts[0], agree[1], counts[1]])


def _found(frfs: FrfSet, band_hz: tuple[float, float] | None) -> IdentifiedPoles | None:
    try:
        return identify(frfs, Options(band_hz=band_hz)).found
    except IdentificationError:
        return None


def _missing(
    one: IdentifiedPoles | None, other: IdentifiedPoles | None, low: float, high: float
) -> tuple[list[str], int]:
    """Modes of one between limits that the other has not with P >= 0.9, in words; and how many
    there are in one.
    """
    if one is None:
        return [], 0
    f, zeta = one.modes.frequency_hz, one.modes.damping_ratio
    sure = np.flatnonzero((one.probability >= SURE) & (f > low) & (f < high))
    hz, p = (
        (np.empty(0), np.empty(0))
        if other is None
        else (other.modes.frequency_hz, other.probability)
    )
    missing = []
    for k in sure:
        near = np.abs(hz - f[k]) < max(_NEAR * f[k], zeta[k] * f[k])
        best = float(np.max(p[near], initial=0.0))
        if best < SURE:
            missing.append(
                f"{f[k]:.2f} Hz (ζ {100 * zeta[k]:.2g} %) {one.probability[k]:.2f}/{best:.2f}"
            )
    return missing, sure.size


def _share(pair: np.ndarray) -> str:
    return f"{pair[0]}/{pair[1]}" + (f" {100 * pair[0] / pair[1]:.0f} %" if pair[1] else "")
