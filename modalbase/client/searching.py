"""`modalbase find`: rows of one noun over all projects, by a filter and by words."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from modalbase.client.display import print_json, print_table
from modalbase.client.errors import ClientError, Exit
from modalbase.client.files import fetch_file
from modalbase.client.options import AsJson, Url, service_at

FORMATS = {".csv": "csv", ".jsonl": "jsonl", ".arrows": "arrow"}
ARCHIVE = ".zip"


class Noun(StrEnum):
    """What can be searched."""

    structures = "structures"
    campaigns = "campaigns"
    frfs = "frfs"
    modes = "modes"
    results = "results"
    coupons = "coupons"
    records = "records"
    monitors = "monitors"


def search(
    noun: Annotated[Noun, typer.Argument(help="Kind of the rows")],
    condition: Annotated[
        str | None, typer.Argument(metavar="[FILTER]", help='CQL2 text, such as "campaign.temperature_c > 25"')
    ] = None,
    words: Annotated[str | None, typer.Option("--words", "-q", help="Words in names, notes and instruments")] = None,
    sort: Annotated[str | None, typer.Option(help="A field; - in front for descending")] = None,
    fields: Annotated[str | None, typer.Option(help="Columns, with commas between")] = None,
    most: Annotated[int, typer.Option(min=1, help="Rows that are listed")] = 20,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="File for all rows: .csv, .jsonl, .arrows; or .zip, an archive of campaigns"),
    ] = None,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Find things over all your projects by a filter, such as results of pultruded bars with Ex below 30 GPa."""
    query = {"filter": condition, "q": words, "sort": sort, "fields": fields}
    known = [*FORMATS, *([ARCHIVE] if noun == Noun.campaigns else [])]
    if out is not None and out.suffix not in known:
        raise ClientError(f"{out.name} ends in none of {', '.join(known)}", Exit.USAGE)
    with service_at(url) as service:
        if out is not None:
            if out.suffix == ARCHIVE:
                fetch_file(service, f"search/{noun}/archive", out, filter=condition, q=words)
            else:
                fetch_file(service, f"search/{noun}", out, format=FORMATS[out.suffix], **query)
            typer.echo(out)
            return
        first = service.get(f"search/{noun}", limit=1, **query)
        rows = list(service.pages(f"search/{noun}", most, **query))
    if as_json:
        print_json({"count": first["count"], "more": first["more"], "facets": first["facets"], "items": rows})
        return
    columns = list(rows[0]) if rows else []
    print_table("", columns, [[row[name] for name in columns] for row in rows])
    if len(rows) < first["count"]:
        typer.echo(
            f"{len(rows)} of {first['count']:,}{'+' if first['more'] else ''}; --most lists more, --out writes all"
        )
