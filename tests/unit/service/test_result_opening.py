"""What a result opens with: at most three findings with what to do, the rest as notes; the bar of a parameter."""

from __future__ import annotations

from typing import Any

import pytest

from fecore.updating.findings import FINDINGS, found, warnings
from service.show.pages.found import MOST, PLACES, REMEDIES, bar, opening

NOTES = ("measurement", "pairing", "without_joints", "campaign_missed", "campaign_modes_alone")
"""Kinds that nobody acts on from here: remarks on the processing, and those of joint updates, whose page names the campaign."""

WINDOW = found("window_unstated", name="a0", percent=14.0)
MISSED = found("frequencies_missed", percent=2.3)
TURNED = found("frf_turned", who="FRF 33Z/4Z (-1.00) has", of="model")


def document(*findings: Any, notes: tuple[str, ...] = ()) -> dict[str, Any]:
    rows = [{"kind": f.kind, "level": f.level, "text": f.text} for f in findings]
    texts = [f.text for f in findings]
    return {"findings": rows, "warnings": [*notes, *texts], "verdict": {"reasons": texts[:2]}}


def test_each_kind_of_finding_says_what_to_do_and_where() -> None:
    assert REMEDIES.keys() | set(NOTES) == FINDINGS.keys()
    for kind, (place, advice) in REMEDIES.items():
        assert advice or FINDINGS[kind].advice, f"{kind} says nothing to do"
        assert place in PLACES


def test_a_result_opens_with_three_findings_and_keeps_the_rest_as_notes() -> None:
    many = [
        MISSED,
        TURNED,
        WINDOW,
        found("samples_differ", name="Ex", ratio=1.4),
    ]
    steps, notes = opening(document(*many, notes=("coupons: a mean",)))
    assert len(steps) == MOST
    assert steps[0].advice == "Find the cause before you use the estimates."
    assert steps[0].text.endswith("geometry, density or boundary wrong.")
    assert notes == ["coupons: a mean", many[3].text]


def test_alike_findings_are_one_step_that_names_them() -> None:
    other = found("frf_turned", who="FRF 5Z/4Z (-0.98) has", of="model")
    (folded,) = warnings((TURNED, other))
    assert folded == f"{TURNED.text} (likewise: FRF 5Z/4Z (-0.98))"
    made = document(TURNED, other) | {"warnings": [folded], "verdict": {"reasons": [TURNED.text, other.text]}}
    steps, notes = opening(made)
    assert [step.text for step in steps] == [f"{folded}"]
    assert notes == []


def test_a_result_without_findings_shows_its_sentences_once() -> None:
    old = {"findings": None, "warnings": ["a", "b"], "verdict": {"reasons": ["a"]}}
    assert opening(old) == ([], ["a", "b"])


@pytest.mark.parametrize("prior_sd", [9.0e9, None])
def test_a_bar_has_the_estimate_inside_its_interval(prior_sd: float | None) -> None:
    row = {"unit": "Pa", "interval_95": [29e9, 34e9], "estimate": 31e9, "initial": 33e9, "standard_deviation": 1.4e9}
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
