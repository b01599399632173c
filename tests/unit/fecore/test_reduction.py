import numpy as np
import pytest

from fecore.body.constants import Parameter
from fecore.body.specimen import Specimen
from fecore.body.supports import PointMass
from fecore.dynamics.eigen import normal_modes
from fecore.dynamics.reduction import FREQUENCY_TOLERANCE, ReducedModel
from fecore.updating.parameters import parametrise
from tests.support.fits import forward_model
from tests.support.lengths import long
from tests.support.plates import PAPER

FIVE = ("Ex", "Ey", "Gxy", "Gxz", "Gyz")
EIGHT = (*FIVE, "nu_xy", "density", "thickness")


def laden(boundary: str) -> Specimen:
    return Specimen(
        0.5, 0.04, 0.01, PAPER, boundary, (PointMass(0.49, 0.015, 0.0048),), divisions=(20, 2)
    )


def full_modes(model, c, count):
    return normal_modes(
        model.stiffness.at(c.stiffness), model.mass.at(c.mass), count, model.rigid_modes
    )


@pytest.mark.parametrize(("boundary", "names"), [("cantilever", FIVE), long("free", EIGHT)])
def test_frequencies_over_a_box_of_half_and_its_corners(boundary, names) -> None:
    specimen = laden(boundary)
    model, parametrisation = (
        specimen.model,
        parametrise(specimen, [Parameter(name) for name in names]),
    )
    reduced = forward_model(specimen, 9, *names, points={1: (0.4, 0.01)}).basis
    rng = np.random.default_rng(5)
    checked = 0
    for draw in range(20):
        away = rng.choice([-1, 1], len(names)) if draw < 4 else rng.uniform(-1, 1, len(names))
        theta = parametrisation.prior_mean * (1 + 0.5 * away)
        if not parametrisation.is_physical(theta):
            continue
        c = parametrisation.coefficients(theta)
        full = full_modes(model, c, 9)
        before = reduced.system.modes(c.stiffness, c.mass, 9)
        error = np.abs(before.frequency_hz[full.rigid :] / full.frequency_hz[full.rigid :] - 1)
        estimate = reduced.frequency_error(c.stiffness, c.mass, before)
        # It says so: whatever misses the tolerance is estimated to miss it.
        assert np.all(estimate[error > FREQUENCY_TOLERANCE] > FREQUENCY_TOLERANCE)
        after = reduced.modes(c.stiffness, c.mass)
        np.testing.assert_allclose(
            after.frequency_hz[full.rigid :], full.frequency_hz[full.rigid :], rtol=2e-6
        )
        np.testing.assert_array_equal(after.eigenvalue[: full.rigid], 0)
        checked += 1
    assert checked > 10
    assert reduced.full_solves < checked  # what was learnt serves later draws


def test_near_the_start_nothing_is_solved_in_full_and_shapes_agree() -> None:
    specimen = laden("cantilever")
    model, parametrisation = (
        specimen.model,
        parametrise(specimen, [Parameter(name) for name in FIVE]),
    )
    reduced = forward_model(specimen, 9, *FIVE, points={1: (0.4, 0.01)}).basis
    rng = np.random.default_rng(1)
    for _ in range(20):
        c = parametrisation.coefficients(
            parametrisation.prior_mean * (1 + 0.02 * rng.uniform(-1, 1, 5))
        )
        modes, full = reduced.modes(c.stiffness, c.mass), full_modes(model, c, 9)
        np.testing.assert_allclose(modes.frequency_hz, full.frequency_hz, rtol=1e-6)
        shapes = reduced.basis @ modes.shapes
        shapes = shapes * np.sign(np.einsum("dn,dn->n", shapes, full.shapes))
        # A shape's error is about the root of its frequency's.
        np.testing.assert_allclose(shapes, full.shapes, atol=1e-3 * np.abs(full.shapes).max())
    assert reduced.full_solves == 1


def test_a_parameter_at_its_bound_is_mended_to_the_tolerance() -> None:
    """A thousandth of the transverse shear: what enrichment must add has little energy at the start
    and much there.
    """
    specimen = Specimen(0.5, 0.04, 0.01, PAPER)
    model, parametrisation = (
        specimen.model,
        parametrise(specimen, [Parameter(name) for name in FIVE]),
    )
    start = parametrisation.coefficients(parametrisation.prior_mean)
    reduced = ReducedModel(model, start.stiffness, start.mass, 20)
    # the second lies near the first
    for share in ([0.93, 0.81, 0.61, 1e-3, 1e-3], [0.97, 0.91, 0.80, 1e-3, 1e-3]):
        c = parametrisation.coefficients(parametrisation.prior_mean * np.array(share))
        found = reduced.modes(c.stiffness, c.mass).frequency_hz
        np.testing.assert_allclose(
            found, full_modes(model, c, 20).frequency_hz, rtol=FREQUENCY_TOLERANCE
        )


def test_a_basis_that_misses_after_enrichment_is_begun_anew() -> None:
    """No enrichment meets a tolerance below round-off; the answer is the full model's all the same,
    and never an error.
    """
    specimen = laden("cantilever")
    model, parametrisation = (
        specimen.model,
        parametrise(specimen, [Parameter(name) for name in FIVE]),
    )
    start = parametrisation.coefficients(parametrisation.prior_mean)
    reduced = ReducedModel(model, start.stiffness, start.mass, 9, tolerance=1e-15)
    for share in (1.2, 0.8):
        c = parametrisation.coefficients(
            parametrisation.prior_mean * np.array([share, 1, 1 / share, 0.1, 1])
        )
        before = reduced.full_solves
        found, full = reduced.modes(c.stiffness, c.mass), full_modes(model, c, 9)
        assert reduced.full_solves == before + 2  # to enrich it, and to begin anew
        np.testing.assert_allclose(found.frequency_hz, full.frequency_hz, rtol=1e-8)
        assert reduced.basis.shape[1] == ReducedModel(model, c.stiffness, c.mass, 9).basis.shape[1]


def test_a_basis_that_holds_the_lowest_modes_is_smaller_and_holds_them_wherever_they_come_to_lie() -> (
    None
):
    specimen = laden("free")
    model, parametrisation = (
        specimen.model,
        parametrise(specimen, [Parameter(name) for name in FIVE]),
    )
    c = parametrisation.coefficients(parametrisation.prior_mean)
    limit = 0.95 * full_modes(model, c, 14).eigenvalue[9]
    changes = (
        c.stiffness_by * parametrisation.prior_mean / 2,
        c.mass_by * parametrisation.prior_mean / 2,
    )
    whole, part = (
        ReducedModel(model, c.stiffness, c.mass, 14, tolerance=1e-5, held=held, changes=changes)
        for held in (np.inf, limit)
    )
    assert part.basis.shape[1] < 0.8 * whole.basis.shape[1]
    rng = np.random.default_rng(3)
    most = 0
    for away in (np.full(5, -1.0), *rng.uniform(-1, 1, (11, 5))):
        c = parametrisation.coefficients(parametrisation.prior_mean * (1 + 0.3 * away))
        full = full_modes(model, c, 14)
        held = full.eigenvalue <= limit
        most = max(most, int(held.sum()))
        np.testing.assert_allclose(
            part.modes(c.stiffness, c.mass).eigenvalue[held], full.eigenvalue[held], rtol=2e-5
        )
    assert most > 9  # softer, more modes lie below the limit than at the start
    assert part.full_solves < 12
