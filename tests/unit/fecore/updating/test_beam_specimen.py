"""An isotropic beam goes through the same updating as a plate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fecore.body.beam_specimen import BEAM_CONSTANTS, BeamSpecimen
from fecore.body.beams import rectangle_torsion
from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import Specimen
from fecore.frf import Dof, along_z
from fecore.modes import MeasuredModes
from fecore.updating.forward import ForwardModel
from fecore.updating.parameters import Parameter, parametrise
from tests.support.cantilever import grid
from tests.support.fits import update_elastic

BEAM = BeamSpecimen(0.5, 0.04, 0.010, modulus=30e9, poisson=0.3, density=2012.0)
EVERYTHING = [Parameter(name) for name in BEAM_CONSTANTS]
NAMES = BEAM.model.stiffness.names, BEAM.model.mass.names


def isotropic(modulus: float, poisson: float, density: float) -> OrthotropicMaterial:
    shear = modulus / (2 * (1 + poisson))
    return OrthotropicMaterial(modulus, modulus, shear, shear, shear, poisson, density)


def forward(parameters: list[Parameter]) -> ForwardModel:
    points = grid()
    places = np.array(list(points.values()))[:, :2]
    return ForwardModel(BEAM, parametrise(BEAM, parameters), along_z(points), places, 9)


def test_coefficients_are_those_of_the_section() -> None:
    theta = np.array([70e9, 0.33, 2700.0, 0.03, 0.004, 0.5])
    found = parametrise(BEAM, EVERYTHING).coefficients(theta)
    E, nu, density, b, t, _ = theta
    G = E / (2 * (1 + nu))
    torsion = float(rectangle_torsion(*map(np.array, (G, G, b, t))))
    stiffness, mass = (dict(zip(names, range(len(names)), strict=True)) for names in NAMES)
    np.testing.assert_allclose(
        found.stiffness[[stiffness[f"beam.{name}"] for name in ("GA2", "GJ", "EI1")]],
        [5 / 6 * G * b * t, torsion, E * b * t**3 / 12],
        rtol=1e-14,
    )
    polar = b * t * (b**2 + t**2) / 12
    np.testing.assert_allclose(
        found.mass[[mass[f"beam.{name}"] for name in ("m", "mJ", "mI1")]],
        density * np.array([b * t, polar, b * t**3 / 12]),
        rtol=1e-14,
    )


def test_derivatives_agree_with_closed_forms_and_differences() -> None:
    theta = np.array([70e9, 0.33, 2700.0, 0.03, 0.004, 0.5])
    E, nu, density, width, thickness, _ = theta
    parametrisation = parametrise(BEAM, EVERYTHING)
    found = parametrisation.coefficients(theta)
    bends = NAMES[0].index("beam.EI1")
    shears = [row for row, name in enumerate(NAMES[0]) if "G" in name]
    np.testing.assert_allclose(found.stiffness_by[:, 0], found.stiffness / E, rtol=1e-14)
    np.testing.assert_allclose(found.stiffness_by[shears, 1], -found.stiffness[shears] / (1 + nu), rtol=1e-14)
    by_size = found.stiffness[bends] * np.array([1 / width, 3 / thickness])
    np.testing.assert_allclose(found.stiffness_by[bends, 3:5], by_size)
    np.testing.assert_allclose(found.mass_by[:, 2], found.mass / density, rtol=1e-14)
    for p, value in enumerate(theta):  # the torsion series, which has no short derivative
        step = 1e-5 * value * np.eye(6)[p]
        up, down = (parametrisation.coefficients(theta + sign * step) for sign in (1, -1))
        difference = (up.stiffness - down.stiffness) / (2e-5 * value)
        # Central differences err by 1e-10 relative and round-off/step, 1e-11 of the value.
        np.testing.assert_allclose(
            found.stiffness_by[:, p], difference, rtol=1e-8, atol=1e-9 * found.stiffness.max() / value
        )


def test_in_plane_motion_is_left_out_and_the_plate_agrees() -> None:
    state = forward([Parameter("E")]).solve(np.array([30e9]))
    assert set(state.kinds) == {"bending", "torsion"}
    plate = Specimen(0.5, 0.04, 0.010, isotropic(30e9, 0.3, 2012.0))
    shell = ForwardModel(plate, parametrise(plate), along_z((1,)), np.array([[0.5, 0.0]]), 4)
    bending = state.frequency_hz[np.array(state.kinds) == "bending"]
    theirs = shell.solve(shell.parametrisation.prior_mean)
    other = theirs.frequency_hz[np.array(theirs.kinds) == "bending"]
    # A beam's clamp holds no anticlastic bending.
    np.testing.assert_allclose(bending[:3], other[:3], rtol=5e-3)


def test_bending_and_torsion_give_both_constants_back() -> None:
    model = forward([Parameter("E", prior_mean=25e9), Parameter("nu", prior_sd=0.3)])
    truth = np.array([31e9, 0.22])
    state = model.solve(truth)
    dofs = tuple(Dof(point, 3) for point in model.points)
    modes = MeasuredModes(state.frequency_hz[:5], np.full(5, 0.02), state.shapes[:5].astype(complex), dofs)
    result = update_elastic(model, modes)
    sd = np.sqrt(np.diag(result.covariance))
    assert np.all(np.abs(result.theta - truth) < 0.5 * sd)  # priors of 30 % may pull a little, no more
    np.testing.assert_allclose(result.theta, truth, rtol=5e-3)
    assert all(verdict.identifiable for verdict in result.identifiability)


def test_points_of_the_axis_see_no_torsion() -> None:
    model = replace(forward([Parameter("E")]), places=np.array([[0.25, 0.0], [0.5, 0.0]]), dofs=along_z((1, 2)))
    state = model.solve(np.array([30e9]))
    twisted = np.array(state.kinds) == "torsion"
    assert twisted.any()
    np.testing.assert_allclose(state.shapes[twisted], 0, atol=1e-8 * np.abs(state.shapes).max())
