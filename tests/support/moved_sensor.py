"""A tour whose sensor has a mass and goes from point to point while the hammer stays."""

import numpy as np

from fecore.body.specimen import Specimen
from fecore.dynamics.damping_laws import RAYLEIGH, beyond, damping_rate
from fecore.frf import Dof, FrfSet
from fecore.updating.forward import ForwardModel, ForwardState
from fecore.updating.measurement import Measurement
from fecore.updating.parameters import Parameter, parametrise
from tests.support.cantilever import grid

MASS = 0.0048  # the paper's accelerometer: in the mode's worst place it lowers the frequency by some 3 %
LAW = np.array([42.25, 1.10e-5])
LINES = np.arange(2.0, 1201.0, 2.0)
HAMMER = 33
TRUE = {"Ex": 29.5e9, "Gxy": 6.6e9}


def forward(specimen: Specimen, count: int = 14, *, mass: float = MASS, reduced: bool = True) -> ForwardModel:
    points = grid()
    places = np.array(list(points.values()))[:, :2]
    parametrisation = parametrise(specimen, [Parameter(name) for name in ("Ex", "Gxy", "Gxz", "thickness")])
    return ForwardModel(specimen, parametrisation, tuple(points), places, count, reduced, mass)


def sensor_tour() -> tuple[tuple[Dof, ...], tuple[Dof, ...]]:
    """The sensor goes from point to point, the hammer stays at a corner."""
    responses = tuple(Dof(point, 3 if point % 2 else -3) for point in grid())
    return responses, (Dof(HAMMER, 3),) * len(responses)


def nominal_state(model: ForwardModel) -> ForwardState:
    return model.solve(model.parametrisation.prior_mean)


def measured(body: Specimen, mass: float, noise: float = 0.01) -> Measurement:
    responses, references = sensor_tour()
    model = nominal_state(forward(body, 24, mass=mass)).frf_model(responses, references)
    tail = beyond(RAYLEIGH, LAW, float(model.omega[-1]))
    values = model.synthesise(LINES, damping_rate(RAYLEIGH, LAW, model.omega), beyond=tail)
    random = np.random.default_rng(2)
    floor = noise * np.sqrt(np.mean(np.abs(values) ** 2, axis=1, keepdims=True) / 2)
    noisy = values + floor * (random.standard_normal(values.shape) + 1j * random.standard_normal(values.shape))
    return Measurement(FrfSet(LINES, noisy, responses, references), grid(), roving_mass=mass)
