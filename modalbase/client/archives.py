"""`modalbase import-archive`: what another service wrote, into a project of this one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from modalbase.client.display import print_json
from modalbase.client.options import AsJson, Url, service_at


def import_archive(
    file: Annotated[
        Path, typer.Argument(exists=True, dir_okay=False, help="Archive, as `find --out FILE.zip` writes it")
    ],
    project: Annotated[str, typer.Argument(help="Project to read it into; made where there is none of that name")],
    again: Annotated[
        bool, typer.Option("--again", help="Read it though one of the same content was read before")
    ] = False,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Read an archive into a project: all but results, with new ids. Results stay in the archive."""
    from modalbase.objects.laboratory import Laboratory  # it reads files, which no other command needs

    with service_at(url) as service:
        done = Laboratory(service).project(project, create=True).import_archive(file, again=again)
    if as_json:
        print_json({"ids": done.ids, "results": done.results})
        return
    for was, is_now in done.ids.items():
        typer.echo(f"{was} is {is_now}")
    typer.echo(
        f"{len(done.results)} results stay in {file.name}; an update with the recipe in their provenance computes them again"
    )
