"""Files of the service: `modalbase figure`, `report`, `export` and `cards`; and `import-archive`,
an archive into a project.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from modalbase import objects
from modalbase.client.display import print_json
from modalbase.client.errors import ClientError, Exit
from modalbase.commands.options import AsJson, OfJob, Url, laboratory_at, show
from modalbase.formats.registry import FRF_SUFFIXES, WRITERS
from modalbase.objects.files import FIGURES, REPORTS, format_of

What = Literal["frfs", "grid-points", "modes", "predicted", "original"]
"""What to fetch: of a campaign, of a campaign, of a mode set, of an update job, of an import."""


def _say(file: Path, as_json: bool) -> None:
    """Say that a file is written."""
    if as_json:
        print_json({"file": str(file), "bytes": file.stat().st_size})
    else:
        typer.echo(file)


def cards(
    job: OfJob = "latest",
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
    with laboratory_at(url) as lab:
        _say(lab.named(objects.UpdateJob, job).save_cards(out, program or None, element), as_json)


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
    if what != "original" and file_format is None:
        file_format = format_of(out, FRF_SUFFIXES, "state --format: ")
    chosen = {"point": point, "reference": reference, "fmin": fmin, "fmax": fmax, "stride": stride}
    stated = [f"--{name}" for name, value in chosen.items() if value is not None]
    if stated and what not in ("frfs", "predicted"):
        raise ClientError(f"{', '.join(stated)} choose FRFs, not {what}", Exit.USAGE)
    with laboratory_at(url) as lab:
        match what:
            case "frfs":
                lab.named(objects.Campaign, id_).export(out, file_format, **chosen)
            case "grid-points":
                lab.named(objects.Campaign, id_).save_grid_points(out, file_format)
            case "modes":
                lab.named(objects.ModeSet, id_).export(out, file_format)
            case "predicted":
                lab.named(objects.UpdateJob, id_).save_predicted(out, file_format, **chosen)
            case "original":
                lab.named(objects.Import, id_).save(out)
    if as_json and str(out) != "-":
        _say(out, as_json)


def figure(
    name: Annotated[
        str, typer.Argument(help="frf, mac, parameters; `modalbase figure list` names all")
    ],
    job: OfJob = "latest",
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="File to write: .svg .png .pdf, or .json for Plotly"),
    ] = None,
    point: Annotated[int | None, typer.Option(help="Whose FRF is drawn")] = None,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Write a figure of a result to a file."""
    with laboratory_at(url) as lab:
        of = lab.named(objects.UpdateJob, job)
        if name == "list":
            show(of.figures().rows, ("name", "title", "available", "reason"), as_json)
            return
        target = out or Path(f"{name}.svg")
        format_of(target, FIGURES, "--out ")
        _say(of.figure(name, point=point).save(target), as_json)


def report(
    job: OfJob = "latest",
    out: Annotated[Path, typer.Option("--out", "-o", help="File to write: .pdf or .html")] = Path(
        "report.pdf"
    ),
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Write the report of an update: verdict, parameters, correlation, what to do; the data as annex."""
    format_of(out, REPORTS, "--out ")
    with laboratory_at(url) as lab:
        _say(lab.named(objects.UpdateJob, job).report(out), as_json)


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
    with laboratory_at(url) as lab:
        there = any(one.name == project for one in lab.projects())
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
