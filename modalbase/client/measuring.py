"""`modalbase import` and `frfs`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from modalbase.client.errors import ClientError, Exit
from modalbase.client.options import NAMED, AsJson, Campaign, Url, names_of, say_next, service_at


class Quantity(StrEnum):
    """What an FRF is."""

    accelerance = "accelerance"
    mobility = "mobility"
    receptance = "receptance"


def import_files(
    files: Annotated[list[Path], typer.Argument(help="Universal File Format files", exists=True, dir_okay=False)],
    campaign: Annotated[
        str, typer.Option("--campaign", "-c", help=f"Campaign: {NAMED}", autocompletion=names_of("CAMPAIGN"))
    ] = "latest",
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only report what the files hold")] = False,
    quantity: Annotated[Quantity | None, typer.Option(help="What FRFs are whose file does not say")] = None,
    wait: Annotated[bool, typer.Option("--wait/--no-wait", help="Wait for the end of the reading")] = True,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Send UFF files to a campaign. Exit 4 where one of them could not be read."""
    from modalbase.client.display import print_json, print_table, transfer
    from modalbase.client.finding import CAMPAIGN, find_id
    from modalbase.client.jobs import wait_for

    done: list[dict[str, Any]] = []
    with service_at(url) as service:
        id_ = find_id(service, CAMPAIGN, campaign)
        for file in files:
            with transfer(file.name) as watch:
                job = service.upload(
                    f"campaigns/{id_}/imports", file, watch,
                    filename=file.name, dry_run=str(dry_run).lower(), quantity=quantity,
                )  # fmt: skip
            if job["already_imported"]:
                typer.echo(f"{file.name}: the campaign has this file already; it is not read again", err=True)
            done.append(wait_for(service, f"imports/{job['id']}", file.name) if wait else job)
    if as_json:
        print_json(done)
    else:
        names = ("frfs", "grid_points", "modes")
        rows = [[d["id"], d["filename"], d["status"], *((d["counts"] or {}).get(n) for n in names)] for d in done]
        print_table("", ("id", "file", "status", *names), rows)
        for one in done:
            _print_report(one)
        if not dry_run and any(one["status"] == "succeeded" for one in done):
            say_next(f'update "{campaign}" --wait', f'modes "{campaign}" --identify')
    failed = [d["filename"] for d in done if d["status"] in ("failed", "cancelled")]
    if failed:
        raise ClientError(f"{len(failed)} of {len(done)} imports did not succeed: {', '.join(failed)}", Exit.FAILED)


def _print_report(job: dict[str, Any]) -> None:
    """Warnings of an import, its error, and what was refused."""
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
