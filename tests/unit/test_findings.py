"""Findings come from rows of tables alone: each row is used, with the values that it names, leads
somewhere, and stands in the guide.
"""

import ast
import re
from collections import Counter
from functools import cache
from pathlib import Path
from string import Formatter

import pytest

from fecore import correlation
from fecore.findings import Row, alike, make, remark
from fecore.modal.findings import OF_FRFS, OF_MODES, WHY_NOT_USED, finding, not_used
from fecore.signal.findings import OF_HITS
from fecore.signal.reasons import REASONS
from fecore.updating import measurement
from fecore.updating.known_findings import FINDINGS, PASSED_ON, SECTION_OF, SECTIONS
from modalbase.formats.models.losses import LOSSES
from modalbase.formats.models.model import ReadReport, Where, skipped_card
from service.pages.findings import PLACES, section
from service.pages.guide.contents import render
from tests.support.places import ROOT, parsed
from tools import findings

REMARKS = {
    **correlation.REMARKS, **measurement.REMARKS, **OF_FRFS, **OF_MODES, **WHY_NOT_USED, **OF_HITS,
}  # fmt: skip
ROWS: dict[str, Row] = {**FINDINGS, **REMARKS}
MAKERS = ("finding", "of_mode", "reason")
READERS = "modalbase/formats/models"


def named(*templates: str) -> set[str]:
    """Values that templates name."""
    return {name for each in templates for _, name, _, _ in Formatter().parse(each) if name}


def used(folder: str, *, but: str = "") -> set[str]:
    """Texts of one word within the modules of a folder."""
    files = [path for path in parsed(folder) if path.name != but]
    return {word for path in files for word in re.findall(r'"(\w+)"', path.read_text())}


@cache
def calls(folder: str = "fecore") -> list[tuple[Path, ast.Call]]:
    """Of what makes a finding, a note or a loss."""
    return [
        (path, node)
        for path, tree in parsed(folder).items()
        if re.search(r"Finding\(|make\(|finding\(|of_mode\(|reason\(|ard\(|note", path.read_text())
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
    ]


def called(call: ast.Call) -> str:
    return getattr(call.func, "id", getattr(call.func, "attr", ""))


def test_an_id_is_of_one_row() -> None:
    tables = (*SECTIONS.values(), correlation.REMARKS, measurement.REMARKS, OF_FRFS, OF_MODES)
    ids = Counter(kind for rows in (*tables, WHY_NOT_USED, OF_HITS) for kind in rows)
    assert [kind for kind, times in ids.items() if times > 1] == []
    assert ids.keys().isdisjoint(PASSED_ON)


def test_findings_are_made_of_rows_alone() -> None:
    """Only `fecore.findings` makes them, and `make` is given a table: no text stands elsewhere."""
    makers = {
        "Finding": ROOT / "fecore/findings.py",
        "HitFinding": ROOT / "fecore/signal/reasons.py",
    }
    for path, call in calls():
        assert makers.get(called(call), path) == path, path
        if isinstance(call.func, ast.Name) and call.func.id == "make":
            assert ast.unparse(call.args[0]) == "REMARKS", ast.unparse(call)


def test_each_row_is_used_with_the_values_that_it_names() -> None:
    for _, call in calls():
        at = {"make": 1}.get(called(call), 0)
        if called(call) not in (*MAKERS, "make") or len(call.args) <= at:
            continue
        kind = call.args[at]
        starred = any(keyword.arg is None for keyword in call.keywords)
        if isinstance(kind, ast.Constant) and kind.value in ROWS and not starred:
            row = ROWS[kind.value]
            given = {keyword.arg for keyword in call.keywords} | (
                {"which", "hz"} if called(call) == "of_mode" else set()
            )
            wanted = named(row.sentence, row.advice, row.subject)
            assert wanted <= given, f"{kind.value} lacks {wanted - given}"
    assert {*ROWS, *REASONS} - used("fecore") == set()


@pytest.mark.parametrize("kind", sorted(ROWS))
def test_a_row_is_a_sentence_that_pages_and_texts_can_go_on_from(kind: str) -> None:
    row = ROWS[kind]
    assert row.sentence
    assert not row.sentence.endswith((".", " "))
    assert not row.advice.endswith((".", " "))
    assert not row.advice[:1].isupper()
    assert named(row.subject) <= named(row.sentence) | {"campaign", "source"}


def test_each_finding_leads_to_a_page_and_to_a_heading_of_the_guide() -> None:
    page = render((ROOT / findings.PAGE).read_text(), "findings.md", {"findings.md"})
    anchors = {heading.anchor: heading.text for heading in page.sections}
    assert FINDINGS.keys() == SECTION_OF.keys()
    for kind, row in FINDINGS.items():
        name, _, anchor = section(kind).partition("#")
        assert name == "findings.html"
        assert anchors[anchor] == SECTION_OF[kind]
        assert row.link is None or row.link in PLACES


def test_the_guide_lists_each_finding() -> None:
    listed = re.findall(r"^\| `(\w+)` \|", (ROOT / findings.PAGE).read_text(), re.MULTILINE)
    assert Counter(listed) == Counter([*FINDINGS, *REMARKS, *REASONS, *LOSSES])


def test_what_a_reader_of_models_loses_comes_from_rows() -> None:
    assert LOSSES.keys() - used(READERS, but="losses.py") == set()
    for path, call in calls(READERS):
        assert path == ROOT / READERS / "model.py" or called(call) != "SkippedCard", path
        first = {"skipped_card": 0, "note": 1}.get(called(call), 1 if of_notes(call) else None)
        if first is None or not isinstance(kind := call.args[first], ast.Constant):
            continue
        row, given = LOSSES[str(kind.value)], {keyword.arg for keyword in call.keywords}
        named_card = called(call) == "note" or len(call.args) > first + 1
        assert named(row.loss, row.card) - {"card"} == given, kind.value
        assert named_card or "card" not in named(row.card), kind.value


def of_notes(call: ast.Call) -> bool:
    """Whether it adds to a `ReadReport`."""
    return isinstance(call.func, ast.Attribute) and ast.unparse(call.func).endswith("notes.add")


def test_cards_that_lose_the_same_are_noted_once_with_all_their_lines() -> None:
    report = ReadReport()
    for line in (3, 8):
        report.add(Where(line), "param")
    report.add(Where(5), "mass_off_axis", "CBAR")
    assert report.skipped == (
        skipped_card("mass_off_axis", "CBAR", [5]),
        skipped_card("param", "", [3, 8]),
    )
    assert report.skipped[0].card == "PBEAM M1, M2"


def test_an_frf_that_is_not_used_is_named_with_its_reason_and_folded_by_it() -> None:
    dead, constant = finding("dead"), finding("constant")
    unused = [not_used("3Z/1Z", dead), not_used("4Z/1Z", constant), not_used("5Z/1Z", dead)]
    assert unused[0].text == f"FRF 3Z/1Z was not used: {dead.text}"
    groups = alike(note.passed_on("measurement", 0.5) for note in unused)
    assert [[note.subject for note in group] for group in groups] == [
        ["FRF 3Z/1Z", "FRF 5Z/1Z"],
        ["FRF 4Z/1Z"],
    ]


def test_a_value_with_braces_is_not_read_as_a_name() -> None:
    rows = {"open": remark("{which} is open", "close {which}")}
    made = make(rows, "open", which="{lid}")
    assert (made.sentence, made.advice) == ("{lid} is open", "close {lid}")
    assert (made.kind, made.text) == ("open", "{lid} is open: close {lid}")
    assert made.renamed({"{lid}": "box"}).text == "box is open: close box"
