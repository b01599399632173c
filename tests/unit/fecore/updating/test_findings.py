"""Findings in words, and intervals where nothing is uncertain."""

from __future__ import annotations

import numpy as np

from fecore.updating.findings import FINDINGS, found, warnings
from fecore.updating.measured_ratios import ScaleMixture
from fecore.updating.posterior import Mixture
from fecore.updating.result import Finding


def test_findings_alike_are_folded_and_the_same_is_said_once() -> None:
    one, other = "mode 1 (20.00 Hz) is alone", "mode 2 (30.00 Hz) is alone"
    found = [Finding(one, "with_care", 2), Finding(one), Finding(other), Finding("the lid is open", "do_not_use")]
    assert warnings(found) == ("the lid is open", f"{one} (likewise: mode 2 (30.00 Hz))")


def test_a_row_of_the_table_says_what_was_found_and_what_to_do() -> None:
    said = found("modes_absent", level="do_not_use", modes="a mode", which="12.00 Hz")
    assert said.text.endswith("and nothing is there: a wrong boundary or geometry, or modes that were paired wrongly")
    assert (said.kind, said.level, said.weight) == ("modes_absent", "do_not_use", 85)
    assert all(row.sentence and not row.sentence.endswith(".") for row in FINDINGS.values())


def test_what_is_known_exactly_has_an_interval_of_no_width() -> None:
    weight, scale = np.array([0.4, 0.6]), np.array([0.01, 0.02])
    assert ScaleMixture(weight, scale).reach(0.0, 0.0) == 0.0
    assert Mixture(weight, np.zeros((2, 3)), np.stack([np.eye(3)] * 2), scale).reach(np.zeros(3)) == (0.0, 0.0)
