"""`modalbase points`, `import`, `hits`, `frfs` and `modes`: from a campaign's files to its
modes.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from modalbase import objects
from modalbase.client.display import Written, print_json, print_table
from modalbase.client.errors import ClientError, Exit
from modalbase.client.results import beside_lines
from modalbase.commands.options import (
    AsJson,
    OfCampaign,
    ToCampaign,
    Url,
    json_file,
    laboratory_at,
    say_next,
    show,
)
from modalbase.formats.registry import FORMATS, either, titles

AXES = ("x", "y", "z")
TIME_BLOCKS = [row for row in FORMATS.values() if row.looked_at and "hits" in row.takes]
HEADER = "label,x_mm,y_mm,z_mm, or with _m for metres; z may be left out"


def points(
    campaign: OfCampaign,
    file: Annotated[
        Path | None,
        typer.Argument(
            help=f"CSV of the points, in place of those there: {HEADER}",
            exists=True,
            dir_okay=False,
        ),
    ] = None,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Show the grid points of a campaign; state them from a CSV file, where no UFF file does."""
    stated = None if file is None else read_points(file)
    with laboratory_at(url) as lab:
        there = lab.named(objects.Campaign, campaign)
        table = there.grid_points() if stated is None else there.set_grid_points(stated)
    if as_json:
        print_json({"items": table.rows})
        return
    rows = [
        [p["label"], *(Written(f"{1000 * p[f'{axis}_m']:.6g}") for axis in AXES)] for p in table
    ]
    print_table(f"{len(rows)} grid points", ("label", "x mm", "y mm", "z mm"), rows)
    if not rows:
        say_next(f'points "{campaign}" POINTS.csv')


def read_points(file: Path) -> list[dict[str, Any]]:
    """Grid points of a CSV file, in metres as REST has them.

    Raises:
        ClientError: the file is no such table; names the line.
    """
    from modalbase.formats.errors import FormatError
    from modalbase.formats.points import read_points as rows_of
    from modalbase.formats.tables import real, whole

    try:
        return [
            {
                name: (
                    whole(cell, f"line {line}, label")
                    if name == "label"
                    else real(cell, f"line {line}, {name[0]}")
                )
                for name, cell in point.items()
            }
            for line, point in rows_of(file)
        ]
    except OSError as error:
        raise ClientError(f"{file} cannot be read: {error}", Exit.USAGE) from None
    except FormatError as error:
        raise ClientError(f"{file}, {error}", Exit.USAGE) from None


