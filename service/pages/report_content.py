"""What the report of an update says, in the words of the result's page; `report.typ` says how it
looks.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from modalbase.client.display import Written, cell
from modalbase.client.results import correlation_cells, mode_cells
from service.figures.marks import Figure, counted
from service.nouns.campaigns.climate import CLIMATE
from service.nouns.updates.schemas import RecipeIn
from service.pages.findings import agreement, bar, opening
from service.pages.forms import page_words
from service.pages.numbers import in_unit, leaves, moment, spread, unit_of, words
from service.reports.figures import FIGURES

MOST_FIGURES = 4  # numbers below the verdict
MOST_MODES = 12  # on the first pages; the annex lists all of them
ON_FIRST_PAGES = {"frf": "frfs", "bodies": "bodies"}
"""Figures that have a place of their own; the others are in the annex."""
WIDTHS = {"frf": 0.8, "bodies": 1.0}  # of these, as shares of the text's
OF_PARAMETERS = (
    "Parameter", "Unit", "Initial", "Prior ± sd", "Estimate ± sd", "95 % interval", "Prior and estimate", "From",
)  # fmt: skip
OF_MODES = (
    "Mode", "Shape", "Measured [Hz]", "Before [Hz]", "After [Hz]", "Error [%]", "MAC", "ζ measured [%]", "ζ of the law [%]",
)  # fmt: skip
ROLES = ("tested by, date", "checked by, date", "released by, date")
INTERVALS = (
    "Orange: prior, 95 %, and the initial value. Blue: estimate, 95 %; grey where the prior decides it. Intervals hold 95 %"
    " of what is known: measurement noise, the model's discrepancy, priors, and the errors of dimensions, mass, support"
    " and instruments."
)

Cells = Sequence[Sequence[Any]]


def content_of(
    document: Mapping[str, Any],
    structure: Mapping[str, Any],
    campaign: Mapping[str, Any],
    project: str,
    sheets: Mapping[str, Sequence[Figure]],
) -> dict[str, Any]:
    """What the report says, for `report.typ`.

    Args:
        document: the result.
        structure: as REST shows it, in the version that was updated, with its model in short.
        campaign: as REST shows it.
        project: its name.
        sheets: the figures by name, each as one or more; none where there is nothing to draw.
    """
    verdict, version = document["verdict"], document["provenance"]["software"]["modalbase"]
    steps, notes = opening(document)
    level = words(verdict["level"])
    pictures: dict[str, list[dict[str, Any]]] = {"frfs": [], "bodies": [], "annex": []}
    for name, each in sheets.items():
        place = ON_FIRST_PAGES.get(name, "annex")
        for k, figure in enumerate(each):
            width = WIDTHS.get(name) or FIGURES[name].width
            shown = {"title": figure.title, "width": width}
            pictures[place].append({"file": f"{name}-{k}.svg", **shown})
    modes = mode_cells(document["modes"])[1]
    criteria = correlation_cells(document["correlation"])
    return {
        "title": structure["name"],
        "subtitle": f"{campaign['name']}, project {project}",
        "kind": "Report of a model update",
        "author": f"modalbase {version}",
        "foot": f"{structure['name']}, {campaign['name']} · modalbase {version}",
        "at": document["provenance"]["computed_at"],
        "verdict": {
            "level": verdict["level"],
            "word": level[:1].upper() + level[1:],
            "sentence": page_words(verdict["sentence"]),
        },
        "figures": [
            {"name": name, "value": f"{before} → {after}" if before else after}
            for name, before, after in agreement(document)[:MOST_FIGURES]
        ],
        "facts": _pairs(_facts(document, structure, campaign)),
        "parameters": _sheet(
            OF_PARAMETERS, list(map(_parameter, document["parameters"])), "  nnnn  "
        ),
        "intervals": INTERVALS,
        "modes": _sheet(OF_MODES, modes[:MOST_MODES], "n nnnnnnn"),
        "more_modes": f"The annex lists all {len(modes)} modes." if len(modes) > MOST_MODES else "",
        "criteria": _sheet(["Mean over the FRFs", *criteria[0][1:]], criteria[1]),
        **pictures,
        "without_frf": "" if pictures["frfs"] else _without_frf(document),
        "findings": [{"text": s.text, "level": s.level, "advice": s.advice} for s in steps],
        "notes": notes,
        "roles": ROLES,
        "tables": list(_tables(document, modes)),
    }


def _parameter(row: Mapping[str, Any]) -> list[Any]:
    unit, sd = row["unit"], row["standard_deviation"]

    def shown(value: float | None) -> str:
        return in_unit(value, unit, sd)

    prior = "–"
    if row["prior_sd"]:
        prior = " ± ".join(
            in_unit(row[f"prior_{of}"], unit, row["prior_sd"]) for of in ("mean", "sd")
        )
    drawn = bar(row)
    low, high = row["interval_95"] or (None, None)
    return [
        row["name"], unit_of(unit), shown(row["initial"]), prior, f"{shown(row['estimate'])} {spread(row)}",
        f"{shown(low)} … {shown(high)}",
        "" if drawn is None else {**vars(drawn), "sure": bool(row["identifiable"])},
        f"as {row['tied_to']}" if row.get("tied_to") else "data" if row["identifiable"] else "prior",
    ]  # fmt: skip


def _facts(
    document: Mapping[str, Any], structure: Mapping[str, Any], campaign: Mapping[str, Any]
) -> Iterator[tuple[str, str]]:
    """What was tested, how, and when."""
    climate = [
        f"{campaign[name]:g} {one.shown}" for name, one in CLIMATE.items() if campaign.get(name) is not None
    ]  # fmt: skip
    frfs, band = len(document["provenance"]["frfs"]), document["band_hz"]
    fitted = "" if band is None else f", fitted from {band[0]:.4g} to {band[1]:.4g} Hz"
    yield "Size", _size(structure)
    yield "Section", _section(structure)
    yield "Support", words(campaign["boundary"])
    performed = campaign["performed_at"]
    yield "Tested", ", ".join([moment(performed) if performed else "date not stated", *climate])
    yield "Instruments", _instruments(campaign["instruments"])
    yield "Data", counted(frfs, "FRF") + fitted
    yield "Computed", f"{moment(document['provenance']['computed_at'])} UTC"


def _size(structure: Mapping[str, Any]) -> str:
    if structure["model"] is not None:
        return ""
    body = structure["geometry"] or structure["shape"]
    names = ("length", "width", "thickness" if structure["geometry"] else "height")
    there = [name for name in names if body[f"{name}_m"]]
    size = " × ".join(f"{1e3 * body[f'{name}_m']:.5g}" for name in there)
    density = structure["density_kg_m3"]
    dense = "" if density is None else f", {density:g} kg/m³"
    return f"{size} mm ({' × '.join(there)}){dense}"


def _section(structure: Mapping[str, Any]) -> str:
    if (model := structure["model"]) is not None:
        sets = ", ".join(_set(each) for each in model["sets"])
        return f"model {model['filename']}" + (f": {sets}" if sets else ", matrices")
    if (shape := structure["shape"]) is not None:
        walls = (f"{name} {_wall(wall)}" for name, wall in shape["walls"].items())
        return f"{shape['kind']}: {', '.join(walls)}"
    if (laminate := structure["laminate"]) is not None:
        angles = [f"{ply['angle_deg']:g}" for ply in laminate["plies"]]
        shown = "/".join(angles[:16]) + ("/…" if len(angles) > 16 else "")
        return f"laminate of {counted(len(angles), 'ply', 'plies')} [{shown}]"
    return "equivalent orthotropic plate"


def _set(group: Mapping[str, Any]) -> str:
    thickness = group.get("thickness_m")
    return f"{group['name']}" if thickness is None else f"{group['name']} {1e3 * thickness:.4g} mm"


def _wall(wall: Mapping[str, Any]) -> str:
    if wall["plies"]:
        return f"of {counted(len(wall['plies']), 'ply', 'plies')}"
    return f"{1e3 * wall['thickness_m']:.4g} mm"


def _instruments(stated: Mapping[str, Any]) -> str:
    parts = [
        f"{name} {' '.join(str(value) for value in details.values())}"
        for name in ("hammer", "sensor", "analyser")
        if (details := stated.get(name))
    ]
    if mass := stated.get("sensor_mass_kg"):
        parts.append(f"sensor of {1e3 * mass:g} g")
    return "; ".join(parts)


def _without_frf(document: Mapping[str, Any]) -> str:
    why = next(
        (o["message"] for o in document["outcomes"] if o["stage"] == "damping" and o["message"]), ""
    )
    return "No FRF is predicted, as the damping was not fitted" + (
        f": {page_words(why)}." if why else "."
    )


def _tables(document: Mapping[str, Any], modes: Cells) -> Iterator[dict[str, Any]]:
    """The tables of the annex."""
    provenance = document["provenance"]
    if len(modes) > MOST_MODES:
        yield {"title": "All modes", **_sheet(OF_MODES, modes, "n nnnnnnn")}
    usual = RecipeIn.model_validate({}).model_dump(mode="json")
    stated = {key: value for key, value in provenance["recipe"].items() if value != usual.get(key)}
    recipe = [(name, value) for name, value in leaves(stated) if value not in ("", "–")]
    yield {"title": "Recipe", **_pairs(recipe or [("all members", "the defaults")])}
    durations = ", ".join(f"{name} {t:.2f} s" for name, t in provenance["durations_s"].items())
    origin = {
        "Update job": provenance["update_job"],
        "Campaign": provenance["campaign"],
        "Structure's version": provenance["structure_version"],
        "Mode set": provenance["mode_set"] or "identified by the update",
        "Software": ", ".join(f"{name} {at}" for name, at in provenance["software"].items()),
        "Host": provenance["host"],
        "Durations": durations,
    }
    yield {"title": "Origin", **_pairs(origin.items())}
    frfs = [[frf["id"], _digest(frf)] for frf in provenance["frfs"]]
    if frfs:
        yield {"title": "FRFs", **_sheet(("FRF", "SHA-256 of its values"), frfs), "mono": True}


def _digest(frf: Mapping[str, Any]) -> str:
    """What says that an FRF is the one that was used: its digest, or of one that the update made
    itself its time blocks.
    """
    return (
        frf.get("sha256") or f"made by this update of {counted(len(frf['records']), 'time block')}"
    )


def _pairs(rows: Any) -> dict[str, Any]:
    return _sheet((), [list(row) for row in rows if row[1]], "  ")


def _sheet(columns: Sequence[str], rows: Cells, right: str = "") -> dict[str, Any]:
    """A table; columns with an `n` in `right` are numbers, without it those that have nothing else."""
    numbers = [mark == "n" for mark in right] or [
        all(isinstance(row[k], int | float | Written | None) for row in rows)
        for k in range(len(columns))
    ]
    return {
        "columns": list(columns),
        "right": numbers,
        "rows": [
            [_cell(value, number=n) for value, n in zip(row, numbers, strict=True)] for row in rows
        ],
        "mono": False,
    }


def _cell(value: Any, *, number: bool) -> Any:
    """As a table of the terminal has it, with the minus of print."""
    if isinstance(value, Mapping):
        return value
    return cell(value).replace("-", "−") if number else cell(value)
