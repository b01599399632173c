"""`modalbase report`: the report of an update as HTML or PDF."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from modalbase.client.errors import ClientError, Exit
from modalbase.client.options import AsJson, Job, Url, service_at

SUFFIXES = {".html": "html", ".htm": "html", ".pdf": "pdf"}


def report(
    job: Job = "latest",
    out: Annotated[Path, typer.Option("--out", "-o", help="File to write: .pdf or .html")] = Path("report.pdf"),
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Write the report of an update: two pages for a customer, the rest as annex."""
    from modalbase.client.display import print_json, transfer
    from modalbase.client.finding import find_job

    if (chosen := SUFFIXES.get(out.suffix.lower())) is None:
        raise ClientError(f"--out {out.name!r} does not end in one of {', '.join(SUFFIXES)}", Exit.USAGE)
    with service_at(url) as service, transfer(out.name) as watch:
        size = service.download(f"update-jobs/{find_job(service, job)}/report", out, watch, format=chosen)
    if as_json:
        print_json({"file": str(out), "bytes": size})
    else:
        typer.echo(out)
