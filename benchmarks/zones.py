"""Where has the stiffness changed? Zones of strips that are damaged on their lines, between them,
in two places, or nowhere.

The truth is a finer mesh of the damaged strip; each of its frequencies is off by what plate theory
misses, .05 %, and by noise of .02 %. Its moduli, dimensions and density are drawn as a laboratory
has them wrong, and the clamp of a cantilever yields. A zone's true factor is its mean, 1/s = ∫
dx/s(x)/L; it is false where nothing is damaged and its 95 % interval says otherwise.
"""

import time
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.tables import Table
from fecore.arrays import FloatArray
from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import Specimen
from fecore.body.supports import Boundary
from fecore.dynamics.eigen import normal_modes
from fecore.updating.inputs import Inputs
from fecore.updating.measurement import Measurement
from fecore.updating.pipeline import update
from fecore.updating.recipe import Recipe
from fecore.updating.result import UpdateResult
from tests.support.draws import modes_at, yielding

MATERIAL = OrthotropicMaterial(33e9, 32e9, 5.7e9, 4.5e9, 4.5e9, 0.15, 2012.0)
L, WIDTH, THICKNESS, NOISE, THEORY = 0.5, 0.04, 0.010, 2e-4, 5e-4
DAMAGED = 0.97
"""Mean factor below which a zone counts as one that is damaged."""


@dataclass(frozen=True)
class Case:
    """Strips in so many zones, with so many damaged stretches, on lines or anywhere, of which so
    many modes are measured.
    """

    zones: int
    stretches: int
    on_lines: bool = False
    boundary: Boundary = "cantilever"
    modes: int = 9

    @property
    def lines(self) -> tuple[float, ...]:
        """Between the zones, m."""
        return tuple(float(x) for x in np.linspace(0, L, self.zones + 1)[1:-1])


CASES = {
    "eight zones, nothing": Case(8, 0),
    "eight zones, a line to the next": Case(8, 1, on_lines=True),
    "eight zones, anywhere": Case(8, 1),
    "eight zones, two stretches": Case(8, 2),
    "two zones, nothing": Case(2, 0),
    "two zones, anywhere": Case(2, 1),
    "free, shapes fitted, nothing": Case(8, 0, boundary="free"),
    "free, shapes fitted, anywhere": Case(8, 1, boundary="free"),
    "two stretches, fifteen modes": Case(8, 2, modes=15),
}


def zones(draws: int = 6, seed: int = 36) -> list[str]:
    """Stretches of another stiffness: false zones, damaged ones found, intervals that hold, the CPU
    time of an update.
    """
    table = Table("", "strips in:32", "false:d", "of:d", "found:d", "of damaged:d", "held:d", "of zones:d",
                  "held:d", "of moduli:d", "CPU s:.1f")  # fmt: skip
    for number, (name, case) in enumerate(CASES.items()):
        began, rows = time.process_time(), list[FloatArray]()
        for draw in range(draws):
            rows.append(_judged(*_updated(case, np.random.default_rng([seed, number, draw]))))
        table.row(name, *np.sum(rows, axis=0), (time.process_time() - began) / draws)
    return []


def _judged(result: UpdateResult, true: dict[str, float]) -> FloatArray:
    """False and sound zones, found and damaged ones, intervals of zones that hold and of moduli,
    each with their number.
    """
    zones = [p for p in result.parameters if p.name.startswith("zone_")]
    moduli = [p for p in result.parameters if p.name in ("Ex", "Gxy")]
    sound = [p for p in zones if true[p.name] == 1]
    damaged = [p for p in zones if true[p.name] < DAMAGED]
    false = [p for p in sound if not p.interval_95[0] <= 1 <= p.interval_95[1]]
    found = [p for p in damaged if p.interval_95[1] < 1]
    held = [
        [p for p in each if p.interval_95[0] <= true[p.name] <= p.interval_95[1]]
        for each in (zones, moduli)
    ]
    return np.array(
        [len(each) for each in (false, sound, found, damaged, held[0], zones, held[1], moduli)]
    )


