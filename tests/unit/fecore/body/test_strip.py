"""Strips: the dofs that they need, the section's coefficients, and dimensions that are
constants.
"""

from dataclasses import replace

import numpy as np
import pytest

from fecore.body.generators import Piece
from fecore.body.specimen import Specimen
from fecore.body.supports import PointMass
from tests.support.bodies import hz
from tests.support.plates import PAPER

BODIES = {
    "cantilever": Specimen(0.5, 0.04, 0.01, PAPER, masses=(PointMass(0.49, 0.015, 0.0048, 1e-6),)),
    "free, fibres turned": Specimen(0.5, 0.04, 0.01, PAPER, "free", fibre_angle=0.2),
    "simply supported": Specimen(0.5, 0.04, 0.01, PAPER, "simply_supported"),
    "numbered across": Specimen(0.2, 0.5, 0.01, PAPER, "free", divisions=(4, 10)),
    "stepped, in zones": Specimen(
        0.5, 0.04, 0.01, PAPER, pieces=(Piece(0.1, 0.3, 0.01, 0.007),), zones=(0.33,)
    ),
}


@pytest.mark.parametrize("name", ["numbered across", "stepped, in zones"])
def test_three_dofs_of_a_node_are_six(name) -> None:
    """w, θx and θy alone give the bending of all six; among these are modes in the plane too."""
    body = BODIES[name]
    all_six = replace(body.structure, dofs=(0, 1, 2, 3, 4, 5))
    flat, every = hz(body), hz(all_six, 24)
    for frequency in flat:
        assert np.abs(every / frequency - 1).min() < 1e-7


@pytest.mark.parametrize("name", list(BODIES))
def test_other_dimensions_are_those_of_a_body_built_with_them(name) -> None:
    body = replace(BODIES[name], masses=(), pieces=())
    size = {
        "length": 1.04 * body.length,
        "width": 0.97 * body.width,
        "thickness": 1.02 * body.thickness,
    }
    zones = tuple(1.04 * x for x in body.zones)
    built = replace(body, **size, zones=zones)
    values = np.array(list((body.nominal | size).values()))
    # 1e-8: two solves of an eigenproblem each to round-off; the closed forms are the same.
    np.testing.assert_allclose(hz(body, 6, values), hz(built), rtol=1e-8)
