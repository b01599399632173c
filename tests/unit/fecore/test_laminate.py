"""Laminates: rotation, shear by plies, one layer in their place, and updating of each ply's
constants.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from examples.plies import CARBON, TRUTH, plate, recovered, simulated
from fecore.body.constants import Parameter
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.sections import homogenise, section
from fecore.body.specimen import LayeredSpecimen
from fecore.body.supports import edges
from fecore.errors import InputError
from fecore.updating.inputs import Inputs
from fecore.updating.measurement import Measurement, Recipe
from fecore.updating.pipeline import update
from tests.support.bodies import hz
from tests.support.plates import PAPER, coefficients, integrated

PLY = OrthotropicMaterial(140e9, 10e9, 5e9, 5e9, 3e9, 0.3, 1600.0)
angles = st.floats(-180, 180)


@settings(max_examples=50)
@given(angles)
def test_rotation_keeps_the_invariants(angle: float) -> None:
    """Tsai and Pagano's U1 … U5 combinations that no rotation changes (Reddy, section 2.4), and the
    shears' trace.
    """
    straight, skew = (section([Ply(PLY, 1e-3, turn)]) for turn in (0.0, angle))
    Q, turned = straight.A, skew.A
    for first, second in (
        (Q[0, 0] + Q[1, 1] + 2 * Q[0, 1], turned[0, 0] + turned[1, 1] + 2 * turned[0, 1]),
        (Q[2, 2] - Q[0, 1], turned[2, 2] - turned[0, 1]),
    ):
        assert first == pytest.approx(second, rel=1e-13)
    S, shear = straight.S, skew.S
    assert np.trace(S) == pytest.approx(np.trace(shear), rel=1e-13)
    assert np.linalg.det(S) == pytest.approx(np.linalg.det(shear), rel=1e-12)
    assert np.all(np.linalg.eigvalsh(turned) > 0)


@settings(max_examples=30)
@given(st.lists(angles, min_size=1, max_size=5))
def test_a_stack_mirrored_about_its_middle_does_not_couple(half: list[float]) -> None:
    laminate = section([Ply(PLY, 1e-3, angle) for angle in (*half, *reversed(half))])
    assert not laminate.is_coupled
    assert np.abs(laminate.B).max() < 1e-12 * np.sqrt(
        np.abs(laminate.A).max() * np.abs(laminate.D).max()
    )


def test_ply_wise_shear_of_one_ply_is_five_sixths() -> None:
    by_ply = section([Ply(PAPER, 0.002)] * 5)
    np.testing.assert_allclose(by_ply.S, section([Ply(PAPER, 0.01)]).S, rtol=1e-12, atol=1e-6)


GLASS = OrthotropicMaterial(Ex=38e9, Ey=9e9, Gxy=4e9, Gxz=4e9, Gyz=3e9, nu_xy=0.26, density=1950.0)


def test_one_layer_is_itself() -> None:
    same = homogenise(section([Ply(GLASS, 0.01)]))
    for name in ("Ex", "Ey", "Gxy", "Gxz", "Gyz", "nu_xy", "density"):
        # a 3 × 3 inverse's round-off
        assert getattr(same, name) == pytest.approx(getattr(GLASS, name), rel=1e-12)


def test_cross_ply_keeps_its_bending_and_shear_stiffness() -> None:
    plies = [Ply(GLASS, 0.001, angle) for angle in (0, 90, 90, 0)]
    laminate = section(plies)
    layer = section([Ply(homogenise(laminate), laminate.thickness)])
    np.testing.assert_allclose(layer.D, laminate.D, rtol=1e-12, atol=1e-12 * laminate.D[0, 0])
    np.testing.assert_allclose(layer.S, laminate.S, rtol=1e-12, atol=1e-9)
    assert layer.inertia[0] == pytest.approx(laminate.inertia[0], rel=1e-12)


@pytest.mark.parametrize(("angles", "words"), [((0, 90), "membrane"), ((30, 30), "twisting")])
def test_coupled_laminates_have_no_equivalent_layer(angles: tuple[float, ...], words: str) -> None:
    with pytest.raises(InputError, match=words):
        homogenise(section([Ply(replace(GLASS), 0.001, angle) for angle in angles]))


def stack(*angles: float) -> LayeredSpecimen:
    return replace(plate(*angles), divisions=(8, 6))


def constants(body: LayeredSpecimen) -> np.ndarray:
    return np.array(list(body.nominal.values()))


def test_a_stack_of_more_plies_than_can_be_updated_keeps_their_angles() -> None:
    body = stack(*(45.0, -45.0) * 21)
    assert not any(name.startswith("angle") for name in body.nominal)
    turned = stack(*(0.0, 90.0) * 21)
    assert not np.allclose(
        body.stiffness_coefficients(constants(body)),
        turned.stiffness_coefficients(constants(turned)),
        rtol=1e-3,
    )


@pytest.mark.parametrize("angles", [(45, -45), (0, 90), (30, -30, -30, 30), (0, 30, 45, 90)])
def test_coefficients_are_those_of_the_section(angles) -> None:
    body = stack(*angles)
    assert (0 in body.model.dofs) == body.section.is_coupled
    q = constants(body)
    expected, inertia = coefficients(body.structure, integrated(body.plies))
    # 1e-6 N/m and so on: entries that are zero by symmetry are sums of round-off.
    np.testing.assert_allclose(body.stiffness_coefficients(q), expected, rtol=1e-12, atol=1e-6)
    np.testing.assert_allclose(body.mass_coefficients(q), inertia, rtol=1e-12)


@pytest.mark.parametrize("angles", [(45, -45), (30, -30, -30, 30)])
def test_other_dimensions_and_angles_are_those_of_a_body_built_with_them(angles) -> None:
    body = stack(*angles)
    size = (0.31, 0.19, 0.0042)
    turned = tuple(Ply(CARBON, size[2] / len(angles), angle + 2) for angle in angles)
    built = replace(body, length=size[0], width=size[1], thickness=size[2], plies=turned)
    q = dict(body.nominal) | dict(zip(("length", "width", "thickness"), size, strict=True))
    q |= {f"angle_{k}": np.radians(ply.angle_deg) for k, ply in enumerate(turned, start=1)}
    # 1e-8: two solves of an eigenproblem each to round-off; the closed forms are the same.
    np.testing.assert_allclose(hz(body, 8, np.array(list(q.values()))), hz(built, 8), rtol=1e-8)


@pytest.mark.parametrize("angles", [(0,), (90, 90)])
def test_bending_stiffness_of_a_strip_of_one_direction(angles) -> None:
    body = stack(*angles)
    modulus = CARBON.Ex if angles[0] == 0 else CARBON.Ey
    # free to bend across, so without Poisson's ratio
    expected = modulus * body.width * body.thickness**3 / 12
    assert body.bending_stiffness(constants(body)) == pytest.approx(expected, rel=1e-12)


def test_a_sandwich_vibrates_as_allens_closed_form() -> None:
    """Simply supported, thin faces: ω² = D k⁴ / (m (1 + D k²/S)) with D = E t d²/2(1 - ν²), S = G
    d²/c (Allen 1969, ch. 5).
    """
    E, nu, G, t, c, side = 68.9e9, 0.33, 80e6, 0.0004, 0.02, 1.0
    face = OrthotropicMaterial(
        E, E, E / 2 / (1 + nu), E / 2 / (1 + nu), E / 2 / (1 + nu), nu, 2768.0
    )
    core = OrthotropicMaterial(1e5, 1e5, 4e4, G, G, 0.0, 60.0)
    plies = (Ply(face, t), Ply(core, c), Ply(face, t))
    mass, d = 2 * t * 2768 + c * 60, c + t
    held = edges(*["simply_supported"] * 4)
    body = LayeredSpecimen(
        side, side, c + 2 * t, plies, mass / (c + 2 * t), divisions=(10, 10), supports=held
    )
    assert "G13_2" in body.nominal
    k2 = np.pi**2 * np.array([2.0, 5.0, 5.0, 8.0]) / side**2
    D, S = E * t * d**2 / 2 / (1 - nu**2), G * d**2 / c
    allen = np.sqrt(D * k2**2 / mass / (1 + D * k2 / S)) / 2 / np.pi
    # Allen has no rotary inertia and no bending of the faces about themselves: 1 %, as asked for.
    np.testing.assert_allclose(hz(body, 4), allen, rtol=0.01)


def test_ply_constants_are_recovered_from_a_simulated_plate() -> None:
    """Antisymmetric angle-ply: within 2 %, as asked for."""
    found = recovered(45, -45, 45, -45)
    for parameter in found.parameters:
        if parameter.name in ("E1", "E2", "G12"):
            assert parameter.estimate == pytest.approx(TRUTH[parameter.name], rel=0.02)
            assert parameter.identifiable
    by_mechanism = next(law for law in found.damping_models if law.name == "mechanism")
    assert set(by_mechanism.coefficients) == {"a0", "eta_E", "eta_G"}


@pytest.mark.long
def test_angles_are_inputs_with_a_stated_deviation() -> None:
    """In short fibre angles of strips are, in `test_campaigns.py`."""
    body = replace(stack(30, -30, -30, 30), divisions=(12, 8))
    modes, points = simulated(body, np.random.default_rng(2), noise=3e-4, modes=9)
    free = (Parameter("E1"), Parameter("E2"), Parameter("G12"))

    def deviations(inputs: Inputs) -> dict[str, float]:
        recipe = Recipe(parameters=free, damping_models=("rayleigh",))
        found = update(Measurement(None, points, modes, 0.0, inputs), body, recipe)
        sources = {entry.source for p in found.parameters for entry in p.budget}
        assert ("angle_1" in sources) == bool(inputs.ply_angle_sd)
        return {p.name: p.standard_deviation / p.estimate for p in found.parameters}

    known = deviations(Inputs.exact())
    unsure = deviations(replace(Inputs.exact(), ply_angle_sd=float(np.radians(1.0))))
    assert all(unsure[p.name] > 1.5 * known[p.name] for p in free)
