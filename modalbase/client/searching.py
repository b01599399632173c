"""`modalbase find`: rows of one noun over all projects, by a filter and by words."""

from collections.abc import Mapping
from math import floor, log10
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from modalbase.client.display import print_json, print_table
from modalbase.client.errors import ClientError, Exit
from modalbase.client.files import FIGURES, fetch_file, format_of
from modalbase.client.options import AsJson, Url, service_at

FORMATS = {".csv": "csv", ".jsonl": "jsonl", ".arrows": "arrow"}
ARCHIVE = ".zip"


Noun = Literal[
    "structures", "campaigns", "frfs", "modes", "results", "coupons", "records", "monitors"
]
"""What can be searched."""


def rate_rows(trend: Mapping[str, Any]) -> list[dict[str, Any]]:
    """A row for each series of a trend: the change a year in per cent of the mean, by time alone
    and beside the covariates.
    """
    headings = dict.fromkeys(
        _rate_heading(line) for one in trend["series"] for line in one["lines"]
    )
    return [
        {
            "structure": one["structure_name"],
            "series": one["name"],
            "campaigns": len(one["points"]),
            **dict.fromkeys(headings, "–"),
            **{_rate_heading(line): _rate(line) for line in one["lines"]},
        }
        for one in trend["series"]
    ]


def _rate_heading(line: Mapping[str, Any]) -> str:
    beside = ", ".join(name.split("_")[0] for name in line["covariates"])
    return "% a year" + (f" beside {beside}" if beside else "")


def _rate(line: Mapping[str, Any]) -> str:
    """A change a year with its interval, to the second digit of the interval's length."""
    low, high = line["relative_interval_95"]
    places = min(6, max(0, 1 - floor(log10(100 * (high - low))))) if high > low else 2
    middle, low, high = (
        f"{100 * value:+.{places}f}" for value in (line["relative_per_year"], low, high)
    )
    return f"{middle} ({low} to {high})"


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
            help="File for all rows: .csv, .jsonl, .arrows; or .zip, an archive of campaigns",
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
        _follow(noun, {"filter": condition, "q": words, "value": trend}, out, url, as_json=as_json)
        return
    query = {"filter": condition, "q": words, "sort": sort, "fields": fields}
    known = [*FORMATS, *([ARCHIVE] if noun == "campaigns" else [])]
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
        print_json(
            {
                "count": first["count"],
                "more": first["more"],
                "facets": first["facets"],
                "items": rows,
            }
        )
        return
    columns = list(rows[0]) if rows else []
    print_table("", columns, [[row[name] for name in columns] for row in rows])
    if len(rows) < first["count"]:
        typer.echo(
            f"{len(rows)} of {first['count']:,}{'+' if first['more'] else ''}; --most lists more,"
            " --out writes all"
        )


def _follow(
    noun: Noun, query: dict[str, Any], out: Path | None, url: str | None, *, as_json: bool
) -> None:
    """Show the trend of what is found, or write it to a file: its points, or the figure."""
    path = f"search/{noun}/trend"
    if noun not in ("results", "modes"):
        raise ClientError(f"{noun} have no trend; results and modes have", Exit.USAGE)
    with service_at(url) as service:
        if out is not None:
            form = format_of(out, {**FIGURES, ".csv": "csv"})
            fetch_file(
                service, path if form == "csv" else f"{path}/figure", out, format=form, **query
            )
            typer.echo(out)
            return
        trend = service.get(path, **query)
    if as_json:
        print_json(trend)
        return
    rows = rate_rows(trend)
    columns = list(dict.fromkeys(name for row in rows for name in row))
    print_table("", columns, [[row.get(name) for name in columns] for row in rows])
    for note in dict.fromkeys(
        [*trend["notes"], *(note for one in trend["series"] for note in one["notes"])]
    ):
        typer.echo(note)
