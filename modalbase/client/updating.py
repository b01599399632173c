"""`modalbase update`, `result`, `jobs`, `monitors` and `alarms`."""

from pathlib import Path
from typing import Annotated, Any

import typer

from modalbase.client.display import print_json
from modalbase.client.errors import ClientError, Exit
from modalbase.client.finding import (
    CAMPAIGN,
    MODE_SET,
    MONITOR,
    PROJECT,
    STRUCTURE,
    find_id,
    find_job,
    uuid_of,
)
from modalbase.client.jobs import require_success, wait_for
from modalbase.client.options import (
    AsJson,
    Campaign,
    Confirm,
    Job,
    OfProject,
    OfStructure,
    Url,
    json_file,
    names_of,
    say_next,
    service_at,
    show,
)
from modalbase.client.results import print_result


def update(
    campaign: Campaign = "latest",
    recipe: Annotated[
        Path | None,
        typer.Option(
            help="JSON of the recipe; without it the defaults", exists=True, dir_okay=False
        ),
    ] = None,
    mode_set: Annotated[
        str | None, typer.Option(help="Measured modes: id, name or latest of the campaign")
    ] = None,
    idempotency_key: Annotated[
        str | None, typer.Option(help="The same key again: the same job, no second one")
    ] = None,
    wait: Annotated[bool, typer.Option("--wait", help="Wait for the result and show it")] = False,
    confirm: Confirm = False,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Queue an update of a campaign's structure and print its id, or wait for its result. Exit 4
    where it fails.
    """
    if idempotency_key is not None and not (
        idempotency_key.isascii() and idempotency_key.isprintable()
    ):
        raise ClientError(
            "--idempotency-key takes printable ASCII alone, as all that goes in a header",
            Exit.USAGE,
        )
    body = {} if recipe is None else json_file(recipe)
    headers = None if idempotency_key is None else {"Idempotency-Key": idempotency_key}
    with service_at(url) as service:
        id_ = find_id(service, CAMPAIGN, campaign)
        if mode_set is not None:
            body["mode_set"] = find_id(service, MODE_SET, mode_set, id_)
        job = service.post(f"campaigns/{id_}/update-jobs", body, headers, confirm=confirm or None)
        if not wait:
            if as_json:
                print_json(job)
            else:
                typer.echo(job["id"])
                say_next("jobs", f"result {job['id']}")
            return
        require_success(
            wait_for(service, f"update-jobs/{job['id']}", "update"), f"update {job['id']}"
        )
        document = service.get(f"update-jobs/{job['id']}/result")
    if as_json:
        print_json(document)
    else:
        print_result(f"update {job['id']}", document)
        say_next(
            f"figure frf {job['id']} --out frf.pdf",
            f"export {job['id']} --what predicted --out predicted.uff",
        )


def result(job: Job = "latest", as_json: AsJson = False, url: Url = None) -> None:
    """Show the result of an update: verdict, parameters, modes, correlation, warnings."""
    with service_at(url) as service:
        id_ = find_job(service, job)
        document = service.get(f"update-jobs/{id_}/result")
    if as_json:
        print_json(document)
    else:
        print_result(f"update {id_}", document)


def jobs(
    campaign: Annotated[
        str | None, typer.Option(help="Of this campaign only", autocompletion=names_of(CAMPAIGN))
    ] = None,
    structure: OfStructure = None,
    project: OfProject = None,
    status: Annotated[
        str | None, typer.Option(help="queued, running, succeeded, failed or cancelled")
    ] = None,
    limit: Annotated[int, typer.Option(min=1, help="The newest so many")] = 20,
    cancel: Annotated[str | None, typer.Option(help="Ask for the end of this job")] = None,
    retry: Annotated[
        str | None, typer.Option(help="Queue this job again, which failed or was cancelled")
    ] = None,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """List update jobs, newest first; cancel one, or queue one again."""
    with service_at(url) as service:
        if cancel is not None or retry is not None:
            verb, which = ("cancel", cancel) if cancel is not None else ("retry", retry)
            listed = [service.call("POST", f"update-jobs/{find_job(service, str(which))}/{verb}")]
        else:
            given = {CAMPAIGN: campaign, STRUCTURE: structure, PROJECT: project}
            narrowed = {
                kind.word: find_id(service, kind, text)
                for kind, text in given.items()
                if text is not None
            }
            listed = list(service.pages("update-jobs", limit, status=status, **narrowed))
    rows = [
        [
            one["id"], one["campaign_name"], one["status"], one["stage"], one["created_at"],
            (one["error"] or {}).get("detail"),
        ]
        for one in listed
    ]  # fmt: skip
    show(listed, ("id", "campaign", "status", "stage", "queued", "error"), as_json, rows)


def monitors(
    structure: OfStructure = None,
    new: Annotated[
        str | None, typer.Option(help="Watch the structure: make a monitor of this name")
    ] = None,
    parameters: Annotated[
        str, typer.Option(help="With --new: what is watched, separated by commas")
    ] = "Ex",
    run: Annotated[
        str | None,
        typer.Option(
            help="Run this monitor on the campaigns not yet in it", autocompletion=names_of(MONITOR)
        ),
    ] = None,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """List monitors with their state; make one, or run one."""
    with service_at(url) as service:
        if run is not None:
            runs = service.post(f"monitors/{find_id(service, MONITOR, run)}/runs", {})["items"]
            show(runs, {"campaign": "campaign_id", "state": "state", "message": "message"}, as_json)
            if not runs:
                typer.echo(
                    "no campaign waits: a monitor takes those that state when they were performed",
                    err=True,
                )
            return
        if new is not None:
            watched = [{"name": name.strip()} for name in parameters.split(",")]
            path = f"structures/{find_id(service, STRUCTURE, structure or 'latest')}/monitors"
            made = service.post(path, {"name": new, "parameters": watched})
            show([made], ("id", "name", "state"), as_json)
            say_next(f'monitors --run "{new}"')
            return
        path = (
            "monitors"
            if structure is None
            else f"structures/{find_id(service, STRUCTURE, structure)}/monitors"
        )
        listed = list(service.pages(path))
    show(listed, ("id", "structure_name", "name", "state", "state_since", "open_alarms"), as_json)


def alarms(
    state: Annotated[
        str | None, typer.Option(help="alarm, acknowledged, cleared or withdrawn")
    ] = None,
    acknowledge: Annotated[
        str | None, typer.Option(help="Id of an alarm that is now known")
    ] = None,
    note: Annotated[
        str | None, typer.Option(help="With --acknowledge: what is done about it")
    ] = None,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """List alarms, newest first; acknowledge one."""
    with service_at(url) as service:
        if acknowledge is not None:
            if (id_ := uuid_of(acknowledge)) is None or not note:
                raise ClientError(
                    "--acknowledge takes the id of an alarm, and --note what is done about it",
                    Exit.USAGE,
                )
            listed: list[dict[str, Any]] = [
                service.post(f"alarms/{id_}/acknowledge", {"note": note})
            ]
        else:
            listed = list(service.pages("alarms", state=state))
    show(
        listed,
        ("id", "created_at", "monitor_name", "parameter", "state", "acknowledged_by", "note"),
        as_json,
    )
