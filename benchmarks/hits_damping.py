"""Time blocks of strips to a0 and a1: how far off on average, with and without an exponential window.

Clamped and free strips of beam theory, of other size, stiffness and damping in
each draw, in analysers drawn at random (`benchmarks.hammer`), hit 2 mm beside the points, a third of the hits with a fault.
Each draw is processed and updated by the default choices twice: as recorded, and as an analyser with a window of 2 per second
records it.
Truth and model are not the same: bending with shear and rotary inertia to first order, twisting by Saint-Venant, shapes of
the slender beam; and every frequency is off by 0.2 %.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from benchmarks.hammer import CLAMPED, FAULTS, FREE, Bench, Body, Laboratory, random_laboratory
from fecore.arrays import FloatArray
from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import Specimen
from fecore.frf import Dof
from fecore.identification import Options
from fecore.signal import Processing, by_point, process
from fecore.updating.inputs import Inputs
from fecore.updating.measurement import Measurement
from fecore.updating.pipeline import update
from fecore.updating.recipe import Recipe
from fecore.updating.result import ParameterEstimate, UpdateResult

DRAWS, SEED, HITS = 20, 52_000, 4
RATES = (0.0, 2.0)
FREQUENCY_ERROR = 0.002


@dataclass(frozen=True)
class TwistedStrip(Body):
    """A body whose free ends twist as Saint-Venant's do: with the cosines of the length."""

    def shapes(self, place: tuple[float, float]) -> FloatArray:
        """(m,) mass-normalised shapes at x, y in m."""
        values = super().shapes(place)
        if self.kind == "free":
            x, y = place[0] / self.length_m, place[1] / self.width_m
            for i, (k, j) in enumerate(self.orders):
                if j == 1 and k > 0:
                    values[i] = np.sqrt(2) * np.cos(k * np.pi * x) * np.sqrt(12) * y / np.sqrt(self.mass_kg)
        return values


@dataclass(frozen=True)
class Strip:
    """A body, what its laboratory states of it, and its damping law."""

    body: Body
    stated: Specimen
    a0: float
    a1: float


def main(draws: int = DRAWS) -> None:
    """Print the table."""
    print("draw  window   a0 off   sd   held     a1 off   sd   held   verdict")
    rows = [row for number in range(draws) for row in _both(number)]
    for rate in RATES:
        off = np.array([found for own, found in rows if own == rate])
        print(f"\nwindow of {rate:g} per second, {len(off)} draws:")
        for k, name in enumerate(("a0", "a1")):
            e, sd, held = off[:, 3 * k], off[:, 3 * k + 1], off[:, 3 * k + 2]
            bias, error, rms = e.mean(), e.std(ddof=1) / np.sqrt(len(e)), np.sqrt((e**2).mean())
            print(f"  {name}: bias {bias:+.2%} ± {error:.2%}, median {np.median(e):+.2%}, rms {rms:.2%}", end="")
            print(f", rms of error over sd {np.sqrt(((e / sd) ** 2).mean()):.2f}, in 95 % intervals {held.mean():.0%}")


def _both(number: int) -> list[tuple[float, list[float]]]:
    rng = np.random.default_rng(SEED + number)
    strip = draw(rng, ("cantilever", "free")[number % 2])
    laboratory = random_laboratory(rng, 0.0)
    found = []
    for rate in RATES:
        result = _updated(strip, replace(laboratory, window_rate_per_s=rate), np.random.default_rng(number))
        own = {p.name: p for p in result.parameters}
        if "a0" not in own:
            print(f"{number:4}{rate:8g}   no damping: {'; '.join(result.warnings[:2])}", flush=True)
            continue
        row = [each for name, true in (("a0", strip.a0), ("a1", strip.a1)) for each in _compared(own[name], true)]
        found.append((rate, row))
        print(f"{number:4}{rate:8g}{row[0]:+9.2%}{row[1]:7.2%}{row[2]:5.0f}", end="")
        print(f"{row[3]:+11.2%}{row[4]:7.2%}{row[5]:5.0f}   {result.verdict.level}", flush=True)
    return found


