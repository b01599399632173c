"""`modalbase coupons`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from modalbase.client.errors import ClientError, Exit
from modalbase.client.options import NAMED, AsJson, Confirm, Reuse, Url, json_file, make, names_of, service_at

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
    reuse: Reuse = False,
    confirm: Confirm = False,
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
        path = f"coupon-batches/{_batch(service, batch, new, constants, reuse)}"
        for file in files or []:
            coupon = {"specimen": file.stem, **known, **specimens.get(file.stem, {})}
            try:
                service.submit(f"{path}/coupons", file, {"coupon": json.dumps(coupon)}, confirm=confirm or None)
            except ClientError as error:
                raise ClientError(f"{file}: {error}", error.code) from error
        found, summary = list(service.pages(f"{path}/coupons")), service.get(f"{path}/summary")
    if as_json:
        print_json({"coupons": found, "summary": summary})
        return
    print_table(f"{len(found)} specimens", list(COLUMNS), [_cells(coupon) for coupon in found])
    rows = [[name, *_statistics(of)] for name, of in summary["constants"].items()]
    print_table("\nconstants", ("constant", "n", "mean", "± sd", "CV %", "unit", "from"), rows)
    for warning in summary["warnings"]:
        typer.echo(warning, err=True)


COLUMNS = {
    "specimen": ("specimen", None),
    "E GPa": ("E_Pa", 1e-9),
    "G GPa": ("G_Pa", 1e-9),
    "ν": ("nu", 1.0),
    "strength MPa": ("strength_Pa", 1e-6),
    "ultimate strain %": ("ultimate_strain", 100.0),
    "failure": ("failure_code", None),
    "left out because": ("exclusion_reason", None),
}
"""Member of a specimen by heading, and the factor to the heading's unit; None of a text."""


def _cells(coupon: dict[str, Any]) -> list[Any]:
    from modalbase.client.display import Written

    values = [(coupon[name], factor) for name, factor in COLUMNS.values()]
    return [v if v is None or factor is None else Written(f"{v * factor:.4g}") for v, factor in values]


def _statistics(of: dict[str, Any]) -> list[Any]:
    """Number, mean, standard deviation, coefficient of variation, unit and origin of a constant."""
    from modalbase.client.display import Written, with_digits

    factor, unit = (1e-9, "GPa") if of["unit"] == "Pa" else (1.0, "–")
    mean, sd = (None if of[name] is None else factor * of[name] for name in ("mean", "standard_deviation"))
    share = None if of["cv_percent"] is None else Written(f"{of['cv_percent']:.2g}")
    return [of["n"], *with_digits(mean, sd), share, unit, of["source"]]


def _batch(service: Connection, batch: str, structure: str | None, constants: str, reuse: bool) -> str:
    """The id of the batch, which is made where a structure is stated."""
    from modalbase.client.finding import BATCH, STRUCTURE, find_id

    if structure is None:
        return find_id(service, BATCH, batch)
    body = {"name": batch, "constants": constants.split(",")}
    return str(make(service, BATCH, body, find_id(service, STRUCTURE, structure), reuse)["id"])
