"""`modalbase update` and `result`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from modalbase.client.errors import ClientError, Exit
from modalbase.client.options import HERE, AsJson, Campaign, Url, an_id, json_file


def update(
    campaign: Campaign,
    recipe: Annotated[
        Path | None, typer.Option(help="JSON of the recipe; without it the defaults", exists=True, dir_okay=False)
    ] = None,
    mode_set: Annotated[str | None, typer.Option(help="Id of the measured modes")] = None,
    idempotency_key: Annotated[str | None, typer.Option(help="The same key again: the same job, no second one")] = None,
    wait: Annotated[bool, typer.Option("--wait", help="Wait for the result and show it")] = False,
    as_json: AsJson = False,
    url: Url = HERE,
) -> None:
    """Queue an update of a campaign's structure and print its id, or wait for its result. Exit 4 where it fails."""
    from modalbase.client.connection import Connection
    from modalbase.client.display import print_json
    from modalbase.client.jobs import require_success, wait_for
    from modalbase.client.results import print_result

    if idempotency_key is not None and not (idempotency_key.isascii() and idempotency_key.isprintable()):
        raise ClientError("--idempotency-key takes printable ASCII alone, as all that goes in a header", Exit.USAGE)
    body = {} if recipe is None else json_file(recipe)
    if mode_set is not None:
        body["mode_set"] = mode_set
    headers = None if idempotency_key is None else {"Idempotency-Key": idempotency_key}
    with Connection(url) as service:
        job = service.post(f"campaigns/{an_id(campaign)}/update-jobs", body, headers)
        if not wait:
            if as_json:
                print_json(job)
            else:
                typer.echo(job["id"])
            return
        require_success(wait_for(service, f"update-jobs/{job['id']}", "update"), f"update {job['id']}")
        document = service.get(f"update-jobs/{job['id']}/result")
    if as_json:
        print_json(document)
    else:
        print_result(f"update {job['id']}", document)


def result(
    job: Annotated[str, typer.Argument(help="Id of the update job")], as_json: AsJson = False, url: Url = HERE
) -> None:
    """Show the result of an update: parameters, modes, correlation, warnings."""
    from modalbase.client.connection import Connection
    from modalbase.client.display import print_json
    from modalbase.client.results import print_result

    with Connection(url) as service:
        document = service.get(f"update-jobs/{an_id(job)}/result")
    if as_json:
        print_json(document)
    else:
        print_result(f"update {job}", document)
