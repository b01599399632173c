"""`modalbase coupons`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from modalbase.client.errors import ClientError, Exit
from modalbase.client.options import NAMED, AsJson, Url, json_file, names_of, service_at

if TYPE_CHECKING:
    from modalbase.client.connection import Connection


def coupons(
    batch: Annotated[str, typer.Argument(help=f"Coupon batch: {NAMED}", autocompletion=names_of("BATCH"))],
    files: Annotated[
        list[Path] | None, typer.Argument(help="Raw curves to add, one a specimen", exists=True, dir_okay=False)
    ] = None,
    about: Annotated[
        Path | None,
        typer.Option(help="JSON of what the curves have in common (dimensions, columns, standard); "
                     "`specimens` in it may say more by name", exists=True, dir_okay=False),
    ] = None,
    new: Annotated[str | None, typer.Option(help="Make the batch first, of this structure")] = None,
    constants: Annotated[str, typer.Option(help="With --new: which constants it measures")] = "Ex",
    as_json: AsJson = False,
    url: Url = None,
) -> None:  # fmt: skip
    """Show a batch with its statistics; add specimens from testing machines' files, each named as its file."""
    from modalbase.client.display import print_json, print_table

    if files and about is None:
        raise ClientError("state with --about what the files hold: dimensions, columns and their units", Exit.USAGE)
    known = {} if about is None else json_file(about)
    specimens = known.pop("specimens", {})
    if not (isinstance(specimens, dict) and all(isinstance(more, dict) for more in specimens.values())):
        raise ClientError(f'{about}: specimens is no object such as {{"A3": {{"excluded": true}}}}', Exit.USAGE)
    with service_at(url) as service:
        path = f"coupon-batches/{_batch(service, batch, new, constants)}"
        for file in files or []:
            coupon = {"specimen": file.stem, **known, **specimens.get(file.stem, {})}
            try:
                service.submit(f"{path}/coupons", file, {"coupon": json.dumps(coupon)})
            except ClientError as error:
                raise ClientError(f"{file}: {error}", error.code) from error
        found, summary = list(service.pages(f"{path}/coupons")), service.get(f"{path}/summary")
    if as_json:
        print_json({"coupons": found, "summary": summary})
        return
    columns = ("specimen", "E_Pa", "G_Pa", "nu", "strength_Pa", "ultimate_strain", "failure_code", "exclusion_reason")
    print_table(f"{len(found)} specimens", columns, [[c[name] for name in columns] for c in found])
    measures = ("n", "mean", "standard_deviation", "cv_percent", "unit", "source")
    rows = [[name, *(value[m] for m in measures)] for name, value in summary["constants"].items()]
    print_table("\nconstants", ("constant", *measures), rows)
    for warning in summary["warnings"]:
        typer.echo(warning, err=True)


def _batch(service: Connection, batch: str, structure: str | None, constants: str) -> str:
    """The id of the batch, which is made where a structure is stated."""
    from modalbase.client.finding import BATCH, STRUCTURE, find_id

    if structure is None:
        return find_id(service, BATCH, batch)
    path = f"structures/{find_id(service, STRUCTURE, structure)}/coupon-batches"
    return str(service.post(path, {"name": batch, "constants": constants.split(",")})["id"])
