"""`modalbase hits`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from modalbase.client.errors import ClientError, Exit
from modalbase.client.measuring import send_file
from modalbase.client.options import NAMED, AsJson, Url, json_file, names_of, say_next, service_at


def hits(
    files: Annotated[list[Path], typer.Argument(help="Time blocks: npz, .mat, CSV, wav", exists=True, dir_okay=False)],
    campaign: Annotated[
        str, typer.Option("--campaign", "-c", help=f"Campaign: {NAMED}", autocompletion=names_of("CAMPAIGN"))
    ] = "latest",
    mapping: Annotated[
        Path | None, typer.Option(help="JSON that says which variable is what; without it one is proposed", exists=True)
    ] = None,
    process: Annotated[bool, typer.Option("--process", help="Make FRFs of the good hits then")] = False,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Send time blocks of hits, see how each hit is judged, and make FRFs of the good ones."""
    from modalbase.client.display import print_json, print_table
    from modalbase.client.finding import CAMPAIGN, find_id
    from modalbase.client.jobs import require_success, wait_for

    stated = None if mapping is None else json_file(mapping)
    judged: list[dict[str, Any]] = []
    with service_at(url) as service:
        path = f"campaigns/{(id_ := find_id(service, CAMPAIGN, campaign))}"
        for file in files:
            sent = send_file(service, id_, file, dry_run=stated is None, kind="hits", mapping=stated)
            require_success(sent, file.name)
            if stated is None:
                print_json(sent["found"])
                raise ClientError(
                    "nothing is stored: save `mapping` of this, corrected, and state it with --mapping", Exit.USAGE
                )
            judged += service.get(f"imports/{sent['id']}/records")["hits"]
        placed = bool(service.get(f"{path}/grid-points")["items"])
        if process:
            job = wait_for(service, f"processings/{service.post(f'{path}/processings', {})['id']}", "processing")
            require_success(job, "processing")
    if as_json:
        print_json(judged)
        return
    rows = [[hit["point"], hit["hit"], hit["accepted"], _said(hit)] for hit in judged]
    print_table("", ("point", "hit", "good", "why not"), rows)
    if not placed:  # shapes have no place on the body without them
        say_next(f'points "{campaign}" POINTS.csv')
    say_next(f'modes "{campaign}" --identify' if process else f'hits FILE --campaign "{campaign}" --process')


def _said(hit: dict[str, Any]) -> str | None:
    """What failed of a hit."""
    return "; ".join(finding["sentence"] for finding in hit["findings"] if finding["failed"]) or None
