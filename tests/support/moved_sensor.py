"""A tour whose sensor has a mass and goes from point to point while the hammer stays."""

import numpy as np

from fecore.body.specimen import Specimen
from fecore.dynamics.damping_laws import RAYLEIGH, beyond, damping_rate
from fecore.frf import Dof, FrfSet
from fecore.updating.forward import ForwardModel
from fecore.updating.measurement import Measurement
from tests.support.cantilever import grid
from tests.support.fits import at_prior, forward_model

# the paper's accelerometer: in the mode's worst place it lowers the frequency by some 3 %
MASS = 0.0048
LAW = np.array([42.25, 1.10e-5])
LINES = np.arange(2.0, 1201.0, 2.0)
HAMMER = 33
TRUE = {"Ex": 29.5e9, "Gxy": 6.6e9}


def forward(
    specimen: Specimen, count: int = 14, *, mass: float = MASS, reduced: bool = True
) -> ForwardModel:
    names = ("Ex", "Gxy", "Gxz", "thickness")
    return forward_model(specimen, count, *names, points=grid(), reduced=reduced, roving_mass=mass)


def sensor_tour() -> tuple[tuple[Dof, ...], tuple[Dof, ...]]:
    """The sensor goes from point to point, the hammer stays at a corner."""
    responses = tuple(Dof(point, 3 if point % 2 else -3) for point in grid())
    return responses, (Dof(HAMMER, 3),) * len(responses)


def measured(body: Specimen, mass: float, noise: float = 0.01) -> Measurement:
    responses, references = sensor_tour()
    model = at_prior(forward(body, 24, mass=mass)).frf_model(responses, references)
    tail = beyond(RAYLEIGH, LAW, float(model.omega[-1]))
    values = model.synthesise(LINES, damping_rate(RAYLEIGH, LAW, model.omega), beyond=tail)
    random = np.random.default_rng(2)
    floor = noise * np.sqrt(np.mean(np.abs(values) ** 2, axis=1, keepdims=True) / 2)
    noisy = values + floor * (
        random.standard_normal(values.shape) + 1j * random.standard_normal(values.shape)
    )
    return Measurement(FrfSet(LINES, noisy, responses, references), grid(), roving_mass=mass)
