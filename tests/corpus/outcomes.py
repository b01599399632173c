"""What may become of an input: each outcome is called with what the input gave, and asserts."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from fecore.modal import Identification
from fecore.updating.result import UpdateResult

Case = tuple[Callable[[], Any], "str | Callable[[Any], None]"]
"""An input, as a call of a public function, and its outcome: how its error begins, or what is
asserted of what it gives.
"""


def estimates(result: UpdateResult) -> np.ndarray:
    return np.array([row.estimate for row in result.parameters])


def deviations(result: UpdateResult) -> np.ndarray:
    return np.array([row.standard_deviation for row in result.parameters])


@dataclass(frozen=True)
class Updated:
    """An update's result.

    Attributes:
        says: each matches the beginning of a warning.
        silent: words that no warning has.
        level: of the verdict.
        reasons: each matches the beginning of a reason of the verdict, in this order; None: any.
        like: gives the result whose estimates it has within a tenth of their standard deviations,
            and these within a tenth.
        close: gives the result whose estimates it has but for a thousandth.
        no_damping: words of why the damping failed; the constants stand.
        more: a further assertion.
    """

    says: Sequence[str] = ()
    silent: Sequence[str] = ()
    level: str | None = None
    reasons: Sequence[str] | None = None
    like: Callable[[], UpdateResult] | None = None
    close: Callable[[], UpdateResult] | None = None
    no_damping: str | None = None
    more: Callable[[UpdateResult], object] | None = None

    def __call__(self, result: UpdateResult) -> None:
        for sentence in self.says:
            assert any(re.match(sentence, text) for text in result.warnings), (
                sentence,
                result.warnings,
            )
        assert [
            text for text in result.warnings if any(words in text for words in self.silent)
        ] == []
        assert result.verdict.level == (self.level or result.verdict.level)
        if self.reasons is not None:
            assert len(self.reasons) == len(result.verdict.reasons), result.verdict.reasons
            assert all(map(re.match, self.reasons, result.verdict.reasons)), result.verdict.reasons
        if self.like is not None:
            clean = self.like()
            assert np.all(np.abs(estimates(result) - estimates(clean)) < 0.1 * deviations(clean))
            np.testing.assert_allclose(deviations(result), deviations(clean), rtol=0.1)
        if self.close is not None:
            clean = self.close()
            np.testing.assert_allclose(
                estimates(result)[: len(estimates(clean))], estimates(clean), rtol=1e-3
            )
        if self.no_damping is not None:
            self._without_damping(result)
        assert self.more is None or self.more(result) in (None, True)

    def _without_damping(self, result: UpdateResult) -> None:
        outcomes = {outcome.stage: outcome for outcome in result.outcomes}
        assert (outcomes["elastic"].status, outcomes["damping"].status) == ("succeeded", "failed")
        assert re.search(self.no_damping or "", outcomes["damping"].message)
        assert "a0" not in [row.name for row in result.parameters]
        assert result.verdict.level != "usable"


@dataclass(frozen=True)
class Modes:
    """An identification.

    Attributes:
        hz: its modes, all of them that are not doubtful.
        rel: how near each must be.
        zeta: their damping ratios within a tenth, where they are stated.
        doubtful: of which there is a doubtful pole, and no mode, each with a word of the doubt.
        says: words of warnings.
    """

    hz: Sequence[float]
    rel: float = 2e-3
    zeta: Sequence[float] | None = None
    doubtful: Sequence[tuple[float, str]] = ()
    says: Sequence[str] = ()

    def __call__(self, found: Identification) -> None:
        assert found.modes.frequency_hz.tolist() == pytest.approx(list(self.hz), rel=self.rel)
        if self.zeta is not None:
            assert found.modes.damping_ratio.tolist() == pytest.approx(list(self.zeta), rel=0.1)
        doubts = found.doubtful
        for hz, word in self.doubtful:
            poles = zip(doubts.modes.frequency_hz, doubts.doubt, strict=True)
            near = [why for each, why in poles if abs(each / hz - 1) < 0.01]
            assert near, f"{hz} Hz is not doubtful: {doubts.modes.frequency_hz}"
            assert any(word in str(why) for why in near), near
        said = "\n".join(found.warnings)
        assert [words for words in self.says if words not in said] == [], said
