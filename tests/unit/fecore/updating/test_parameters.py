from dataclasses import replace

import numpy as np
import pytest

from fecore.body.constants import DEFAULT_PARAMETERS, PLY_PARAMETERS, Parameter
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.specimen import CONSTANTS, LayeredSpecimen, Specimen
from fecore.body.supports import Spring
from fecore.errors import InputError
from fecore.updating.parameters import parametrise
from tests.support.plates import coefficients as of_laminate

EVERYTHING = tuple(Parameter(name) for name in CONSTANTS)


def test_coefficients_are_those_of_the_section(nominal: Specimen) -> None:
    theta = np.array([30e9, 28e9, 5e9, 4e9, 6e9, 0.2, 1900.0, 0.011, 0.5, 0.04])
    coefficients = parametrise(nominal, EVERYTHING).coefficients(theta)
    values = dict(zip(CONSTANTS, theta.tolist(), strict=True))
    thickness = values.pop("thickness")
    material = replace(
        nominal.material,
        **{name: values[name] for name in values if hasattr(nominal.material, name)},
    )
    section = replace(nominal, material=material, thickness=thickness).section
    # The same closed forms evaluated in another order: equal to round-off.
    stiffness, inertia = of_laminate(nominal.structure, section)
    np.testing.assert_allclose(coefficients.stiffness, stiffness, rtol=1e-13, atol=0)
    np.testing.assert_allclose(coefficients.mass, inertia, rtol=1e-13, atol=0)


def test_derivatives_agree_with_complex_steps(nominal: Specimen) -> None:
    parametrisation = parametrise(nominal, EVERYTHING)
    theta = np.array([30e9, 28e9, 5e9, 4e9, 6e9, 0.2, 1900.0, 0.011, 0.5, 0.04])
    exact = parametrisation.coefficients(theta)
    for column, value in enumerate(theta):
        step = theta.astype(complex)
        step[column] += 1e-30j * value
        moved = parametrisation.coefficients(step)
        for got, by in ((moved.stiffness, exact.stiffness_by), (moved.mass, exact.mass_by)):
            # A complex step has no cancellation: only the formulas' own round-off is left.
            np.testing.assert_allclose(
                got.imag / (1e-30 * value), by[:, column], rtol=1e-13, atol=0
            )


def test_a_tied_constant_keeps_the_ratio_of_nominal_values(nominal: Specimen) -> None:
    recipe = (Parameter("Gxz", prior_mean=4e9), Parameter("Gyz", prior_mean=6e9, tied_to="Gxz"))
    constants = dict(
        zip(CONSTANTS, parametrise(nominal, recipe).constants(np.array([5e9])), strict=True)
    )
    assert constants["Gyz"] == pytest.approx(7.5e9, rel=1e-15)
    assert constants["Ex"] == nominal.material.Ex
    signed = parametrise(
        nominal, (Parameter("Ex"), Parameter("nu_xy", prior_mean=0.0, prior_sd=0.1))
    )
    # a free one follows itself, also from 0
    assert signed.spread[CONSTANTS.index("nu_xy")].tolist() == [0.0, 1.0]


def test_without_a_recipe_a_layer_s_constants_a_laminate_s_plies_and_every_zone_are_updated(
    nominal: Specimen,
) -> None:
    ply = Ply(OrthotropicMaterial(30e9, 10e9, 5e9, 4e9, 4e9, 0.2, 1600.0), 0.001)
    plies = LayeredSpecimen(0.3, 0.1, 0.002, (ply, ply), 1600.0)
    assert nominal.default_parameters() == DEFAULT_PARAMETERS
    assert plies.default_parameters() == PLY_PARAMETERS
    names = [one.name for one in replace(nominal, zones=(0.1, 0.2)).default_parameters()]
    assert names == [*(one.name for one in DEFAULT_PARAMETERS), "zone_1", "zone_2", "zone_3"]


def test_a_fixed_constant_is_its_prior_mean(nominal: Specimen) -> None:
    recipe = (
        Parameter("Ex"),
        Parameter("Gxz", prior_mean=4e9, fixed=True),
        Parameter("Gyz", fixed=True),
    )
    found = parametrise(nominal, recipe)
    constants = dict(zip(CONSTANTS, found.constants(np.array([30e9])), strict=True))
    assert found.names == ("Ex",)
    assert (constants["Ex"], constants["Gxz"], constants["Gyz"]) == (
        30e9,
        4e9,
        nominal.material.Gyz,
    )


def test_priors_signs_and_inputs_have_their_places(nominal: Specimen) -> None:
    parametrisation = parametrise(
        nominal, (Parameter("Ex"), Parameter("nu_xy", prior_mean=0.2, prior_sd=0.02))
    )
    assert parametrisation.prior_mean.tolist() == [nominal.material.Ex, 0.2]
    np.testing.assert_allclose(
        parametrisation.prior_sd, [0.3 * nominal.material.Ex, 0.02], rtol=1e-15
    )
    assert parametrisation.logarithmic.tolist() == [True, False]
    assert parametrisation.constants(parametrisation.prior_mean).shape == (len(CONSTANTS),)
    assert parametrisation.reported == parametrisation.names
    assert parametrisation.units[:6] == ("Pa",) * 5 + ("1",)
    assert len(parametrisation.units) == len(parametrisation.constant_names)
    # An input that is exactly known or that is a parameter anyway is not let go.
    wider = parametrisation.with_inputs({"density": 10.0, "thickness": 0.0, "Ex": 1e9})
    assert wider.names == ("Ex", "nu_xy", "density")
    assert wider.reported == ("Ex", "nu_xy")
    with pytest.raises(InputError, match="has the name of a constant"):
        parametrise(
            replace(nominal, springs=(Spring("Ex", 500.0, 3, point=(0.5, 0.0)),)),
            (Parameter("Ey"),),
        )
