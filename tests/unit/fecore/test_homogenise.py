from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fecore.body.laminate import OrthotropicMaterial, Ply, homogenise, section
from fecore.errors import InputError

GLASS = OrthotropicMaterial(Ex=38e9, Ey=9e9, Gxy=4e9, Gxz=4e9, Gyz=3e9, nu_xy=0.26, density=1950.0)


def test_one_layer_is_itself() -> None:
    same = homogenise(section([Ply(GLASS, 0.01)]))
    for name in ("Ex", "Ey", "Gxy", "Gxz", "Gyz", "nu_xy", "density"):
        assert getattr(same, name) == pytest.approx(getattr(GLASS, name), rel=1e-12)  # a 3 × 3 inverse's round-off


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
