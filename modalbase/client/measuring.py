"""`modalbase points`, `import`, `hits`, `frfs` and `modes`: from a campaign's files to its
modes.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from modalbase.client.display import Written, print_json, print_table
from modalbase.client.errors import ClientError, Exit
from modalbase.client.files import send_file
from modalbase.client.finding import CAMPAIGN, MODE_SET, find, find_id
from modalbase.client.jobs import require_success, wait_for
from modalbase.client.options import (
    NAMED,
    AsJson,
    Campaign,
    Url,
    json_file,
    names_of,
    say_next,
    service_at,
    show,
)
from modalbase.client.results import beside_lines, mode_set_cells
from modalbase.formats.registry import FORMATS, either, titles

if TYPE_CHECKING:
    from modalbase.client.connection import Connection


AXES = ("x", "y", "z")
TIME_BLOCKS = [row for row in FORMATS.values() if row.looked_at and "hits" in row.takes]
HEADER = "label,x_mm,y_mm,z_mm, or with _m for metres; z may be left out"


def points(
    campaign: Campaign,
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
    with service_at(url) as service:
        path = f"campaigns/{find_id(service, CAMPAIGN, campaign)}/grid-points"
        there = service.request("GET", path)
        table = there.json()
        if stated is not None:
            replaced = {"If-Match": there.headers["etag"]}  # by whoever looked last
            table = service.call("PUT", path, json={"items": stated}, headers=replaced)
    if as_json:
        print_json(table)
        return
    rows = [
        [p["label"], *(Written(f"{1000 * p[f'{axis}_m']:.6g}") for axis in AXES)]
        for p in table["items"]
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
    campaign: Annotated[
        str,
        typer.Option(
            "--campaign", "-c", help=f"Campaign: {NAMED}", autocompletion=names_of(CAMPAIGN)
        ),
    ] = "latest",
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only report what the files hold")
    ] = False,
    quantity: Annotated[
        Literal["accelerance", "mobility", "receptance"] | None,
        typer.Option(help="What FRFs are whose file does not say"),
    ] = None,
    kind: Annotated[
        Literal["hits", "frfs"] | None,
        typer.Option(help=f"What an {titles(either())} holds; by default as its arrays say"),
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
    with service_at(url) as service:
        id_ = find_id(service, CAMPAIGN, campaign)
        done = [_import(service, id_, file, wait, dry_run=dry_run, **stated) for file in files]
    if as_json:
        print_json(done)
    else:
        names = ("frfs", "grid_points", "modes", "records")
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
    service: Connection, campaign: str, file: Path, wait: bool = True, **stated: Any
) -> dict[str, Any]:
    """The import of a file that is sent to a campaign, read where that is waited for."""
    job = send_file(service, f"campaigns/{campaign}/imports", file, **stated)
    if job["already_imported"]:
        typer.echo(
            f"{file.name}: the campaign has this file already; it is not read again", err=True
        )
    return wait_for(service, f"imports/{job['id']}", file.name) if wait else job


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
    campaign: Campaign,
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
    with service_at(url) as service:
        filters = {
            "point": point,
            "direction": direction,
            "reference": reference,
            "quantity": quantity,
        }
        listed = list(
            service.pages(
                f"campaigns/{find_id(service, CAMPAIGN, campaign)}/frfs", limit, **filters
            )
        )
    columns = (
        "id",
        "label",
        "response",
        "reference",
        "quantity",
        "lines",
        "start_hz",
        "end_hz",
        "averages",
    )
    rows = [
        [
            f["id"], f["label"], _dof(f, "response"), _dof(f, "reference"), f["quantity"],
            f["lines"], f["start_hz"], f["end_hz"], f["averages"],
        ]
        for f in listed
    ]  # fmt: skip
    show(listed, columns, as_json, rows, f"{len(listed)} FRFs")


def _dof(frf: dict[str, Any], side: str) -> str:
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
    campaign: Annotated[
        str,
        typer.Option(
            "--campaign", "-c", help=f"Campaign: {NAMED}", autocompletion=names_of(CAMPAIGN)
        ),
    ] = "latest",
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
    with service_at(url) as service:
        path = f"campaigns/{(id_ := find_id(service, CAMPAIGN, campaign))}"
        for file in files:
            sent = _import(service, id_, file, dry_run=stated is None, kind="hits", mapping=stated)
            require_success(sent, file.name)
            if stated is None:
                print_json(sent["found"])
                raise ClientError(
                    "nothing is stored: save `mapping` of this, corrected, and state it with"
                    " --mapping",
                    Exit.USAGE,
                )
            judged += service.get(f"imports/{sent['id']}/records")["hits"]
        placed = bool(service.get(f"{path}/grid-points")["items"])
        if process:
            options = {} if false_discovery is None else {"false_discovery": false_discovery}
            made = service.post(f"{path}/processings", options)
            job = wait_for(service, f"processings/{made['id']}", "processing")
            require_success(job, "processing")
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
    campaign: Campaign = "latest",
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
    decided = _decided(keep or [], drop or [], why)
    with service_at(url) as service:
        id_ = find_id(service, CAMPAIGN, campaign)
        document = (
            _identified(service, id_, band, threshold)
            if identify
            else find(service, MODE_SET, mode_set, within=id_)
        )
        if decided:
            document = _edited(service, document, decided)
    if as_json:
        print_json(document)
        return
    print_table(
        f"{document['name']} ({document['origin']}), {document['id']}",
        *mode_set_cells(document["modes"]),
    )
    for line in beside_lines(document["details"]):
        typer.echo(line, err=True)
    say_next(f'update "{campaign}" --mode-set {document["id"]} --wait')


def _decided(keep: list[float], drop: list[float], why: str | None) -> list[dict[str, Any]]:
    """What is decided of poles, as the service takes it; asked before anything is computed."""
    poles = [*((hz, True) for hz in keep), *((hz, False) for hz in drop)]
    if poles and why is None:
        raise ClientError("--keep and --drop need a reason: --why TEXT", Exit.USAGE)
    return [{"frequency_hz": hz, "keep": kept, "reason": why} for hz, kept in poles]


def _edited(
    service: Connection, document: dict[str, Any], decisions: list[dict[str, Any]]
) -> dict[str, Any]:
    body = {"name": f"{document['name']}, edited", "decisions": decisions}
    return service.post(f"mode-sets/{document['id']}/edits", body)


def _identified(
    service: Connection, campaign: str, band: str | None, threshold: float | None
) -> dict[str, Any]:
    options: dict[str, Any] = {} if band is None else {"band_hz": _band(band)}
    if threshold is not None:
        options["threshold"] = threshold
    job = service.post(f"campaigns/{campaign}/identifications", options)
    ended = wait_for(service, f"identifications/{job['id']}", "identification")
    require_success(ended, f"identification {job['id']}")
    return service.get(f"mode-sets/{ended['mode_set']}")


def _band(text: str) -> list[float]:
    try:
        low, high = (float(part) for part in text.split("-"))
    except ValueError:
        raise ClientError(f"--band {text!r} is no band in Hz, such as 10-900", Exit.USAGE) from None
    return [low, high]