def _updated(case: Case, random: np.random.Generator) -> tuple[UpdateResult, dict[str, float]]:
    """The update of a strip as it is stated, and the true moduli and zones."""
    stated = Specimen(L, WIDTH, THICKNESS, MATERIAL, case.boundary, zones=case.lines)
    cuts, factors = _damage(case, random)
    moduli = {
        n: getattr(MATERIAL, n) * np.exp(0.1 * random.standard_normal())
        for n in ("Ex", "Ey", "Gxy", "Gxz")
    }
    inputs = Inputs()
    own = {
        key: (
            stated.nominal[key]
            + inputs.standard_deviation(key, stated.nominal[key]) * random.standard_normal()
        )
        for key in ("length", "width", "thickness", "density")
    }
    body = replace(stated, zones=cuts, divisions=(60, 4))
    if case.boundary == "cantilever":
        compliance = abs(inputs.standard_deviation("clamp_compliance") * random.standard_normal())
        body = yielding(body, max(compliance, 1e-5))
    constants = {**body.nominal, **moduli, "Gyz": moduli["Gxz"], **own}
    constants |= {f"zone_{k}": factor for k, factor in enumerate(factors, start=1)}
    measurement = _measured(body, constants, case, random)
    shown = tuple(p for p in stated.default_parameters() if p.name not in ("Ey", "Gyz"))
    recipe = Recipe(
        parameters=shown, damping_models=("rayleigh",), use_shapes=case.boundary == "free"
    )
    ends, at = np.array([0.0, *case.lines, L]), np.array([0.0, *cuts, L])
    share = np.diff(
        [np.interp(ends, at, np.concatenate([[0.0], np.cumsum(np.diff(at) / factors)]))]
    )[0] / np.diff(ends)
    means = {
        f"zone_{k}": 1.0 if abs(mean - 1) < 1e-9 else 1 / mean
        for k, mean in enumerate(share, start=1)
    }
    return update(measurement, stated, recipe), moduli | means


def _damage(case: Case, random: np.random.Generator) -> tuple[tuple[float, ...], FloatArray]:
    """Lines between stretches of one stiffness, and their factors."""
    factors = np.ones(2 * case.stretches + 1)
    factors[1::2] = random.uniform(0.6, 0.9, case.stretches)
    if case.on_lines:
        first = int(random.integers(1, case.zones - 1))
        return case.lines[first - 1 : first + 1], factors
    while True:
        cuts = np.sort(random.uniform(0.04 * L, 0.9 * L, 2 * case.stretches))
        long = np.diff(cuts)
        if np.all(long > 0.06 * L) and np.all(long[::2] < 0.2 * L):
            return tuple(cuts.tolist()), factors


def _measured(
    body: Specimen, constants: dict[str, float], case: Case, random: np.random.Generator
) -> Measurement:
    """Frequencies and shapes at eleven stations by three rows."""
    model, count = body.model, case.modes + 3 * (case.boundary == "free")
    truth = np.array([constants[name] for name in body.nominal])
    stiffness = np.concatenate(
        [body.stiffness_coefficients(truth), [spring.stiffness for spring in body.springs]]
    )
    modes = normal_modes(
        model.stiffness.at(stiffness),
        model.mass.at(body.mass_coefficients(truth)),
        count,
        model.rigid_modes,
    )
    elastic = slice(modes.rigid, modes.rigid + case.modes)
    hz = modes.frequency_hz[elastic] * (
        1 + np.hypot(NOISE, THEORY) * random.standard_normal(case.modes)
    )
    order = np.argsort(hz)
    places = np.array(
        [(a, b) for a in np.linspace(0.05, 0.98, 11) * L for b in (-0.019, 0.0, 0.019)]
    )
    at = np.column_stack([places, np.zeros(len(places))])
    shapes = (model.observe(at, np.tile([0.0, 0, 1], (len(at), 1))) @ modes.shapes).T[elastic][
        order
    ]
    shapes = shapes + 0.01 * np.abs(shapes).max(axis=1, keepdims=True) * random.standard_normal(
        shapes.shape
    )
    points = {n: (float(a), float(b), 0.0) for n, (a, b) in enumerate(places, start=1)}
    return Measurement(None, points, modes_at(points, hz[order], shapes, NOISE))
