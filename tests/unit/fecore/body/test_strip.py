"""Strips: the dofs that they need, the section's coefficients, and dimensions that are constants."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fecore.body.generators import Piece, strip
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.sections import ShellSection
from fecore.body.specimen import Specimen
from fecore.body.structure import Structure
from fecore.body.supports import PointMass, Support
from fecore.dynamics.eigen import normal_modes
from fecore.dynamics.reduction import ReducedModel
from tests.support.plates import PAPER, entries, integrated

CARBON = OrthotropicMaterial(130e9, 9e9, 5e9, 5e9, 3e9, 0.3, 1550.0)
BODIES = {
    "cantilever": Specimen(0.5, 0.04, 0.01, PAPER, masses=(PointMass(0.49, 0.015, 0.0048, 1e-6),)),
    "free, fibres turned": Specimen(0.5, 0.04, 0.01, PAPER, "free", fibre_angle=0.2),
    "simply supported": Specimen(0.5, 0.04, 0.01, PAPER, "simply_supported"),
    "numbered across": Specimen(0.2, 0.5, 0.01, PAPER, "free", divisions=(4, 10)),
    "stepped, in zones": Specimen(0.5, 0.04, 0.01, PAPER, pieces=(Piece(0.1, 0.3, 0.01, 0.007),), zones=(0.33,)),
}


def hz(body: Specimen | Structure, values: np.ndarray | None = None, count: int = 6) -> np.ndarray:
    q, model = np.array(list(body.nominal.values())) if values is None else values, body.model
    K, M = model.stiffness.at(body.stiffness_coefficients(q)), model.mass.at(body.mass_coefficients(q))
    rigid = model.rigid_modes.shape[1]
    return normal_modes(K, M, count + rigid, model.rigid_modes).frequency_hz[rigid:]


@pytest.mark.parametrize("name", ["numbered across", "stepped, in zones"])
def test_three_dofs_of_a_node_are_six(name) -> None:
    """w, θx and θy alone give the bending of all six; among these are modes in the plane too."""
    body = BODIES[name]
    all_six = replace(body.structure, dofs=(0, 1, 2, 3, 4, 5))
    flat, every = hz(body), hz(all_six, count=24)
    for frequency in flat:
        assert np.abs(every / frequency - 1).min() < 1e-7


@pytest.mark.parametrize("name", list(BODIES))
def test_other_dimensions_are_those_of_a_body_built_with_them(name) -> None:
    body = replace(BODIES[name], masses=(), pieces=())
    size = {"length": 1.04 * body.length, "width": 0.97 * body.width, "thickness": 1.02 * body.thickness}
    zones = tuple(1.04 * x for x in body.zones)
    built = replace(body, **size, zones=zones)
    values = np.array(list((body.nominal | size).values()))
    # 1e-8: two solves of an eigenproblem each to round-off; the closed forms are the same.
    np.testing.assert_allclose(hz(body, values), hz(built), rtol=1e-8)


def test_the_section_has_the_laminates_coefficients() -> None:
    plies = (Ply(CARBON, 0.001, 0.0), Ply(PAPER, 0.002, 30.0), Ply(CARBON, 0.001, -45.0))
    stack = ShellSection(plies)
    found = dict(zip(stack.terms, stack.coefficients(stack.nominal), strict=False))
    laminate = integrated(plies)
    for name, value in entries(laminate).items():
        scale = laminate.S.max() if name[0] == "S" else np.abs(getattr(laminate, name[0])).max()
        assert found[name] == pytest.approx(value, rel=1e-10, abs=1e-12 * scale)


def test_a_reduced_basis_is_of_any_structure() -> None:
    structure = Structure(strip(0.5, 0.04, 12, 2), {"strip": ShellSection((Ply(PAPER, 0.01),))}, (Support("start"),))
    q = np.array(list(structure.nominal.values()))
    reduced = ReducedModel(structure.model, structure.stiffness_coefficients(q), structure.mass_coefficients(q), 8)
    q[:6] *= [1.05, 0.97, 1.1, 1.0, 0.9, 1.0]
    c, m = structure.stiffness_coefficients(q), structure.mass_coefficients(q)
    np.testing.assert_allclose(reduced.modes(c, m).frequency_hz, hz(structure, q, 8), rtol=1e-6)
