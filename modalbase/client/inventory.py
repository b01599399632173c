"""`modalbase projects`, `structures` and `campaigns`: list what there is, or make one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from modalbase.client.errors import ClientError, Exit
from modalbase.client.options import (
    AsJson,
    Confirm,
    OfProject,
    OfStructure,
    Reuse,
    Url,
    json_file,
    make,
    say_next,
    service_at,
)

MODULI = ("Ex", "Ey", "Gxy", "Gxz", "Gyz")
"""Stated in GPa; nu_xy has no unit."""


def projects(
    new: Annotated[str | None, typer.Option(help="Make a project of this name, and print its id")] = None,
    reuse: Reuse = False,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """List projects, or make one."""
    from modalbase.client.finding import PROJECT

    with service_at(url) as service:
        if new is not None:
            _made(
                make(service, PROJECT, {"name": new}, None, reuse),
                as_json,
                f'structures --new NAME --project "{new}" …',
            )
            return
        found = list(service.pages("projects"))
    _listed(found, ("id", "name", "description", "created_at"), as_json, {"created_at": "made"})
    if not found and not as_json:
        say_next("projects --new NAME")


def structures(
    project: OfProject = None,
    new: Annotated[str | None, typer.Option(help="Make a structure of this name in the project, and print its id")] = None,
    size: Annotated[str | None, typer.Option(help="With --new: length x width x thickness in mm, such as 500x40x10")] = None,
    density: Annotated[float | None, typer.Option(help="With --new: kg/m³")] = None,
    moduli: Annotated[
        str | None, typer.Option(help="With --new: GPa, such as Ex=33,Ey=32,Gxy=5.7,Gxz=4.5,Gyz=4.5,nu_xy=0.15")
    ] = None,
    body: Annotated[
        Path | None, typer.Option("--file", help="With --new: JSON as REST has it, for a laminate", exists=True, dir_okay=False)
    ] = None,
    reuse: Reuse = False,
    confirm: Confirm = False,
    as_json: AsJson = False,
    url: Url = None,
) -> None:  # fmt: skip
    """List structures, or make one."""
    from modalbase.client.finding import PROJECT, STRUCTURE, all_of, find, find_id

    with service_at(url) as service:
        if new is not None:
            given: dict[str, Any] = {} if body is None else json_file(body)
            given |= {"name": new} | ({} if density is None else {"density_kg_m3": density})
            given |= {} if size is None else {"geometry": _geometry(size)}
            given |= {} if moduli is None else {"material": _material(moduli)}
            made = make(service, STRUCTURE, given, find_id(service, PROJECT, project or "latest"), reuse, confirm)
            _made(made, as_json, f'campaigns --new NAME --structure "{new}" --boundary cantilever')
            return
        among = None if project is None else find(service, PROJECT, project)
        found = _above(service, among, STRUCTURE, all_of)
    rows = [{**one, "project_name": one["above"]["name"]} for one in found]
    _listed(
        _plain(rows),
        ("id", "project_name", "name", "version", "created_at"),
        as_json,
        {"project_name": "project", "created_at": "made"},
    )


def campaigns(
    project: OfProject = None,
    structure: OfStructure = None,
    new: Annotated[str | None, typer.Option(help="Make a campaign of this name, and print its id")] = None,
    boundary: Annotated[str | None, typer.Option(help="With --new: cantilever, free or simply_supported")] = None,
    temperature: Annotated[float | None, typer.Option(help="With --new: °C")] = None,
    humidity: Annotated[float | None, typer.Option(help="With --new: relative humidity, %")] = None,
    sensor_mass: Annotated[float | None, typer.Option(help="With --new: mass of the accelerometer, g")] = None,
    sensor_point: Annotated[int | None, typer.Option(help="With --new: grid point where it stays")] = None,
    performed_at: Annotated[str | None, typer.Option(help="With --new: when, such as 2026-03-02T09:30:00Z")] = None,
    notes: Annotated[str | None, typer.Option(help="With --new: free text")] = None,
    reuse: Reuse = False,
    confirm: Confirm = False,
    as_json: AsJson = False,
    url: Url = None,
) -> None:  # fmt: skip
    """List campaigns, or make one."""
    from modalbase.client.finding import CAMPAIGN, PROJECT, STRUCTURE, all_of, find, find_id

    if project is not None and structure is not None:
        raise ClientError("state --project or --structure: a structure is in one project", Exit.USAGE)
    with service_at(url) as service:
        if new is not None:
            if boundary is None:
                raise ClientError("--new needs --boundary: cantilever, free or simply_supported", Exit.USAGE)
            mass = None if sensor_mass is None else sensor_mass / 1000
            instruments = _stated(sensor_mass_kg=mass, sensor_point=sensor_point)
            given = {"name": new, "boundary": boundary, "instruments": instruments}
            given |= _stated(
                temperature_c=temperature, humidity_percent=humidity, performed_at=performed_at, notes=notes
            )
            made = make(service, CAMPAIGN, given, find_id(service, STRUCTURE, structure or "latest"), reuse, confirm)
            _made(made, as_json, f'import FILE.uff --campaign "{new}"')
            return
        among = None
        if structure is not None:
            among = find(service, STRUCTURE, structure)
            found = [{**one, "above": among} for one in service.pages(f"structures/{among['id']}/campaigns")]
        else:
            wanted = None if project is None else find(service, PROJECT, project)["id"]
            found = [one for one in all_of(service, CAMPAIGN) if wanted in (None, one["above"]["project_id"])]
    rows = [{**one, "structure_name": one["above"]["name"]} for one in found]
    columns = ("id", "structure_name", "name", "boundary", "performed_at", "temperature_c")
    heads = {"structure_name": "structure", "performed_at": "performed", "temperature_c": "°C"}
    _listed(_plain(rows), columns, as_json, heads)


def _above(service: Any, among: dict[str, Any] | None, kind: Any, all_of: Any) -> list[dict[str, Any]]:
    """Things of a kind, each with the one above it; of one of those alone where it is stated."""
    if among is None:
        return list(all_of(service, kind))
    return [{**one, "above": among} for one in service.pages(kind.below.format(among["id"]))]


def _plain(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{name: value for name, value in row.items() if name != "above"} for row in rows]


def _stated(**values: Any) -> dict[str, Any]:
    return {name: value for name, value in values.items() if value is not None}


def _made(thing: dict[str, Any], as_json: bool, following: str) -> None:
    """What was made: its id alone, or its JSON."""
    from modalbase.client.display import print_json

    if as_json:
        print_json(thing)
    else:
        typer.echo(thing["id"])
        say_next(following)


def _listed(
    found: list[dict[str, Any]], columns: tuple[str, ...], as_json: bool, heads: dict[str, str] | None = None
) -> None:
    from modalbase.client.display import print_json, print_table

    if as_json:
        print_json(found)
    else:
        shown = [(heads or {}).get(name, name) for name in columns]
        print_table("", shown, [[one[name] for name in columns] for one in found])


def _geometry(text: str) -> dict[str, float]:
    """Length, width and thickness in m of a text in mm."""
    parts = text.lower().replace("×", "x").split("x")
    try:
        length, width, thickness = (float(part) / 1000 for part in parts)
    except ValueError:
        raise ClientError(
            f"--size {text!r} is no length x width x thickness in mm, such as 500x40x10", Exit.USAGE
        ) from None
    return {"length_m": length, "width_m": width, "thickness_m": thickness}


def _material(text: str) -> dict[str, float]:
    """Moduli in Pa of a text in GPa."""
    found: dict[str, float] = {}
    for part in text.split(","):
        name, _, value = (piece.strip() for piece in part.partition("="))
        try:
            number = float(value)
        except ValueError:
            raise ClientError(f"--moduli: {part.strip()!r} is no constant in GPa, such as Ex=33", Exit.USAGE) from None
        if name != "nu_xy" and name not in MODULI:
            raise ClientError(f"--moduli: there is no {name!r}, there is {', '.join((*MODULI, 'nu_xy'))}", Exit.USAGE)
        found[name if name == "nu_xy" else f"{name}_Pa"] = number if name == "nu_xy" else number * 1e9
    return found
