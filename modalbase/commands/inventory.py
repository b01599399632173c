"""`modalbase projects`, `structures`, `model`, `campaigns` and `coupons`: list what there is, make
one, send a deck.
"""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Mapping
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any

import typer

from modalbase import objects
from modalbase.client.display import Written, print_json, print_table, with_digits
from modalbase.client.errors import ClientError, Exit
from modalbase.commands.options import (
    NAMED,
    AsJson,
    Confirm,
    OfProject,
    OfStructure,
    Reuse,
    Url,
    json_file,
    laboratory_at,
    names_of,
    say_next,
    show,
)
from modalbase.objects.finding import BATCH


def with_climate(command: Callable[..., None]) -> Callable[..., None]:
    """A command with an option for each condition of a campaign, in the place of its `**climate`:
    `--temperature` for `temperature_c`, by its label.
    """
    text = files("modalbase.client").joinpath("fields.json").read_text(encoding="utf-8")
    signature = inspect.signature(command, eval_str=True)
    *own, _ = signature.parameters.values()
    place = 1 + list(signature.parameters).index("boundary")
    options = [
        inspect.Parameter(
            name,
            inspect.Parameter.POSITIONAL_OR_KEYWORD,
            default=None,
            annotation=Annotated[
                float | None,
                typer.Option(
                    f"--{one['label'].lower().replace(' ', '-')}",
                    help=f"With --new: {one['meaning']}, {one['unit']}",
                ),
            ],
        )
        for name, one in json.loads(text)["climate"].items()
    ]
    command.__signature__ = signature.replace(  # type: ignore[attr-defined]
        parameters=[*own[:place], *options, *own[place:]]
    )
    return command


MODULI = ("Ex", "Ey", "Gxy", "Gxz", "Gyz")
"""Stated in GPa; nu_xy has no unit."""


