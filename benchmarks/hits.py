"""Raw hammer hits of the bodies and analysers of `hammer`: what the judgement finds, and what
becomes of FRFs and damping.
"""

import zlib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from unittest.mock import patch

import numpy as np

from benchmarks.tables import Off, Table, beside, print_coverage
from fecore.arrays import FloatArray
from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import Specimen
from fecore.frf import Dof
from fecore.modal import Options, identify
from fecore.signal import Hit, Processing, Windows, by_point, process, remove_window
from fecore.signal.unstated import SeenRate, seen_rate
from fecore.updating.inputs import Inputs
from fecore.updating.measurement import Measurement, Recipe
from fecore.updating.pipeline import update
from fecore.updating.result import UpdateResult
from tests.support import hammer
from tests.support.habits import HABITS, HabitBench
from tests.support.hammer import (
    Bench,
    Body,
    Laboratory,
    Simulated,
    campaign,
    random_body,
    random_laboratory,
)

KINDS = ("clamped", "free", "plate")
NAMED = {"clip_force": "overload", "clip_response": "overload", "off_place": "place"}

try:
    from pyFRF import FRF
except ImportError:  # an optional peer
    FRF = None


def hits(campaigns: int = 12, seed: int = 20260) -> None:
    """Hits judged: good ones thrown away, bad ones missed, with five, three and two hits a point,
    beside pyFRF's check.
    """
    rng, every = (
        np.random.default_rng(seed),
        {count: Counter[tuple[str, str]]() for count in (5, 3, 2)},
    )
    for number in range(campaigns):
        _, places, simulated = campaign(rng, KINDS[number % 3], 8, 5, 1 / 3)
        for count, tally in every.items():
            some = [s for s in simulated if s.hit.number <= count]
            for one, found in zip(some, _judged(some, places), strict=True):
                fault = one.fault or "good"
                seen = {"hits": True, "found": found, "named": NAMED.get(fault, fault) in found}
                if FRF is not None and count == 5:
                    peer = FRF(
                        int(one.hit.sample_rate_hz),
                        exc_type="f",
                        resp_type="a",
                        fft_len=one.hit.samples,
                    )
                    seen["pyFRF"] = not peer.is_data_ok(
                        one.hit.force.samples, one.hit.responses[0].samples
                    )
                tally.update((name, fault) for name, true in seen.items() if true)
    faults, five = sorted(fault for name, fault in every[5] if name == "hits"), every[5]
    columns = "fault:16", "hits:d", "thrown away:.1%", "under its name:.1%", "pyFRF throws:.1%"
    table = Table(f"\n{campaigns} simulated campaigns", *columns)
    for fault in faults:
        thrown, named, peer = (
            five[name, fault] / five["hits", fault] for name in ("found", "named", "pyFRF")
        )
        shown = None if fault == "good" else named, None if FRF is None else peer
        table.row(fault, five["hits", fault], thrown, *shown)
    table = Table(
        "\nthrown away, by hits a point", "fault:16", *(f"{count}, of:14" for count in every)
    )
    for fault in faults:
        table.row(
            fault,
            *(f"{tally['found', fault]} of {tally['hits', fault]}" for tally in every.values()),
        )


def _judged(
    simulated: Sequence[Simulated], places: dict[int, tuple[float, float]]
) -> list[set[str]]:
    """Why each hit is refused; nothing where it is not."""
    positions = {label: (*place, 0.0) for label, place in places.items()}
    verdicts = process(
        by_point([s.hit for s in simulated]), Processing(positions=positions)
    ).verdicts
    return [{fault.criterion for fault in verdict.faults} for verdict in verdicts]


def hits_habits(campaigns: int = 3, seed: int = 5) -> None:
    """Good hits thrown away and faults found under the habits of instruments and hands, a tenth of
    the hits with a fault.
    """
    table = Table("", "habit:32", "good hits:d", "thrown away:.1%", "for:20", "faulty found:20")
    for habit in HABITS:
        rng = np.random.default_rng([seed, zlib.crc32(habit.encode())])
        made, found, reasons = (Counter[str]() for _ in range(3))
        for number in range(campaigns):
            _, places, simulated = campaign(
                rng, KINDS[number % 3], 8, 5, 0.1, make=partial(HabitBench, habit=habit)
            )
            for one, why in zip(simulated, _judged(simulated, places), strict=True):
                made[one.fault or "good"] += 1
                found[one.fault or "good"] += bool(why)
                reasons.update(why if one.fault is None else ())
        faults = ", ".join(
            f"{name} {found[name]}/{made[name]}" for name in sorted(made) if name != "good"
        )
        reason = ", ".join(f"{name} {count}" for name, count in sorted(reasons.items()))
        table.row(habit, made["good"], found["good"] / made["good"], reason, faults)


