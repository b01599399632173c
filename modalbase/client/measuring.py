"""`modalbase import`, `structures`, `campaigns` and `frfs`."""

from __future__ import annotations

from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from modalbase.client.errors import ClientError, Exit
from modalbase.client.options import HERE, AsJson, Campaign, Url, an_id

if TYPE_CHECKING:
    from modalbase.client.connection import Connection


class Quantity(StrEnum):
    """What an FRF is."""

    accelerance = "accelerance"
    mobility = "mobility"
    receptance = "receptance"


def import_files(
    files: Annotated[list[Path], typer.Argument(help="Universal File Format files", exists=True, dir_okay=False)],
    campaign: Annotated[str, typer.Option("--campaign", "-c", help="Id of the campaign that takes them")],
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only report what the files hold")] = False,
    quantity: Annotated[Quantity | None, typer.Option(help="What FRFs are whose file does not say")] = None,
    wait: Annotated[bool, typer.Option("--wait/--no-wait", help="Wait for the end of the reading")] = True,
    as_json: AsJson = False,
    url: Url = HERE,
) -> None:
    """Send UFF files to a campaign. Exit 4 where one of them could not be read."""
    from modalbase.client.connection import Connection
    from modalbase.client.display import print_json, print_table, transfer
    from modalbase.client.jobs import wait_for

    done: list[dict[str, Any]] = []
    with Connection(url) as service:
        for file in files:
            with transfer(file.name) as watch:
                job = service.upload(
                    f"campaigns/{an_id(campaign)}/imports", file, watch,
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


def structures(
    project: Annotated[str | None, typer.Option(help="Of this project only")] = None,
    as_json: AsJson = False,
    url: Url = HERE,
) -> None:
    """List structures: what campaigns are of."""
    from modalbase.client.connection import Connection
    from modalbase.client.display import print_json, print_table

    with Connection(url) as service:
        found = list(_structures(service, project))
    if as_json:
        print_json(found)
    else:
        rows = [[s["id"], s["project_name"], s["name"], s["version"], s["created_at"]] for s in found]
        print_table("", ("id", "project", "name", "version", "created_at"), rows)


def campaigns(
    project: Annotated[str | None, typer.Option(help="Of this project only")] = None,
    structure: Annotated[str | None, typer.Option(help="Of this structure only")] = None,
    new: Annotated[str | None, typer.Option(help="Make a campaign of this name; needs --structure, --boundary")] = None,
    boundary: Annotated[str | None, typer.Option(help="cantilever, free or simply_supported")] = None,
    as_json: AsJson = False,
    url: Url = HERE,
) -> None:
    """List campaigns, or make one."""
    from modalbase.client.connection import Connection
    from modalbase.client.display import print_json, print_table

    if project is not None and structure is not None:
        raise ClientError("state --project or --structure: a structure is in one project", Exit.USAGE)
    with Connection(url) as service:
        if new is not None:
            if structure is None or boundary is None:
                raise ClientError("--new needs --structure and --boundary", Exit.USAGE)
            body = {"name": new, "boundary": boundary}
            made = service.post(f"structures/{an_id(structure)}/campaigns", body)
            if as_json:
                print_json(made)
            else:
                typer.echo(made["id"])
            return
        found = list(_campaigns(service, project, structure))
    if as_json:
        print_json(found)
    else:
        columns = ("id", "structure", "name", "boundary", "performed_at", "temperature_c")
        rows = [[c["id"], c["structure_name"], *(c[name] for name in columns[2:])] for c in found]
        print_table("", columns, rows)


def _campaigns(service: Connection, project: str | None, structure: str | None) -> Iterator[dict[str, Any]]:
    """Campaigns with the names of their structures."""
    among = [service.get(f"structures/{an_id(structure)}")] if structure else _structures(service, project)
    for one in among:
        for found in service.pages(f"structures/{one['id']}/campaigns"):
            yield {**found, "structure_name": one["name"]}


def _structures(service: Connection, project: str | None) -> Iterator[dict[str, Any]]:
    """Structures with the names of their projects."""
    among = [service.get(f"projects/{an_id(project)}")] if project else service.pages("projects")
    for one in among:
        for found in service.pages(f"projects/{one['id']}/structures"):
            yield {**found, "project_name": one["name"]}


def frfs(
    campaign: Campaign,
    point: Annotated[int | None, typer.Option(help="Response point")] = None,
    direction: Annotated[int | None, typer.Option(help="Signed response direction")] = None,
    reference: Annotated[int | None, typer.Option(help="Reference point")] = None,
    quantity: Annotated[Quantity | None, typer.Option()] = None,
    limit: Annotated[int | None, typer.Option(min=1, help="List no more than these")] = None,
    as_json: AsJson = False,
    url: Url = HERE,
) -> None:
    """List the FRFs of a campaign; `modalbase export` fetches their values."""
    from modalbase.client.connection import Connection
    from modalbase.client.display import print_json, print_table

    with Connection(url) as service:
        wanted = {"point": point, "direction": direction, "reference": reference, "quantity": quantity}
        found = list(service.pages(f"campaigns/{an_id(campaign)}/frfs", limit, **wanted))
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
