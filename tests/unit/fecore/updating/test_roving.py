"""A sensor that moves with the response: each FRF against a body with the mass at that point, and
what updating makes of it.
"""

from dataclasses import replace

import numpy as np
import pytest

from fecore.body.specimen import Specimen
from fecore.body.supports import PointMass
from fecore.dynamics.damping_laws import RAYLEIGH, beyond, damping_rate
from fecore.frf import Dof
from fecore.modes import MeasuredModes
from fecore.updating.inputs import Inputs
from fecore.updating.measurement import Recipe
from fecore.updating.misfit import FrfMisfit
from fecore.updating.pipeline import update
from fecore.updating.result import UpdateResult
from tests.support.direct import direct_frf
from tests.support.fits import at_prior
from tests.support.lengths import long
from tests.support.moved_sensor import HAMMER, LAW, MASS, TRUE, forward, measured


@pytest.fixture(scope="module")
def nominal(nominal: Specimen) -> Specimen:
    """On a mesh that is coarse, as what is measured comes from it too."""
    return replace(nominal, divisions=(12, 2))


@pytest.fixture(scope="module")
def body(nominal: Specimen) -> Specimen:
    return replace(nominal, material=replace(nominal.material, **TRUE))


@pytest.mark.parametrize("boundary", ["cantilever", long("free")])
def test_each_frf_is_that_of_the_body_with_the_mass_at_its_response_point(
    nominal: Specimen, boundary: str
) -> None:
    bare = replace(nominal, boundary=boundary, divisions=(20, 2))
    model = forward(bare, 24, reduced=False)
    state, c = at_prior(model), at_prior(model).coefficients
    frequency = np.linspace(5, 1000, 7)
    K, M = bare.model.stiffness.at(c.stiffness), bare.model.mass.at(c.mass)
    damping = LAW[0] * M + LAW[1] * K  # of the body: the sensor has none
    row = {point: number for number, point in enumerate(model.points)}
    for point in (1, 33):
        frfs = state.frf_model([Dof(point, 3)], [Dof(HAMMER, 3)])
        tail = beyond(RAYLEIGH, LAW, float(frfs.omega[-1]))
        found = frfs.synthesise(frequency, damping_rate(RAYLEIGH, LAW, frfs.omega), beyond=tail)
        x, y, _ = model.places[row[point]]
        laden = replace(bare, masses=(PointMass(float(x), float(y), MASS),))
        load = model.observation[[row[HAMMER]]].toarray().ravel()
        # the last coefficient is that of masses which are known
        heavier = laden.model.mass.at(np.append(c.mass, 1.0))
        exact = direct_frf(
            K, heavier, damping, model.observation[[row[point]]], load, frequency, "accelerance"
        )
        assert np.max(np.abs(found - exact)) < 2e-6 * np.abs(exact).max()
        plain = replace(frfs, roving=None).synthesise(
            frequency, damping_rate(RAYLEIGH, LAW, frfs.omega), beyond=tail
        )
        if point == HAMMER:
            assert np.max(np.abs(plain - exact)) > 0.05 * np.abs(exact).max()


def test_derivatives_by_modes_agree_with_differences(body: Specimen) -> None:
    """Gradient and hessian of the misfit under a roving mass against differences of the FRFs
    themselves.
    """
    taken = measured(body, MASS, 0.05).frfs
    model = at_prior(forward(body)).frf_model(taken.responses, taken.references)
    misfit = FrfMisfit(taken, model, "linear", np.ones(taken.values.shape))
    rate = damping_rate(RAYLEIGH, LAW * 1.2, model.omega)
    normal = misfit.normal(model.eigenvalue, rate)
    columns = []
    for u, values in enumerate((model.eigenvalue, rate)):
        for k in range(values.size):
            step = 1e-5 * values[k] * np.eye(values.size)[k]
            pair = (
                (
                    (model.eigenvalue + s * step, rate)
                    if u == 0
                    else (model.eigenvalue, rate + s * step)
                )
                for s in (1, -1)
            )
            up, down = (misfit.predict(*each) for each in pair)
            columns.append((up - down).ravel() / (2e-5 * values[k]))
    J = np.array(columns).T
    residual = (taken.values - misfit.predict(model.eigenvalue, rate)).ravel()
    size = np.linalg.norm(J, axis=0)
    # Central differences err by the square of the step over the half bandwidth, (1e-5/ζ)² < 1e-6,
    # at worst.
    np.testing.assert_allclose(
        normal.gradient / size,
        2 * np.real(J.conj().T @ residual) / size,
        atol=1e-5 * np.linalg.norm(residual),
    )
    np.testing.assert_allclose(
        normal.hessian / np.outer(size, size),
        2 * np.real(J.conj().T @ J) / np.outer(size, size),
        atol=1e-5,
    )


@pytest.fixture(scope="module")
def modelled(nominal: Specimen, body: Specimen, _few_draws: None) -> UpdateResult:
    state = at_prior(forward(body))
    typed, tour = (
        MeasuredModes(state.frequency_hz[:5] * 0.985, np.full(5, 0.02)),
        measured(body, MASS),
    )
    few = tour.frfs.select(list(range(0, 33, 2)))
    recipe = Recipe(damping_models=("rayleigh",))
    return update(replace(tour, frfs=few, modes=typed), nominal, recipe)


def test_constants_and_damping_come_back_from_under_a_roving_sensor(modelled: UpdateResult) -> None:
    rows = {row.name: row for row in modelled.parameters}
    for name, value in {**TRUE, "a0": LAW[0], "a1": LAW[1]}.items():
        assert rows[name].estimate == pytest.approx(value, rel=0.01), name
        assert rows[name].interval_95[0] < value < rows[name].interval_95[1], name
    assert rows["Ex"].estimate == pytest.approx(TRUE["Ex"], rel=2e-3)
    assert any(
        "4.8 g moved with the response" in text and "mode set was not used" in text
        for text in modelled.warnings
    )
    assert np.min(modelled.correlation.updated.sac) > 0.9995
    held = modelled.correlation.held_out_frfs
    assert held is not None
    assert held.coverage_95 > 0.9


def test_modes_are_those_without_the_sensor(modelled: UpdateResult, body: Specimen) -> None:
    bare = at_prior(forward(body, mass=0.0)).frequency_hz[:5]
    # The sensor lowers them by up to 3 %; noise leaves half a thousandth of the first, which is the
    # most damped.
    np.testing.assert_allclose([mode.measured_hz for mode in modelled.modes], bare, rtol=1.5e-3)


@pytest.mark.long
def test_without_it_they_do_not_come_back(nominal: Specimen, body: Specimen) -> None:
    """Why the mass is modelled, as the tests above have it: taken for massless, the sensor's modes pass for those of a softer
    body.

    The inputs are exactly known: a careful laboratory's thickness alone widens the interval to more
    than the 5 % of the sensor.
    """
    sensed = measured(body, MASS, 0.05)
    few = sensed.frfs.select(list(range(0, 33, 6)))
    massless = replace(sensed, frfs=few, roving_mass=0.0, inputs=Inputs.exact())
    blind = update(massless, nominal, Recipe(damping_models=("rayleigh",)))
    rows = {row.name: row for row in blind.parameters}
    assert rows["Ex"].estimate < 0.985 * TRUE["Ex"]
    assert rows["Ex"].interval_95[1] < TRUE["Ex"]