# --- accuracy -----------------------------------------------------------------------------------------------------------

SEED, LOWEST_HZ = 31800, 10.0  # above the suspension


def hits_accuracy(campaigns: int = 18, repeats: int = 40) -> None:
    """FRFs of hits against exact ones, stated variance against the seen one, damping under windows.

    "on the point" has every hit where its grid point is, so that what is left is the processing's
    own error; "2 mm beside" is what people hit, where the exact FRF of the point is not what was
    measured.
    """
    title = (
        f"{campaigns} campaigns of 6 points, from {LOWEST_HZ:g} Hz to where the hammer has a tenth"
        " of its force"
    )
    columns = (
        "scale off, median:.3%",
        "worst:.2%",
        "1 - log-correlation, median:.1e",
        "worst:.1e",
        "within:.0%",
    )
    table = Table(title, "hits:16", "FRFs:d", *columns)
    for name, spread in (("on the point", 0.0), ("2 mm beside", hammer.PLACE_SD_M)):
        with patch.object(hammer, "PLACE_SD_M", spread):
            found = np.array([row for number in range(campaigns) for row in _against_exact(number)])
        scale, unlike = np.abs(found[:, 0] - 1), 1 - found[:, 1]
        within = np.mean((scale < 0.01) & (unlike < 0.001))
        table.row(
            name, len(found), np.median(scale), scale.max(), np.median(unlike), unlike.max(), within
        )
    print(
        f"\nstated variance over the seen one, {repeats} repetitions of four hits (1 is right),"
        " median over the lines:"
    )
    print(
        "  ".join(f"{_variance_ratio(number, repeats):.2f}" for number in range(min(6, campaigns)))
    )
    rates = (0.0, 0.5, 1.0, 3.0)
    print(f"\ndamping ratio over the true one, first two elastic modes, window rates of {rates}")
    for number in range(min(4, campaigns)):
        print("  ".join(f"{ratio:.4f}" for ratio in _under_windows(number, rates).ravel()))


def _against_exact(number: int) -> Iterator[tuple[float, float]]:
    """Scale and log-correlation of each FRF of a campaign."""
    bench, places, simulated = campaign(
        np.random.default_rng(SEED + number), KINDS[number % 3], 6, 5, 1 / 3
    )
    found = process(by_point([s.hit for s in simulated]))
    band = (found.frfs.frequency_hz > LOWEST_HZ) & (found.frfs.frequency_hz < found.excited_hz)
    for values, force in zip(found.frfs.values, found.frfs.references, strict=True):
        exact = bench.accelerance(found.frfs.frequency_hz, places[force.point], found.rate_per_s)[
            band
        ]
        seen = values[band]
        scale = abs(np.vdot(exact, seen) / np.vdot(exact, exact))
        yield float(scale), float(np.corrcoef(np.log(np.abs(exact)), np.log(np.abs(seen)))[0, 1])


def _bench(number: int, **changes: float) -> Bench:
    rng = np.random.default_rng(SEED + 1000 + number)
    body = random_body(rng, KINDS[number % 3])
    laboratory = replace(random_laboratory(rng, 0.0), **changes)  # type: ignore[arg-type]  # fields of many types
    return Bench(body, laboratory, (0.96 * body.length_m, 0.45 * body.width_m), rng)


def _good(bench: Bench, places: Sequence[tuple[float, float]], hits: int) -> list[Hit]:
    """Good hits of places in shares of the body's length and width."""
    at = [(x * bench.body.length_m, y * bench.body.width_m) for x, y in places]
    return [
        bench.hit(label, place, n).hit
        for label, place in enumerate(at, 1)
        for n in range(1, hits + 1)
    ]


def _variance_ratio(number: int, repeats: int) -> float:
    with patch.object(hammer, "PLACE_SD_M", 0.0):
        bench = _bench(number)
        windows = Processing(windows=Windows(40 / bench.laboratory.sample_rate_hz, 1.0))
        every = [process(by_point(_good(bench, [(0.7, 0.3)], 4)), windows) for _ in range(repeats)]
    excited = every[-1].frfs.frequency_hz < every[-1].excited_hz
    seen = np.var([found.frfs.values[0] for found in every], axis=0, ddof=1)[excited]
    stated = np.mean(
        [found.frfs.variance[0] for found in every if found.frfs.variance is not None], axis=0
    )
    return float(np.median(stated[excited] / seen))