def import_files(
    files: Annotated[
        list[Path],
        typer.Argument(help=titles(last=""), exists=True, dir_okay=False),
    ],
    campaign: ToCampaign = "latest",
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only report what the files hold")
    ] = False,
    quantity: Annotated[
        Literal["accelerance", "mobility", "receptance"] | None,
        typer.Option(help="What FRFs are whose file does not say"),
    ] = None,
    kind: Annotated[
        Literal["hits", "frfs", "responses", "loads"] | None,
        typer.Option(
            help=f"What an {titles(either())} holds, by default as its arrays say; `responses` where"
            " no load was measured, `loads` where all were throughout"
        ),
    ] = None,
    mapping: Annotated[
        Path | None,
        typer.Option(
            help="JSON that says which variable is what; --dry-run proposes one", exists=True
        ),
    ] = None,
    wait: Annotated[
        bool, typer.Option("--wait/--no-wait", help="Wait for the end of the reading")
    ] = True,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Send files to a campaign. Exit 4 where one of them could not be read."""
    stated = {
        "quantity": quantity,
        "kind": kind,
        "mapping": None if mapping is None else json_file(mapping),
    }
    with laboratory_at(url) as lab:
        into = lab.named(objects.Campaign, campaign)
        done = [_import(into, file, wait, dry_run=dry_run, **stated).fields for file in files]
    if as_json:
        print_json(done)
    else:
        names = ("frfs", "grid_points", "modes", "records", "recordings")
        rows = [
            [d["id"], d["filename"], d["status"], *((d["counts"] or {}).get(n) for n in names)]
            for d in done
        ]
        print_table("", ("id", "file", "status", *names), rows)
        for one in done:
            _print_report(one)
        if not dry_run and any(one["status"] == "succeeded" for one in done):
            say_next(f'update "{campaign}" --wait', f'modes "{campaign}" --identify')
    failed = [d["filename"] for d in done if d["status"] in ("failed", "cancelled")]
    if failed:
        raise ClientError(
            f"{len(failed)} of {len(done)} imports did not succeed: {', '.join(failed)}",
            Exit.FAILED,
        )


def _import(
    campaign: objects.Campaign, file: Path, wait: bool = True, **stated: Any
) -> objects.Import:
    """The import of a file that is sent to a campaign, read where that is waited for."""
    job = campaign.import_file(file, wait=False, **stated)
    if job.already_imported:
        typer.echo(
            f"{file.name}: the campaign has this file already; it is not read again", err=True
        )
    return job.wait() if wait else job


def _print_report(job: dict[str, Any]) -> None:
    """What a trial found in an import's file, its warnings, its error, and what was refused."""
    if job["dry_run"] and job["found"]:
        typer.echo(
            json.dumps({"file": job["filename"], **job["found"]}, indent=1, ensure_ascii=False)
        )
    if job["error"]:
        typer.echo(f"{job['filename']}: {job['error'].get('detail')}", err=True)
    for warning in job["warnings"]:
        typer.echo(f"{job['filename']}: {warning}", err=True)
    for one in job["datasets"]:
        if one["outcome"] == "refused":
            typer.echo(
                f"{job['filename']}: dataset {one['number']} (type {one['type']}): {one['reason']}",
                err=True,
            )


