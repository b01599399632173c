"""`modalbase coupons`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from modalbase.client.errors import ClientError, Exit
from modalbase.client.options import HERE, AsJson, Url, an_id, json_file


def coupons(
    batch: Annotated[str, typer.Argument(help="Id of the coupon batch")],
    files: Annotated[
        list[Path] | None, typer.Argument(help="Raw curves to add, one a specimen", exists=True, dir_okay=False)
    ] = None,
    about: Annotated[
        Path | None,
        typer.Option(help="JSON of what the curves have in common (dimensions, columns, standard); "
                     "`specimens` in it may say more by name", exists=True, dir_okay=False),
    ] = None,
    as_json: AsJson = False,
    url: Url = HERE,
) -> None:  # fmt: skip
    """Show a batch with its statistics; add specimens from testing machines' files, each named as its file."""
    from modalbase.client.connection import Connection
    from modalbase.client.display import print_json, print_table

    if files and about is None:
        raise ClientError("state with --about what the files hold: dimensions, columns and their units", Exit.USAGE)
    known = {} if about is None else json_file(about)
    specimens = known.pop("specimens", {})
    if not (isinstance(specimens, dict) and all(isinstance(more, dict) for more in specimens.values())):
        raise ClientError(f'{about}: specimens is no object such as {{"A3": {{"excluded": true}}}}', Exit.USAGE)
    path = f"coupon-batches/{an_id(batch)}"
    with Connection(url) as service:
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