def _compared(parameter: ParameterEstimate, true: float) -> tuple[float, float, float]:
    """Relative error, relative standard deviation, and whether the interval holds the truth."""
    low, high = parameter.interval_95
    return parameter.estimate / true - 1, parameter.standard_deviation / true, float(low <= true <= high)


def draw(rng: np.random.Generator, boundary: str) -> Strip:
    """A strip of beam theory, and how it is stated: constants up to 15 % off, all else as it is."""
    length = rng.uniform(0.3, 0.6)
    width, thickness, density = (
        length * rng.uniform(0.06, 0.1),
        length * rng.uniform(0.014, 0.022),
        rng.uniform(1500, 2100),
    )
    ex, gxy = rng.uniform(20e9, 45e9), rng.uniform(4e9, 8e9)
    gxz, nu = 0.8 * gxy, 0.15
    roots = CLAMPED if boundary == "cantilever" else FREE
    slender = roots**2 / (2 * np.pi * length**2) * np.sqrt(ex * thickness**2 / (12 * density))
    bending = slender / np.sqrt(1 + (roots * thickness / length) ** 2 / 12 * (1 + ex / (5 / 6 * gxz)))
    ratio = thickness / width
    polar = density * (width**2 + thickness**2) / 12 * width * thickness
    speed = np.sqrt(gxy * width * thickness**3 / 3 * (1 - 0.63 * ratio * (1 - ratio**4 / 12)) / polar)
    orders = np.arange(1, 7) - 0.5 if boundary == "cantilever" else np.arange(1.0, 7)
    first = 1 if boundary == "cantilever" else 2
    modes = [(f, k + first, 0) for k, f in enumerate(bending)]
    modes += [(speed * order / (2 * length), k, 1) for k, order in enumerate(orders, start=1)]
    suspension = [] if boundary == "cantilever" else [(rng.uniform(1, 3), *each) for each in ((0, 0), (1, 0), (0, 1))]
    modes = sorted([*modes, *suspension])
    f = np.array([mode[0] for mode in modes]) * (1 + FREQUENCY_ERROR * rng.standard_normal(len(modes)))
    a0, a1 = np.exp(rng.uniform(np.log(3), np.log(25))), rng.uniform(1e-6, 6e-6)
    zeta = np.where(f < 5, 0.04, a0 / (4 * np.pi * f) + a1 * np.pi * f)
    kind = "clamped" if boundary == "cantilever" else "free"
    mass = density * length * width * thickness
    body = TwistedStrip(kind, length, width, mass, f, zeta, tuple((k, j) for _, k, j in modes))
    off = np.exp(0.07 * rng.standard_normal(4))
    material = OrthotropicMaterial(ex * off[0], 0.9 * ex, gxy * off[1], gxz * off[2], gxz * off[2], nu, density)
    return Strip(body, Specimen(length, width, thickness, material, boundary), a0, a1)  # type: ignore[arg-type]


def _updated(strip: Strip, laboratory: Laboratory, rng: np.random.Generator) -> UpdateResult:
    """From hits to parameters, all by default."""
    body = strip.body
    places = [(x * body.length_m, y * body.width_m) for x in (0.15, 0.3, 0.45, 0.6, 0.75, 0.9) for y in (-0.45, 0.4)]
    sensor = (0.97 * body.length_m, 0.45 * body.width_m)
    bench = Bench(body, laboratory, sensor, rng)
    hits = [
        bench.hit(label, place, number, str(rng.choice(FAULTS)) if rng.random() < 1 / 3 else None).hit
        for label, place in enumerate(places, start=1)
        for number in range(1, HITS + 1)
    ]
    points = {label: (x, y, 0.0) for label, (x, y) in enumerate([*places, sensor], start=1)}
    processed = process(by_point(hits), Processing(positions=points))
    frfs = replace(processed.frfs, responses=tuple(Dof(len(points), 3) for _ in processed.frfs.responses))
    band = (float(frfs.frequency_hz[0]), processed.strong_hz)
    measurement = Measurement(frfs, points, inputs=Inputs(window_rate=processed.rate_per_s, sensor_mass_sd=0.0))
    return update(measurement, strip.stated, Recipe(identification=Options(band_hz=band)))
