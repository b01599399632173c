import numpy as np
import pytest

from fecore.body.constants import Parameter
from fecore.body.laminate import Ply
from fecore.body.sections import section
from fecore.body.specimen import Specimen
from fecore.body.supports import PointMass, Spring, edges, of_boundary
from fecore.modes import MeasuredModes
from tests.support.fits import forward_model, update_elastic
from tests.support.plates import PAPER, matrices, paper_section, plate, solve

MESH = (0.5, 0.04), (20, 2)


def test_points_are_interpolated_by_shape_functions_in_every_direction() -> None:
    model = plate(*MESH, (), membrane=True).model
    x, y = model.mesh.nodes[:, :2].T
    # all within the element's polynomials
    field = np.column_stack([1 + x * y, y**2, x**2 - x * y, 3 * x, 2 - y])
    points = np.random.default_rng(0).uniform([0, -0.02, 0.003], [0.5, 0.02, 0.003], (15, 3))
    px, py, pz = points.T
    # On a face a point moves by the wall's rotation too: θ × z.
    exact = [1 + px * py + pz * (2 - py), py**2 - pz * 3 * px, px**2 - px * py]
    for axis, values in enumerate(exact):
        seen = model.observe(points, np.tile(np.eye(3)[axis], (15, 1))) @ field.ravel()
        np.testing.assert_allclose(seen, values, rtol=1e-12, atol=1e-14)


def test_stiff_springs_are_a_clamp_and_soft_ones_carry_a_rigid_body() -> None:
    clamped = solve(plate(*MESH, of_boundary("cantilever")), paper_section(), 4).frequency_hz
    springs = [Spring(f"root_{d}", 1e13 if d == 3 else 1e10, d, edge="start") for d in (3, 4, 5)]
    held = plate(*MESH, (), springs=springs)
    assert held.model.rigid_modes.shape[1] == 0
    np.testing.assert_allclose(solve(held, paper_section(), 4).frequency_hz, clamped, rtol=1e-4)
    # One soft spring under the centre of a free strip: ω² = k/m, and two rigid rotations are left.
    soft = plate(*MESH, (), springs=[Spring("thread", 100.0, 3, point=(0.25, 0.0))])
    assert soft.model.rigid_modes.shape[1] == 2
    mass = 0.5 * 0.04 * 0.01 * PAPER.density
    heave = solve(soft, paper_section(), 3).omega[2]
    # the strip itself bends a little
    assert heave == pytest.approx(np.sqrt(100.0 / mass), rel=5e-4)


def test_a_rotational_spring_is_the_elastically_clamped_beam() -> None:
    """Frequency equation of a slender beam with w = 0 and a moment kθ at one end (Blevins): see the
    residual below.
    """
    thin = section([Ply(PAPER, 0.002)])
    length, k = 0.5, 0.5  # N·m/rad for the whole edge
    spring = Spring("root_rotation", k / 0.01, 5, edge="start")
    body = plate((length, 0.01), (30, 1), edges(start="simply_supported"), springs=[spring])
    omega = solve(body, thin, 1).omega[0]
    compliance = np.linalg.inv(thin.D)[0, 0]
    bending = 0.01 / compliance
    beta = (omega**2 * thin.inertia[0] * 0.01 / bending) ** 0.25 * length
    c, s, C, S = np.cos(beta), np.sin(beta), np.cosh(beta), np.sinh(beta)
    # (1 + cos cosh) kL/EI = β (sin cosh - cos sinh)
    left, right = (1 + c * C) * k * length / bending, beta * (s * C - c * S)
    assert left == pytest.approx(right, rel=2e-3)  # a plate of width b/L = 0.02 is a beam to that


def test_rigid_body_motions_of_a_laden_free_strip_are_exact() -> None:
    masses = [PointMass(0.5, 0.02, 0.0048, 1e-6), PointMass(0.1, -0.01, 0.002)]
    body = plate(*MESH, (), masses)
    _, M = matrices(body, paper_section())
    heave, roll, pitch = (body.model.rigid_modes[:, i] for i in range(3))
    total = 0.5 * 0.04 * 0.01 * PAPER.density
    assert heave @ M @ heave == pytest.approx(total + 0.0068, rel=1e-12)
    inertia = total * (0.04**2 + 0.01**2) / 12 + 0.0048 * 0.02**2 + 1e-6 + 0.002 * 0.01**2
    assert roll @ M @ roll == pytest.approx(inertia, rel=1e-12)
    inertia = total * (0.5**2 + 0.01**2) / 12 + 0.0048 * 0.25**2 + 1e-6 + 0.002 * 0.15**2
    assert pitch @ M @ pitch == pytest.approx(inertia, rel=1e-12)


def test_a_root_spring_is_an_updating_parameter() -> None:
    """Synthetic frequencies of an elastically held strip give the spring back."""
    root = Spring("root_rotation", 4e4, 5, edge="start")
    specimen = Specimen(
        0.5,
        0.04,
        0.01,
        PAPER,
        "cantilever",
        divisions=(20, 2),
        springs=(root,),
        supports=edges("simply_supported"),
    )
    forward = forward_model(
        specimen, 5, "Ex", Parameter("root_rotation", prior_sd=4e4), points={1: (0.5, 0.0)}
    )
    truth = np.array([31.0e9, 2.5e4])
    measured = MeasuredModes(forward.solve(truth).frequency_hz, np.full(5, np.nan))
    result = update_elastic(forward, measured)
    # The prior and the model's allowed discrepancy pull a little.
    np.testing.assert_allclose(result.theta, truth, rtol=1e-2)
