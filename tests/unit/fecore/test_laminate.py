from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fecore.body.laminate import OrthotropicMaterial, Ply, section
from tests.support.plates import PAPER

PLY = OrthotropicMaterial(140e9, 10e9, 5e9, 5e9, 3e9, 0.3, 1600.0)
angles = st.floats(-180, 180)


@settings(derandomize=True, max_examples=50, deadline=None)
@given(angles)
def test_rotation_keeps_the_invariants(angle: float) -> None:
    """Tsai and Pagano's U1 … U5 combinations that no rotation changes (Reddy, section 2.4), and the shears' trace."""
    Q, turned = PLY.plane_stress(), Ply(PLY, 1e-3, angle).plane_stress()
    for first, second in (
        (Q[0, 0] + Q[1, 1] + 2 * Q[0, 1], turned[0, 0] + turned[1, 1] + 2 * turned[0, 1]),
        (Q[2, 2] - Q[0, 1], turned[2, 2] - turned[0, 1]),
    ):
        assert first == pytest.approx(second, rel=1e-13)
    S, shear = PLY.transverse_shear(), Ply(PLY, 1e-3, angle).transverse_shear()
    assert np.trace(S) == pytest.approx(np.trace(shear), rel=1e-13)
    assert np.linalg.det(S) == pytest.approx(np.linalg.det(shear), rel=1e-12)
    assert np.all(np.linalg.eigvalsh(turned) > 0)


@settings(derandomize=True, max_examples=30, deadline=None)
@given(st.lists(angles, min_size=1, max_size=5))
def test_a_stack_mirrored_about_its_middle_does_not_couple(half: list[float]) -> None:
    laminate = section([Ply(PLY, 1e-3, angle) for angle in (*half, *reversed(half))])
    assert not laminate.is_coupled
    assert np.abs(laminate.B).max() < 1e-12 * np.sqrt(np.abs(laminate.A).max() * np.abs(laminate.D).max())


def test_ply_wise_shear_of_one_ply_is_five_sixths() -> None:
    by_ply = section([Ply(PAPER, 0.002)] * 5, shear="equilibrium")
    np.testing.assert_allclose(by_ply.S, section([Ply(PAPER, 0.01)]).S, rtol=1e-12, atol=1e-6)
