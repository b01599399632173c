"""`modalbase update`, `result`, `jobs`, `monitors` and `alarms`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from modalbase import objects
from modalbase.client.display import print_json
from modalbase.client.errors import ClientError, Exit
from modalbase.client.results import print_result
from modalbase.commands.options import (
    AsJson,
    Confirm,
    OfCampaign,
    OfJob,
    OfProject,
    OfStructure,
    Url,
    json_file,
    laboratory_at,
    names_of,
    say_next,
    show,
)
from modalbase.objects.finding import CAMPAIGN, MONITOR, uuid_of


def update(
    campaign: OfCampaign = "latest",
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
    with laboratory_at(url) as lab:
        of = lab.named(objects.Campaign, campaign)
        modes = {} if mode_set is None else {"mode_set": lab.named(objects.ModeSet, mode_set, of)}
        job = of.update(body, confirm=confirm, idempotency_key=idempotency_key, **modes)
        if not wait:
            if as_json:
                print_json(job.fields)
            else:
                typer.echo(job.id)
                say_next("jobs", f"result {job.id}")
            return
        done = job.result()
    _print(done, as_json)
    if not as_json:
        say_next(
            f"figure frf {job.id} --out frf.pdf",
            f"export {job.id} --what predicted --out predicted.uff",
        )


def result(job: OfJob = "latest", as_json: AsJson = False, url: Url = None) -> None:
    """Show the result of an update: verdict, parameters, modes, correlation, warnings."""
    with laboratory_at(url) as lab:
        _print(lab.named(objects.UpdateJob, job).result(wait=False), as_json)


def _print(result: objects.Result, as_json: bool) -> None:
    if as_json:
        print_json(result.document)
    else:
        print_result(f"update {result.job}", result.document)


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
    with laboratory_at(url) as lab:
        if cancel is not None:
            chosen = [lab.named(objects.UpdateJob, cancel).cancel()]
        elif retry is not None:
            chosen = [lab.named(objects.UpdateJob, retry).retry()]
        else:
            given = {
                objects.Campaign: campaign,
                objects.Structure: structure,
                objects.Project: project,
            }
            narrowed = {
                of.noun.word: lab.named(of, which).id
                for of, which in given.items()
                if which is not None
            }
            chosen = lab.jobs(limit, status=status, **narrowed)
    listed = [one.fields for one in chosen]
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
        str | None,
        typer.Option(
            help="With --new: what is watched, separated by commas; default: Ex, or modes"
        ),
    ] = None,
    modes: Annotated[
        bool, typer.Option("--modes", help="With --new: follow modes, which need no model")
    ] = False,
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
    with laboratory_at(url) as lab:
        if run is not None:
            runs = lab.named(objects.Monitor, run).run()
            show(runs, {"campaign": "campaign_id", "state": "state", "message": "message"}, as_json)
            if not runs:
                typer.echo(
                    "no campaign waits: a monitor takes those that state when they were performed",
                    err=True,
                )
            return
        if new is not None:
            stated = parameters or (None if modes else "Ex")
            watched = stated and [{"name": name.strip()} for name in stated.split(",")]
            of = lab.named(objects.Structure, structure or "latest")
            made = of.new_monitor(
                new, watch="modes" if modes else "update", parameters=watched or None
            )
            show([made.fields], ("id", "name", "state"), as_json)
            say_next(f'monitors --run "{new}"')
            return
        there = lab if structure is None else lab.named(objects.Structure, structure)
        listed = [one.fields for one in there.monitors()]
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
    with laboratory_at(url) as lab:
        if acknowledge is not None:
            if (id_ := uuid_of(acknowledge)) is None or not note:
                raise ClientError(
                    "--acknowledge takes the id of an alarm, and --note what is done about it",
                    Exit.USAGE,
                )
            chosen = [objects.Alarm(lab, {"id": id_}).acknowledge(note)]
        else:
            chosen = lab.alarms(state=state)
    listed = [one.fields for one in chosen]
    show(
        listed,
        ("id", "created_at", "monitor_name", "parameter", "state", "acknowledged_by", "note"),
        as_json,
    )
