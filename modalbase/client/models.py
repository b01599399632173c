"""`modalbase model`: an engineer's deck as a structure."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from modalbase.client.display import print_json, print_table
from modalbase.client.files import send_file
from modalbase.client.finding import STRUCTURE, find_id
from modalbase.client.jobs import require_success, wait_for
from modalbase.client.options import AsJson, Confirm, OfStructure, Url, json_file, say_next, service_at


def model(
    file: Annotated[
        Path | None,
        typer.Argument(
            help="Deck of Abaqus, CalculiX (.inp) or Nastran (.bdf); matrices; a mesh", exists=True, dir_okay=False
        ),
    ] = None,
    structure: OfStructure = None,
    units: Annotated[
        str | None, typer.Option(help="That its numbers are in: m-N-kg, mm-N-t, in-lbf-slinch and the like")
    ] = None,
    accept: Annotated[
        list[str] | None, typer.Option(help="Name of a card that may be left out although modes change by that")
    ] = None,
    sections: Annotated[
        Path | None, typer.Option(help="JSON of what each set of a mesh is", exists=True, dir_okay=False)
    ] = None,
    confirm: Confirm = False,
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Send a deck, which the structure then is; or show the model that a structure is."""
    with service_at(url) as service:
        address = f"structures/{find_id(service, STRUCTURE, structure or 'latest')}/model"
        if file is None:
            found = service.get(address)
        else:
            stated = None if sections is None else json_file(sections)
            said: dict[str, Any] = {"units": units, "accept": accept or [], "confirm": confirm or None}
            sent = send_file(service, address, file, sections=stated, **said)
            found = wait_for(service, f"models/{sent['id']}", "model")
            require_success(found, f"model {sent['id']}")
    if as_json:
        print_json(found)
        return
    _show(found)
    say_next("campaigns --new NAME --boundary free")


def _show(found: dict[str, Any]) -> None:
    """Sets, junctions and what was not used."""
    read = found["found"]
    rows = [[s["name"], s["elements"], ", ".join(s["materials"]), s["thickness_m"], s["mass_kg"]] for s in read["sets"]]
    title = f"{found['filename']}: {read['counts']['nodes']} nodes, {read['mass_kg']:.4g} kg, {found['units']}"
    print_table(title, ("set", "elements", "materials", "thickness m", "mass kg"), rows)
    for line in read["junctions"]:
        walls = ", ".join(f"{wall['set']} {1e3 * wall['thickness_m']:.3g} mm" for wall in line["walls"])
        typer.echo(f"junction of {1e3 * line['length_m']:.4g} mm: {walls}")
    for card in read["ignored"]:
        typer.echo(f"not used: {card['card']} (line {card['lines'][0]}): {card['loss']}")
