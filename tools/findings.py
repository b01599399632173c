"""The guide's page of all findings, made from their tables."""

import re
from collections.abc import Iterable, Mapping
from typing import Protocol

from fecore import correlation
from fecore.findings import Row
from fecore.modal.findings import OF_FRFS, OF_MODES, WHY_NOT_USED
from fecore.signal.findings import OF_HITS
from fecore.signal.reasons import REASONS
from fecore.updating import measurement
from fecore.updating.known_findings import PASSED_ON, SECTIONS

PAGE = "docs/findings.md"

REMARKS: dict[str, Mapping[str, Row]] = {
    "FRFs": OF_FRFS,
    "FRFs that are not used": WHY_NOT_USED,
    "Modes from FRFs": OF_MODES,
    "What an update can use": measurement.REMARKS,
    "Modes without a partner": correlation.REMARKS,
    "Hits of a campaign": OF_HITS,
}
"""Tables of what is said before an update, by the heading that they have."""


class _Said(Protocol):
    """A row of any table."""

    @property
    def sentence(self) -> str:
        """What was found."""

    @property
    def advice(self) -> str:
        """What to do."""


def page() -> str:
    """`docs/findings.md`: every finding by its id."""
    passed = " and ".join(f"`{kind}`" for kind in PASSED_ON)
    lines = [
        "# All findings", "", "<!-- made by python -m tools.reference -->", "",
        "What a [result](results.md#warnings-and-what-to-do), an [identification](modes.md#what-it-says-of-faults) and a",
        "[processing of hits](hammer.md) can say, by lasting ids. … stands for values. A verdict is no better than its gravest",
        "finding: `with_care` or `do_not_use`. Findings without such a level leave it as it is.", "",
    ]  # fmt: skip
    for title, rows in SECTIONS.items():
        lines += [f"## {title}", "", *_table(rows, {k: row.level for k, row in rows.items()}), ""]
    lines += [
        "## Remarks on the data", "",
        f"A result passes these on as findings of the kinds {passed}, with their ids in `remark`. An identification and a",
        "processing have them among their `warnings`.", "",
    ]  # fmt: skip
    for title, rows in REMARKS.items():
        lines += [f"### {title}", "", *_table(rows), ""]
    lines += [
        "## Each hit", "",
        "[How hits are judged](hammer-judgement.md) says what the numbers are. The advice stands behind the sentence where the",
        "hit is refused for it.", "",
        *_table(REASONS), "",
    ]  # fmt: skip
    return "\n".join(lines)


def _table(
    rows: Mapping[str, _Said], levels: Mapping[str, str | None] | None = None
) -> Iterable[str]:
    """A table of Markdown, with a column for levels where there are some."""
    head = ["id", "what is found", "what to do", *(["level"] if levels else [])]
    yield _line(head)
    yield _line(["---"] * len(head))
    for kind, row in rows.items():
        level = [f"`{levels[kind]}`" if levels[kind] else ""] if levels else []
        yield _line([f"`{kind}`", _plain(row.sentence), _plain(row.advice), *level])


def _line(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _plain(template: str) -> str:
    return re.sub(r"\{[^}]*\}", "…", template)
