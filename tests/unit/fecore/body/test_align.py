"""The test's frame over the model: by pairs, and by the closest points of the faces."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fecore.body.align import by_closest, by_pairs
from fecore.body.structure import Structure
from fecore.errors import InputError
from service.nouns.structures.schemas import StructureIn
from service.nouns.updates.bodies import nominal_body
from tests.support.places import shared_file
from tests.support.profiles import ANGLE, points
from tests.support.stored_solids import stated


@pytest.fixture(scope="module")
def body() -> Structure:
    return nominal_body(StructureIn.model_validate(ANGLE), "free")


def test_three_pairs_bring_a_test_onto_its_body() -> None:
    places = np.array(list(points().values()))
    turn, shift = Rotation.from_rotvec([0.3, -1.2, 0.7]).as_matrix(), np.array([0.4, -2.0, 0.1])
    measured = (places - shift) @ turn
    found = by_pairs(measured[:4], places[:4])
    np.testing.assert_allclose(found.turn, turn, atol=1e-12)
    np.testing.assert_allclose(found.shift, shift, atol=1e-12)
    assert found.rms < 1e-12
    with pytest.raises(InputError, match="are 2, expected three or more"):
        by_pairs(measured[:2], places[:2])
    with pytest.raises(InputError, match="on a line"):
        by_pairs(np.outer(np.arange(4.0), [1, 0, 0]), places[:4])


def test_closest_points_find_the_frame_of_a_body_without_symmetry(body: Structure) -> None:
    """Walls of 56 and 78 mm, a grid that reaches one end alone: no other turn brings all points
    onto faces.
    """
    places = np.array([[x, y, z] for n, (x, y, z) in points().items() if n < 13])
    R, shift = Rotation.from_rotvec([0.03, -0.05, np.pi]).as_matrix(), np.array([0.2, 0.5, -0.3])
    best, *others = by_closest(body.model.surfaces, (places - shift) @ R)
    assert best.rms < 2e-4
    moved = ((places - shift) @ R) @ best.turn.T + best.shift
    if not others:  # along the length nothing but the ends holds a grid
        np.testing.assert_allclose(moved[:, 1:], places[:, 1:], atol=5e-3)


@pytest.mark.long
def test_a_symmetric_grid_has_several_answers(body: Structure) -> None:
    """In short one without symmetry has one, above."""
    ends = np.array(
        [[x, 0.0, -0.04] for x in (0.05, 0.2, 0.35)] + [[x, 0.01, -0.04] for x in (0.05, 0.2, 0.35)]
    )
    assert len(by_closest(body.model.surfaces, ends)) > 1


@pytest.mark.long
def test_a_frame_that_is_the_bodys_comes_first() -> None:
    """Points on outer faces, half a wall off the middle surfaces: of an open solid, whose drawing
    is the mesh's. In short another frame is found, above.
    """
    truth = json.loads(
        shared_file("BLIND_OPEN", "blind-open", "structures/angle-1.truth.json").read_text()
    )
    surfaces = stated(truth, 2)[0].model.surfaces
    best, *_ = by_closest(surfaces, np.array([point["xyz"] for point in truth["points"]]))
    np.testing.assert_allclose(best.turn, np.eye(3), atol=5e-3)
    np.testing.assert_allclose(best.shift, 0, atol=5e-4)
