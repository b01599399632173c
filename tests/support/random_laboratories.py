"""Laboratories drawn at random by seed, one fault in each or none.

Structures are strips and plates of 1 to 20 mm of glass fibre, carbon fibre and isotropic material;
tours a grid, an edge, a centre line or a few points, by hammer or sensors, with one reference or
two; bands begin at 0 Hz, below or above the first mode, and end between modes or in one. Damping is
0.05 to 8 %, noise 0.1 to 10 %.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, get_args

import numpy as np

from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import Specimen
from fecore.body.supports import Boundary
from fecore.dynamics.damping_laws import RAYLEIGH, ModalDamping, beyond, damping_rate
from fecore.dynamics.synthesis import ModalFrfModel
from fecore.frf import Dof, FrfSet, Quantity
from fecore.updating.forward import ForwardModel, modes_to_cover
from fecore.updating.measurement import Measurement
from fecore.updating.parameters import parametrise
from tests.support.draws import Dofs, Drawn, Points, noisy, solved

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
CHOICES: dict[str, Any] = {
    "body": list(BODIES),
    "material": list(MATERIALS),
    "boundary": list(get_args(Boundary)),
    "tour": ["grid", "few", "centre", "edge"],
    "band": ["plain", "from 0 Hz", "above mode 1", "to a resonance", "two modes"],
    "law": ["rayleigh", "stiffness", "constant"],
    "quantity": list(get_args(Quantity)),
    "noise": ["0.001", "0.01", "0.03", "0.1"],
    "lines": ["150", "400", "800", "1600", "3200"],
}
FAULTS = (
    "sign",
    "height",
    "all heights",
    "points",
    "dead",
    "hum",
    "overload",
    "boundary",
    "length",
    "thickness",
)


def draw(seed: int, fault: str = "none") -> Drawn:
    """One laboratory; its constants are up to 45 % off the nominal ones, frequencies off by 0.2 %,
    damping ratios by 2 %.
    """
    rng = np.random.default_rng(seed)
    kind = {name: str(rng.choice(values)) for name, values in CHOICES.items()}
    length, width, thickness, divisions = BODIES[kind["body"]]
    nominal = MATERIALS[kind["material"]]
    stated = Specimen(length, width, thickness, nominal, kind["boundary"], divisions=divisions)  # type: ignore[arg-type]
    spread = rng.choice([0.1, 0.2, 0.3])
    true = {
        name: float(
            getattr(nominal, name) * (1 + spread * np.clip(rng.standard_normal(), -1.5, 1.5))
        )
        for name in ("Ex", "Ey", "Gxy", "Gxz")
    }
    body = replace(
        stated, material=replace(nominal, **true, Gyz=nominal.Gyz * true["Gxz"] / nominal.Gxz)
    )
    points = _tour(kind["tour"], stated, rng)
    dofs = _pairs(points, rng)
    hz, ends = _axis(kind, body, rng)
    state = solved(body, points, modes_to_cover(parametrise(body), float(hz[-1]), 12))
    damping = float(np.exp(rng.uniform(np.log(0.0005), np.log(0.08))))
    values, law = _frfs(state.frf_model(*dofs), state.modes.rigid, kind, hz, ends, damping, rng)
    if law is not None:
        true.update(a0=float(law[0]), a1=float(law[1]))
    given = Measurement(FrfSet(hz, values, *dofs, kind["quantity"]), points)  # type: ignore[arg-type]
    return Drawn(*_spoil(fault, stated, given, rng), true, {**kind, "fault": fault})


def _tour(tour: str, body: Specimen, rng: np.random.Generator) -> Points:
    """Points where the boundary lets the body move."""
    count, across = (8, 3) if body.width < body.length / 4 else (6, 5)
    inner = np.linspace(0, body.length, count + 2)
    x = {"cantilever": inner[1:], "free": inner, "simply_supported": inner[1:-1]}[body.boundary]
    y = {"centre": np.zeros(1), "edge": np.array([body.width / 2])}.get(
        tour, np.linspace(-0.5, 0.5, across) * body.width
    )
    places = [(float(a), float(b), 0.0) for a in x for b in y]
    if tour == "few":
        some = rng.choice(len(places) - 1, rng.integers(2, 6), replace=False)
        places = [places[row] for row in sorted(some)] + places[-1:]
    return dict(enumerate(places, start=1))


def _pairs(points: Points, rng: np.random.Generator) -> tuple[Dofs, Dofs]:
    """Responses and references: hammer or sensors rove about one fixed dof or two, some of them
    along -z.
    """
    fixed = [len(points)] if rng.random() < 0.75 else [len(points), max(1, len(points) // 2)]
    sense = -3 if rng.random() < 0.3 else 3
    roving = tuple(Dof(point, sense) for _ in fixed for point in points)
    still = tuple(Dof(point, 3) for point in fixed for _ in points)
    return (still, roving) if rng.random() < 0.5 else (roving, still)


def _axis(
    kind: Mapping[str, str], body: Specimen, rng: np.random.Generator
) -> tuple[np.ndarray, tuple[float, float]]:
    """Lines in Hz, and the first and the last natural frequency in the band."""
    known = parametrise(body)
    modes = ForwardModel(body, known, (), np.zeros((0, 2)), 12).solve(known.prior_mean).frequency_hz
    last = 1 if kind["band"] == "two modes" else int(rng.integers(3, 7))
    low = {"from 0 Hz": 0.0, "above mode 1": np.sqrt(modes[0] * modes[1])}.get(
        kind["band"], 0.3 * modes[0]
    )
    high = (
        modes[last] * 1.002
        if kind["band"] == "to a resonance"
        else np.sqrt(modes[last] * modes[last + 1])
    )
    return np.linspace(low, high, int(kind["lines"])), (float(modes[0]), float(modes[last]))


def _frfs(
    model: ModalFrfModel,
    rigid: int,
    kind: Mapping[str, str],
    hz: np.ndarray,
    ends: tuple[float, float],
    damping: float,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray | None]:
    """FRFs with noise of a body that is not quite the model, and the coefficients of its law where
    it is Rayleigh's.
    """
    omega = model.omega * (1 + 0.002 * rng.standard_normal(model.omega.size))
    first, last = (2 * np.pi * end for end in ends)
    if kind["law"] == "constant":
        law, tail = None, (0.0, 0.0)
        rate = damping_rate(ModalDamping((last,)), np.array([damping]), omega)
        rate[:rigid] = 0.1 * damping * first
    else:
        law = damping * np.array(
            [first, 1 / last] if kind["law"] == "rayleigh" else [0.0, 2 / last]
        )
        rate, tail = damping_rate(RAYLEIGH, law, omega), beyond(RAYLEIGH, law, float(omega[-1]))
    rate = rate * np.exp(0.02 * rng.standard_normal(rate.size))
    lines = np.maximum(hz, 1e-3 * hz[-1])
    values = model.with_eigenvalue(omega**2).synthesise(lines, rate, kind["quantity"], tail)  # type: ignore[arg-type]
    return noisy(values, float(kind["noise"]), rng, lines > 0.5 * ends[0]), law


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
    elif fault in ("length", "thickness"):
        stated = replace(stated, **{fault: 1.1 * getattr(stated, fault)})
    return stated, replace(
        measurement, frfs=replace(measurement.frfs, values=values), points=points
    )
