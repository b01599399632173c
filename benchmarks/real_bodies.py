"""Do intervals hold where the body is not the model? One deviation at a time, and many bodies with all of them drawn.

The truth shares none of the model's assumptions: its clamp is springs along an edge, on a finer mesh; its length, thickness,
density, Poisson's ratio and fibres are not as stated; a sensor is not stated; a window and a delay are left in the FRFs; every
frequency is off by 0.1 %. The default recipe is given what the laboratory states.

    table [words of a row]     one deviation at a time
    drawn 60                   bodies with all of them drawn
    perfect 40                 bodies without any, everything stated as exactly known
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np

from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import Specimen
from fecore.body.supports import PointMass, Spring, Supports
from fecore.dynamics.damping_laws import RAYLEIGH, beyond, damping_rate
from fecore.errors import FecoreError
from fecore.frf import Dof, FrfSet
from fecore.updating.excursions import REACH_95
from fecore.updating.forward import ForwardModel
from fecore.updating.inputs import TOLERANCES, UNSTATED_SENSOR, UNSTATED_WINDOW, Inputs
from fecore.updating.measurement import Measurement
from fecore.updating.parameters import parametrise
from fecore.updating.pipeline import update

NOMINAL = OrthotropicMaterial(Ex=40e9, Ey=12e9, Gxy=4.5e9, Gxz=4.2e9, Gyz=4.2e9, nu_xy=0.28, density=1950.0)
STATED = Specimen(0.5, 0.04, 0.010, NOMINAL)
LAW = np.array([30.0, 1e-5])
LINES_HZ = np.arange(1.0, 1001.0, 1.0)
SENSOR, FREQUENCY_ERROR, NOISE = 33, 0.001, 0.01
REPORTED = ("Ex", "Ey", "Gxy", "Gxz", "a0", "a1")


@dataclass(frozen=True)
class Truth:
    """How a body and its measurement differ from what is stated: shares, SI units, or nothing by default."""

    clamp: float = 0.0  # EI/kL
    length: float = 0.0  # m longer
    thickness: float = 0.0  # share thicker
    density: float = 0.0  # share denser
    nu: float = 0.0
    angle: float = 0.0  # rad
    sensor: float = 0.0  # kg
    window: float = 0.0  # 1/τ, 1/s
    delay: float = 0.0  # s
    boundary: str = "cantilever"


TABLE = {
    "nothing": Truth(),
    **{f"clamp kL/EI = {k}": Truth(clamp=1 / k) for k in (500, 200, 75)},
    **{f"length +{mm} mm": Truth(length=mm * 1e-3) for mm in (1, 3)},
    **{f"thickness stated +{p} %": Truth(thickness=-p / 100) for p in (0.5, 1.2, 3)},
    "density stated -3 %": Truth(density=0.03),
    **{f"fibres {d}° off": Truth(angle=np.radians(d)) for d in (2, 4)},
    **{f"unstated sensor of {g} g": Truth(sensor=g * 1e-3) for g in (1, 2)},
    **{f"window of {tau} s": Truth(window=1 / tau) for tau in (1, 0.25)},
    "30 µs between channels": Truth(delay=30e-6),
}


def drawn(rng: np.random.Generator) -> Truth:
    """Every deviation from the prior of a careful laboratory."""
    normal = rng.standard_normal(9)
    tolerance = {name: value for name, (value, _) in TOLERANCES.items()}
    return Truth(
        clamp=abs(normal[0]) * tolerance["clamp_compliance"],
        length=normal[1] * tolerance["length"],
        thickness=normal[2] * tolerance["thickness"],
        density=normal[3] * tolerance["density"],
        nu=normal[4] * tolerance["nu_xy"],
        angle=normal[5] * tolerance["fibre_angle"],
        sensor=abs(normal[6]) * UNSTATED_SENSOR,
        window=abs(normal[7]) * UNSTATED_WINDOW * (LINES_HZ[1] - LINES_HZ[0]),
        delay=normal[8] * tolerance["delay"],
        boundary=str(rng.choice(["cantilever", "free"])),
    )


def body_of(truth: Truth, material: OrthotropicMaterial, points: dict[int, tuple[float, float, float]]) -> Specimen:
    """The body as it is, on a mesh of its own."""
    length, t = STATED.length + truth.length, STATED.thickness * (1 + truth.thickness)
    held, springs = None, ()
    if truth.boundary == "cantilever" and truth.clamp:
        EI = material.Ex * t**3 / 12  # per metre of edge
        stiffness = EI / (truth.clamp * length)
        springs = (
            Spring("pitch", stiffness, 5, edge="start"),
            Spring("roll", stiffness, 4, edge="start"),
            Spring("heave", stiffness / t**2, 3, edge="start"),
        )
        held = Supports()
    x, y, _ = points[SENSOR]
    masses = (PointMass(min(x, length), y, truth.sensor),) if truth.sensor else ()
    return Specimen(
        length,
        STATED.width,
        t,
        replace(material, density=material.density * (1 + truth.density), nu_xy=material.nu_xy + truth.nu),
        truth.boundary,  # type: ignore[arg-type]
        masses,
        divisions=(60, 8),
        springs=springs,
        supports=held,
        fibre_angle=truth.angle,
    )


def measured(truth: Truth, material: OrthotropicMaterial, rng: np.random.Generator) -> Measurement:
    """33 accelerances to a sensor at the tip's corner."""
    places = [(STATED.length * row / 11, 0.02 * side, 0.0) for row in range(1, 12) for side in (-1, 0, 1)]
    points = dict(enumerate(places, start=1))
    body = body_of(truth, material, points)
    parametrisation = parametrise(body)
    at = np.minimum(np.array(places)[:, :2], [body.length, 1.0])
    state = ForwardModel(body, parametrisation, tuple(points), at, 16, reduced=False).solve(parametrisation.prior_mean)
    hammer, sensor = tuple(Dof(point, 3) for point in points), (Dof(SENSOR, 3),) * len(points)
    model = state.frf_model(sensor, hammer)
    omega = model.omega * (1 + FREQUENCY_ERROR * rng.standard_normal(model.omega.size))
    rate = damping_rate(RAYLEIGH, LAW, omega) + 2 * truth.window
    values = model.with_eigenvalue(omega**2).synthesise(LINES_HZ, rate, beyond=beyond(RAYLEIGH, LAW, float(omega[-1])))
    values = values * np.exp(-2j * np.pi * LINES_HZ * truth.delay)
    floor = NOISE * np.sqrt(np.mean(np.abs(values) ** 2, axis=1, keepdims=True) / 2)
    noise = rng.standard_normal(values.shape) + 1j * rng.standard_normal(values.shape)
    return Measurement(FrfSet(LINES_HZ, values + floor * noise, sensor, hammer), points)


