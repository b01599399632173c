import numpy as np
import pytest

from fecore.body.specimen import Specimen
from fecore.body.supports import PointMass
from fecore.dynamics.damping_laws import RAYLEIGH, beyond, damping_rate
from fecore.dynamics.synthesis import ModalFrfModel
from fecore.frf import Dof, Quantity
from fecore.updating.forward import ForwardModel, ForwardState
from tests.support.direct import direct_frf
from tests.support.fits import at_prior, forward_model
from tests.support.lengths import long
from tests.support.plates import PAPER

PLACES = {0: (0.5, 0.02), 1: (0.21, -0.013), 2: (0.37, 0.004), 3: (0.06, 0.02)}
DOFS = [Dof(point, 3) for point in range(4)]
A = np.array([42.25, 1.10e-5])  # the paper's


def forward(boundary: str, count: int, *, reduced: bool) -> ForwardModel:
    specimen = Specimen(
        0.5, 0.04, 0.01, PAPER, boundary, (PointMass(0.49, 0.015, 0.0048),), divisions=(20, 2)
    )
    return forward_model(specimen, count, points=PLACES, reduced=reduced)


def direct(state: ForwardState, frequency: np.ndarray, quantity: Quantity) -> np.ndarray:
    """FRFs of all points under a load at the first, solved line by line."""
    model, c, rows = state.forward.specimen.model, state.coefficients, state.forward.observation
    K, M = model.stiffness.at(c.stiffness), model.mass.at(c.mass)
    return direct_frf(
        K, M, A[0] * M + A[1] * K, rows, rows[[0]].toarray().ravel(), frequency, quantity
    )


@pytest.mark.parametrize(("boundary", "reduced"), [long("cantilever", False), ("free", True)])
def test_superposition_with_residuals_against_the_direct_solve(boundary, reduced) -> None:
    state = at_prior(forward(boundary, 24, reduced=reduced))
    frequency = np.linspace(5, 1000, 30)
    frfs = state.frf_model(DOFS, [DOFS[0]] * 4)
    rate = damping_rate(RAYLEIGH, A, frfs.omega)
    found = frfs.synthesise(frequency, rate, beyond=beyond(RAYLEIGH, A, float(frfs.omega[-1])))
    exact = direct(state, frequency, "accelerance")
    # 1e-6 of each FRF's peak.
    peak = np.abs(exact).max(axis=1, keepdims=True)
    assert np.max(np.abs(found - exact) / peak) < 1e-6


@pytest.mark.long
def test_residual_terms_each_gain_an_order() -> None:
    """In short superposition with them is the direct solution."""
    state = at_prior(forward("cantilever", 8, reduced=False))
    frequency = np.linspace(5, 1000, 40)
    frfs = state.frf_model(DOFS, [DOFS[0]] * 4)
    exact = direct(state, frequency, "receptance")
    errors = []
    for terms in range(4):
        cut = ModalFrfModel(frfs.eigenvalue, frfs.residues, frfs.residual[:, :terms], frfs.shift)
        found = cut.synthesise(
            frequency, damping_rate(RAYLEIGH, A, cut.omega), "receptance", (A[0], A[1])
        )
        errors.append(np.abs(found - exact).max())
    # The first mode left out is at 2024 Hz, so each term is worth (1000/2024)² ≈ 1/4 at the top of
    # the band.
    for terms in range(1, 4):
        assert errors[terms] < errors[terms - 1] / 3


def test_a_free_bodys_rigid_modes_are_rigid_body_theory() -> None:
    state = at_prior(forward("free", 12, reduced=True))
    frequency = np.array([0.05])
    frfs = state.frf_model([DOFS[0]], [DOFS[1]])
    found = frfs.synthesise(frequency, np.zeros(frfs.eigenvalue.size)).real[0, 0]
    # 1/m + moments about the centre of mass, sensor included.
    strip = 0.5 * 0.04 * 0.01 * PAPER.density
    places, masses = np.array([[0.25, 0.0], [0.49, 0.015]]), np.array([strip, 0.0048])
    centre = masses @ places / masses.sum()
    own = strip / 12 * np.array([[0.5**2 + 0.01**2, 0], [0, 0.04**2 + 0.01**2]])
    inertia = own + sum(m * np.outer(r, r) for m, r in zip(masses, places - centre, strict=True))
    a, b = (np.array(PLACES[k]) - centre for k in (0, 1))
    expected = 1 / masses.sum() + a @ np.linalg.solve(inertia, b)
    # At 0.05 Hz the elastic part is (0.05/160)² of it.
    assert found == pytest.approx(expected, rel=1e-6)


def test_reciprocity_and_signed_directions() -> None:
    state = at_prior(forward("cantilever", 10, reduced=True))
    frequency = np.linspace(10, 900, 30)

    def frf(response: Dof, reference: Dof) -> np.ndarray:
        frfs = state.frf_model([response], [reference])
        return frfs.synthesise(frequency, damping_rate(RAYLEIGH, A, frfs.omega))[0]

    one = frf(DOFS[0], DOFS[2])
    np.testing.assert_allclose(one, frf(DOFS[2], DOFS[0]), rtol=1e-6, atol=1e-5 * np.abs(one).max())
    np.testing.assert_allclose(
        one, -frf(Dof(0, -3), DOFS[2]), rtol=1e-6, atol=1e-5 * np.abs(one).max()
    )
