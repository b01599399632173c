"""The report of an update: two pages for who ordered the test, the rest as annex for who checks
it.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from modalbase.client.display import Written, cell
from modalbase.client.results import correlation_cells, mode_cells, parameter_cells
from service.figures.marks import Figure, counted
from service.nouns.campaigns.climate import CLIMATE
from service.reports.blocks import (
    Block,
    Bullets,
    Heading,
    Letterhead,
    PageBreak,
    Paragraph,
    Picture,
    Report,
    Signatures,
    Table,
    Tone,
)

TONES: dict[str, Tone] = {"usable": "good", "with_care": "careful", "do_not_use": "bad"}
MOST_MODES = 12  # modes on the customer's pages; all of them are in the annex


@dataclass(frozen=True)
class UpdateFacts:
    """What the report of an update says."""

    document: Mapping[str, Any]  # the result
    project: str  # as REST shows them; the structure in the version that was updated
    structure: Mapping[str, Any]
    campaign: Mapping[str, Any]
    frfs: int  # how many FRFs were used
    letterhead: Letterhead | None = None  # who reports, where a setting says so


def update_report(
    facts: UpdateFacts, draw: Callable[[str], Sequence[Figure]], widths: Mapping[str, float]
) -> Report:
    """The report of an update.

    Args:
        facts: what it says.
        draw: gives a figure by name as one or more for a page each, none where the result has
            nothing to draw.
        widths: of the figures, by name in their order, as shares of the text's width; `frf` stands
            on the customer's pages, the others in the annex.
    """
    document = facts.document
    title = f"Updated model: {facts.structure['name']}"
    footer = (
        f"modalbase {document['provenance']['software']['modalbase']}, update job"
        f" {document['provenance']['update_job']}"
    )
    head = [] if facts.letterhead is None else [facts.letterhead]
    return Report(
        title,
        footer,
        [*head, *_first(title, facts), *_second(facts, draw), *_annex(document, draw, widths)],
    )


def _first(title: str, facts: UpdateFacts) -> list[Block]:
    """The verdict, what was tested, and the parameters."""
    document = facts.document
    verdict = document["verdict"]
    blocks: list[Block] = [
        Heading(title, 1),
        Paragraph(verdict["sentence"], TONES[verdict["level"]]),
    ]
    if verdict["reasons"]:
        blocks.append(Bullets(verdict["reasons"]))
    blocks += [Heading("Specimen and test"), _pairs(_specimen(facts))]
    columns, rows = parameter_cells(document["parameters"])
    blocks += [Heading("Parameters"), _table(columns, rows), Paragraph(_OF_INTERVALS, "small")]
    return [*blocks, *_budget(document["parameters"])]


_OF_INTERVALS = (
    "Intervals hold 95 % of what is known: measurement noise, the model's discrepancy, priors, and"
    " the errors of dimensions, mass, support and instruments. A parameter that is not identifiable"
    " is its prior, not a finding."
)


def _specimen(facts: UpdateFacts) -> list[tuple[str, str]]:
    structure, campaign, document = facts.structure, facts.campaign, facts.document
    place = [
        f"{campaign[name]:g} {one.shown}" for name, one in CLIMATE.items() if campaign.get(name) is not None
    ]  # fmt: skip
    band = document["band_hz"]
    rows = [
        ("project, test", f"{facts.project}, {campaign['name']}"),
        ("size", _size(structure)),
        ("section", _section(structure)),
        ("support", str(campaign["boundary"]).replace("_", " ")),
        (
            "tested",
            ", ".join(
                [str(campaign["performed_at"] or "date not stated")[:16].replace("T", " "), *place]
            ),
        ),
        ("instruments", _instruments(campaign["instruments"])),
        (
            "data",
            counted(facts.frfs, "FRF")
            + ("" if band is None else f", fitted from {band[0]:.4g} to {band[1]:.4g} Hz"),
        ),
        ("computed", str(document["provenance"]["computed_at"])[:16].replace("T", " ") + " UTC"),
    ]
    return [row for row in rows if row[1]]


def _size(structure: Mapping[str, Any]) -> str:
    if structure["model"] is not None:
        return ""
    body = structure["geometry"] or structure["shape"]
    last = "thickness" if structure["geometry"] else "height"
    size = " × ".join(
        f"{1e3 * body[f'{name}_m']:.5g}" for name in ("length", "width", last) if body[f"{name}_m"]
    )
    named = " × ".join(name for name in ("length", "width", last) if body[f"{name}_m"])
    density = structure["density_kg_m3"]
    return f"{size} mm ({named})" + ("" if density is None else f", {density:g} kg/m³")


def _section(structure: Mapping[str, Any]) -> str:
    if structure["model"] is not None:
        sets = ", ".join(_set(each) for each in structure["model"]["sets"])
        return f"model {structure['model']['filename']}" + (f": {sets}" if sets else ", matrices")
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


def _instruments(given: Mapping[str, Any]) -> str:
    parts = []
    for name in ("hammer", "sensor", "analyser"):
        if details := given.get(name):
            parts.append(f"{name} {' '.join(str(value) for value in details.values())}")
    if given.get("sensor_mass_kg"):
        parts.append(f"sensor of {1e3 * given['sensor_mass_kg']:g} g")
    return "; ".join(parts)


def _budget(parameters: Sequence[Mapping[str, Any]]) -> list[Block]:
    """The largest sources of each parameter's variance, in words."""
    rows = []
    for row in parameters:
        if row["budget"]:
            largest = sorted(row["budget"], key=lambda entry: -entry["share"])[:3]
            named = [
                f"{entry['source'].replace('_', ' ')} {100 * entry['share']:.0f} %"
                for entry in largest
            ]
            rows.append([row["name"], ", ".join(named)])
    return (
        [Table(["parameter", "largest parts of its variance"], rows, [False, False])]
        if rows
        else []
    )


