"""Walls that grow thinner where they are stretched, and that curve, against waves and solids
without a theory.
"""

import numpy as np
import pytest
import scipy

from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.sections import ACROSS, ShellSection
from fecore.body.structure import Structure
from fecore.body.supports import edges
from tests.support.panels import TRUTH, deck, measured
from tests.support.shells import grid
from tests.support.stored_solids import frequencies

SIDE, THICKNESS = 0.1, 0.01
ISOTROPIC = OrthotropicMaterial(70e9, 70e9, 70e9 / 2.5, 70e9 / 2.5, 70e9 / 2.5, 0.25, 2700.0)
GFRP = OrthotropicMaterial(26e9, 9.5e9, 3.4e9, 2.6e9, 2.2e9, 0.27, 1850.0)
CARBON = OrthotropicMaterial(60e9, 40e9, 4.6e9, 4.6e9, 3.2e9, 0.1, 1580.0)


def _stiffness(m: OrthotropicMaterial) -> np.ndarray:
    """(6, 6) of strains xx, yy, zz, yz, xz, xy."""
    give = np.diag([1 / m.Ex, 1 / m.Ey, 1 / m.Ey, 1 / m.Gyz, 1 / m.Gxz, 1 / m.Gxy])
    give[0, 1] = give[1, 0] = -m.nu_xy / m.Ex
    give[0, 2] = give[2, 0] = -ACROSS / m.Ex
    give[1, 2] = give[2, 1] = -ACROSS / m.Ey
    return np.linalg.inv(give)


def exact_hz(m: OrthotropicMaterial, t: float, kx: float, ky: float, order: int = 8) -> float:
    """The lowest wave of a plate by the equations of a solid, by polynomials through its
    thickness.
    """
    z, w = np.polynomial.legendre.leggauss(order + 1)
    N = np.polynomial.legendre.legvander(z, order)
    slopes = [np.polynomial.legendre.legder(np.eye(order + 1)[n]) for n in range(order + 1)]
    dN = np.column_stack([np.polynomial.legendre.legval(z, slope) for slope in slopes]) * 2 / t
    # u, v, w of the mode are cos·sin, sin·cos and sin·sin in the plane; strains by their
    # amplitudes.
    zero = np.zeros_like(N)
    B = np.stack(
        [np.hstack(row) for row in (
            (-kx * N, zero, zero), (zero, -ky * N, zero), (zero, zero, dN),
            (zero, dN, ky * N), (dN, zero, kx * N), (ky * N, kx * N, zero),
        )], axis=1,
    )  # fmt: skip
    K = np.einsum("p,pri,rs,psj->ij", w, B, _stiffness(m), B)
    M = m.density * np.kron(np.eye(3), (N.T * w) @ N)
    return float(
        np.sqrt(scipy.linalg.eigh(K, M, eigvals_only=True, subset_by_index=[0, 0])[0]) / (2 * np.pi)
    )


@pytest.mark.parametrize("material", [ISOTROPIC, GFRP, CARBON])
def test_a_thick_plate_has_the_modes_of_a_solid(material: OrthotropicMaterial) -> None:
    mesh = grid("quad8", 6, 6, lambda st: np.column_stack([SIDE * st, np.zeros(len(st))]))
    names = dict(zip(("x0", "x1", "y0", "y1"), ("start", "end", "lower", "upper"), strict=True))
    supports = edges(*("simply_supported",) * 4)
    supports = tuple(
        type(s)(next(k for k, v in names.items() if v == s.where), s.how) for s in supports
    )
    exact = exact_hz(material, THICKNESS, np.pi / SIDE, np.pi / SIDE)
    own, plain = (
        frequencies(
            Structure(
                mesh, {"plate": ShellSection((Ply(material, THICKNESS),), thins=thins)}, supports
            ),
            1,
        )[0]
        for thins in (True, False)
    )
    assert own == pytest.approx(exact, rel=1.5e-4)
    assert plain < (1 - 5e-4) * exact


def test_layers_that_are_one_are_as_one() -> None:
    one = ShellSection((Ply(GFRP, THICKNESS),)).normal
    many = ShellSection(tuple(Ply(GFRP, share * THICKNESS) for share in (0.2, 0.5, 0.3))).normal
    assert one is not None
    assert many is not None
    assert many.by_curvature == pytest.approx(one.by_curvature, rel=1e-12)
    assert one.by_curvature == pytest.approx(-one.by_strain * THICKNESS**2 / 60, rel=1e-12)
    assert (many.spread, one.offset) == pytest.approx((THICKNESS**2 / 12, 0))


def test_panels_have_the_frequencies_of_solids() -> None:
    for kind, mesh, most in (("tapered", (12, 8), 0.0006), ("curved", (18, 12), 0.0011)):
        off = (
            frequencies(deck(kind, *mesh, "quad8", TRUTH), 7) / measured(kind)[0].frequency_hz[:7]
            - 1
        )
        assert np.abs(off).max() < most, kind
