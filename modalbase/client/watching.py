"""`modalbase jobs`, `monitors` and `alarms`."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from modalbase.client.errors import ClientError, Exit
from modalbase.client.options import AsJson, OfProject, OfStructure, Url, names_of, say_next, service_at


def jobs(
    campaign: Annotated[
        str | None, typer.Option(help="Of this campaign only", autocompletion=names_of("CAMPAIGN"))
    ] = None,
    structure: OfStructure = None,
    project: OfProject = None,
    status: Annotated[str | None, typer.Option(help="queued, running, succeeded, failed or cancelled")] = None,
    limit: Annotated[int, typer.Option(min=1, help="The newest so many")] = 20,
    cancel: Annotated[str | None, typer.Option(help="Ask for the end of this job")] = None,
    retry: Annotated[str | None, typer.Option(help="Queue this job again, which failed or was cancelled")] = None,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """List update jobs, newest first; cancel one, or queue one again."""
    from modalbase.client.finding import CAMPAIGN, PROJECT, STRUCTURE, find_id, find_job

    with service_at(url) as service:
        if cancel is not None or retry is not None:
            verb, which = ("cancel", cancel) if cancel is not None else ("retry", retry)
            found = [service.call("POST", f"update-jobs/{find_job(service, str(which))}/{verb}")]
        else:
            given = {
                "campaign": (CAMPAIGN, campaign),
                "structure": (STRUCTURE, structure),
                "project": (PROJECT, project),
            }
            narrowed = {name: find_id(service, kind, text) for name, (kind, text) in given.items() if text is not None}
            found = list(service.pages("update-jobs", limit, status=status, **narrowed))
    rows = [
        [
            one["id"], one["campaign_name"], one["status"], one["stage"], one["created_at"],
            (one["error"] or {}).get("detail"),
        ]
        for one in found
    ]  # fmt: skip
    _show(found, ("id", "campaign", "status", "stage", "queued", "error"), rows, as_json)


def monitors(
    structure: OfStructure = None,
    new: Annotated[str | None, typer.Option(help="Watch the structure: make a monitor of this name")] = None,
    parameters: Annotated[str, typer.Option(help="With --new: what is watched, separated by commas")] = "Ex",
    run: Annotated[
        str | None,
        typer.Option(help="Run this monitor on the campaigns not yet in it", autocompletion=names_of("MONITOR")),
    ] = None,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """List monitors with their state; make one, or run one."""
    from modalbase.client.finding import MONITOR, STRUCTURE, find_id

    with service_at(url) as service:
        if run is not None:
            runs = service.post(f"monitors/{find_id(service, MONITOR, run)}/runs", {})["items"]
            _show(
                runs,
                ("campaign", "state", "message"),
                [[r["campaign_id"], r["state"], r["message"]] for r in runs],
                as_json,
            )
            if not runs:
                typer.echo("no campaign waits: a monitor takes those that state when they were performed", err=True)
            return
        if new is not None:
            watched = [{"name": name.strip()} for name in parameters.split(",")]
            path = f"structures/{find_id(service, STRUCTURE, structure or 'latest')}/monitors"
            made = service.post(path, {"name": new, "parameters": watched})
            _show([made], ("id", "name", "state"), [[made["id"], made["name"], made["state"]]], as_json)
            say_next(f'monitors --run "{new}"')
            return
        path = "monitors" if structure is None else f"structures/{find_id(service, STRUCTURE, structure)}/monitors"
        found = list(service.pages(path))
    columns = ("id", "structure_name", "name", "state", "state_since", "open_alarms")
    _show(found, columns, [[one[name] for name in columns] for one in found], as_json)


def alarms(
    state: Annotated[str | None, typer.Option(help="alarm, acknowledged, cleared or withdrawn")] = None,
    acknowledge: Annotated[str | None, typer.Option(help="Id of an alarm that is now known")] = None,
    note: Annotated[str | None, typer.Option(help="With --acknowledge: what is done about it")] = None,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """List alarms, newest first; acknowledge one."""
    from modalbase.client.finding import uuid_of

    with service_at(url) as service:
        if acknowledge is not None:
            if (id_ := uuid_of(acknowledge)) is None or not note:
                raise ClientError(
                    "--acknowledge takes the id of an alarm, and --note what is done about it", Exit.USAGE
                )
            found: list[dict[str, Any]] = [service.post(f"alarms/{id_}/acknowledge", {"note": note})]
        else:
            found = list(service.pages("alarms", state=state))
    columns = ("id", "created_at", "monitor_name", "parameter", "state", "acknowledged_by", "note")
    _show(found, columns, [[one[name] for name in columns] for one in found], as_json)


def _show(found: Any, columns: tuple[str, ...], rows: list[list[Any]], as_json: bool) -> None:
    from modalbase.client.display import print_json, print_table

    if as_json:
        print_json(found)
    else:
        print_table("", columns, rows)
