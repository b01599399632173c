"""What moved: patterns of a change of modes without a model."""

import numpy as np
import pytest

from fecore.trend.patterns import patterns, patterns_in_words

NAMES = ["frequency_1", "frequency_2", "frequency_3", "frequency_4"]
SLOPES = {"temperature_deck_c": np.array([-5e-4, -1.2e-3, -2e-4, -8e-4])}


@pytest.mark.parametrize(
    ("deviation", "kind", "words"),
    [
        ([0.0, 0.0005, -0.0005, 0.0], "none", "no change of the frequencies"),
        ([-0.010, -0.011, -0.010, -0.0095], "alike", "all modes -1.0"),
        ([0.0, -0.012, 0.0004, 0.0], "one", "frequency_2 -1.20"),
        ([-0.012, 0.011, 0.0, 0.02], "several", "several modes"),
        ([-0.005, -0.012, -0.002, -0.008], "covariate", "temperature_deck_c"),
    ],
)
def test_a_pattern_is_told_by_what_moved_together(
    deviation: list[float], kind: str, words: str
) -> None:
    ranked = patterns(NAMES, np.array(deviation), np.full(4, 0.0005**2), SLOPES)
    assert ranked[0].kind == kind
    assert ranked[0].probability > 0.5
    assert sum(each.probability for each in ranked) == pytest.approx(1)
    assert words in patterns_in_words(ranked)
