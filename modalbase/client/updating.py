"""`modalbase update`, `result` and `figure`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated
from urllib.parse import quote

import typer

from modalbase.client.errors import ClientError, Exit
from modalbase.client.options import AsJson, Campaign, Confirm, Job, Url, json_file, say_next, service_at

FIGURES = {".svg": "svg", ".png": "png", ".pdf": "pdf", ".json": "plotly"}


def update(
    campaign: Campaign = "latest",
    recipe: Annotated[
        Path | None, typer.Option(help="JSON of the recipe; without it the defaults", exists=True, dir_okay=False)
    ] = None,
    mode_set: Annotated[str | None, typer.Option(help="Measured modes: id, name or latest of the campaign")] = None,
    idempotency_key: Annotated[str | None, typer.Option(help="The same key again: the same job, no second one")] = None,
    wait: Annotated[bool, typer.Option("--wait", help="Wait for the result and show it")] = False,
    confirm: Confirm = False,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Queue an update of a campaign's structure and print its id, or wait for its result. Exit 4 where it fails."""
    from modalbase.client.display import print_json
    from modalbase.client.finding import CAMPAIGN, MODE_SET, find, find_id, uuid_of
    from modalbase.client.jobs import require_success, wait_for
    from modalbase.client.results import print_result

    if idempotency_key is not None and not (idempotency_key.isascii() and idempotency_key.isprintable()):
        raise ClientError("--idempotency-key takes printable ASCII alone, as all that goes in a header", Exit.USAGE)
    body = {} if recipe is None else json_file(recipe)
    headers = None if idempotency_key is None else {"Idempotency-Key": idempotency_key}
    with service_at(url) as service:
        id_ = find_id(service, CAMPAIGN, campaign)
        if mode_set is not None:
            body["mode_set"] = uuid_of(mode_set) or find(service, MODE_SET, mode_set, within=id_)["id"]
        job = service.post(f"campaigns/{id_}/update-jobs", body, headers, confirm=confirm or None)
        if not wait:
            if as_json:
                print_json(job)
            else:
                typer.echo(job["id"])
                say_next("jobs", f"result {job['id']}")
            return
        require_success(wait_for(service, f"update-jobs/{job['id']}", "update"), f"update {job['id']}")
        document = service.get(f"update-jobs/{job['id']}/result")
    if as_json:
        print_json(document)
    else:
        print_result(f"update {job['id']}", document)
        say_next(f"figure frf {job['id']} --out frf.pdf", f"export {job['id']} --what predicted --out predicted.uff")


def result(job: Job = "latest", as_json: AsJson = False, url: Url = None) -> None:
    """Show the result of an update: verdict, parameters, modes, correlation, warnings."""
    from modalbase.client.display import print_json
    from modalbase.client.finding import find_job
    from modalbase.client.results import print_result

    with service_at(url) as service:
        id_ = find_job(service, job)
        document = service.get(f"update-jobs/{id_}/result")
    if as_json:
        print_json(document)
    else:
        print_result(f"update {id_}", document)


def figure(
    name: Annotated[str, typer.Argument(help="frf, mac, parameters; `modalbase figure list` names all")],
    job: Job = "latest",
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File to write: .svg .png .pdf, or .json for Plotly")
    ] = None,
    point: Annotated[int | None, typer.Option(help="Whose FRF is drawn")] = None,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Write a figure of a result to a file."""
    from modalbase.client.display import print_json, print_table, transfer
    from modalbase.client.finding import find_job

    with service_at(url) as service:
        path = f"update-jobs/{find_job(service, job)}/figures"
        if name == "list":
            found = service.get(path)["items"]
            columns = ("name", "title", "available", "reason")
            if as_json:
                print_json(found)
            else:
                print_table("", columns, [[one[column] for column in columns] for one in found])
            return
        target = out or Path(f"{name}.svg")
        chosen = FIGURES.get(target.suffix.lower())
        if chosen is None:
            raise ClientError(f"--out {target.name!r} does not end in one of {', '.join(FIGURES)}", Exit.USAGE)
        with transfer(target.name) as watch:
            size = service.download(f"{path}/{quote(name, safe='')}", target, watch, format=chosen, point=point)
    if as_json:
        print_json({"file": str(target), "bytes": size})
    else:
        typer.echo(target)
