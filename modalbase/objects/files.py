"""Files to the service and from it, with a bar while they travel; and the formats that their names
say.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modalbase.client.display import transfer
from modalbase.client.errors import ClientError, Exit

if TYPE_CHECKING:
    from modalbase.client.connection import Connection

MESH_FORMATS = {".vtu": "vtu", ".uff": "uff", ".unv": "uff", ".json": "json"}
"""Formats of a mesh and its shapes, by the end of a file's name."""

FIGURES = {".svg": "svg", ".png": "png", ".pdf": "pdf", ".json": "plotly"}
REPORTS = {".html": "html", ".htm": "html", ".pdf": "pdf"}
ROWS = {".csv": "csv", ".jsonl": "jsonl", ".arrows": "arrow", ".parquet": "parquet"}
"""Formats of a file of rows, by the end of its name."""
TRENDS = {**FIGURES, ".csv": "csv", ".parquet": "parquet"}
"""Formats of a trend's figure and of its points, by the end of a file's name."""
_LONG = 10_000  # characters of a mapping that an address still has room for, escaped
SOLVERS = {
    ".inp": "calculix",
    ".bdf": "nastran",
    ".dat": "nastran",
    ".nas": "nastran",
    ".fem": "nastran",
}
"""The program whose deck a file's name says."""


def format_of(file: Path, formats: Mapping[str, str], advice: str = "") -> str:
    """The format that a file's name says.

    Args:
        file: to be written.
        formats: those that there are, by the name's end.
        advice: begins the error.

    Raises:
        ClientError: it says none.
    """
    if (form := formats.get(file.suffix.lower())) is None:
        raise ClientError(
            f"{advice}{file.name!r} does not end in one of {', '.join(formats)}", Exit.USAGE
        )
    return form


def send_file(
    service: Connection,
    path: str,
    file: Path,
    *,
    mapping: Mapping[str, Any] | None = None,
    sections: Mapping[str, Any] | None = None,
    campaign: Mapping[str, Any] | None = None,
    **query: Any,
) -> dict[str, Any]:
    """Send a file, with a mapping that says which variable is what, sections of a mesh, or the
    campaign that it makes; returns the JSON that answers it.

    What an address may have no room for, sections or the order of many points, goes in a form.
    """
    texts = {"mapping": mapping, "campaign": campaign}
    query |= {name: json.dumps(text) for name, text in texts.items() if text is not None}
    form = {"sections": json.dumps(sections)} if sections is not None else {}
    if sum(len(query.get(name, "")) for name in texts) > _LONG:
        form |= {name: query.pop(name) for name in texts if name in query}
    if form:
        return service.submit(path, file, form, **query)
    with transfer(file.name) as watch:
        return service.upload(path, file, watch, filename=file.name, **query)


def save_file(
    service: Connection,
    path: str,
    file: str | Path,
    formats: Mapping[str, str] | None = None,
    advice: str = "",
    **query: Any,
) -> Path:
    """Write what is at a path to a file, whole or not at all, in the format that its name says
    where there are several; returns its path. `-` is standard output.

    Raises:
        ClientError: the name says no format, or the service refuses.
    """
    target = Path(file)
    if formats is not None and query.get("format") is None:
        query["format"] = format_of(target, formats, advice)
    with transfer(target.name) as watch:
        service.download(path, None if str(file) == "-" else target, watch, **query)
    return target
