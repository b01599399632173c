from __future__ import annotations

import numpy as np
import pytest

from fecore.body.specimen import Specimen
from fecore.body.supports import PointMass
from fecore.dynamics.damping_laws import RAYLEIGH, beyond, damping_rate
from fecore.dynamics.synthesis import ModalFrfModel
from fecore.frf import Dof, along_z
from fecore.updating.forward import ForwardModel
from fecore.updating.parameters import parametrise
from tests.support.direct import direct_frf
from tests.support.plates import PAPER

PLACES = np.array([[0.5, 0.02], [0.21, -0.013], [0.37, 0.004], [0.06, 0.02]])
DOFS = [Dof(point, 3) for point in range(4)]
A = np.array([42.25, 1.10e-5])  # the paper's


def forward(boundary: str, count: int, *, reduced: bool) -> ForwardModel:
    specimen = Specimen(0.5, 0.04, 0.01, PAPER, boundary, (PointMass(0.49, 0.015, 0.0048),), divisions=(20, 2))
    return ForwardModel(specimen, parametrise(specimen), along_z((0, 1, 2, 3)), PLACES, count, reduced)


@pytest.mark.parametrize("boundary", ["cantilever", "free"])
@pytest.mark.parametrize("reduced", [False, True])
def test_superposition_with_residuals_against_the_direct_solve(boundary, reduced) -> None:
    model = forward(boundary, 24, reduced=reduced)
    state = model.solve(model.parametrisation.prior_mean)
    frequency = np.linspace(5, 1000, 30)
    frfs = state.frf_model(DOFS, [DOFS[0]] * 4)
    rate = damping_rate(RAYLEIGH, A, frfs.omega)
    found = frfs.synthesise(frequency, rate, beyond=beyond(RAYLEIGH, A, float(frfs.omega[-1])))
    plate, c = model.specimen.model, state.coefficients
    K, M = plate.stiffness.at(c.stiffness), plate.mass.at(c.mass)
    load = model.observation[[0]].toarray().ravel()
    exact = direct_frf(K, M, A[0] * M + A[1] * K, model.observation, load, frequency, "accelerance")
    # 1e-6 of each FRF's peak.
    peak = np.abs(exact).max(axis=1, keepdims=True)
    assert np.max(np.abs(found - exact) / peak) < 1e-6


def test_residual_terms_each_gain_an_order() -> None:
    model = forward("cantilever", 8, reduced=False)
    state = model.solve(model.parametrisation.prior_mean)
    frequency = np.linspace(5, 1000, 40)
    frfs = state.frf_model(DOFS, [DOFS[0]] * 4)
    plate, c = model.specimen.model, state.coefficients
    K, M = plate.stiffness.at(c.stiffness), plate.mass.at(c.mass)
    exact = direct_frf(
        K, M, A[0] * M + A[1] * K, model.observation, model.observation[[0]].toarray().ravel(), frequency
    )
    errors = []
    for terms in range(4):
        cut = ModalFrfModel(frfs.eigenvalue, frfs.residues, frfs.residual[:, :terms], frfs.shift)
        found = cut.synthesise(frequency, damping_rate(RAYLEIGH, A, cut.omega), "receptance", (A[0], A[1]))
        errors.append(np.abs(found - exact).max())
    # The first mode left out is at 2024 Hz, so each term is worth (1000/2024)² ≈ 1/4 at the top of the band.
    for terms in range(1, 4):
        assert errors[terms] < errors[terms - 1] / 3


def test_a_free_bodys_rigid_modes_are_rigid_body_theory() -> None:
    model = forward("free", 12, reduced=True)
    state = model.solve(model.parametrisation.prior_mean)
    frequency = np.array([0.05])
    frfs = state.frf_model([DOFS[0]], [DOFS[1]])
    found = frfs.synthesise(frequency, np.zeros(frfs.eigenvalue.size)).real[0, 0]
    # 1/m + moments about the centre of mass, sensor included.
    strip = 0.5 * 0.04 * 0.01 * PAPER.density
    places, masses = np.array([[0.25, 0.0], [0.49, 0.015]]), np.array([strip, 0.0048])
    centre = masses @ places / masses.sum()
    own = strip / 12 * np.array([[0.5**2 + 0.01**2, 0], [0, 0.04**2 + 0.01**2]])
    inertia = own + sum(m * np.outer(r, r) for m, r in zip(masses, places - centre, strict=True))
    a, b = PLACES[0] - centre, PLACES[1] - centre
    expected = 1 / masses.sum() + a @ np.linalg.solve(inertia, b)
    # At 0.05 Hz the elastic part is (0.05/160)² of it.
    assert found == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("boundary", ["cantilever", "free"])
def test_the_reduced_basis_gives_the_full_models_frfs(boundary: str) -> None:
    full, reduced = (forward(boundary, 12, reduced=kind) for kind in (False, True))
    frequency = np.linspace(10, 1000, 200)
    rng = np.random.default_rng(4)
    # At the start the shapes' own tolerance, elsewhere a frequency's over 2ζ too.
    for away, tolerance in ((0.0, 1e-5), (0.1, 5e-5)):
        theta = full.parametrisation.prior_mean * (1 + away * rng.uniform(-1, 1, full.parametrisation.prior_mean.size))
        ours, theirs = (
            (frfs := model.solve(theta).frf_model(DOFS[:2], DOFS[2:3] * 2)).synthesise(
                frequency, damping_rate(RAYLEIGH, A, frfs.omega)
            )
            for model in (reduced, full)
        )
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=tolerance * np.abs(theirs).max())


def test_reciprocity_and_signed_directions() -> None:
    model = forward("cantilever", 10, reduced=True)
    state = model.solve(model.parametrisation.prior_mean)
    frequency = np.linspace(10, 900, 30)

    def frf(response: Dof, reference: Dof) -> np.ndarray:
        frfs = state.frf_model([response], [reference])
        return frfs.synthesise(frequency, damping_rate(RAYLEIGH, A, frfs.omega))[0]

    one = frf(DOFS[0], DOFS[2])
    np.testing.assert_allclose(one, frf(DOFS[2], DOFS[0]), rtol=1e-6, atol=1e-5 * np.abs(one).max())
    np.testing.assert_allclose(one, -frf(Dof(0, -3), DOFS[2]), rtol=1e-6, atol=1e-5 * np.abs(one).max())
