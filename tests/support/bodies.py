"""Matrices and natural modes of any body, at its nominal constants or at others."""

import numpy as np
from scipy.sparse import csc_array

from fecore.arrays import FloatArray
from fecore.body.constants import Body
from fecore.dynamics.eigen import NormalModes, normal_modes


def pencil(body: Body, constants: FloatArray | None = None) -> tuple[csc_array, csc_array]:
    """K and M, with the body's springs."""
    q, model = np.array(list(body.nominal.values())) if constants is None else constants, body.model
    springs = [spring.stiffness for spring in body.springs]
    stiffness = np.append(body.stiffness_coefficients(q), springs)
    return model.stiffness.at(stiffness), model.mass.at(body.mass_coefficients(q))


def modes(body: Body, count: int, constants: FloatArray | None = None) -> NormalModes:
    """As many elastic modes as asked for, after those of the rigid body."""
    rigid = body.model.rigid_modes
    return normal_modes(*pencil(body, constants), count + rigid.shape[1], rigid)


def hz(body: Body, count: int = 6, constants: FloatArray | None = None) -> FloatArray:
    """The lowest elastic natural frequencies."""
    found = modes(body, count, constants)
    return found.frequency_hz[found.rigid :]