def frfs(
    campaign: OfCampaign,
    point: Annotated[int | None, typer.Option(help="Response point")] = None,
    direction: Annotated[int | None, typer.Option(help="Signed response direction")] = None,
    reference: Annotated[int | None, typer.Option(help="Reference point")] = None,
    quantity: Annotated[
        Literal["accelerance", "mobility", "receptance"] | None, typer.Option()
    ] = None,
    limit: Annotated[int | None, typer.Option(min=1, help="List no more than these")] = None,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """List the FRFs of a campaign; `modalbase export` fetches their values."""
    chosen = {"point": point, "direction": direction, "reference": reference, "quantity": quantity}
    with laboratory_at(url) as lab:
        listed = lab.named(objects.Campaign, campaign).list_frfs(limit, **chosen).rows
    columns = [
        "id",
        "label",
        "response",
        "reference",
        "quantity",
        "lines",
        "start_hz",
        "end_hz",
        "averages",
    ]
    places = [{side: _dof(frf, side) for side in ("response", "reference")} for frf in listed]
    rows = [
        [{**frf, **place}[name] for name in columns]
        for frf, place in zip(listed, places, strict=True)
    ]
    show(listed, columns, as_json, rows, f"{len(listed)} FRFs")


def _dof(frf: Mapping[str, Any], side: str) -> str:
    direction = frf[f"{side}_direction"]
    axis = "?" if direction == 0 else ("X", "Y", "Z", "RX", "RY", "RZ")[abs(direction) - 1]
    return f"{frf[f'{side}_point']}{'-' if direction < 0 else '+'}{axis}"


def hits(
    files: Annotated[
        list[Path],
        typer.Argument(
            help=f"Time blocks: {titles(TIME_BLOCKS, last='')}", exists=True, dir_okay=False
        ),
    ],
    campaign: ToCampaign = "latest",
    mapping: Annotated[
        Path | None,
        typer.Option(
            help="JSON that says which variable is what; without it one is proposed", exists=True
        ),
    ] = None,
    process: Annotated[
        bool, typer.Option("--process", help="Make FRFs of the good hits then")
    ] = False,
    false_discovery: Annotated[
        float | None,
        typer.Option(help="With --process: refuse hits whose probability of being good is below"),
    ] = None,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Send time blocks of hits, see how each hit is judged, and make FRFs of the good ones."""
    stated = None if mapping is None else json_file(mapping)
    judged: list[dict[str, Any]] = []
    with laboratory_at(url) as lab:
        into = lab.named(objects.Campaign, campaign)
        for file in files:
            sent = _import(into, file, dry_run=stated is None, kind="hits", mapping=stated)
            sent.check(file.name)
            if stated is None:
                print_json(sent.fields["found"])
                raise ClientError(
                    "nothing is stored: save `mapping` of this, corrected, and state it with"
                    " --mapping",
                    Exit.USAGE,
                )
            judged += sent.records()["hits"]
        placed = bool(into.grid_points())
        if process:
            options = {} if false_discovery is None else {"false_discovery": false_discovery}
            into.process(wait=False, **options).wait().check("processing")
    if as_json:
        print_json(judged)
        return
    rows = [[hit["point"], hit["hit"], hit["accepted"], _failures(hit)] for hit in judged]
    print_table("", ("point", "hit", "good", "why not"), rows)
    if not placed:  # shapes have no place on the body without them
        say_next(f'points "{campaign}" POINTS.csv')
    say_next(
        f'modes "{campaign}" --identify'
        if process
        else f'hits FILE --campaign "{campaign}" --process'
    )


def _failures(hit: dict[str, Any]) -> str | None:
    """What failed of a hit."""
    return (
        "; ".join(finding["sentence"] for finding in hit["findings"] if finding["failed"]) or None
    )


def modes(
    campaign: OfCampaign = "latest",
    identify: Annotated[
        bool, typer.Option("--identify", help="Find modes in the FRFs first, and wait for them")
    ] = False,
    band: Annotated[str | None, typer.Option(help="With --identify: Hz, such as 10-900")] = None,
    threshold: Annotated[
        float | None, typer.Option(help="With --identify: probability from which a pole is a mode")
    ] = None,
    mode_set: Annotated[str, typer.Option(help="Which modes: id, name or latest")] = "latest",
    keep: Annotated[
        list[float] | None, typer.Option(help="Hz of an uncertain or refused pole to keep")
    ] = None,
    drop: Annotated[list[float] | None, typer.Option(help="Hz of a mode to drop")] = None,
    why: Annotated[
        str | None,
        typer.Option(help="With --keep and --drop: the reason, which the new set records"),
    ] = None,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Show the modes of a campaign: typed in, read from a file, or identified; with what the
    identification doubts.

    --keep and --drop make a new mode set; the old one stays as it is.
    """
    if (keep or drop) and why is None:
        raise ClientError("--keep and --drop need a reason: --why TEXT", Exit.USAGE)
    kept, dropped = (dict.fromkeys(poles or (), str(why)) for poles in (keep, drop))
    with laboratory_at(url) as lab:
        of = lab.named(objects.Campaign, campaign)
        if identify:
            options: dict[str, Any] = {} if band is None else {"band_hz": _band(band)}
            shown = of.identify(
                **options, **({} if threshold is None else {"threshold": threshold})
            )
        else:
            shown = of.mode_set(mode_set)
        if keep or drop:
            shown = shown.edit(keep=kept, drop=dropped, name=f"{shown.name}, edited")
    if as_json:
        print_json(shown.fields)
        return
    print_table(f"{shown.name} ({shown.origin}), {shown.id}", *shown.modes.cells())
    for line in beside_lines(shown.details):
        typer.echo(line, err=True)
    say_next(f'update "{campaign}" --mode-set {shown.id} --wait')


def _band(text: str) -> list[float]:
    try:
        low, high = (float(part) for part in text.split("-"))
    except ValueError:
        raise ClientError(f"--band {text!r} is no band in Hz, such as 10-900", Exit.USAGE) from None
    return [low, high]
