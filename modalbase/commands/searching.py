"""`modalbase find`: rows of one noun over all projects, by a filter and by words."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from modalbase.client.display import print_json, print_table
from modalbase.client.errors import ClientError, Exit
from modalbase.commands.options import AsJson, Url, laboratory_at
from modalbase.objects.files import ROWS, TRENDS, format_of

ARCHIVE = ".zip"


Noun = Literal[
    "structures", "campaigns", "frfs", "modes", "results", "coupons", "records", "monitors"
]
"""What can be searched."""


def search(
    noun: Annotated[Noun, typer.Argument(help="Kind of the rows")],
    condition: Annotated[
        str | None,
        typer.Argument(metavar="[FILTER]", help='CQL2 text, such as "campaign.temperature_c > 25"'),
    ] = None,
    words: Annotated[
        str | None, typer.Option("--words", "-q", help="Words in names, notes and instruments")
    ] = None,
    sort: Annotated[str | None, typer.Option(help="A field; - in front for descending")] = None,
    fields: Annotated[str | None, typer.Option(help="Columns, with commas between")] = None,
    most: Annotated[int, typer.Option(min=1, help="Rows that are listed")] = 20,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            help="File for all rows: .csv, .jsonl, .arrows, .parquet; or .zip, an archive of campaigns",
        ),
    ] = None,
    trend: Annotated[
        str | None,
        typer.Option(
            help=(
                "Over time: a constant of results, or frequency_hz, damping_ratio; --out takes"
                " .csv, .svg, .pdf"
            )
        ),
    ] = None,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Find things over all your projects by a filter, such as results of pultruded bars with Ex
    below 30 GPa.
    """
    if trend is not None:
        _follow(noun, condition, words, trend, out, url, as_json=as_json)
        return
    known = [*ROWS, *([ARCHIVE] if noun == "campaigns" else [])]
    if out is not None and out.suffix not in known:
        raise ClientError(f"{out.name} ends in none of {', '.join(known)}", Exit.USAGE)
    with laboratory_at(url) as lab:
        matching = lab.find(
            noun, condition, words=words, sort=sort, fields=(fields or "").split(",")
        )
        if out is not None:
            typer.echo(matching.archive(out) if out.suffix == ARCHIVE else matching.save(out))
            return
        count, more, facets = matching.count, matching.more, matching.facets
        rows = matching.head(most).rows
    if as_json:
        print_json({"count": count, "more": more, "facets": facets, "items": rows})
        return
    columns = list(rows[0]) if rows else []
    print_table("", columns, [[row[name] for name in columns] for row in rows])
    if len(rows) < count:
        typer.echo(
            f"{len(rows)} of {count:,}{'+' if more else ''}; --most lists more, --out writes all"
        )


def _follow(
    noun: Noun,
    condition: str | None,
    words: str | None,
    value: str,
    out: Path | None,
    url: str | None,
    *,
    as_json: bool,
) -> None:
    """Show the trend of what is found, or write it to a file: its points, or the figure."""
    if noun not in ("results", "modes"):
        raise ClientError(f"{noun} have no trend; results and modes have", Exit.USAGE)
    if out is not None:
        format_of(out, TRENDS)
    with laboratory_at(url) as lab:
        trend = lab.find(noun, condition, words=words).trend(value)
        if out is not None:
            typer.echo(trend.save(out))
            return
    if as_json:
        print_json(trend.fields)
        return
    print_table("", *trend.table().cells())
    for note in trend.notes:
        typer.echo(note)
