"""What was typed into the fields of a page: read here, so that what a page shows as understood is
what it sends.

A field says in which unit it is and in which REST has it; `attributes` writes that from its label
and its name.
"""

import re
from typing import Annotated, Any, Literal

from fastapi import Body
from markupsafe import Markup, escape

from service.nouns.campaigns.climate import ENDINGS
from service.nouns.monitors.runs import unit_of
from service.platform.access import CurrentUser
from service.platform.errors import Fault, Invalid
from service.platform.web import StrictModel, typed
from service.platform.web.quantities import UNITS
from service.platform.web.routing import UI, page_router

router = page_router(UI)
SENT = {**ENDINGS, **UNITS, "_days": "days"}
"""Unit in which REST has a member, by the end of its name."""
LONGEST = 1_000_000  # characters of a table of points
_NUMBER = re.compile(r"\s*[+−-]?[.,]?[0-9]")


class Typed(StrictModel):
    """A text and the field that it stands in."""

    text: Annotated[str, Body(max_length=LONGEST)]
    kind: Literal["number", "whole", "numbers", "array", "points"]
    unit: Annotated[str, Body(max_length=20)] = ""  # of a number without one
    to: Annotated[str, Body(max_length=20)] = ""  # that REST has
    # parameter whose value it is, which has the units
    of: Annotated[str, Body(max_length=200)] | None = None


@router.post("/quantities")
def read_typed(
    entries: Annotated[list[Typed], Body(max_length=5000)], _user: CurrentUser
) -> list[dict[str, Any]]:
    """Of each text its `value`, as REST takes it, with `words` for the page; or the `fault` in
    it, and the `readings` of what could be two numbers, unusual ones left out.
    """
    return [_read(one, place) for place, one in enumerate(entries)]


def _read(entry: Typed, place: int) -> dict[str, Any]:
    if entry.of == "":
        return {"fault": "name the parameter first: the value is in its unit"}
    unit, to = (entry.unit, entry.to) if entry.of is None else units_of_parameter(entry.of)
    if not typed.are_alike(unit, to):
        raise Invalid([Fault(f"/{place}/unit", f"{unit!r} is no unit of what is {to!r}")])
    try:
        match entry.kind:
            case "whole":
                whole = typed.read_whole(entry.text)
                return {"value": whole, "words": str(whole)}
            case "points":
                points = typed.read_points(entry.text)
                return {"value": points, "words": f"{len(points)} points"}
            case "array" if not _NUMBER.match(entry.text):
                return {"value": {"variable": entry.text.strip()}, "words": ""}
            case "number":
                value = typed.read(entry.text, unit, to)
                return {"value": value, "words": typed.in_words(value, unit, to)}
        values = typed.read_numbers(entry.text, unit, to)
        words = "; ".join(typed.in_words(value, unit, to) for value in values)
        return {
            "value": values[0] if entry.kind == "array" and len(values) == 1 else values,
            "words": words,
        }
    except typed.AmbiguousError as error:
        readings = error.usual(unit, to) if entry.kind == "number" else []
        return {"fault": str(error), "readings": readings}
    except typed.UnreadableError as error:
        return {"fault": str(error)}


def units_of_parameter(name: str) -> tuple[str, str]:
    """Unit in which people write a parameter of a recipe, and the SI unit.

    >>> units_of_parameter("web.G12"), units_of_parameter("angle_1"), units_of_parameter("nu_xy")
    (('GPa', 'Pa'), ('rad', 'rad'), ('', ''))
    """
    unit = unit_of(name) or ""
    unit = "" if unit == "1" else unit
    return typed.SHOWN_AS.get(unit, unit), unit


def attributes(name: str, label: str, kind: str = "number") -> Markup:
    """The attributes of the field of a quantity: its unit is in brackets in its label, that of REST
    at the end of its name.
    """
    unit, to = units_of_field(name, label)
    scale = 1.0 if "°C" in (unit, to) else typed.size_of(unit, to)
    data = f' data-unit="{escape(unit)}"' if unit else ""
    data += f' data-to="{escape(to)}"' if to else ""
    data += f' data-scale="{scale!r}"' if scale != 1 else ""
    mode = "numeric" if kind == "whole" else "text" if kind in ("numbers", "points") else "decimal"
    return Markup(f'type="text" inputmode="{mode}" autocomplete="off" data-quantity="{kind}"{data}')


def units_of_field(name: str, label: str) -> tuple[str, str]:
    """The unit of a field and that of REST.

    >>> units_of_field("geometry/length_m", "Length [mm]"), units_of_field("frame/origin_m/0", "Origin, x [mm]")
    (('mm', 'm'), ('mm', 'm'))
    """
    member = re.sub(r"/\d+$", "", name)
    to = next((unit for ending, unit in SENT.items() if member.endswith(ending)), "")
    stated = re.search(r"\[(.+?)\]", label)
    unit = stated[1] if stated else to
    return (unit if typed.are_alike(unit, to) else to), to
