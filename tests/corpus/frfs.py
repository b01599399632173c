"""FRFs with the faults that measured ones have: no mode is lost, none is invented, and what may be
either is uncertain.
"""

import functools
import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.made_frfs import KINDS, Draw
from fecore.frf import Dof, FrfSet
from fecore.modal import Identification, Options, StatedPole, identify
from tests.corpus.outcomes import Case, Modes
from tests.support.beams import PAPER_HZ, paper_frfs
from tests.support.measured import with_coherence
from tests.support.places import shared_file

HZ, ZETA, LINES = np.array([101.3, 160.7]), np.array([0.01, 0.02]), 60 + np.arange(161.0)


def made(
    hz: np.ndarray = HZ,
    zeta: np.ndarray = ZETA,
    *,
    lines: np.ndarray = LINES,
    count: int = 12,
    shapes: np.ndarray | None = None,
    noise: float = 1e-3,
    more: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None,
) -> FrfSet:
    """Receptances of modes with random real shapes.

    Args:
        hz, zeta: (n,) of the modes.
        lines: (L,) in Hz.
        count: of the FRFs.
        shapes: (N, n), else drawn.
        noise: standard deviation of white noise, of the root mean square of all values.
        more: what is added, of the values and the lines.
    """
    rng = np.random.default_rng(3)
    shapes = rng.standard_normal((count, hz.size)) if shapes is None else shapes
    s, omega = 2j * np.pi * lines[:, None], 2 * np.pi * hz
    values = shapes @ (omega**2 / (s**2 + 2 * zeta * omega * s + omega**2)).T
    values = values if more is None else values + more(values, lines)
    white = np.random.default_rng(7).standard_normal((2, *values.shape)) / np.sqrt(2)
    values = values + noise * np.sqrt(np.mean(np.abs(values) ** 2)) * (white[0] + 1j * white[1])
    return FrfSet(
        lines,
        values,
        tuple(Dof(i + 1, 3) for i in range(count)),
        (Dof(99, 3),) * count,
        "receptance",
    )


def scaled(times: float) -> FrfSet:
    """One FRF so many times as large as it should be."""
    frfs = made()
    return replace(frfs, values=frfs.values * np.where(ONE_ROW, times, 1.0)[:, None])


def of_power(power: int, **others: Any) -> FrfSet:
    """Receptances of which one was multiplied by a power of iω, as if it were another quantity."""
    frfs = made(**others)
    s = (2j * np.pi * frfs.frequency_hz) ** power
    return replace(frfs, values=frfs.values * np.where(ONE_ROW[:, None], s, 1.0))


def sent_as_accelerance(sign: float = 1.0) -> Identification:
    """Receptances with a driving point, stated as accelerances, and perhaps of the wrong sign."""
    frfs = made(lines=1 + np.arange(220.0), shapes=PRODUCT * PRODUCT[0])
    s = (2j * np.pi * frfs.frequency_hz) ** (0 if sign > 0 else 2)
    references = (frfs.responses[0],) * 12
    return identify(
        replace(frfs, values=sign * s * frfs.values, references=references, quantity="accelerance")
    )


def stated(hz: float, zeta: float | None = None) -> Callable[[], Identification]:
    """A mode that hardly is above the noise, and a pole that a person states."""
    frfs = made(more=resonance(125.3, 0.01, PRODUCT[:, 0], 0.0015))
    return lambda: identify(frfs, Options(poles=(StatedPole(hz, zeta),)))


def resonance(
    hz: float, zeta: float, rows: Any, size: float
) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """A resonance in some rows, its peak a share of the largest value."""

    def add(values: np.ndarray, lines: np.ndarray) -> np.ndarray:
        peak = 2 * zeta * hz**2 / (hz**2 - lines**2 + 2j * zeta * hz * lines)
        return (
            size
            * np.abs(values).max()
            * np.multiply.outer(np.broadcast_to(rows, len(values)), peak)
        )

    return add


