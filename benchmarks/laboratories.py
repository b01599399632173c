"""The default recipe in laboratories that are not the paper's: do intervals hold, and is every fault reported?

Each set draws a structure (strips and plates, 1 to 20 mm; glass fibre, carbon fibre, nearly isotropic), a boundary, a tour
(grid, edge, centre line, a few points; roving hammer or sensors, two references, negative directions), a band (from 0 Hz,
above the first mode, ending in a resonance, of two modes), lines, a quantity, damping from 0.05 to 8 % and noise from 0.1 to
10 %. The truth comes from the model with constants up to 45 % off the nominal ones, frequencies off by 0.2 % and damping ratios
by 2 %. Then the same laboratories have one fault each.
"""

from __future__ import annotations

import collections
import re
import time
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import Specimen
from fecore.body.supports import Boundary
from fecore.dynamics.damping_laws import RAYLEIGH, ModalDamping, beyond, damping_rate
from fecore.dynamics.synthesis import ModalFrfModel
from fecore.errors import FecoreError
from fecore.frf import Dof, FrfSet, Quantity
from fecore.updating.forward import ForwardModel, modes_to_cover
from fecore.updating.measurement import Measurement
from fecore.updating.parameters import parametrise
from fecore.updating.pipeline import update

SETS, SEED = 40, 1
MATERIALS = {
    "glass": OrthotropicMaterial(33e9, 32e9, 5.7e9, 4.5e9, 4.5e9, 0.15, 2012.0),
    "carbon": OrthotropicMaterial(140e9, 9e9, 5e9, 4e9, 4e9, 0.3, 1600.0),
    "isotropic": OrthotropicMaterial(70e9, 69e9, 26e9, 26e9, 26e9, 0.33, 2700.0),
}
BODIES = {
    "strip, 10 mm": (0.5, 0.04, 0.010, (20, 4)),
    "strip, 1 mm": (0.3, 0.03, 0.001, (20, 4)),
    "strip, 20 mm": (0.5, 0.06, 0.020, (20, 4)),
    "plate, 4 mm": (0.4, 0.3, 0.004, (14, 10)),
    "square, 3 mm": (0.3, 0.3, 0.003, (12, 12)),
    "plate, 20 mm": (0.4, 0.3, 0.020, (14, 10)),
}
TOURS = ("grid", "few", "centre", "edge")
BANDS = ("plain", "from 0 Hz", "above mode 1", "to a resonance", "two modes")
LAWS = ("rayleigh", "stiffness", "constant")
FAULTS = ("sign", "height", "all heights", "points", "dead", "hum", "overload", "boundary", "length", "thickness")
FREQUENCY_ERROR, DAMPING_ERROR = 0.002, 0.02


@dataclass(frozen=True)
class Laboratory:
    """What a laboratory hands in, and the truth that it does not know.

    Attributes:
        kind: what was drawn, by name.
        stated: the specimen as it is stated.
        measurement: what was measured.
        true: constants by name; a0 and a1 where the body's damping has them.
    """

    kind: dict[str, str]
    stated: Specimen
    measurement: Measurement
    true: dict[str, float]


def draw(seed: int, fault: str = "none") -> Laboratory:
    """One laboratory."""
    rng = np.random.default_rng(seed)
    kind = {
        name: str(rng.choice(list(values)))
        for name, values in {
            "body": BODIES,
            "material": MATERIALS,
            "boundary": get_args(Boundary),
            "tour": TOURS,
            "band": BANDS,
            "law": LAWS,
            "quantity": get_args(Quantity),
            "noise": ("0.001", "0.01", "0.03", "0.1"),
            "lines": ("150", "400", "800", "1600", "3200"),
        }.items()
    }
    length, width, thickness, divisions = BODIES[kind["body"]]
    nominal = MATERIALS[kind["material"]]
    stated = Specimen(length, width, thickness, nominal, kind["boundary"], divisions=divisions)  # type: ignore[arg-type]
    spread = rng.choice([0.1, 0.2, 0.3])
    true = {
        name: float(getattr(nominal, name) * (1 + spread * np.clip(rng.standard_normal(), -1.5, 1.5)))
        for name in ("Ex", "Ey", "Gxy", "Gxz")
    }
    body = replace(stated, material=replace(nominal, **true, Gyz=nominal.Gyz * true["Gxz"] / nominal.Gxz))
    points = _tour(kind["tour"], stated, rng)
    responses, references = _pairs(points, rng)
    hz, first, last = _axis(kind, body, rng)
    model, rigid = _model(body, points, responses, references, hz)
    damping = float(np.exp(rng.uniform(np.log(0.0005), np.log(0.08))))
    values, law = _frfs(model, rigid, kind, hz, (first, last), damping, rng)
    if law is not None:
        true.update(a0=float(law[0]), a1=float(law[1]))
    frfs = FrfSet(hz, values, responses, references, kind["quantity"])  # type: ignore[arg-type]
    stated, measurement = _spoil(fault, stated, Measurement(frfs, points), rng)
    return Laboratory({**kind, "fault": fault}, stated, measurement, true)


