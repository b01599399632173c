"""What pages show: joined points, documents a line each, findings at a result's head, bars of
parameters.
"""

import itertools
from typing import Any

import numpy as np
import pytest

from fecore.frf import Dof
from fecore.modes import MeasuredModes
from fecore.updating.known_findings import FINDINGS
from fecore.updating.result import finding, warnings
from service.figures.measured import _by_axis
from service.figures.modes import chains, joined, joined_as
from service.nouns.updates.result_schemas import FindingOut
from service.pages.comparing import _told_apart, leaves
from service.pages.findings import MOST, PLACES, bar, opening
from service.pages.numbers import minus

GRID = np.array([(0.045 * i, 0.02 * j, 0.0) for i in range(11) for j in range(3)])


def test_irregular_points_are_joined_to_neighbours_in_one_net_and_never_over_a_point() -> None:
    places = np.random.default_rng(1).random((60, 3)) * [1.0, 0.3, 0.0]
    pairs = joined(places)
    reached, rest = {0}, list(pairs)
    for _ in places:
        reached |= {k for pair in rest if reached & set(pair) for k in pair}
    assert reached == set(range(60))
    for i, j in pairs:
        others = np.delete(places, [i, j], axis=0)
        distance = np.linalg.norm(others - (places[i] + places[j]) / 2, axis=1)
        assert distance.min() > np.linalg.norm(places[i] - places[j]) / 2


@pytest.mark.parametrize(
    ("places", "pairs"),
    [([], []), ([[0, 0, 0]], []), ([[0, 0, 0], [0, 0, 0]], []), ([[0, 0, 0], [1, 0, 0]], [(0, 1)])],
)
def test_two_places_have_a_line(places: list[list[float]], pairs: list[tuple[int, int]]) -> None:
    assert joined(np.array(places, dtype=float).reshape(-1, 3)) == pairs


def test_lines_go_on_along_a_grid_and_hold_each_pair_once() -> None:
    lines = chains(GRID)
    assert sorted(len(line) for line in lines) == [3] * 11 + [11] * 3
    held = sorted((min(a, b), max(a, b)) for line in lines for a, b in itertools.pairwise(line))
    assert held == joined(GRID)
    assert len(held) == 11 * 2 + 10 * 3
    irregular = np.random.default_rng(2).random((40, 3)) * [1.0, 0.5, 0.0]
    held = sorted(
        (min(a, b), max(a, b)) for line in chains(irregular) for a, b in itertools.pairwise(line)
    )
    assert held == joined(irregular)


def test_trace_lines_come_before_neighbours() -> None:
    places = np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0]])
    assert joined_as([(10, 30, 0, 30, 20), (20, 30, 77, 10)], [10, 20, 30], places) == [
        (0, 2),
        (1, 2),
    ]
    assert joined_as([(0, 77, 10)], [10, 20, 30], places) == joined(places) == [(0, 1), (1, 2)]


def test_shapes_are_compared_along_positive_axes() -> None:
    shapes = np.array([[1.0 + 0j, 2.0]])
    modes = MeasuredModes(np.array([10.0]), np.array([0.01]), shapes, (Dof(1, 3), Dof(2, -3)))
    assert {key: value.tolist() for key, value in _by_axis(modes).items()} == {
        (1, 3): [1.0],
        (2, 3): [-2.0],
    }
    assert _by_axis(MeasuredModes(np.array([10.0]), np.array([0.01]))) == {}


@pytest.mark.parametrize(
    ("value", "line"),
    [
        ({"material": {"Ex_Pa": 33.05e9}}, ("material Ex", "33.05 GPa")),
        ({"temperature_c": 21.5}, ("temperature", "21.5 °C")),
        ({"humidity_percent": None}, ("humidity percent", "–")),
        ({"hold_out": {"points": [1, 2]}}, ("hold out points", "1, 2")),
        ({"parameters": [{"name": "Ex"}]}, ("parameters 1 name", "Ex")),
        ({"use_shapes": True}, ("use shapes", "True")),
    ],
)
def test_a_document_is_written_a_line_each_in_a_laboratorys_units(
    value: object, line: tuple[str, str]
) -> None:
    assert list(leaves(value)) == [line]


def test_names_are_as_long_as_they_must_be() -> None:
    twice = ("May", "bar", "1")
    assert _told_apart([twice, twice, ("June", "bar", "1")]) == [
        "May, bar, 1",
        "May, bar, 1",
        "June",
    ]


# --- what a result opens with: at most three findings with what to do, the rest as notes
# ------------------------------


NOTES = ("without_joints", "campaign_missed", "campaign_modes_alone", "loads_unmeasured")
"""Kinds that nobody acts on from here: those of joint updates, whose page names the campaign, and
what modes of responses alone are.
"""