def _second(facts: UpdateFacts, draw: Callable[[str], Sequence[Figure]]) -> list[Block]:
    """Modes, correlation, one FRF, signatures."""
    document = facts.document
    columns, rows = mode_cells(document["modes"])
    blocks: list[Block] = [PageBreak(), Heading("Modes"), _table(columns, rows[:MOST_MODES])]
    if len(rows) > MOST_MODES:
        blocks.append(Paragraph(f"The annex lists all {len(rows)} modes.", "small"))
    columns, rows = correlation_cells(document["correlation"])
    if rows:
        blocks += [
            Heading("Correlation of measured and predicted FRFs, means"),
            _table(columns, rows),
        ]
    blocks += [Picture(figure, 0.86) for figure in draw("frf")] or [
        Paragraph(_without_frf(document))
    ]
    return [*blocks, Signatures(("tested by", "checked by", "released by"))]


def _without_frf(document: Mapping[str, Any]) -> str:
    why = next(
        (o["message"] for o in document["outcomes"] if o["stage"] == "damping" and o["message"]), ""
    )
    return "No FRF is predicted, as the damping was not fitted" + (f": {why}." if why else ".")


def _annex(
    document: Mapping[str, Any],
    draw: Callable[[str], Sequence[Figure]],
    widths: Mapping[str, float],
) -> list[Block]:
    blocks: list[Block] = [PageBreak(), Heading("Annex", 1)]
    if document["warnings"]:
        blocks += [Heading("Warnings"), Bullets(document["warnings"])]
    if len(document["modes"]) > MOST_MODES:
        blocks += [Heading("All modes"), _table(*mode_cells(document["modes"]))]
    blocks.append(Heading("Figures"))
    blocks += [
        Picture(figure, width)
        for name, width in widths.items()
        if name != "frf"
        for figure in draw(name)
    ]
    provenance = document["provenance"]
    recipe = json.dumps(provenance["recipe"], ensure_ascii=False, indent=1, sort_keys=True)
    blocks += [
        Heading("Recipe"),
        Paragraph(recipe, "code"),
        Heading("Origin"),
        _pairs(_origin(provenance)),
    ]
    hashes = [[frf["id"], _content(frf)] for frf in provenance["frfs"]]
    if hashes:
        blocks += [
            Heading("FRFs and their SHA-256"),
            Table(["FRF", "SHA-256 of its values"], hashes, [False, False]),
        ]
    return blocks


def _content(frf: Mapping[str, Any]) -> str:
    """What says that an FRF is the one that was used: its digest, or of one that the update made
    itself its time blocks.
    """
    return (
        frf.get("sha256") or f"made by this update of {counted(len(frf['records']), 'time block')}"
    )


def _origin(provenance: Mapping[str, Any]) -> list[tuple[str, str]]:
    software = ", ".join(f"{name} {version}" for name, version in provenance["software"].items())
    durations = ", ".join(
        f"{name} {seconds:.2f} s" for name, seconds in provenance["durations_s"].items()
    )
    return [
        ("update job", provenance["update_job"]),
        ("campaign", provenance["campaign"]),
        ("structure's version", provenance["structure_version"]),
        ("mode set", provenance["mode_set"] or "none"),
        ("software", software),
        ("host", provenance["host"]),
        ("durations", durations),
    ]


def _pairs(rows: Sequence[tuple[str, str]]) -> Table:
    return Table([], rows, [False, False])


def _table(columns: Sequence[str], rows: Sequence[Sequence[Any]]) -> Table:
    numeric = [
        bool(rows) and all(isinstance(row[k], int | float | Written | None) for row in rows)
        for k in range(len(columns))
    ]
    return Table(columns, [[cell(value) for value in row] for row in rows], numeric)