def _tour(tour: str, body: Specimen, rng: np.random.Generator) -> dict[int, tuple[float, float, float]]:
    """Points where the boundary lets the body move."""
    narrow = body.width < body.length / 4
    count, across = (8, 3) if narrow else (6, 5)
    inner = np.linspace(0, body.length, count + 2)
    x = {"cantilever": inner[1:], "free": inner, "simply_supported": inner[1:-1]}
    y = {"centre": np.zeros(1), "edge": np.array([body.width / 2])}.get(
        tour, np.linspace(-0.5, 0.5, across) * body.width
    )
    places = [(float(a), float(b), 0.0) for a in x[body.boundary] for b in y]
    if tour == "few":
        some = rng.choice(len(places) - 1, rng.integers(2, 6), replace=False)
        places = [places[row] for row in sorted(some)] + places[-1:]
    return dict(enumerate(places, start=1))


def _pairs(
    points: dict[int, tuple[float, float, float]], rng: np.random.Generator
) -> tuple[tuple[Dof, ...], tuple[Dof, ...]]:
    """Responses and references: hammer or sensors rove about one fixed dof or two, some of them along -z."""
    fixed = [len(points)] if rng.random() < 0.75 else [len(points), max(1, len(points) // 2)]
    sense = -3 if rng.random() < 0.3 else 3
    roving = tuple(Dof(point, sense) for _ in fixed for point in points)
    still = tuple(Dof(point, 3) for point in fixed for _ in points)
    return (still, roving) if rng.random() < 0.5 else (roving, still)


def _axis(kind: dict[str, str], body: Specimen, rng: np.random.Generator) -> tuple[np.ndarray, float, float]:
    """Lines in Hz, and the first and the last natural frequency in the band."""
    parametrisation = parametrise(body)
    modes = ForwardModel(body, parametrisation, (), np.zeros((0, 2)), 12).solve(parametrisation.prior_mean).frequency_hz
    last = 1 if kind["band"] == "two modes" else int(rng.integers(3, 7))
    low = {"from 0 Hz": 0.0, "above mode 1": np.sqrt(modes[0] * modes[1])}.get(kind["band"], 0.3 * modes[0])
    high = modes[last] * 1.002 if kind["band"] == "to a resonance" else np.sqrt(modes[last] * modes[last + 1])
    return np.linspace(low, high, int(kind["lines"])), float(modes[0]), float(modes[last])


def _model(
    body: Specimen,
    points: dict[int, tuple[float, float, float]],
    responses: tuple[Dof, ...],
    references: tuple[Dof, ...],
    hz: np.ndarray,
) -> tuple[ModalFrfModel, int]:
    parametrisation = parametrise(body)
    places = np.array(list(points.values()))[:, :2]
    count = modes_to_cover(parametrisation, float(hz[-1]), 12)
    state = ForwardModel(body, parametrisation, tuple(points), places, count).solve(parametrisation.prior_mean)
    return state.frf_model(responses, references), state.modes.rigid


def _frfs(
    model: ModalFrfModel,
    rigid: int,
    kind: dict[str, str],
    hz: np.ndarray,
    ends: tuple[float, float],
    damping: float,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray | None]:
    """FRFs with noise of a body that is not quite the model, and the coefficients of its law where it is Rayleigh's."""
    omega = model.omega * (1 + FREQUENCY_ERROR * rng.standard_normal(model.omega.size))
    first, last = (2 * np.pi * end for end in ends)
    law = {
        "rayleigh": damping * np.array([first, 1 / last]),
        "stiffness": damping * np.array([0.0, 2 / last]),
        "constant": None,
    }[kind["law"]]
    if law is None:
        rate = damping_rate(ModalDamping((last,)), np.array([damping]), omega)
        rate[:rigid] = 0.1 * damping * first
        tail = (0.0, 0.0)
    else:
        rate, tail = damping_rate(RAYLEIGH, law, omega), beyond(RAYLEIGH, law, float(omega[-1]))
    rate = rate * np.exp(DAMPING_ERROR * rng.standard_normal(rate.size))
    lines = np.maximum(hz, 1e-3 * hz[-1])
    values = model.with_eigenvalue(omega**2).synthesise(lines, rate, kind["quantity"], tail)  # type: ignore[arg-type]
    level = np.sqrt(np.mean(np.abs(values[:, lines > 0.5 * ends[0]]) ** 2, axis=1, keepdims=True))
    noise = rng.standard_normal((2, *values.shape)) / np.sqrt(2)
    return values + float(kind["noise"]) * level * (noise[0] + 1j * noise[1]), law


def _spoil(
    fault: str, stated: Specimen, measurement: Measurement, rng: np.random.Generator
) -> tuple[Specimen, Measurement]:
    """What the laboratory gets wrong."""
    values, points = measurement.frfs.values.copy(), dict(measurement.points)
    row, level = int(rng.integers(len(values))), np.sqrt(np.mean(np.abs(values) ** 2, axis=1))
    if fault in ("sign", "height", "dead"):
        values[row] *= {"sign": -1, "height": 2, "dead": 0}[fault]
    elif fault == "all heights":
        values *= 2
    elif fault == "points":
        points[1], points[len(points)] = points[len(points)], points[1]
    elif fault == "hum":
        values[:, values.shape[1] // 3] += 10 * level * np.exp(2j * np.pi * rng.random(len(values)))
    elif fault == "overload":
        values[row, int(rng.integers(5, values.shape[1] - 5))] += 20 * level.max()
    elif fault == "boundary":
        stated = replace(stated, boundary="cantilever" if stated.boundary == "free" else "free")
    elif fault == "length":
        stated = replace(stated, length=1.1 * stated.length)
    elif fault == "thickness":
        stated = replace(stated, thickness=1.1 * stated.thickness)
    return stated, replace(measurement, frfs=replace(measurement.frfs, values=values), points=points)


@dataclass(frozen=True)
class Outcome:
    """What the update made of a laboratory: its error or "", warnings, and by parameter whether the interval held."""

    error: str
    warnings: tuple[str, ...]
    held: dict[str, bool]
    seconds: float


def judge(laboratory: Laboratory) -> Outcome:
    """Run the default recipe. Only errors of the core are an outcome; any other ends the benchmark."""
    start = time.perf_counter()
    try:
        result = update(laboratory.measurement, laboratory.stated)
    except FecoreError as error:
        return Outcome(f"{type(error).__name__}: {error}", (), {}, time.perf_counter() - start)
    held = {
        row.name: row.interval_95[0] <= laboratory.true[row.name] <= row.interval_95[1]
        for row in result.parameters
        if row.identifiable and row.name in laboratory.true
    }
    return Outcome("", result.warnings, held, time.perf_counter() - start)


def main(sets: int = SETS, seed: int = SEED) -> None:
    """Print coverage by class, and what became of each fault."""
    honest = [(laboratory, judge(laboratory)) for laboratory in map(draw, range(seed, seed + sets))]
    print(f"  {len(honest)} laboratories without a fault: {sum(not outcome.error for _, outcome in honest)} updated")
    for error, count in collections.Counter(outcome.error[:90] for _, outcome in honest if outcome.error).most_common():
        print(f"    {count} × {error}")
    classes = collections.defaultdict(list)
    for laboratory, outcome in honest:
        for name, value in laboratory.kind.items():
            classes[name, value] += list(outcome.held.values())
        for name, ok in outcome.held.items():
            classes["parameter", name].append(ok)
    print("  95 % intervals of identifiable parameters that hold the truth")
    for (name, value), held in sorted(classes.items()):
        if held:
            print(f"    {name:10s} {value:16s} {100 * np.mean(held):5.1f} % of {len(held)}")
    times = [outcome.seconds for _, outcome in honest]
    print(f"  time: median {np.median(times):.2f} s, longest {max(times):.1f} s")
    print("  faults:     refused   warned  silent, with a wrong interval")
    for place, fault in enumerate(FAULTS):
        numbers = [k for k in range(place, len(honest), len(FAULTS)) if not honest[k][1].error]
        outcomes = [(judge(draw(seed + k, fault)), _kinds(honest[k][1])) for k in numbers]
        refused = sum(bool(each.error) for each, _ in outcomes)
        silent = [each for each, usual in outcomes if not each.error and not _kinds(each) - usual]
        wrong = sum(not all(each.held.values()) for each in silent)
        print(f"    {fault:12s} {refused:5d} {len(outcomes) - refused - len(silent):6d} {len(silent):7d} {wrong:8d}")


def _kinds(outcome: Outcome) -> set[str]:
    """Warnings without their numbers."""
    return {re.sub(r"[\d.]+", "", warning) for warning in outcome.warnings}
