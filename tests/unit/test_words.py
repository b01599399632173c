"""Code, messages and documents use the glossary's words: the private ones of earlier versions do not come back."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.places import ROOT

PRIVATE = re.compile(
    r"\b(tell|tells|told|telling|keepers?|postman|stewards?|rungs?|climb(s|ed|ing)?|disown(s|ed)?|what of it)\b"
    r"(?!\(\))",  # `file.tell()` is Python's
    re.IGNORECASE,
)
PLACES = (
    *("fecore", "modalbase", "service", "migrations", "tests", "benchmarks", "examples"),
    *("docs", "README.md", "CHANGELOG.md", "SECURITY.md"),
)
KINDS = (".py", ".md")


def files(place: str) -> Iterator[Path]:
    top = ROOT / place
    for path in [top] if top.is_file() else sorted(top.rglob("*")):
        if path.suffix in KINDS and path != Path(__file__):
            yield path


@pytest.mark.parametrize("place", PLACES)
def test_the_words_are_the_glossarys(place: str) -> None:
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in files(place)
        for number, line in enumerate(path.read_text().splitlines(), start=1)
        if PRIVATE.search(line)
    ]
    assert not found, "\n".join(found)
