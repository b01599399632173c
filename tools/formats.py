"""The guide's table of formats, made from `modalbase/formats/registry.py`."""

import re
from collections.abc import Iterable
from pathlib import Path

from modalbase.formats.registry import ALL, Format

ROOT = Path(__file__).resolve().parent.parent
PAGE = "docs/database.md"
BLOCK = re.compile(
    r"(<!-- formats: made by python -m tools.reference -->\n).*?(<!-- end -->)", re.DOTALL
)


def page() -> str:
    """`docs/database.md` with the table as the formats are now."""
    head = [
        "format",
        "suffixes",
        "stated with FRFs",
        "stated with hits",
        "stated with responses, with loads",
        "FRFs written as",
        "needs",
    ]
    rows = [head, ["---"] * len(head), *map(_row, ALL)]
    table = "".join(f"| {' | '.join(cells)} |\n" for cells in rows)
    return BLOCK.sub(lambda found: found[1] + table + found[2], (ROOT / PAGE).read_text())


def _row(row: Format) -> list[str]:
    return [
        f"{row.title}: {row.about}",
        _code(row.every_suffix),
        *(
            "–" if kind not in row.takes else _code(row.takes[kind]) or "nothing"
            for kind in ("frfs", "hits", "responses")
        ),
        _code(writer.name for writer in row.writers),
        ", ".join(
            f"`modalbase[{need.extra}]`" + (f" ({need.file})" if need.file else "")
            for need in row.needs
        ),
    ]


def _code(words: Iterable[str]) -> str:
    return " ".join(f"`{word}`" for word in words)
