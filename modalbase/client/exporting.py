"""`modalbase export` and `cards`: measured and predicted FRFs, grid points, modes, originals, decks."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from modalbase.client.errors import ClientError, Exit
from modalbase.client.options import AsJson, Job, Url, service_at

if TYPE_CHECKING:
    from modalbase.client.connection import Connection


class What(StrEnum):
    """What to fetch, and of what the id is."""

    frfs = "frfs"  # of a campaign
    grid_points = "grid-points"  # of a campaign
    modes = "modes"  # of a mode set
    predicted = "predicted"  # of an update job
    original = "original"  # of an import


PATHS = {
    What.frfs: "campaigns/{}/frfs/data",
    What.grid_points: "campaigns/{}/grid-points",
    What.modes: "mode-sets/{}",
    What.predicted: "update-jobs/{}/frfs/data",
    What.original: "imports/{}/original",
}
SUFFIXES = {
    ".json": "json",
    ".npz": "npz",
    ".csv": "csv",
    ".uff": "uff",
    ".unv": "uff",
    ".arrow": "arrow",
    ".arrows": "arrow",
}


def format_of(file: Path) -> str:
    """The format that a file's name says.

    Raises:
        ClientError: it says none.
    """
    if (found := SUFFIXES.get(file.suffix.lower())) is None:
        raise ClientError(f"state --format; {file.name!r} does not say one of {', '.join(SUFFIXES)}", Exit.USAGE)
    return found


SOLVERS = {".inp": "calculix", ".bdf": "nastran", ".dat": "nastran", ".nas": "nastran"}


def solver_of(file: Path) -> str:
    """The program whose deck a file's name says.

    Raises:
        ClientError: it says none.
    """
    if (found := SOLVERS.get(file.suffix.lower())) is None:
        raise ClientError(f"state the program: {file.name!r} does not end in one of {', '.join(SOLVERS)}", Exit.USAGE)
    return found


def cards(
    job: Job = "latest",
    out: Annotated[Path, typer.Option("--out", "-o", help="File to write: .inp, .bdf")] = Path("updated.inp"),
    program: Annotated[
        str | None, typer.Option("--format", help="calculix, abaqus or nastran; by default as the file's name says")
    ] = None,
    element: Annotated[str | None, typer.Option(help="solid or shell")] = None,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Write the updated model as a deck that CalculiX, Abaqus or Nastran runs."""
    from modalbase.client.display import print_json, transfer
    from modalbase.client.finding import find_job

    with service_at(url) as service, transfer(out.name) as watch:
        path = f"update-jobs/{find_job(service, job)}/cards"
        size = service.download(path, out, watch, format=program or solver_of(out), element=element)
    if as_json:
        print_json({"file": str(out), "bytes": size})
    else:
        typer.echo(out)


def _id(service: Connection, what: What, text: str) -> str:
    """The id of what a text names."""
    from modalbase.client.finding import CAMPAIGN, MODE_SET, find_id, find_job, uuid_of

    if what is What.predicted:
        return find_job(service, text)
    if what is What.original:
        if (id_ := uuid_of(text)) is None:
            raise ClientError(f"{text!r} is no id of an import; `modalbase import` prints them", Exit.USAGE)
        return id_
    return find_id(service, MODE_SET if what is What.modes else CAMPAIGN, text)


def export(
    id_: Annotated[
        str, typer.Argument(metavar="ID", help="Campaign, mode set, update job or import: id, name or latest")
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="File to write; - is standard output")],
    what: Annotated[What, typer.Option(help="What to fetch")] = What.frfs,
    file_format: Annotated[
        str | None,
        typer.Option("--format", help="json npz csv uff uff-ascii arrow; by default as the file's name says"),
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
    from modalbase.client.display import print_json, transfer

    target = None if str(out) == "-" else out
    if what is not What.original and file_format is None:
        file_format = format_of(out)
    wanted = {"point": point, "reference": reference, "fmin": fmin, "fmax": fmax, "stride": stride}
    stated = [f"--{name}" for name, value in wanted.items() if value is not None]
    if stated and what not in (What.frfs, What.predicted):
        raise ClientError(f"{', '.join(stated)} choose FRFs, not {what}", Exit.USAGE)
    with service_at(url) as service, transfer(out.name) as watch:
        path = PATHS[what].format(_id(service, what, id_))
        size = service.download(path, target, watch, format=file_format, **wanted)
    if as_json and target is not None:
        print_json({"file": str(target), "bytes": size})
