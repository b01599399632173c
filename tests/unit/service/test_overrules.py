"""Which hits a user's decisions mean."""

from __future__ import annotations

import pytest

from fecore.errors import InputError
from fecore.frf import Dof
from service.store.records.decisions import decisions
from service.store.records.schemas import OverruleIn

HITS = [((1, -3), 1), ((1, -3), 2), ((2, 3), 1), ((2, -3), 1)]


def test_without_a_direction_the_one_is_meant_in_which_the_point_was_hit() -> None:
    left_out = OverruleIn(point=1, hit=2, use=False)
    assert decisions([left_out, left_out], HITS) == {(Dof(1, -3), 2): False}
    assert decisions([OverruleIn(point=2, direction=-3, hit=1, use=True)], HITS) == {(Dof(2, -3), 1): True}


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        (OverruleIn(point=2, hit=1, use=True), r"direction: is missing: there is hit 1 of point 2 in directions -3, 3"),
        (
            OverruleIn(point=1, direction=3, hit=1, use=True),
            r"direction -3: hits 1 to 2; point 2, direction -3: hits 1 to 1",
        ),
        (
            OverruleIn(point=1, direction=-3, hit=2, use=True),
            r"overrules.1: contradicts another about hit 2 of point 1",
        ),
    ],
)
def test_what_means_no_hit_or_several_is_refused(wrong: OverruleIn, text: str) -> None:
    with pytest.raises(InputError, match=text):
        decisions([OverruleIn(point=1, hit=2, use=False), wrong], HITS)