def table(word: str = "") -> None:
    """Each deviation alone: error over standard deviation of the parameter that it moves most, and the verdict."""
    print(f"{'true deviation':26} {'':3} {'error %':>8} {'z':>6}  verdict")
    for name, truth in ((name, truth) for name, truth in TABLE.items() if word in name):
        rng = np.random.default_rng(1)
        true = {**{n: getattr(NOMINAL, n) for n in ("Ex", "Gxy")}, "a0": LAW[0], "a1": LAW[1]}
        result = update(measured(truth, NOMINAL, rng), replace(STATED, boundary=truth.boundary))  # type: ignore[arg-type]
        found = {p.name: p for p in result.parameters}
        watched = "a0" if truth.window else "a1" if truth.delay else "Ex"
        p = found[watched]
        error = p.estimate - true[watched]
        z = error / p.standard_deviation
        print(f"{name:26} {watched:3} {100 * error / true[watched]:8.2f} {z:6.2f}  {result.verdict.level}", flush=True)


def coverage(bodies: int, perfect: bool) -> None:
    """Bodies with constants drawn, and all deviations or none: how often each interval holds the truth, and how wide it is."""
    held: dict[str, list[bool]] = {name: [] for name in REPORTED}
    score: dict[str, list[float]] = {name: [] for name in REPORTED}
    width: dict[str, list[float]] = {name: [] for name in REPORTED}
    verdicts: list[str] = []
    below_zero = failed = 0
    for seed in range(bodies):
        rng = np.random.default_rng(1000 + seed)
        truth = Truth(boundary=drawn(rng).boundary) if perfect else drawn(rng)
        factors = np.exp(0.29 * rng.standard_normal(4).clip(-2, 2))
        true = {name: getattr(NOMINAL, name) * f for name, f in zip(("Ex", "Ey", "Gxy", "Gxz"), factors, strict=True)}
        material = replace(NOMINAL, **true, Gyz=true["Gxz"])
        stated = replace(STATED, boundary=truth.boundary)  # type: ignore[arg-type]
        measurement = measured(truth, material, rng)
        if perfect:
            measurement = replace(measurement, inputs=Inputs.exact())
        try:
            result = update(measurement, stated)
        except FecoreError as error:
            failed += 1
            print(f"  body {seed}: {type(error).__name__}: {error}")
            continue
        verdicts.append(result.verdict.level)
        for outcome in (outcome for outcome in result.outcomes if outcome.status != "succeeded"):
            print(f"  body {seed}: {outcome.stage} {outcome.status}: {outcome.message}")
        found, true = {p.name: p for p in result.parameters}, {**true, "a0": LAW[0], "a1": LAW[1]}
        for name in (name for name in REPORTED if name in found):
            low, high = found[name].interval_95
            held[name].append(low <= true[name] <= high)
            score[name].append((found[name].estimate - true[name]) / ((high - low) / (2 * REACH_95)))
            width[name].append((high - low) / 2 / true[name])
        below_zero += sum(p.interval_95[0] <= 0 for p in result.parameters if p.unit == "Pa")
    print(f"\n{bodies} bodies, {'perfect' if perfect else 'with every deviation drawn'}, {failed} not updated")
    print(
        "  held: share of intervals that hold the truth; rms: of the error over a quarter of the interval, 1 at best;"
    )
    print("  half: median of half an interval, as a share of the truth")
    for name, rows in held.items():
        rms, half = np.sqrt(np.mean(np.square(score[name]))), 100 * np.median(width[name])
        print(f"  {name:4} held {100 * np.mean(rows):6.1f} %   rms {rms:5.2f}   half {half:6.2f} %")
    print(f"  verdicts: {dict(Counter(verdicts))}; moduli with an interval that reaches zero: {below_zero}")


def main(what: str = "table", *rest: str | int) -> None:
    """Print one of the three."""
    if what == "table":
        table(" ".join(map(str, rest)))
    else:
        coverage(int(rest[0]), what == "perfect")