def tone(hz: float, size: float) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """A tone between the lines, of another phase in each FRF, as a window shows it."""

    def add(values: np.ndarray, lines: np.ndarray) -> np.ndarray:
        phase = np.exp(2j * np.pi * np.random.default_rng(11).random((len(values), 1)))
        return size * np.abs(values).max() * phase / (lines - hz + 0.05j)

    return add


ONE_ROW = np.arange(12) == 4
LOW, TO_200 = np.array([2.0, 2.6, 3.4, 22.0, 45.0, 77.0, 130.0]), 0.125 * np.arange(1, 1601)
TURNING = np.exp(2j * np.pi * np.arange(12) / 12)  # a shape without a phase of its own
PRODUCT = np.random.default_rng(3).standard_normal((12, 2))


def open_set(kind: str) -> tuple[FrfSet, Draw]:
    """An open set and its truth; of the aeroplane every other of its 74 hits, each at three
    sensors.
    """
    path = shared_file("BLIND_OPEN", "blind-open", f"real-like-{kind}.uff")
    modes = json.loads(path.with_suffix(".truth.json").read_text())["modes"]
    frfs = with_coherence(path)
    if kind == "aeroplane":
        frfs = frfs.select([i for i in range(222) if i // 3 % 2 == 0])
    f, zeta, optional = (
        np.array([mode[key] for mode in modes]) for key in ("f_hz", "zeta_seen", "suspension")
    )
    return frfs, Draw(
        frfs, f, zeta, residue=np.empty((f.size, 0)), optional=optional, distortions=np.empty(0)
    )


def true_to(draw: Draw, found: Identification, *, says: str = "") -> None:
    """Every mode that must be there is a mode, f within 0.2 %, ζ within 10 % or its 95 % interval;
    and there is no other.
    """
    f, zeta, sd = found.modes.frequency_hz, found.modes.damping_ratio, found.modes.damping_sd
    for true, ratio in zip(
        draw.frequency_hz[~draw.optional], draw.zeta[~draw.optional], strict=True
    ):
        near = np.flatnonzero(np.abs(f / true - 1) < 0.002)
        assert near.size, f"{true:.2f} Hz is lost; found {f}"
        assert np.any(np.abs(zeta[near] - ratio) < np.maximum(0.1 * ratio, 1.96 * sd[near])), (
            f"damping at {true:.2f} Hz"
        )
    first = draw.frequency_hz[~draw.optional][0]
    assert all(np.min(np.abs(each / draw.frequency_hz - 1)) < 0.05 for each in f[f < first])
    assert np.sum(f > 0.98 * first) == np.sum(~draw.optional), f"invented among {f}"
    assert says in "\n".join(found.warnings)


@functools.cache
def drawn(kind: str, seed: int) -> Draw:
    return KINDS[kind](seed)


def of_draw(kind: str, seed: int, *, conjugated: bool = False, **expected: str) -> Case:
    def run() -> Identification:
        frfs = drawn(kind, seed).frfs
        return identify(frfs.conjugated() if conjugated else frfs)

    return run, lambda found: true_to(drawn(kind, seed), found, **expected)


def of_open_set(kind: str) -> Case:
    return lambda: (open_set(kind)[1], identify(open_set(kind)[0])), lambda both: true_to(*both)


def half_of_the_numbers(part: str) -> Callable[[], Identification]:
    frfs = paper_frfs(0.01, 3)
    only = getattr(frfs.values, part) * (1 if part == "real" else 1j)
    return lambda: identify(replace(frfs, values=only.astype(complex)))


def measured_bridge(*band_hz: float) -> Case:
    """The FRFs of a bridge that somebody measured, in a band that holds its six modes below 6
    Hz.
    """

    def found() -> Identification:
        frfs = with_coherence(shared_file("MEASURED", "measured", "dam0.unv"))
        return identify(frfs, Options(band_hz=band_hz or None))

    return found, modes_of_the_measured_bridge


def every_fourth_line() -> Identification:
    """The same with modes less than a line wide and four lines apart."""
    frfs = with_coherence(shared_file("MEASURED", "measured", "dam0.unv"))
    variance = None if frfs.variance is None else frfs.variance[:, ::4]
    return identify(
        replace(
            frfs,
            frequency_hz=frfs.frequency_hz[::4],
            values=frfs.values[:, ::4],
            measured=frfs.measured[:, ::4],
            variance=variance,
        )
    )


def modes_of_the_measured_bridge(found: Identification, rel: float = 0.002) -> None:
    f = found.modes.frequency_hz
    for true in (2.482, 2.958, 3.497, 4.081, 4.166, 4.632):
        assert np.sum(np.abs(f / true - 1) < rel) == 1
    assert np.sum(f < 6) == 6  # above, there are resonances of which nobody knows what they are


@functools.cache
def long_record() -> Draw:
    return KINDS["aeroplane"](3, points=74, sensors=3)


def drifting() -> Identification:
    """Seventy-four draws of one sensor, between which the frequencies drift."""
    rows = [i for i in range(222) if i % 3 == 0]
    return identify(long_record().frfs.select(rows).band(40.0, 130.0))


def without_drift(found: Identification) -> None:
    # 74 draws: ± 8 %, and drift beside the errors of the chain
    assert abs(found.drift / 3e-4 - 1) < 0.25
    assert any("drift" in warning for warning in found.warnings)
    draw, modes = long_record(), found.modes
    inside = np.flatnonzero((draw.frequency_hz > 40) & (draw.frequency_hz < 130))
    at = [int(np.argmin(np.abs(modes.frequency_hz - draw.frequency_hz[k]))) for k in inside]
    ratio = draw.zeta[inside]
    # a drift left in makes it 2 to 10 % too large
    assert np.all(np.abs(modes.damping_ratio[at] / ratio - 1) < 0.02)
    z = (modes.frequency_hz[at] - draw.frequency_hz[inside]) / modes.frequency_sd_hz[at]
    z = np.append(z, (modes.damping_ratio[at] - ratio) / modes.damping_sd[at])
    assert np.mean(np.abs(z) < 1.96) >= 0.85  # of 95 % intervals, few of them


def one_frf(threshold: float = 0.9) -> Identification:
    return identify(paper_frfs(0.01, 6).select([0]), Options(threshold=threshold))


def modes_of_one_frf(found: Identification) -> None:
    """At the root the first mode, of 16 % damping, is within the errors of its lines; the others
    are clear.
    """
    assert np.allclose(found.found.modes.frequency_hz[-4:], PAPER_HZ[1:], rtol=0.01)
    assert len(found.chosen(include_doubtful=True).modes) == len(found.found.modes)


def stopped() -> None:
    """A run ends with what its report raises, and reports a share that grows."""
    shares: list[float] = []

    def report(stage: str, share: float) -> None:
        assert stage
        assert share >= max(shares, default=0.0)
        shares.append(share)
        if share > 0.3:
            raise InterruptedError

    try:
        identify(drawn("bridge", 5).frfs, report=report)
    except InterruptedError:
        assert len(shares) > 3
        return
    raise AssertionError("it went on")


def beside_the_mains(stretch: float = 1.0) -> Callable[[], Identification]:
    """Lines 1.25 Hz apart: a hum of 100 Hz lies on one of them and has no tails, so what has tails
    is a mode.
    """
    rng = np.random.default_rng(2)
    hz, f = np.arange(1.25, 400.0, 1.25), np.array([100.5, 180.0, 290.0])
    s, w = 2j * np.pi * hz, 2 * np.pi * f[:, None]
    values = rng.standard_normal((10, 3)) @ (s**2 / (s**2 + 0.003 * w * s + w**2))
    values = values + 0.02 * (
        rng.standard_normal(values.shape) + 1j * rng.standard_normal(values.shape)
    )
    frfs = FrfSet(hz * stretch, values, tuple(Dof(i + 1, 3) for i in range(10)), (Dof(99, 3),) * 10)
    return lambda: identify(frfs)


THREE, NARROW, BETWEEN = (
    np.array([70.0, 90.0, 160.0]),
    np.array([0.01, 0.0015]),
    60.3 + np.arange(161.0),
)
OWN = np.column_stack([PRODUCT, 0.02 * np.random.default_rng(9).standard_normal(12)])


def overloads(values: np.ndarray, _: np.ndarray) -> np.ndarray:
    """Nine lines of one record, a hundred times as high as their neighbours."""
    high = np.zeros(values.shape, dtype=complex)
    high[0, 10:145:16] = 100 * values[0, 10:145:16]
    return high


def leak(values: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """Drift of each record, as its leakage shows it."""
    return (
        2
        * np.abs(values).max()
        / lines**2
        * np.random.default_rng(1).standard_normal((len(values), 1))
    )


# fmt: off
FRFS: dict[str, Case] = {
    "without noise": (lambda: identify(made(noise=0.0)), Modes(HZ, zeta=ZETA, rel=1e-6)),
    "noise alone": (lambda: identify(made(noise=1e5)), "no mode is supported by the 12 FRFs from 60 to 220 Hz"),
    "a resonance of one record": (lambda: identify(made(more=resonance(125.3, 0.01, ONE_ROW, 0.3))), Modes(
        HZ, doubtful=[(125.3, "the FRF that shows it best has 99 % of it")], says=["125.30 Hz): 5Z/99Z alone shows it"])),
    "a resonance in one of two": (
        lambda: identify(made(count=2, more=resonance(125.3, 0.01, [0, 1], 0.3))), Modes([101.3, 125.3, 160.7])),
    "a shape without a phase": (lambda: identify(made(more=resonance(125.3, 0.01, TURNING, 0.02))), Modes(
        HZ, doubtful=[(125.3, "neither a mode's nor clear")], says=["125.30 Hz): complex shape"])),
    "a weak mode": (lambda: identify(made(more=resonance(125.3, 0.01, PRODUCT[:, 0], 0.003))), Modes(
        HZ, doubtful=[(125.3, "it is 6 % of the FRFs at its frequency")], says=["125.31 Hz): weak"])),
    "a mode in the noise": (lambda: identify(made(more=resonance(125.3, 0.01, PRODUCT[:, 0], 0.0015))), Modes(HZ)),
    "a tone between lines": (
        lambda: identify(made(lines=BETWEEN, more=tone(150.0, 0.02))), Modes(HZ, says=["150.3 Hz left out"])),
    "as narrow as a tone": (lambda: identify(made(np.array([101.3, 150.1]), NARROW, lines=BETWEEN)), Modes([101.3, 150.1])),
    "narrow, and the mains on a line": (beside_the_mains(), Modes([100.5, 180.0, 290.0], rel=1e-3)),
    "narrow, and the mains beside a line": (beside_the_mains(300.2 / 290.0), Modes(
        300.2 / 290.0 * np.array([100.5, 180.0, 290.0]), rel=1e-3)),
    "beyond the band": (lambda: identify(made(np.array([101.3, 220.2]), np.full(2, 0.01))), Modes([101.3])),
    "at the band's end": (lambda: identify(made(np.array([101.3, 219.6]), np.full(2, 0.01))), Modes([101.3, 219.6])),
    "many overloads": (lambda: identify(made(more=overloads)), Modes(HZ, zeta=ZETA, says=["1 more such lines were left out"])),
    "drift of the records": (lambda: identify(made(lines=1 + np.arange(220.0), more=leak)), Modes(HZ, zeta=ZETA)),
    "a quadratic spring": (lambda: identify(KINDS["squared"](1).frfs), Modes([22.45, 37.36, 43.26, 60.62])),
    "a mode at the sum of two": (lambda: identify(made(THREE, np.full(3, 0.01), shapes=OWN)), Modes(THREE)),
    "a trend": (lambda: identify(made(zeta=np.array([0.01, 0.65]))), Modes([101.3])),
    "a heavily damped mode": (lambda: identify(made(zeta=np.array([0.01, 0.16]))), Modes(HZ, zeta=[0.01, 0.16])),
    "a close pair": (lambda: identify(made(np.array([101.3, 102.0, 160.7]), np.array([0.01, 0.01, 0.02]))), Modes(
        [101.3, 102.0, 160.7], rel=2e-4, says=["overlap: a close pair"])),
    "three modes in the lowest 2 % of a band": (lambda: identify(made(LOW, np.full(LOW.size, 0.01), lines=TO_200)), Modes(
        LOW, rel=2e-3)),
    "one FRF of another scale": (lambda: identify(scaled(1e9)), Modes(
        HZ, zeta=ZETA, says=["FRF 5Z/99Z was not used: is 3.7e+09 times as large as most FRFs"])),
    "one FRF in mV for V": (lambda: identify(scaled(1e3)), Modes(
        HZ, zeta=ZETA, says=["FRF 5Z/99Z was not used: is 3.7e+03 times as large as most FRFs: another unit (mV for V)"])),
    "one FRF an accelerance among receptances": (lambda: identify(of_power(2)), Modes(
        HZ, zeta=ZETA, says=[
            "5Z/99Z was not used: is 1.6e+06 times as large as most FRFs, and rises with ω² beside them: accelerance"])),
    "one FRF a mobility among receptances": (lambda: identify(of_power(1)), Modes(
        HZ, zeta=ZETA, says=["rises with ω beside them: mobility stated as receptance"])),
    "two modes of mobilities stated as receptances": (
        lambda: identify(replace(made(), values=made().values * 2j * np.pi * LINES)), Modes(
            HZ, zeta=ZETA, says=["the residues of all strong poles are turned by 90°"])),
    "receptances stated as accelerances": (sent_as_accelerance, Modes(
        HZ, zeta=ZETA, says=["which are 1/k: receptance stated as accelerance"])),
    "accelerances of the wrong sign": (lambda: sent_as_accelerance(-1.0), Modes(
        HZ, zeta=ZETA, says=["so the sign of hammer or sensor is wrong"])),
    "a pole that is stated": (stated(125.0), Modes([101.3, 125.3, 160.7], says=["the pole at 125.32 Hz was stated"])),
    "a pole stated where there is none": (stated(99.0, 0.02), "the FRFs hold no pole of its own at 99 Hz"),
    "a pole stated beyond the lines": (stated(300.0), "poles.0.frequency_hz: is 300, outside the lines, 60 to 220 Hz"),
    "no imaginary part": (half_of_the_numbers("real"), "no FRF is usable: 33Z/1Z has no imaginary part"),
    "no real part": (half_of_the_numbers("imag"), "no FRF is usable: 33Z/1Z has no real part"),
    "one FRF": (one_frf, modes_of_one_frf),
    "one FRF, nothing certain": (lambda: one_frf(threshold=1 - 1e-9), modes_of_one_frf),
    "one FRF, no mode chosen": (lambda: one_frf(threshold=1 - 1e-9).chosen(), "all modes that the data show are uncertain ("),
    "stopped on the way": (stopped, lambda _: None),
    "records that drift": (drifting, without_drift),
    "plate": of_draw("plate", 7),
    "bridge, conjugated": of_draw("bridge", 7, conjugated=True, says="the FRFs are conjugates"),
    **{f"open {kind}": of_open_set(kind) for kind in ("bridge", "plate", "aeroplane")},
    **{f"a measured bridge, {band or 'all lines'}": measured_bridge(*band)
       for band in ((), (0.4, 6.0), (2.0, 8.0))},
    "a measured bridge, every fourth line": (
        every_fourth_line, functools.partial(modes_of_the_measured_bridge, rel=0.004)),
}
