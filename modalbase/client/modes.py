"""`modalbase modes`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from modalbase.client.errors import ClientError, Exit
from modalbase.client.options import AsJson, Campaign, Url, say_next, service_at

if TYPE_CHECKING:
    from modalbase.client.connection import Connection


def modes(
    campaign: Campaign = "latest",
    identify: Annotated[
        bool, typer.Option("--identify", help="Find modes in the FRFs first, and wait for them")
    ] = False,
    band: Annotated[str | None, typer.Option(help="With --identify: Hz, such as 10-900")] = None,
    mode_set: Annotated[str, typer.Option(help="Which modes: id, name or latest")] = "latest",
    as_json: AsJson = False,
    url: Url = None,
) -> None:
    """Show the modes of a campaign: typed in, read from a file, or identified; with what the identification doubts."""
    from modalbase.client.display import print_json, print_table
    from modalbase.client.finding import CAMPAIGN, MODE_SET, find, find_id
    from modalbase.client.mode_tables import beside_lines, mode_set_cells

    with service_at(url) as service:
        id_ = find_id(service, CAMPAIGN, campaign)
        found = _identified(service, id_, band) if identify else find(service, MODE_SET, mode_set, within=id_)
    if as_json:
        print_json(found)
        return
    print_table(f"{found['name']} ({found['origin']}), {found['id']}", *mode_set_cells(found["modes"]))
    for line in beside_lines(found["details"]):
        typer.echo(line, err=True)
    say_next(f'update "{campaign}" --mode-set {found["id"]} --wait')


def _identified(service: Connection, campaign: str, band: str | None) -> dict[str, Any]:
    from modalbase.client.jobs import require_success, wait_for

    options = {} if band is None else {"band_hz": _band(band)}
    job = service.post(f"campaigns/{campaign}/identifications", options)
    ended = wait_for(service, f"identifications/{job['id']}", "identification")
    require_success(ended, f"identification {job['id']}")
    found: dict[str, Any] = service.get(f"mode-sets/{ended['mode_set']}")
    return found


def _band(text: str) -> list[float]:
    try:
        low, high = (float(part) for part in text.split("-"))
    except ValueError:
        raise ClientError(f"--band {text!r} is no band in Hz, such as 10-900", Exit.USAGE) from None
    return [low, high]
