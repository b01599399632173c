"""Bodies drawn at random by seed, as a laboratory states and measures them: for tests of intervals
and for `updates`.

beam   the paper's cantilever, frequencies off by 0.2 %, damping off its law by 2 %, 1 % noise
real   a bar whose clamp, sizes, density, fibres, sensor, window and delay are not as stated
plate  a free wooden plate that a handbook describes; its modes stand in another order than in the
model solid  a beam of CalculiX's solid elements
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import Specimen
from fecore.body.supports import PointMass, Spring
from fecore.dynamics.damping_laws import RAYLEIGH, beyond, damping_rate
from fecore.frf import Dof, FrfSet, along_z
from fecore.modes import MeasuredModes
from fecore.updating.forward import ForwardModel, ForwardState
from fecore.updating.inputs import TOLERANCES, UNSTATED_SENSOR, UNSTATED_WINDOW, Inputs
from fecore.updating.measurement import Measurement
from fecore.updating.parameters import parametrise
from tests.support import calculix
from tests.support.beams import add_noise

Points = dict[int, tuple[float, float, float]]
Dofs = tuple[Dof, ...]
SENSOR = 33


@dataclass(frozen=True)
class Drawn:
    """What a laboratory hands in, and the truth that it does not know."""

    stated: Specimen  # the specimen as it is stated
    measurement: Measurement  # what was measured
    true: dict[str, float]  # constants by name; a0 and a1 where the body's damping has them
    kind: dict[str, str] = field(default_factory=dict)  # what was drawn, by name


def grid(length: float = 0.5, width: float = 0.04, z: float = 0.0, *, free: bool = False) -> Points:
    """33 points, three across and eleven along, those of a cantilever without its root."""
    along = length * (np.arange(11) / 10 if free else np.arange(1, 12) / 11)
    return dict(
        enumerate(((float(x), width * (y / 2), z) for x in along for y in (-1, 0, 1)), start=1)
    )


def solved(body: Specimen, points: Points, modes: int, *, reduced: bool = True) -> ForwardState:
    """The body's modes and their shapes at the points."""
    at = np.minimum(np.array(list(points.values()))[:, :2], [body.length, 1.0])
    known = parametrise(body)
    return ForwardModel(body, known, along_z(points), at, modes, reduced).solve(known.prior_mean)


def _hit(points: Points, sensor: int = SENSOR) -> tuple[Dofs, Dofs]:
    """Responses at one sensor, forces at each point."""
    return (Dof(sensor, 3),) * len(points), tuple(Dof(point, 3) for point in points)


def noisy(
    values: np.ndarray, share: float, rng: np.random.Generator, lines: Any = slice(None)
) -> np.ndarray:
    """FRFs with white noise of that share of their root mean square, which some of the lines
    say.
    """
    level = share * np.sqrt(np.mean(np.abs(values[:, lines]) ** 2, axis=1, keepdims=True) / 2)
    real, imaginary = rng.standard_normal((2, *values.shape))
    return np.asarray(values + level * (real + 1j * imaginary))


def with_one_line_in(step: int, given: Measurement) -> Measurement:
    """The measurement with one line in so many."""
    assert given.frfs is not None
    return replace(given, frfs=given.frfs.on_every(step))


def modes_at(
    points: Iterable[int], hz: np.ndarray, shapes: np.ndarray, share: float, zeta: float = 0.01
) -> MeasuredModes:
    """Modes as measured out of plane at points, with a share of each frequency and 1e-4 of damping
    as standard deviations.
    """
    covariance = np.diag(np.concatenate([(share * hz) ** 2, np.full(hz.size, 1e-8)]))
    return MeasuredModes(
        hz, np.full(hz.size, zeta), shapes + 0j, tuple(Dof(p, 3) for p in points), covariance
    )


# --- beam ---------------------------------------------------------------------------------------------------------------

COUPONS = OrthotropicMaterial(
    Ex=33.05e9, Ey=31.80e9, Gxy=5.73e9, Gxz=4.5e9, Gyz=4.5e9, nu_xy=0.15, density=2012.0
)
BEAM = Specimen(length=0.5, width=0.04, thickness=0.010, material=COUPONS)


def beam(seed: int) -> Drawn:
    """A cantilever with constants and damping about the nominal ones."""
    rng = np.random.default_rng(seed)
    # Ey as its prior says, for nothing else depends on it
    spread = {"Ex": 0.12, "Ey": 0.30, "Gxy": 0.12, "Gxz": 0.12}
    factor = {
        name: np.clip(1 + share * rng.standard_normal(), 0.4, 1.6) for name, share in spread.items()
    }
    true = {name: float(getattr(COUPONS, name) * factor[name]) for name in spread}
    law = np.array([30.0, 1e-5]) * np.exp(0.3 * rng.standard_normal(2))
    body, points = replace(BEAM, material=replace(COUPONS, **true, Gyz=true["Gxz"])), grid(z=0.005)
    model = solved(body, points, 14).frf_model(*_hit(points))
    omega = model.omega * (1 + 0.002 * rng.standard_normal(model.omega.size))
    rate = damping_rate(RAYLEIGH, law, omega) * np.exp(0.02 * rng.standard_normal(omega.size))
    hz, tail = np.arange(2.0, 1001.0, 2.0), beyond(RAYLEIGH, law, float(omega[-1]))
    values = noisy(model.with_eigenvalue(omega**2).synthesise(hz, rate, beyond=tail), 0.01, rng)
    true.update(a0=float(law[0]), a1=float(law[1]))
    return Drawn(BEAM, Measurement(FrfSet(hz, values, *_hit(points)), points), true)