def _under_windows(number: int, rates: Sequence[float]) -> FloatArray:
    """(rates, 2) identified damping ratio over the true one, the window's part taken out."""
    bench = _bench(number, high_pass=False)
    hits = _good(bench, [(x, y) for x in (0.15, 0.4, 0.65, 0.9) for y in (-0.4, 0.4)], 3)
    elastic = bench.body.frequency_hz > 5
    true, ratio = bench.body.frequency_hz[elastic], bench.body.damping_ratio[elastic]
    band, rows = (0.7 * true[0], (true[1] + true[2]) / 2), []
    for rate in rates:
        windows = Windows(40 / bench.laboratory.sample_rate_hz, rate)
        found = process(by_point(hits), Processing(windows=windows, band_hz=band))
        modes = identify(found.frfs).modes
        frequency, damping = remove_window(
            modes.frequency_hz, modes.damping_ratio, found.rate_per_s
        )
        rows.append([damping[np.argmin(np.abs(frequency - f))] for f in true[:2]])
    return np.array(rows) / ratio[:2]


# --- damping ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class TwistedStrip(Body):
    """A body whose free ends twist as Saint-Venant's do: with the cosines of the length."""

    def shapes(self, place: tuple[float, float]) -> FloatArray:
        """(m,) mass-normalised shapes at x, y in m."""
        values, (x, y) = super().shapes(place), (place[0] / self.length_m, place[1] / self.width_m)
        for i, (k, j) in enumerate(self.orders):
            if self.kind == "free" and j == 1 and k > 0:
                values[i] = (
                    np.sqrt(2) * np.cos(k * np.pi * x) * np.sqrt(12) * y / np.sqrt(self.mass_kg)
                )
        return values


def hits_damping(draws: int = 20) -> None:
    """From hits on strips of beam theory to a0 and a1, as recorded and under a window of 2 per
    second.

    Truth and model are not the same: bending with shear and rotary inertia to first order, twisting
    by Saint-Venant, shapes of the slender beam; and every frequency is off by 0.2 %.
    """
    table = Table(
        "", "draw:4", "window 1/s:g", "a0 off:+.2%", "z:+.1f", "a1 off:+.2%", "z:+.1f", "verdict:12"
    )
    rows: dict[float, list[dict[str, Off]]] = {0.0: [], 2.0: []}
    for number in range(draws):
        rng = np.random.default_rng(52_000 + number)
        body, stated, law = _strip(rng, ("cantilever", "free")[number % 2])
        laboratory = random_laboratory(rng, 0.0)
        for rate, found in rows.items():
            drawn = replace(laboratory, window_rate_per_s=rate)
            result = _updated(body, stated, drawn, np.random.default_rng(number))
            offs = beside(result.parameters, dict(zip(("a0", "a1"), law, strict=True)))
            if not offs:
                print(
                    f"  {number}, {rate:g}: no damping: {'; '.join(result.warnings[:2])}",
                    flush=True,
                )
                continue
            found.append(offs)
            shown = [part for off in offs.values() for part in (off.share, off.z)]
            table.row(number, rate, *shown, result.verdict.level)
    groups = {
        f"{n}, window {r:g} 1/s": [offs[n] for offs in found]
        for r, found in rows.items()
        for n in ("a0", "a1")
    }
    print_coverage("", groups)


def hits_windows(draws: int = 40, hits: int = 45) -> None:
    """The rate of an exponential window that nobody stated, before a 16-bit converter and behind
    it, by the force's noise.
    """
    table = Table(
        "",
        "window:20",
        "noise, steps:g",
        "1/s:g",
        "not seen:d",
        "sd:.4f",
        "within 95 %:.0%",
        "largest z:.1f",
    )
    for first, noise in ((True, 1.3), (True, 0.8), (False, 1.3), (False, 0.3)):
        for rate in (0.0, 0.5, 1.0, 3.0):
            seen = [
                _window_seen(np.random.default_rng([53, k]), first, noise, rate, hits)
                for k in range(draws)
            ]
            sd = np.array([s.sd for s in seen if s.sd is not None])
            z = (np.array([s.rate_per_s for s in seen if s.sd is not None]) - rate) / sd
            most = np.median(sd), np.mean(np.abs(z) < 1.96), np.abs(z).max(initial=0.0)
            table.row(
                "before the converter" if first else "behind it", noise, rate, draws - len(z), *most
            )


