"""`modalbase import` and `frfs`."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from modalbase.client.connection import Connection
from modalbase.client.errors import ClientError, Exit
from modalbase.client.options import NAMED, AsJson, Campaign, Url, json_file, names_of, say_next, service_at


class Quantity(StrEnum):
    """What an FRF is."""

    accelerance = "accelerance"
    mobility = "mobility"
    receptance = "receptance"


class Kind(StrEnum):
    """What the arrays of a file are."""

    hits = "hits"
    frfs = "frfs"


def import_files(
    files: Annotated[list[Path], typer.Argument(help="UFF, npz, .mat, CSV, wav", exists=True, dir_okay=False)],
    campaign: Annotated[
        str, typer.Option("--campaign", "-c", help=f"Campaign: {NAMED}", autocompletion=names_of("CAMPAIGN"))
    ] = "latest",
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only report what the files hold")] = False,
    quantity: Annotated[Quantity | None, typer.Option(help="What FRFs are whose file does not say")] = None,
    kind: Annotated[
        Kind | None, typer.Option(help="What an npz, .mat or CSV holds; by default as its arrays say")
    ] = None,
    mapping: Annotated[
        Path | None, typer.Option(help="JSON that says which variable is what; --dry-run proposes one", exists=True)
    ] = None,
    wait: Annotated[bool, typer.Option("--wait/--no-wait", help="Wait for the end of the reading")] = True,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Send files to a campaign. Exit 4 where one of them could not be read."""
    from modalbase.client.display import print_json, print_table
    from modalbase.client.finding import CAMPAIGN, find_id

    stated = {"quantity": quantity, "kind": kind, "mapping": None if mapping is None else json_file(mapping)}
    with service_at(url) as service:
        id_ = find_id(service, CAMPAIGN, campaign)
        done = [send_file(service, id_, file, wait=wait, dry_run=dry_run, **stated) for file in files]
    if as_json:
        print_json(done)
    else:
        names = ("frfs", "grid_points", "modes", "records")
        rows = [[d["id"], d["filename"], d["status"], *((d["counts"] or {}).get(n) for n in names)] for d in done]
        print_table("", ("id", "file", "status", *names), rows)
        for one in done:
            _print_report(one)
        if not dry_run and any(one["status"] == "succeeded" for one in done):
            say_next(f'update "{campaign}" --wait', f'modes "{campaign}" --identify')
    failed = [d["filename"] for d in done if d["status"] in ("failed", "cancelled")]
    if failed:
        raise ClientError(f"{len(failed)} of {len(done)} imports did not succeed: {', '.join(failed)}", Exit.FAILED)


def send_file(
    service: Connection, campaign: str, file: Path, *, wait: bool = True, dry_run: bool = False, **stated: Any
) -> dict[str, Any]:
    """Send a file to a campaign and give its import, read where that is waited for.

    Args:
        service: the connection.
        campaign: its id.
        file: of any format.
        wait: for the end of the reading.
        dry_run: only look at it.
        stated: `quantity`, `kind`, `mapping`.
    """
    from modalbase.client.display import transfer
    from modalbase.client.jobs import wait_for

    if stated.get("mapping") is not None:
        stated["mapping"] = json.dumps(stated["mapping"])
    with transfer(file.name) as watch:
        path = f"campaigns/{campaign}/imports"
        job: dict[str, Any] = service.upload(
            path, file, watch, filename=file.name, dry_run=str(dry_run).lower(), **stated
        )
    if job["already_imported"]:
        typer.echo(f"{file.name}: the campaign has this file already; it is not read again", err=True)
    return wait_for(service, f"imports/{job['id']}", file.name) if wait else job


def _print_report(job: dict[str, Any]) -> None:
    """What a trial found in an import's file, its warnings, its error, and what was refused."""
    if job["dry_run"] and job["found"]:
        typer.echo(json.dumps({"file": job["filename"], **job["found"]}, indent=1, ensure_ascii=False))
    if job["error"]:
        typer.echo(f"{job['filename']}: {job['error'].get('detail')}", err=True)
    for warning in job["warnings"]:
        typer.echo(f"{job['filename']}: {warning}", err=True)
    for one in job["datasets"]:
        if one["outcome"] == "refused":
            typer.echo(f"{job['filename']}: dataset {one['number']} (type {one['type']}): {one['reason']}", err=True)


def frfs(
    campaign: Campaign,
    point: Annotated[int | None, typer.Option(help="Response point")] = None,
    direction: Annotated[int | None, typer.Option(help="Signed response direction")] = None,
    reference: Annotated[int | None, typer.Option(help="Reference point")] = None,
    quantity: Annotated[Quantity | None, typer.Option()] = None,
    limit: Annotated[int | None, typer.Option(min=1, help="List no more than these")] = None,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """List the FRFs of a campaign; `modalbase export` fetches their values."""
    from modalbase.client.display import print_json, print_table
    from modalbase.client.finding import CAMPAIGN, find_id

    with service_at(url) as service:
        wanted = {"point": point, "direction": direction, "reference": reference, "quantity": quantity}
        found = list(service.pages(f"campaigns/{find_id(service, CAMPAIGN, campaign)}/frfs", limit, **wanted))
    if as_json:
        print_json(found)
        return
    columns = ("id", "label", "response", "reference", "quantity", "lines", "start_hz", "end_hz", "averages")
    rows = [
        [
            f["id"], f["label"], _dof(f, "response"), _dof(f, "reference"), f["quantity"],
            f["lines"], f["start_hz"], f["end_hz"], f["averages"],
        ]
        for f in found
    ]  # fmt: skip
    print_table(f"{len(found)} FRFs", columns, rows)


def _dof(frf: dict[str, Any], side: str) -> str:
    direction = frf[f"{side}_direction"]
    axis = "?" if direction == 0 else ("X", "Y", "Z", "RX", "RY", "RZ")[abs(direction) - 1]
    return f"{frf[f'{side}_point']}{'-' if direction < 0 else '+'}{axis}"
