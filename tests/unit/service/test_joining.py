"""Which points a picture joins."""

import itertools

import numpy as np
import pytest

from service.show.figures.modes import chains, joined, joined_as


def test_a_grid_is_joined_along_its_rows_and_columns() -> None:
    places = np.array([(0.045 * i, 0.02 * j, 0.0) for i in range(11) for j in range(3)])
    found = joined(places)
    assert len(found) == 11 * 2 + 10 * 3
    across = places[[i for i, _ in found]] - places[[j for _, j in found]]
    assert np.all(np.sum(across != 0, axis=1) == 1)


def test_irregular_points_are_joined_to_neighbours_in_one_net_and_never_over_a_point() -> None:
    places = np.random.default_rng(1).random((60, 3)) * [1.0, 0.3, 0.0]
    found = joined(places)
    reached, rest = {0}, list(found)
    for _ in places:
        reached |= {k for pair in rest if reached & set(pair) for k in pair}
    assert reached == set(range(60))
    for i, j in found:
        others = np.delete(places, [i, j], axis=0)
        away = np.linalg.norm(others - (places[i] + places[j]) / 2, axis=1)
        assert away.min() > np.linalg.norm(places[i] - places[j]) / 2


@pytest.mark.parametrize("places", [[], [[0, 0, 0]], [[0, 0, 0], [0, 0, 0]]])
def test_what_has_no_two_places_has_no_line(places: list[list[float]]) -> None:
    assert joined(np.array(places, dtype=float).reshape(-1, 3)) == []


def test_two_points_are_joined() -> None:
    assert joined(np.array([[0.0, 0, 0], [1.0, 0, 0]])) == [(0, 1)]


def test_lines_go_on_along_a_grid_and_hold_each_pair_once() -> None:
    places = np.array([(0.045 * i, 0.02 * j, 0.0) for i in range(11) for j in range(3)])
    found = chains(places)
    assert sorted(len(line) for line in found) == [3] * 11 + [11] * 3
    held = sorted((min(a, b), max(a, b)) for line in found for a, b in itertools.pairwise(line))
    assert held == joined(places)
    irregular = np.random.default_rng(2).random((40, 3)) * [1.0, 0.5, 0.0]
    held = sorted((min(a, b), max(a, b)) for line in chains(irregular) for a, b in itertools.pairwise(line))
    assert held == joined(irregular)


def test_trace_lines_come_before_neighbours() -> None:
    places = np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0]])
    assert joined_as([(10, 30, 0, 30, 20), (20, 30, 77, 10)], [10, 20, 30], places) == [(0, 2), (1, 2)]
    assert joined_as([(0, 77, 10)], [10, 20, 30], places) == joined(places) == [(0, 1), (1, 2)]
