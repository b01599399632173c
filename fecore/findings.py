"""What a user may have to know: rows of tables, and the findings that are made of them.

A row has the sentence of one kind of finding and what to do about it, with names in braces. A
finding is a row with its values. Its parts stay apart, so that nobody has to read them out of a
sentence again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple

Level = Literal["with_care", "do_not_use"]

Place = Literal["campaign", "modes", "structure", "update", "frfs", "damping"]
"""Where a finding is mended."""

MOST_NAMED = 4  # of alike findings, how many are named one by one


class Row(NamedTuple):
    """A row of a table; with names for values in braces."""

    level: Level | None  # what it means for the use of a result; None: nothing
    weight: float  # within a level, more comes first
    sentence: str
    advice: str = ""  # what to do
    # where that is done, for a page to lead there; None where a result states it as a note
    link: Place | None = None
    # whether the advice stands apart from the finding's text, which then is the sentence alone
    apart: bool = False
    # what it is about; findings of one kind about several things are folded into one
    subject: str = ""
    folds: bool = True  # whether they are: not where each says more than its subject


def remark(sentence: str, advice: str = "", subject: str = "", *, folds: bool = True) -> Row:
    """A row that by itself means nothing for the use of a result."""
    return Row(None, 0.0, sentence, advice, subject=subject, folds=folds)


@dataclass(frozen=True)
class Finding:
    """Something that a user must know."""

    kind: str  # id of its row
    sentence: str  # what was found
    text: str  # in words: the sentence and, where its row has it so, the advice
    advice: str = ""  # what to do; empty where there is nothing to do
    # what it means for the use of the result; None where it means nothing for it
    level: Level | None = None
    weight: float = 0.0  # within a level, more comes first
    link: Place | None = None  # where it is mended
    subject: str | None = None  # what it is about, such as a mode or a campaign
    remark: str | None = None  # id of the remark on the data that a result passes on as this kind
    folds: bool = True  # whether it is said as one with others of its kind

    def renamed(self, names: Mapping[str, str]) -> Finding:
        """The same with other names, by those that it has among its values; of one whose values are
        not at hand itself.
        """
        del names
        return self

    def reworded(self, words: Callable[[str], str]) -> Finding:
        """The same with each of its texts as a function of texts gives it."""
        sentence, text, advice = map(words, (self.sentence, self.text, self.advice))
        subject = self.subject and words(self.subject)
        return replace(self, sentence=sentence, text=text, advice=advice, subject=subject)

    def passed_on(self, kind: str, weight: float) -> Finding:
        """The same as a result says it, under the kind that it has for all remarks of a step."""
        return replace(self, kind=kind, weight=weight, remark=self.kind)


@dataclass(frozen=True)
class _Made(Finding):
    """A finding with what it was made of, which documents do not have."""

    row: Row = field(kw_only=True, repr=False, compare=False)
    values: Mapping[str, object] = field(kw_only=True, repr=False, compare=False)

    def renamed(self, names: Mapping[str, str]) -> Finding:
        """The same with other names, by those that it has among its values."""
        values = {key: names.get(str(each), each) for key, each in self.values.items()}
        return replace(self, **_words(self.row, values), values=values)


def make(
    rows: Mapping[str, Row], kind: str, *, level: Level | None = None, **values: object
) -> Finding:
    """A finding of a row of a table, with its values; of a graver or a milder level where one is
    given.
    """
    row = rows[kind]
    return _Made(
        kind,
        **_words(row, values),
        level=level or row.level,
        weight=row.weight,
        link=row.link,
        folds=row.folds,
        row=row,
        values=values,
    )


def _words(row: Row, values: Mapping[str, object]) -> dict[str, Any]:
    """What a row says with values."""
    sentence, advice = row.sentence.format(**values), row.advice.format(**values)
    between = "; " if ": " in row.sentence or "; " in row.sentence else ": "
    return {
        "sentence": sentence,
        "text": sentence if row.apart or not advice else sentence + between + advice,
        "advice": advice,
        "subject": row.subject.format(**values) or None,
    }


def texts(findings: Iterable[Finding]) -> tuple[str, ...]:
    """Findings in words."""
    return tuple(finding.text for finding in findings)


def alike(findings: Iterable[Finding]) -> list[list[Finding]]:
    """Findings in groups that are said as one, in the order of their first; each text once."""
    groups: dict[tuple[str | None, ...], dict[str, Finding]] = {}
    for each in findings:
        key = (each.kind, each.remark) if each.folds and each.subject else (each.text,)
        groups.setdefault(key, {}).setdefault(each.text, each)
    return [list(group.values()) for group in groups.values()]


def likewise(others: Sequence[Finding]) -> str:
    """In brackets, of what else the first of alike findings holds; nothing without others."""
    return f" (likewise: {listed([each.subject for each in others], MOST_NAMED)})" if others else ""


def listed(words: Sequence[object], most: int) -> str:
    """The first words of a list, and how many more there are."""
    more = f" and {len(words) - most} more" if len(words) > most else ""
    return ", ".join(map(str, words[:most])) + more