# --- real ---------------------------------------------------------------------------------------------------------------

NOMINAL = OrthotropicMaterial(
    Ex=40e9, Ey=12e9, Gxy=4.5e9, Gxz=4.2e9, Gyz=4.2e9, nu_xy=0.28, density=1950.0
)
STATED = Specimen(0.5, 0.04, 0.010, NOMINAL)
LAW = np.array([30.0, 1e-5])
LINES_HZ = np.arange(1.0, 1001.0, 1.0)


@dataclass(frozen=True)
class Truth:
    """How a body and its measurement differ from what is stated: shares, SI units, or nothing by
    default.
    """

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

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Self:
        """Every deviation from the prior of a careful laboratory."""
        normal = rng.standard_normal(9)
        tolerance = {name: value for name, (value, _) in TOLERANCES.items()}
        return cls(
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


def _as_it_is(truth: Truth, material: OrthotropicMaterial, points: Points) -> Specimen:
    """The body on a mesh of its own, its clamp springs along an edge."""
    length, (x, y, _) = STATED.length + truth.length, points[SENSOR]
    body = replace(
        STATED,
        length=length,
        thickness=STATED.thickness * (1 + truth.thickness),
        material=replace(
            material,
            density=material.density * (1 + truth.density),
            nu_xy=material.nu_xy + truth.nu,
        ),
        boundary=truth.boundary,  # type: ignore[arg-type]
        masses=(PointMass(min(x, length), y, truth.sensor),) if truth.sensor else (),
        divisions=(60, 8),
        fibre_angle=truth.angle,
    )
    return yielding(body, truth.clamp) if truth.boundary == "cantilever" and truth.clamp else body


def yielding(body: Specimen, compliance: float) -> Specimen:
    """The cantilever on springs along its edge, EI/kL of which is the compliance."""
    # per metre of edge
    k, t = body.material.Ex * body.thickness**3 / 12 / (compliance * body.length), body.thickness
    rows = (("pitch", k, 5), ("roll", k, 4), ("heave", k / t**2, 3))
    return replace(body, supports=(), springs=tuple(Spring(*row, edge="start") for row in rows))


def measured(truth: Truth, material: OrthotropicMaterial, rng: np.random.Generator) -> Measurement:
    """33 accelerances to a sensor at the tip's corner."""
    points = grid()
    model = solved(_as_it_is(truth, material, points), points, 16, reduced=False).frf_model(
        *_hit(points)
    )
    omega = model.omega * (1 + 0.001 * rng.standard_normal(model.omega.size))
    rate, tail = (
        damping_rate(RAYLEIGH, LAW, omega) + 2 * truth.window,
        beyond(RAYLEIGH, LAW, float(omega[-1])),
    )
    values = model.with_eigenvalue(omega**2).synthesise(LINES_HZ, rate, beyond=tail)
    values = noisy(values * np.exp(-2j * np.pi * LINES_HZ * truth.delay), 0.01, rng)
    return Measurement(FrfSet(LINES_HZ, values, *_hit(points)), points)


def real(seed: int, *, perfect: bool = False) -> Drawn:
    """A bar with constants drawn, and all deviations or none, which is then known exactly."""
    rng = np.random.default_rng(1000 + seed)
    truth = Truth.drawn(rng)
    truth = Truth(boundary=truth.boundary) if perfect else truth
    factors = np.exp(0.29 * rng.standard_normal(4).clip(-2, 2))
    true = {
        name: getattr(NOMINAL, name) * f
        for name, f in zip(("Ex", "Ey", "Gxy", "Gxz"), factors, strict=True)
    }
    given = measured(truth, replace(NOMINAL, **true, Gyz=true["Gxz"]), rng)
    given = replace(given, inputs=Inputs.exact()) if perfect else given
    stated = replace(STATED, boundary=truth.boundary)  # type: ignore[arg-type]
    return Drawn(stated, given, true | {"a0": LAW[0], "a1": LAW[1]})


# --- plate --------------------------------------------------------------------------------------------------------------

HANDBOOK = OrthotropicMaterial(
    Ex=10.9e9, Ey=0.64e9, Gxy=0.58e9, Gxz=0.6e9, Gyz=0.06e9, nu_xy=0.37, density=420.0
)
EVIDENCE = ("25 points", "one FRF", "frequencies")


def plate(seed: int) -> dict[str, Drawn]:
    """A free spruce-like plate by what is measured of its first 8 to 12 modes: `EVIDENCE`, the
    FRF's near a corner.
    """
    rng = np.random.default_rng([4, seed])
    length, width, thickness = (
        rng.uniform(0.30, 0.45),
        rng.uniform(0.18, 0.30),
        rng.uniform(0.0025, 0.004),
    )
    true = {
        "Ex": rng.uniform(10e9, 15e9),
        "Ey": rng.uniform(0.8e9, 1.6e9),
        "Gxy": rng.uniform(0.5e9, 1.0e9),
    }
    shear = {"Gxz": rng.uniform(0.5e9, 0.8e9), "Gyz": rng.uniform(0.03e9, 0.09e9)}
    nu, density = rng.uniform(0.3, 0.45), HANDBOOK.density * rng.normal(1, 0.005)
    # Given, as the mesh is not the question.
    stated = Specimen(length, width, thickness, HANDBOOK, "free", divisions=(14, 8))
    body = replace(
        stated,
        material=OrthotropicMaterial(**true, **shear, nu_xy=nu, density=density),
        divisions=(20, 12),
    )
    share = np.linspace(0.04, 0.96, 5)
    points = dict(
        enumerate(((length * x, width * (y - 0.5), 0.0) for x in share for y in share), start=1)
    )
    count = int(rng.integers(8, 13))
    state = solved(body, points, count + 3, reduced=False)
    hz = state.frequency_hz[:count] * (1 + 0.002 * rng.standard_normal(count))
    order = np.argsort(hz)
    hz, shapes = hz[order], state.shapes[:count][order]
    shapes = shapes + 0.02 * np.abs(shapes).max(axis=1, keepdims=True) * rng.standard_normal(
        shapes.shape
    )
    hit = int(rng.choice([1, 2, 6]))  # at a corner, or a quarter along an edge
    height = np.abs(shapes[:, hit - 1])
    seen = height > 0.05 * height.max()  # a mode below stays in the noise
    one = {hit: points[hit]}
    found = (
        Measurement(None, points, modes_at(points, hz, shapes, 2e-4, 0.006)),
        Measurement(None, one, modes_at(one, hz[seen], shapes[seen, hit - 1 : hit], 2e-4, 0.006)),
        Measurement(None, {}, MeasuredModes(hz, np.full(hz.size, np.nan))),
    )
    return {kind: Drawn(stated, each, true) for kind, each in zip(EVIDENCE, found, strict=True)}


# --- solid --------------------------------------------------------------------------------------------------------------

SOLID = {"width": 0.04, "thickness": 0.01012}


def solid(rng: np.random.Generator) -> Drawn:
    """A beam with constants within ±20 % of usual ones, damping of 1 to 20 %, 1 to 5 % noise, and a
    sensor's stated mass.

    Noise: H (1 + m g₁) + n rms(H) g₂ with complex normal g of unit variance, rms over the record.
    """
    usual = {"Ex": 30e9, "Ey": 28e9, "Gxy": 5.5e9, "Gxz": 5e9, "Gyz": 5e9}
    true = {name: value * rng.uniform(0.8, 1.2) for name, value in usual.items()}
    free = bool(rng.random() < 0.4)
    true["nu_xy"], true["a0"], true["a1"] = (
        rng.uniform(0.12, 0.2),
        rng.uniform(10, 60),
        rng.uniform(5e-6, 2e-5),
    )
    noise, highest = float(rng.choice([0.01, 0.02, 0.05])), float(rng.choice([800, 1000, 1600]))
    sensor, mass = int(rng.choice([33, 30, 31, 27])), float(rng.choice([0.0, 0.0048, 0.002]))
    length = 0.501 if free else 0.5
    # so that the points are nodes
    points, nx, ny = grid(length, SOLID["width"], free=free), 50 if free else 55, 6
    material = true | {"Ez": 1e10, "nu_xz": 0.15, "nu_yz": 0.15, "density": COUPONS.density}
    body = calculix.plate((nx, ny, 2), (length, *SOLID.values()), material)
    seen = body.nearest([(x, y, 0.0) for x, y, _ in points.values()])
    at = (seen[sensor - 1], mass) if mass else None
    found, motion = calculix.modes(body, 46, seen, clamped=not free, mass=at)
    eigenvalue, shapes = (2 * np.pi * found) ** 2, motion[..., 2]
    hz = np.arange(1.0, highest + 0.5)
    omega = 2 * np.pi * hz
    below = (
        eigenvalue[:, None]
        - omega**2
        + 1j * omega * (true["a0"] + true["a1"] * eigenvalue[:, None])
    )
    H = -(omega**2) * ((shapes * shapes[:, [sensor - 1]]).T @ (1 / below))
    H = add_noise(H, noise, 0.5, rng)
    boundary, (x, y, _) = "free" if free else "cantilever", points[sensor]
    masses = (PointMass(x, y, mass),) if mass else ()
    stated = Specimen(length, *SOLID.values(), COUPONS, boundary, masses)  # type: ignore[arg-type]
    kind = {
        "boundary": boundary,
        "noise": f"{noise}",
        "to": f"{highest:.0f} Hz",
        "mass": f"{1e3 * mass:.1f} g",
    }
    frfs = FrfSet(hz, H, tuple(Dof(point, 3) for point in points), (Dof(sensor, 3),) * len(points))
    return Drawn(stated, Measurement(frfs, points), true, kind)
