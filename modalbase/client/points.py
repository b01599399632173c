"""`modalbase points`."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Annotated, Any

import typer

from modalbase.client.errors import ClientError, Exit
from modalbase.client.options import AsJson, Campaign, Url, say_next, service_at

AXES = ("x", "y", "z")
METRES = {"m": 1.0, "mm": 1e-3}
HEADER = "label,x_mm,y_mm,z_mm, or with _m for metres; z may be left out"


def points(
    campaign: Campaign,
    file: Annotated[
        Path | None,
        typer.Argument(help=f"CSV of the points, in place of those there: {HEADER}", exists=True, dir_okay=False),
    ] = None,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Show the grid points of a campaign; state them from a CSV file, where no UFF file does."""
    from modalbase.client.display import Written, print_json, print_table
    from modalbase.client.finding import CAMPAIGN, find_id

    stated = None if file is None else read_points(file)
    with service_at(url) as service:
        path = f"campaigns/{find_id(service, CAMPAIGN, campaign)}/grid-points"
        there = service.request("GET", path)
        found = there.json()
        if stated is not None:
            replaced = {"If-Match": there.headers["etag"]}  # by whoever looked last
            found = service.call("PUT", path, json={"items": stated}, headers=replaced)
    if as_json:
        print_json(found)
        return
    rows = [[p["label"], *(Written(f"{1000 * p[f'{axis}_m']:.6g}") for axis in AXES)] for p in found["items"]]
    print_table(f"{len(rows)} grid points", ("label", "x mm", "y mm", "z mm"), rows)
    if not rows:
        say_next(f'points "{campaign}" POINTS.csv')


def read_points(file: Path) -> list[dict[str, Any]]:
    """Grid points of a CSV file, in metres as REST has them.

    Cells are parted by commas, semicolons or tabs; a comma inside a number of the latter two is a decimal comma.

    Raises:
        ClientError: the file is no such table; names the line.
    """
    try:
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ClientError(f"{file} is no text in UTF-8: {error}", Exit.USAGE) from None
    first = lines[0] if lines else ""
    parted = next((sign for sign in ";\t" if sign in first), ",")
    head, *rows = csv.reader(lines or [""], delimiter=parted)
    places = _places(file, [cell.strip() for cell in head])
    found = []
    for line, row in enumerate(rows, 2):
        if any(cell.strip() for cell in row):
            if len(row) != len(head):
                raise ClientError(f"{file}, line {line}: {len(row)} cells, the header has {len(head)}", Exit.USAGE)
            found.append({"z_m": 0.0} | {name: _number(file, line, row[i], by) for name, (i, by) in places.items()})
    return found


def _places(file: Path, head: list[str]) -> dict[str, tuple[int, float | None]]:
    """Column and factor to metres by member of a point; no factor of the label."""
    known: dict[str, tuple[str, float | None]] = {"label": ("label", None), "point": ("label", None)}
    known |= {f"{axis}_{unit}": (f"{axis}_m", factor) for axis in AXES for unit, factor in METRES.items()}
    found = {known[cell][0]: (i, known[cell][1]) for i, cell in enumerate(head) if cell in known}
    if len(found) != len(head) or not {"label", "x_m", "y_m"} <= found.keys():
        raise ClientError(f"{file}: line 1 is {','.join(head)[:200]!r}, expected {HEADER}", Exit.USAGE)
    return found


def _number(file: Path, line: int, cell: str, factor: float | None) -> float | int:
    try:
        return int(cell) if factor is None else float(cell.strip().replace(",", ".")) * factor
    except ValueError:
        what = "no label, a whole number" if factor is None else "no number"
        raise ClientError(f"{file}, line {line}: {cell.strip()!r} is {what}", Exit.USAGE) from None
