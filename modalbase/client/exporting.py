"""Files of the service: `modalbase figure`, `report`, `export` and `cards`; and `import-archive`,
an archive into a project.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal
from urllib.parse import quote

import typer

from modalbase.client.display import print_json, transfer
from modalbase.client.errors import ClientError, Exit
from modalbase.client.files import FIGURES, REPORTS, SOLVERS, fetch_file, format_of
from modalbase.client.finding import CAMPAIGN, MODE_SET, find_id, find_job, uuid_of
from modalbase.client.options import AsJson, Job, Url, service_at, show
from modalbase.formats.registry import FRF_SUFFIXES, WRITERS

if TYPE_CHECKING:
    from modalbase.client.connection import Connection


What = Literal["frfs", "grid-points", "modes", "predicted", "original"]
"""What to fetch: of a campaign, of a campaign, of a mode set, of an update job, of an import."""

PATHS: dict[What, str] = {
    "frfs": "campaigns/{}/frfs/data",
    "grid-points": "campaigns/{}/grid-points",
    "modes": "mode-sets/{}",
    "predicted": "update-jobs/{}/frfs/data",
    "original": "imports/{}/original",
}


def _fetch(service: Connection, path: str, file: Path, as_json: bool, **query: Any) -> None:
    """Write what is at a path to a file, and say so."""
    size = fetch_file(service, path, file, **query)
    if as_json:
        print_json({"file": str(file), "bytes": size})
    else:
        typer.echo(file)


def cards(
    job: Job = "latest",
    out: Annotated[Path, typer.Option("--out", "-o", help="File to write: .inp, .bdf")] = Path(
        "updated.inp"
    ),
    program: Annotated[
        str | None,
        typer.Option(
            "--format", help="calculix, abaqus or nastran; by default as the file's name says"
        ),
    ] = None,
    element: Annotated[str | None, typer.Option(help="solid or shell")] = None,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Write the updated model as a deck that CalculiX, Abaqus or Nastran runs."""
    with service_at(url) as service:
        path = f"update-jobs/{find_job(service, job)}/cards"
        chosen = program or format_of(out, SOLVERS, "state the program: ")
        _fetch(service, path, out, as_json, format=chosen, element=element)


def _id(service: Connection, what: What, text: str) -> str:
    """The id of what a text names."""
    if what == "predicted":
        return find_job(service, text)
    if what == "original":
        if (id_ := uuid_of(text)) is None:
            raise ClientError(
                f"{text!r} is no id of an import; `modalbase import` prints them", Exit.USAGE
            )
        return id_
    return find_id(service, MODE_SET if what == "modes" else CAMPAIGN, text)


def export(
    id_: Annotated[
        str,
        typer.Argument(
            metavar="ID", help="Campaign, mode set, update job or import: id, name or latest"
        ),
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="File to write; - is standard output")],
    what: Annotated[What, typer.Option(help="What to fetch")] = "frfs",
    file_format: Annotated[
        str | None,
        typer.Option("--format", help=f"{' '.join(WRITERS)}; by default as the file's name says"),
    ] = None,
    point: Annotated[int | None, typer.Option(help="Response point")] = None,
    reference: Annotated[int | None, typer.Option(help="Reference point")] = None,
    fmin: Annotated[float | None, typer.Option(help="Hz")] = None,
    fmax: Annotated[float | None, typer.Option(help="Hz")] = None,
    stride: Annotated[int | None, typer.Option(help="Every how many-th line")] = None,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Fetch FRFs, grid points, modes, predictions or an original file."""
    target = None if str(out) == "-" else out
    if what != "original" and file_format is None:
        file_format = format_of(out, FRF_SUFFIXES, "state --format: ")
    chosen = {"point": point, "reference": reference, "fmin": fmin, "fmax": fmax, "stride": stride}
    stated = [f"--{name}" for name, value in chosen.items() if value is not None]
    if stated and what not in ("frfs", "predicted"):
        raise ClientError(f"{', '.join(stated)} choose FRFs, not {what}", Exit.USAGE)
    with service_at(url) as service, transfer(out.name) as watch:
        path = PATHS[what].format(_id(service, what, id_))
        size = service.download(path, target, watch, format=file_format, **chosen)
    if as_json and target is not None:
        print_json({"file": str(target), "bytes": size})


def figure(
    name: Annotated[
        str, typer.Argument(help="frf, mac, parameters; `modalbase figure list` names all")
    ],
    job: Job = "latest",
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="File to write: .svg .png .pdf, or .json for Plotly"),
    ] = None,
    point: Annotated[int | None, typer.Option(help="Whose FRF is drawn")] = None,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Write a figure of a result to a file."""
    with service_at(url) as service:
        path = f"update-jobs/{find_job(service, job)}/figures"
        if name == "list":
            figures = service.get(path)["items"]
            show(figures, ("name", "title", "available", "reason"), as_json)
            return
        target = out or Path(f"{name}.svg")
        chosen = format_of(target, FIGURES, "--out ")
        _fetch(
            service, f"{path}/{quote(name, safe='')}", target, as_json, format=chosen, point=point
        )


def report(
    job: Job = "latest",
    out: Annotated[Path, typer.Option("--out", "-o", help="File to write: .pdf or .html")] = Path(
        "report.pdf"
    ),
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Write the report of an update: two pages for a customer, the rest as annex."""
    chosen = format_of(out, REPORTS, "--out ")
    with service_at(url) as service:
        _fetch(service, f"update-jobs/{find_job(service, job)}/report", out, as_json, format=chosen)


def import_archive(
    file: Annotated[
        Path,
        typer.Argument(
            exists=True, dir_okay=False, help="Archive, as `find --out FILE.zip` writes it"
        ),
    ],
    project: Annotated[
        str, typer.Argument(help="Project to read it into; made where there is none of that name")
    ],
    again: Annotated[
        bool, typer.Option("--again", help="Read it though one of the same content was read before")
    ] = False,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Read an archive into a project: all but results, with new ids. Results stay in the
    archive.
    """
    # it reads files, which no other command needs
    from modalbase.objects.laboratory import Laboratory

    with service_at(url) as service:
        lab = Laboratory(service)
        there = any(one["name"] == project for one in service.pages("projects"))
        into = lab.project(project, create=True)
        try:
            done = into.import_archive(file, again=again)
        except BaseException:
            if not there and not into.structures():
                into.delete()
            raise
    if as_json:
        print_json({"ids": done.ids, "results": done.results})
        return
    for was, is_now in done.ids.items():
        typer.echo(f"{was} is {is_now}")
    typer.echo(
        f"{len(done.results)} results stay in {file.name}; an update with the recipe in their"
        " provenance computes them again"
    )