def _window_seen(
    rng: np.random.Generator, first: bool, noise: float, rate: float, hits: int
) -> SeenRate:
    force, step = 65.0, 65e-3
    laboratory = replace(
        random_laboratory(rng, rate),
        sample_rate_hz=6400.0,
        samples=8192,
        pretrigger=160,
        tip_s=1e-3,
        high_pass=True,
        force_n=force,
        force_step=step,
        force_noise=noise * step,
        hum=2e-4,
        window_first=first,
    )
    bench = Bench(random_body(rng, "clamped"), laboratory, (0.1, 0.0), rng)
    made = [bench.hit(1, (0.2, 0.0), number).hit for number in range(1, hits + 1)]
    return seen_rate(
        [replace(hit, force=replace(hit.force, window_rate_per_s=0.0)) for hit in made]
    )


def _strip(rng: np.random.Generator, boundary: str) -> tuple[Body, Specimen, tuple[float, float]]:
    """A strip of beam theory, how it is stated (constants up to 15 % off, all else as it is), and
    its a0 and a1.
    """
    length = rng.uniform(0.3, 0.6)
    width, thickness, density = (
        length * rng.uniform(0.06, 0.1),
        length * rng.uniform(0.014, 0.022),
        rng.uniform(1500, 2100),
    )
    ex, gxy = rng.uniform(20e9, 45e9), rng.uniform(4e9, 8e9)
    gxz, clamped = 0.8 * gxy, boundary == "cantilever"
    roots = hammer.CLAMPED if clamped else hammer.FREE
    slender = roots**2 / (2 * np.pi * length**2) * np.sqrt(ex * thickness**2 / (12 * density))
    bending = slender / np.sqrt(
        1 + (roots * thickness / length) ** 2 / 12 * (1 + ex / (5 / 6 * gxz))
    )
    ratio = thickness / width
    polar = density * (width**2 + thickness**2) / 12 * width * thickness
    speed = np.sqrt(
        gxy * width * thickness**3 / 3 * (1 - 0.63 * ratio * (1 - ratio**4 / 12)) / polar
    )
    orders = np.arange(1, 7) - (0.5 if clamped else 0.0)
    modes = [(f, k + (1 if clamped else 2), 0) for k, f in enumerate(bending)]
    modes += [(speed * order / (2 * length), k, 1) for k, order in enumerate(orders, start=1)]
    # on soft cords
    modes += [] if clamped else [(rng.uniform(1, 3), *each) for each in ((0, 0), (1, 0), (0, 1))]
    modes.sort()
    f = np.array([mode[0] for mode in modes]) * (1 + 0.002 * rng.standard_normal(len(modes)))
    a0, a1 = np.exp(rng.uniform(np.log(3), np.log(25))), rng.uniform(1e-6, 6e-6)
    zeta = np.where(f < 5, 0.04, a0 / (4 * np.pi * f) + a1 * np.pi * f)
    kind, mass = "clamped" if clamped else "free", density * length * width * thickness
    body = TwistedStrip(kind, length, width, mass, f, zeta, tuple((k, j) for _, k, j in modes))
    off = np.exp(0.07 * rng.standard_normal(4))
    material = OrthotropicMaterial(
        ex * off[0], 0.9 * ex, gxy * off[1], gxz * off[2], gxz * off[2], 0.15, density
    )
    return body, Specimen(length, width, thickness, material, boundary), (a0, a1)  # type: ignore[arg-type]


def _updated(
    body: Body, stated: Specimen, laboratory: Laboratory, rng: np.random.Generator
) -> UpdateResult:
    """From hits, a third of them with a fault, to parameters, all by default."""
    shares = [(x, y) for x in (0.15, 0.3, 0.45, 0.6, 0.75, 0.9) for y in (-0.45, 0.4)]
    places = [(x * body.length_m, y * body.width_m) for x, y in [*shares, (0.97, 0.45)]]
    bench = Bench(body, laboratory, places[-1], rng)
    hits = [
        bench.hit(
            label, place, number, str(rng.choice(hammer.FAULTS)) if rng.random() < 1 / 3 else None
        ).hit
        for label, place in enumerate(places[:-1], start=1)
        for number in range(1, 5)
    ]
    points = {label: (x, y, 0.0) for label, (x, y) in enumerate(places, start=1)}
    processed = process(by_point(hits), Processing(positions=points))
    frfs = replace(
        processed.frfs, responses=tuple(Dof(len(points), 3) for _ in processed.frfs.responses)
    )
    band = (float(frfs.frequency_hz[0]), processed.strong_hz)
    inputs = Inputs(
        window_rate=processed.rate_per_s, window_rate_sd=processed.rate_sd_per_s, sensor_mass_sd=0.0
    )
    measurement = Measurement(frfs, points, inputs=inputs)
    return update(measurement, stated, Recipe(identification=Options(band_hz=band)))
