"""Plates of plies whose modes are simulated on a finer mesh than updating takes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fecore.body.laminate import OrthotropicMaterial
from fecore.body.layered import LayeredSpecimen
from fecore.frf import Dof
from fecore.modes import MeasuredModes
from fecore.updating.forward import ForwardModel
from fecore.updating.parameters import Parameter, parametrise

CARBON = OrthotropicMaterial(130e9, 9e9, 5e9, 5e9, 3.5e9, 0.3, 1600.0)
"""A carbon fibre ply, as a handbook has it."""

Points = dict[int, tuple[float, float, float]]


def measured_plate(
    body: LayeredSpecimen, truth: dict[str, float], random: np.random.Generator, *, noise: float, modes: int = 12
) -> tuple[MeasuredModes, Points]:
    """The first out-of-plane modes of a plate whose constants are the truth's, with noise relative to the frequencies."""
    length, width = body.length, body.width
    nx, ny = body.divisions or (16, 10)
    fine = replace(body, divisions=(3 * nx // 2, 3 * ny // 2))
    along, across = np.meshgrid(np.linspace(0.03, 0.97, 8) * length, np.linspace(-0.47, 0.47, 5) * width)
    places = np.column_stack([along.ravel(), across.ravel()])
    held = [Parameter(name, prior_mean=value) for name, value in {**fine.nominal, **truth}.items()]
    prior = parametrise(fine, held)
    state = ForwardModel(fine, prior, tuple(range(1, len(places) + 1)), places, modes + 14, reduced=False).solve(
        prior.prior_mean
    )
    seen = [k for k in range(state.frequency_hz.size) if k not in state.hidden][:modes]
    hz = state.frequency_hz[seen] * (1 + noise * random.standard_normal(modes))
    covariance = np.diag(np.concatenate([(noise * hz) ** 2, np.full(modes, 1e-8)]))
    points = {number: (float(x), float(y), 0.0) for number, (x, y) in enumerate(places, start=1)}
    dofs = tuple(Dof(number, 3) for number in points)
    return MeasuredModes(hz, np.full(modes, 0.01), state.shapes[seen] + 0j, dofs, covariance), points
