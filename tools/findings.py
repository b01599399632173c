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
from modalbase.formats.models.losses import OF_BDF, OF_INP, OF_MODELS, Loss

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


LOSSES = {
    "Nastran": OF_BDF,
    "Abaqus and CalculiX": OF_INP,
    "Meshes, and models of any format": OF_MODELS,
}
"""Tables of what a reader of models says is lost, by the heading that they have."""


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
        "What a [result](results.md#warnings-and-what-to-do), an [identification](modes.md#what-it-says-of-faults), a",
        "[processing of hits](hammer.md) and the import of a deck can say, by ids. … stands for values. A verdict is no better",
        "than its gravest finding: `with_care` or `do_not_use`. Findings without such a level leave it as it is.", "",
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
        "## Decks and meshes", "",
        "What [an import](own-model.md) leaves out, under the name that `accept` takes; where modes change by it, it must be",
        "accepted. CARD stands for the name of the card.", "",
    ]  # fmt: skip
    for title, losses in LOSSES.items():
        lines += [f"### {title}", "", *_losses(losses), ""]
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


def _losses(rows: Mapping[str, Loss]) -> Iterable[str]:
    yield _line(["id", "under the name", "what is lost", "modes change"])
    yield _line(["---"] * 4)
    for kind, row in rows.items():
        name = _plain(row.card.format(card="CARD", lamina="{}"))
        yield _line([f"`{kind}`", name, _plain(row.loss), "yes" if row.changes else ""])


def _line(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _plain(template: str) -> str:
    return re.sub(r"\{[^}]*\}", "…", template)
