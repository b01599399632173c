"""FRFs of simulated hammer hits against the exact modal ones; stated variance against the seen one; damping under windows.

The bodies and analysers of `benchmarks.hammer`, drawn at random, a third of
the hits with a fault. "on the point" has every hit where its grid point is, so that what is left is the processing's own error;
"2 mm beside" is what people hit, where the exact FRF of the point is not what was measured.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from benchmarks import hammer
from benchmarks.hammer import Bench, campaign, random_body, random_laboratory
from fecore.arrays import ComplexArray, FloatArray
from fecore.identification import identify
from fecore.signal import Hit, Processed, Processing, Windows, by_point, process, remove_window

POINTS, HITS, SEED = 6, 5, 31800
REPEATS, REPEATED = 40, 6
KINDS = ("clamped", "free", "plate")
RATES = (0.0, 0.5, 1.0, 3.0)
LOWEST_HZ = 10.0  # above the suspension


def main(campaigns: int = 18) -> None:
    """Print the tables."""
    print(
        f"{campaigns} campaigns of {POINTS} points, from {LOWEST_HZ:g} Hz to where the hammer has a tenth of its force"
    )
    print(
        f"{'hits':16}{'FRFs':>6}{'scale off: median':>19}{'worst':>8}{'1 - log-correlation: median':>29}{'worst':>9}",
        end="",
    )
    print(f"{'within':>8}")
    for name, spread in (("on the point", 0.0), ("2 mm beside", hammer.PLACE_SD_M)):
        with _places_within(spread):
            found = np.array([row for number in range(campaigns) for row in _against_exact(number)])
        scale, unlike = np.abs(found[:, 0] - 1), 1 - found[:, 1]
        within = np.mean((scale < 0.01) & (unlike < 0.001))
        print(f"{name:16}{len(found):6}{np.median(scale):19.3%}{scale.max():8.2%}", end="")
        print(f"{np.median(unlike):29.1e}{unlike.max():9.1e}{within:8.0%}", flush=True)
    print(
        f"\nstated variance over the seen one, {REPEATS} repetitions of four hits each (1 is right), median over the lines:"
    )
    print("  ".join(f"{ratio:.2f}" for ratio in (_variance_ratio(number) for number in range(REPEATED))))
    print(
        "\ndamping ratio over the true one, first two elastic modes, window rates of "
        + ", ".join(f"{r:g}" for r in RATES)
    )
    for number in range(4):
        print("  ".join(f"{ratio:.4f}" for ratio in _under_windows(number).ravel()))


@contextmanager
def _places_within(spread: float) -> Iterator[None]:
    before = hammer.PLACE_SD_M
    hammer.PLACE_SD_M = spread
    try:
        yield
    finally:
        hammer.PLACE_SD_M = before


def _against_exact(number: int) -> list[tuple[float, float]]:
    """Scale and log-correlation of each FRF of a campaign."""
    rng = np.random.default_rng(SEED + number)
    bench, places, simulated = campaign(rng, KINDS[number % 3], POINTS, HITS, 1 / 3)
    found = process(by_point([s.hit for s in simulated]))
    band = (found.frfs.frequency_hz > LOWEST_HZ) & (found.frfs.frequency_hz < found.excited_hz)
    rows = []
    for values, force in zip(found.frfs.values, found.frfs.references, strict=True):
        exact, measured = exact_frf(bench, places[force.point], found)[band], values[band]
        scale = abs(np.vdot(exact, measured) / np.vdot(exact, exact))
        rows.append((float(scale), float(np.corrcoef(np.log(np.abs(exact)), np.log(np.abs(measured)))[0, 1])))
    return rows


def exact_frf(bench: Bench, place: tuple[float, float], found: Processed) -> ComplexArray:
    """(L,) accelerance at s = iω + r, which an exponential window of the rate r makes of it."""
    s = 2j * np.pi * found.frfs.frequency_hz[:, None] + found.rate_per_s
    w, zeta = 2 * np.pi * bench.body.frequency_hz, bench.body.damping_ratio
    gains = bench.sensor * bench.body.shapes(place)
    return np.asarray((gains * s**2 / (w**2 + 2 * zeta * w * s + s**2)).sum(axis=1))


def _bench(number: int, **changes: float) -> Bench:
    rng = np.random.default_rng(SEED + 1000 + number)
    body = random_body(rng, KINDS[number % 3])
    laboratory = replace(random_laboratory(rng, 0.0), **changes)  # type: ignore[arg-type]  # fields of many types
    return Bench(body, laboratory, (0.96 * body.length_m, 0.45 * body.width_m), rng)


def _good(bench: Bench, places: Sequence[tuple[float, float]], hits: int) -> list[Hit]:
    return [bench.hit(label, place, n).hit for label, place in enumerate(places, 1) for n in range(1, hits + 1)]


def _variance_ratio(number: int) -> float:
    with _places_within(0.0):
        bench = _bench(number)
        place = (0.7 * bench.body.length_m, 0.3 * bench.body.width_m)
        windows = Processing(windows=Windows(40 / bench.laboratory.sample_rate_hz, 1.0))
        values, stated = [], []
        for _ in range(REPEATS):
            found = process(by_point(_good(bench, [place], 4)), windows)
            assert found.frfs.variance is not None, "four hits have one"
            values.append(found.frfs.values[0])
            stated.append(found.frfs.variance[0])
    excited = found.frfs.frequency_hz < found.excited_hz
    seen = np.var(values, axis=0, ddof=1)[excited]
    return float(np.median(np.mean(stated, axis=0)[excited] / seen))


def _under_windows(number: int) -> FloatArray:
    """(rates, 2) identified damping ratio over the true one, the window's part taken out."""
    bench = _bench(number, high_pass=False)
    places = [(x * bench.body.length_m, y * bench.body.width_m) for x in (0.15, 0.4, 0.65, 0.9) for y in (-0.4, 0.4)]
    hits = _good(bench, places, 3)
    length = 40 / bench.laboratory.sample_rate_hz
    elastic = bench.body.frequency_hz[bench.body.frequency_hz > 5]
    truth = bench.body.damping_ratio[bench.body.frequency_hz > 5][:2]
    band = (0.7 * elastic[0], (elastic[1] + elastic[2]) / 2)
    rows = []
    for rate in RATES:
        found = process(by_point(hits), Processing(windows=Windows(length, rate), band_hz=band))
        modes = identify(found.frfs).modes
        frequency, damping = remove_window(modes.frequency_hz, modes.damping_ratio, found.rate_per_s)
        rows.append([damping[np.argmin(np.abs(frequency - f))] for f in elastic[:2]])
    return np.array(rows) / truth