WINDOW = finding("window_unstated", name="a0", percent=14.0)
MISSED = finding("frequencies_missed", percent=2.3)
TURNED = finding("frf_turned", frfs="FRF 33Z/4Z (-1.00)", have="has", of="model")
BEYOND = finding(
    "points_beyond", where="", campaign="", points="31, 32", name="length", size=500, out=12.0
)


def of_findings(*findings: Any, notes: tuple[str, ...] = ()) -> dict[str, Any]:
    rows = [FindingOut.model_validate(finding).model_dump(mode="json") for finding in findings]
    texts = [f.text for f in findings]
    return {"findings": rows, "warnings": [*notes, *texts], "verdict": {"reasons": texts[:2]}}


def test_each_kind_of_finding_says_what_to_do_and_where() -> None:
    assert {kind for kind, row in FINDINGS.items() if row.link is None} == set(NOTES)
    for kind, row in FINDINGS.items():
        if row.link is not None:
            assert row.advice, f"{kind} says nothing to do"
            assert row.link in PLACES


def test_a_result_opens_with_three_findings_and_keeps_the_rest_as_notes() -> None:
    many = [MISSED, TURNED, WINDOW, finding("samples_differ", name="Ex", ratio=1.4)]
    steps, notes = opening(of_findings(*many, notes=("coupons: a mean",)))
    assert len(steps) == MOST
    assert steps[0].advice == "Find the cause before you use the estimates."
    assert steps[0].text.endswith("geometry, density or boundary wrong.")
    assert notes == ["coupons: a mean", many[3].text]


def test_alike_findings_are_one_step_that_names_them() -> None:
    other = finding("frf_turned", frfs="FRF 5Z/4Z (-0.98)", have="has", of="model")
    (folded,) = warnings((TURNED, other))
    assert folded == f"{TURNED.text} (likewise: FRF 5Z/4Z (-0.98))"
    made = of_findings(TURNED, other) | {
        "warnings": [folded],
        "verdict": {"reasons": [TURNED.text, other.text]},
    }
    steps, notes = opening(made)
    assert [step.text for step in steps] == [minus(folded)]
    assert notes == []


def test_advice_with_values_stands_apart_from_the_sentence() -> None:
    mesh = finding("mesh_moves", size=20.0, finest=5.0, moved="Ex by +3 %", enough=10.0)
    (beyond, moves), notes = opening(of_findings(BEYOND, mesh))
    assert beyond.text == "Points 31, 32 lie beyond the length of 500 mm, by up to 12 mm."
    assert beyond.advice.startswith("The length or the points' coordinates are wrong")
    assert moves.text.endswith("the constants are those of elements of 5 mm.")
    assert moves.advice == "Elements of 10 mm would do."
    assert notes == []
    (sign,), _ = opening(of_findings(finding("sign_opposite")))
    assert sign.text.endswith("the damping was fitted to the FRFs with their sign reversed.")
    assert sign.advice.startswith("Correct the direction or polarity")


def test_the_lengths_and_widths_of_campaigns_are_not_said_as_one() -> None:
    other = finding(
        "points_beyond", where="", campaign="", points="7", name="width", size=50, out=3.0
    )
    assert warnings([BEYOND, other]) == (BEYOND.text, other.text)
    assert opening(of_findings(BEYOND, other))[1] == [other.text]


def test_a_result_without_findings_shows_its_sentences_once() -> None:
    old = {"findings": None, "warnings": ["a", "b"], "verdict": {"reasons": ["a"]}}
    assert opening(old) == ([], ["a", "b"])


@pytest.mark.parametrize("prior_sd", [9.0e9, None])
def test_a_bar_has_the_estimate_inside_its_interval(prior_sd: float | None) -> None:
    row = {
        "unit": "Pa",
        "interval_95": [29e9, 34e9],
        "estimate": 31e9,
        "initial": 33e9,
        "standard_deviation": 1.4e9,
    }
    made = bar({**row, "prior_mean": 33e9 if prior_sd else None, "prior_sd": prior_sd})
    assert made is not None
    left, wide = made.posterior
    assert left < made.estimate < left + wide
    assert (made.prior is None) == (prior_sd is None)
    assert "29.0 to 34.0" in made.words
    if made.prior is not None:
        assert made.prior[1] == pytest.approx(96.0, abs=0.01)
        assert wide == pytest.approx(96 * 5 / (2 * 1.96 * 9), abs=0.01)  # of a prior 35.3 GPa wide


def test_a_parameter_without_an_interval_has_no_bar() -> None:
    assert bar({"interval_95": [None, None], "prior_sd": None}) is None
