"""A structure's plies become the specimen that updating takes: a sandwich gives way in its core."""

import numpy as np
import pytest

from fecore.body.laminate import SHEAR_CORRECTION
from fecore.updating.forward import ForwardModel
from fecore.updating.parameters import Parameter, parametrise
from service.store.structures.schemas import StructureIn
from service.store.updating.bodies import nominal_specimen

FACE = {
    "E1_Pa": 70e9,
    "E2_Pa": 70e9,
    "G12_Pa": 26e9,
    "G13_Pa": 26e9,
    "G23_Pa": 26e9,
    "nu_12": 0.3,
    "density_kg_m3": 2700.0,
}
CORE = {"E1_Pa": 1e6, "E2_Pa": 1e6, "G12_Pa": 5e5, "G13_Pa": 4e7, "G23_Pa": 2e7, "nu_12": 0.0, "density_kg_m3": 100.0}
T, H, LENGTH, WIDTH = 0.0005, 0.02, 0.6, 0.04


def structure(plies: list[dict[str, float]]) -> StructureIn:
    thickness = sum(ply["thickness_m"] for ply in plies)
    mass = sum(ply["thickness_m"] * (ply["density_kg_m3"] or 0.0) for ply in plies)
    return StructureIn.model_validate(
        {
            "name": "s",
            "geometry": {"length_m": LENGTH, "width_m": WIDTH, "thickness_m": thickness},
            "density_kg_m3": mass / thickness,
            "laminate": {"plies": plies},
        }
    )


def ply(material: dict[str, float], thickness: float) -> dict[str, float]:
    return {**material, "thickness_m": thickness, "angle_deg": 0.0}


def test_a_sandwich_has_the_shear_stiffness_and_the_frequency_of_the_published_solution() -> None:
    """Allen, Analysis and Design of Structural Sandwich Panels (1969): S = G_c (h + t)²/h, and a simply supported strip's
    ω = (π/L)² √(D/m) / √(1 + π² D/(L² S)) with D = E_f t (h + t)²/2."""
    body = nominal_specimen(structure([ply(FACE, T), ply(CORE, H), ply(FACE, T)]), "simply_supported")
    shear, bending = 4e7 * (H + T) ** 2 / H, 70e9 * T * (H + T) ** 2 / 2
    assert body.material.Gxz * SHEAR_CORRECTION * body.thickness == pytest.approx(shear, rel=0.01)
    prior = parametrise(body, [Parameter("Ex")])
    forward = ForwardModel(body, prior, (), np.zeros((0, 2)), 4, reduced=False)
    mass = 2 * T * 2700.0 + H * 100.0
    wave = (np.pi / LENGTH) ** 2
    expected = wave * np.sqrt(bending / mass) / np.sqrt(1 + wave * bending / shear) / (2 * np.pi)
    assert forward.solve(prior.prior_mean).frequency_hz[0] == pytest.approx(expected, rel=0.01)


def test_plies_alike_have_the_shear_of_one_layer() -> None:
    body = nominal_specimen(structure([ply(FACE, 0.002)] * 4), "free")
    assert body.material.Gxz == pytest.approx(26e9, rel=1e-9)