def projects(
    new: Annotated[
        str | None, typer.Option(help="Make a project of this name, and print its id")
    ] = None,
    reuse: Reuse = False,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """List projects, or make one."""
    with laboratory_at(url) as lab:
        if new is not None:
            made = lab.project(new, create=True) if reuse else lab.new_project(new, again=True)
            _made(made, as_json, f'structures --new NAME --project "{new}" …')
            return
        rows = [one.fields for one in lab.projects()]
    columns = {"id": "id", "name": "name", "description": "description", "made": "created_at"}
    show(rows, columns, as_json)
    if not rows and not as_json:
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
    with laboratory_at(url) as lab:
        if new is not None:
            given = {} if body is None else json_file(body)
            given |= {} if density is None else {"density_kg_m3": density}
            given |= {} if size is None else {"geometry": _geometry(size)}
            given |= {} if moduli is None else {"material": _material(moduli)}
            within = lab.named(objects.Project, project or "latest")
            make = partial(within.structure, create=True) if reuse else within.new_structure
            made = make(new, confirm=confirm, body=given)
            _made(made, as_json, f'campaigns --new NAME --structure "{new}" --boundary cantilever')
            return
        rows = [
            {**one.fields, "project_name": above.name} for above, one in _structures(lab, project)
        ]
    named = {"id": "id", "project": "project_name", "name": "name", "version": "version"}
    show(rows, {**named, "made": "created_at"}, as_json)


@with_climate
def campaigns(
    project: OfProject = None,
    structure: OfStructure = None,
    new: Annotated[str | None, typer.Option(help="Make a campaign of this name, and print its id")] = None,
    boundary: Annotated[str | None, typer.Option(help="With --new: cantilever, free or simply_supported")] = None,
    sensor_mass: Annotated[float | None, typer.Option(help="With --new: mass of the accelerometer, g")] = None,
    sensor_point: Annotated[int | None, typer.Option(help="With --new: grid point where it stays")] = None,
    performed_at: Annotated[str | None, typer.Option(help="With --new: when, such as 2026-03-02T09:30:00Z")] = None,
    notes: Annotated[str | None, typer.Option(help="With --new: free text")] = None,
    reuse: Reuse = False,
    confirm: Confirm = False,
    as_json: AsJson = False,
    url: Url = None,
    **climate: float | None,
) -> None:  # fmt: skip
    """List campaigns, or make one."""
    if project is not None and structure is not None:
        raise ClientError(
            "state --project or --structure: a structure is in one project", Exit.USAGE
        )
    with laboratory_at(url) as lab:
        if new is not None:
            if boundary is None:
                raise ClientError(
                    "--new needs --boundary: cantilever, free or simply_supported", Exit.USAGE
                )
            stated: dict[str, Any] = {
                "boundary": boundary,
                "sensor_mass_kg": None if sensor_mass is None else sensor_mass / 1000,
                "sensor_point": sensor_point,
                **climate,
                "performed_at": performed_at,
                "notes": notes,
            }
            given = {name: value for name, value in stated.items() if value is not None}
            within = lab.named(objects.Structure, structure or "latest")
            make = partial(within.campaign, create=True) if reuse else within.new_campaign
            made = make(new, confirm=confirm, **given)
            _made(made, as_json, f'import FILE.uff --campaign "{new}"')
            return
        bodies = (
            [one for _, one in _structures(lab, project)]
            if structure is None
            else [lab.structure(structure)]
        )
        pairs = [(above, one) for above in bodies for one in above.campaigns()]
        rows = [{**one.fields, "structure_name": above.name} for above, one in pairs]
    columns = {
        "id": "id", "structure": "structure_name", "name": "name", "boundary": "boundary", "performed": "performed_at",
        "°C": "temperature_c",
    }  # fmt: skip
    show(rows, columns, as_json)


def _structures(
    lab: objects.Laboratory, project: str | None
) -> list[tuple[objects.Project, objects.Structure]]:
    """The structures of all projects or of one, each with its project."""
    projects = lab.projects() if project is None else [lab.project(project)]
    return [(above, one) for above in projects for one in above.structures()]


def _made(thing: objects.Thing, as_json: bool, following: str) -> None:
    """What was made: its id alone, or its JSON."""
    if as_json:
        print_json(thing.fields)
    else:
        typer.echo(thing.id)
        say_next(following)


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
    constants: dict[str, float] = {}
    for part in text.split(","):
        name, _, value = (piece.strip() for piece in part.partition("="))
        try:
            number = float(value)
        except ValueError:
            raise ClientError(
                f"--moduli: {part.strip()!r} is no constant in GPa, such as Ex=33", Exit.USAGE
            ) from None
        if name != "nu_xy" and name not in MODULI:
            raise ClientError(
                f"--moduli: there is no {name!r}, there is {', '.join((*MODULI, 'nu_xy'))}",
                Exit.USAGE,
            )
        constants[name if name == "nu_xy" else f"{name}_Pa"] = (
            number if name == "nu_xy" else number * 1e9
        )
    return constants


def coupons(
    batch: Annotated[str, typer.Argument(help=f"Coupon batch: {NAMED}", autocompletion=names_of(BATCH))],
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
    """Show a batch with its statistics; add specimens from testing machines' files, each named as
    its file.
    """
    if files and about is None:
        raise ClientError(
            "state with --about what the files hold: dimensions, columns and their units",
            Exit.USAGE,
        )
    known = {} if about is None else json_file(about)
    specimens = known.pop("specimens", {})
    if not (
        isinstance(specimens, dict) and all(isinstance(more, dict) for more in specimens.values())
    ):
        raise ClientError(
            f'{about}: specimens is no object such as {{"A3": {{"excluded": true}}}}', Exit.USAGE
        )
    with laboratory_at(url) as lab:
        into = _batch(lab, batch, new, constants, reuse)
        for file in files or []:
            coupon = {**known, **specimens.get(file.stem, {})}
            try:
                into.add_curve(file, confirm=confirm, body=coupon)
            except ClientError as error:
                raise ClientError(f"{file}: {error}", error.code) from error
        listed, summary = into.coupons().rows, into.summary()
    if as_json:
        print_json({"coupons": listed, "summary": summary})
        return
    print_table(f"{len(listed)} specimens", list(COLUMNS), [_cells(coupon) for coupon in listed])
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


def _cells(coupon: Mapping[str, Any]) -> list[Any]:
    values = [(coupon[name], factor) for name, factor in COLUMNS.values()]
    return [
        v if v is None or factor is None else Written(f"{v * factor:.4g}") for v, factor in values
    ]


def _statistics(of: dict[str, Any]) -> list[Any]:
    """Number, mean, standard deviation, coefficient of variation, unit and origin of a constant."""
    factor, unit = (1e-9, "GPa") if of["unit"] == "Pa" else (1.0, "–")
    mean, sd = (
        None if of[name] is None else factor * of[name] for name in ("mean", "standard_deviation")
    )
    share = None if of["cv_percent"] is None else Written(f"{of['cv_percent']:.2g}")
    return [of["n"], *with_digits(mean, sd), share, unit, of["source"]]


def _batch(
    lab: objects.Laboratory, batch: str, structure: str | None, constants: str, reuse: bool
) -> objects.CouponBatch:
    """The batch, which is made where a structure is stated."""
    if structure is None:
        return lab.named(objects.CouponBatch, batch)
    measured, within = constants.split(","), lab.named(objects.Structure, structure)
    if reuse:
        return within.coupon_batch(batch, create=True, constants=measured)
    return within.new_coupon_batch(batch, measured)


def model(
    file: Annotated[
        Path | None,
        typer.Argument(
            help="Deck of Abaqus, CalculiX (.inp) or Nastran (.bdf); matrices; a mesh",
            exists=True,
            dir_okay=False,
        ),
    ] = None,
    structure: OfStructure = None,
    units: Annotated[
        str | None,
        typer.Option(help="That its numbers are in: m-N-kg, mm-N-t, in-lbf-slinch and the like"),
    ] = None,
    accept: Annotated[
        list[str] | None,
        typer.Option(
            help="A card that may be left out, or an unusual value that is meant so: density:GAUGE"
        ),
    ] = None,
    sections: Annotated[
        Path | None,
        typer.Option(help="JSON of what each set of a mesh is", exists=True, dir_okay=False),
    ] = None,
    confirm: Confirm = False,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Send a deck, which the structure then is; or show the model that a structure is."""
    with laboratory_at(url) as lab:
        of = lab.named(objects.Structure, structure or "latest")
        if file is None:
            sent = of.sent_model()
        else:
            stated = None if sections is None else json_file(sections)
            sent = of.import_model(
                file, units, accept=accept or (), sections=stated, confirm=confirm, wait=False
            )
            sent.wait().check()
    if as_json:
        print_json(sent.fields)
        return
    _show(sent)
    say_next("campaigns --new NAME --boundary free")


def _show(model: objects.Model) -> None:
    """Sets, junctions and what was not used."""
    read = model.fields["found"]
    rows = [
        [s["name"], s["elements"], ", ".join(s["materials"]), s["thickness_m"], s["mass_kg"]]
        for s in read["sets"]
    ]
    title = (
        f"{model.filename}: {read['counts']['nodes']} nodes, {read['mass_kg']:.4g} kg,"
        f" {model.units}"
    )
    print_table(title, ("set", "elements", "materials", "thickness m", "mass kg"), rows)
    for line in read["junctions"]:
        walls = ", ".join(
            f"{wall['set']} {1e3 * wall['thickness_m']:.3g} mm" for wall in line["walls"]
        )
        typer.echo(f"junction of {1e3 * line['length_m']:.4g} mm: {walls}")
    for card in read["ignored"]:
        typer.echo(f"not used: {card['card']} (line {card['lines'][0]}): {card['loss']}")
