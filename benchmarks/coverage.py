"""Measurements made by the core with a random truth and a model that is slightly wrong, for tests of intervals.

Each is a cantilever with constants and damping drawn at random around the nominal ones. Its FRFs come from the model
with every natural frequency off by a random 0.2 % and every damping ratio off its law by a random 2 % (the model error that
the intervals claim to allow for), and 1 % noise.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import Specimen
from fecore.dynamics.damping_laws import RAYLEIGH, beyond, damping_rate
from fecore.frf import Dof, FrfSet
from fecore.updating.forward import ForwardModel
from fecore.updating.measurement import Measurement
from fecore.updating.parameters import parametrise
from fecore.updating.result import UpdateResult

NOMINAL = OrthotropicMaterial(Ex=33.05e9, Ey=31.80e9, Gxy=5.73e9, Gxz=4.5e9, Gyz=4.5e9, nu_xy=0.15, density=2012.0)
BEAM = Specimen(length=0.5, width=0.04, thickness=0.010, material=NOMINAL)
LINES_HZ = np.arange(2.0, 1001.0, 2.0)
SENSOR = 33
FREQUENCY_ERROR, DAMPING_ERROR, NOISE = 0.002, 0.02, 0.01
PARAMETERS = ("Ex", "Ey", "Gxy", "Gxz", "a0", "a1")


def grid() -> dict[int, tuple[float, float, float]]:
    """33 points, three across and eleven along."""
    places = [(0.5 * row / 11, 0.02 * column, 0.005) for row in range(1, 12) for column in (-1, 0, 1)]
    return dict(enumerate(places, start=1))


def draw(seed: int) -> tuple[Measurement, dict[str, float]]:
    """A measurement of a random beam, and its true parameters."""
    random = np.random.default_rng(seed)
    spread = {"Ex": 0.12, "Ey": 0.30, "Gxy": 0.12, "Gxz": 0.12}  # Ey as its prior says, for nothing else depends on it
    factor = {name: np.clip(1 + share * random.standard_normal(), 0.4, 1.6) for name, share in spread.items()}
    true = {name: float(getattr(NOMINAL, name) * factor[name]) for name in spread}
    true["a0"], true["a1"] = 30 * np.exp(0.3 * random.standard_normal()), 1e-5 * np.exp(0.3 * random.standard_normal())
    material = replace(NOMINAL, Ex=true["Ex"], Ey=true["Ey"], Gxy=true["Gxy"], Gxz=true["Gxz"], Gyz=true["Gxz"])
    body, points = replace(BEAM, material=material), grid()
    places = np.array(list(points.values()))[:, :2]
    parametrisation = parametrise(body)
    state = ForwardModel(body, parametrisation, tuple(points), places, 14).solve(parametrisation.prior_mean)
    hammer, sensor = tuple(Dof(point, 3) for point in points), (Dof(SENSOR, 3),) * len(points)
    model = state.frf_model(sensor, hammer)
    omega = model.omega * (1 + FREQUENCY_ERROR * random.standard_normal(model.omega.size))
    rate = damping_rate(RAYLEIGH, np.array([true["a0"], true["a1"]]), omega)
    rate = rate * np.exp(DAMPING_ERROR * random.standard_normal(rate.size))
    tail = beyond(RAYLEIGH, np.array([true["a0"], true["a1"]]), float(omega[-1]))
    values = model.with_eigenvalue(omega**2).synthesise(LINES_HZ, rate, beyond=tail)
    floor = NOISE * np.sqrt(np.mean(np.abs(values) ** 2, axis=1, keepdims=True) / 2)
    noise = random.standard_normal(values.shape) + 1j * random.standard_normal(values.shape)
    return Measurement(FrfSet(LINES_HZ, values + floor * noise, sensor, hammer), points), true


def inside(result: UpdateResult, true: dict[str, float]) -> dict[str, bool]:
    """Whether each parameter's 95 % interval holds the truth."""
    found = {row.name: row.interval_95 for row in result.parameters}
    return {name: found[name][0] <= true[name] <= found[name][1] for name in PARAMETERS}
