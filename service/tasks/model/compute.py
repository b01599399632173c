"""Reading a user's model in the child process: what is in it, in SI, and the arrays that are kept
of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.structure import Structure
from modalbase.formats.models.check import mean_thickness, sizes
from modalbase.formats.models.model import BeamSection, FiniteElementModel, ShellSection, Where
from modalbase.formats.models.questions import (
    massless,
    of_cards,
    of_materials,
    of_size,
    require_answers,
)
from modalbase.formats.models.units import guess, in_si, units_of
from service.compute.models.bodies import body_of_model
from service.compute.models.keeping import kept
from service.compute.models.matrices import (
    are_matrices,
    describe_matrices,
    kept_matrices,
    matrices_in_si,
)
from service.compute.models.meshes import is_mesh, is_of_sections, mesh_in_si
from service.compute.models.reading import MOST_BYTES, faults_of, files_of, parsed
from service.platform.errors import Invalid

if TYPE_CHECKING:
    from service.platform.queue.kinds import Reporter

MOST_LISTED = 1000  # of each list in a description


@dataclass(frozen=True)
class DeckInputs:
    """A deck to read."""

    path: Path  # where it lies
    filename: str  # what its sender calls it
    units: str | None  # that its numbers are in, such as `mm-N-t`; None where they are not stated
    # answers to what is asked of it: cards that may be left out, `density:GAUGE`
    accepted: tuple[str, ...]
    sections: Mapping[str, Any] | None = None  # of the sets of a mesh without properties


@dataclass(frozen=True)
class DeckOutput:
    """A model that was read: what is in it, as JSON, and its arrays."""

    document: dict[str, Any]
    arrays: bytes


def read_deck(inputs: DeckInputs, report: Reporter) -> Iterator[DeckOutput]:
    """A deck or mesh as a model in SI.

    Raises:
        Invalid: it cannot be read, its units are not stated, a question of it is not answered or an
            answer is of none, or sections that it needs are not stated.
        InputError: no body can be made of it.
    """
    report("reading the model", 0.0)
    content = inputs.path.read_bytes()
    if is_mesh(inputs.filename):
        si = faults_of(
            lambda: mesh_in_si(content, inputs.filename, inputs.units, inputs.sections or {})
        )
        questions = [*of_size(si), *of_cards(si)]
        named = [name for name in inputs.accepted if not is_of_sections(name)]
        faults_of(lambda: require_answers(questions, named, si.ignored))
    elif inputs.sections is not None:
        raise Invalid(
            "sections",
            "are of meshes without properties; a deck has its own, and matrices have none",
        )
    elif are_matrices(files := files_of(content, inputs.filename)):
        faults_of(lambda: require_answers((), inputs.accepted))
        yield _of_matrices(files, inputs.units)
        return
    else:
        si = _answered(parsed(content, inputs.filename), inputs)
    report("looking for joints", 0.5)
    body = body_of_model(si)
    yield DeckOutput(describe(si, body), kept(si))


def _of_matrices(files: Mapping[str, bytes], units: str | None) -> DeckOutput:
    if units is None:
        raise Invalid(
            "units", "are not stated, and matrices have none: say length-force-mass, such as mm-N-t"
        )
    model = faults_of(lambda: matrices_in_si(files, units, MOST_BYTES))
    return DeckOutput(describe_matrices(model), kept_matrices(model))


def _answered(model: FiniteElementModel, inputs: DeckInputs) -> FiniteElementModel:
    """A deck's model in SI, of which every question is answered.

    Raises:
        Invalid: units are not stated, a question is open, or an answer is of none.
    """
    units = inputs.units
    if units is None:
        offered = guess(model)
        hint = (
            f"units={offered.units}? {offered.reason}"
            if offered
            else "no usual units give its materials and size"
        )
        raise Invalid("units", f"are not stated, and a deck has none; {hint}")
    noted = replace(model, ignored=(*model.ignored, *faults_of(lambda: tuple(massless(model)))))
    questions = [
        *of_size(model, units_of(units).length),
        *of_materials(model, units),
        *of_cards(model),
    ]
    faults_of(lambda: require_answers(questions, inputs.accepted, noted.ignored))
    return in_si(noted, units)


def describe(model: FiniteElementModel, body: Structure) -> dict[str, Any]:
    """What is in a model in SI, as an engineer checks it."""
    # equations may keep a body from moving as one, and what it weighs is no matter of these
    without_equations = replace(
        body, links=tuple(link for link in body.links if link.equations is None)
    )
    body = body if len(without_equations.links) == len(body.links) else without_equations
    masses = body.mass_coefficients(np.array(list(body.nominal.values())))
    shift = body.model.motions[:, 0]
    counts = {
        "nodes": len(model.nodes),
        "elements": sum(len(block.nodes) for block in model.elements),
    }
    counts |= {
        name: len(getattr(model, name)) for name in ("masses", "springs", "links", "supports")
    }
    return {
        "format": model.format,
        "title": model.title,
        "counts": counts,
        "size_m": np.ptp(model.nodes, axis=0).tolist(),
        "mass_kg": float(shift @ (body.model.mass.at(masses) @ shift)),
        "sets": [_set(model, name) for name in model.sets],
        "materials": [
            {"name": m.name, **_place(m.where), "constants": dict(m.constants)}
            for m in model.materials.values()
        ][:MOST_LISTED],
        "masses": [
            {"node": int(model.numbers[m.node]), "mass_kg": m.mass, **_place(m.where)}
            for m in model.masses[:MOST_LISTED]
        ],
        "supports": [
            {"nodes": len(s.nodes), "dofs": [dof + 1 for dof in s.dofs], **_place(s.where)}
            for s in model.supports[:MOST_LISTED]
        ],
        "ignored": [
            {"card": one.card, "lines": list(one.lines[:MOST_LISTED]), "file": one.file or None}
            | {"loss": one.loss, "changes": one.changes}
            for one in model.ignored
        ],
        "junctions": [
            {
                "walls": [
                    {"set": name, "thickness_m": t, "passes": passes}
                    for name, t, passes in junction.walls
                ],
                "angles_deg": [round(angle, 1) for angle in junction.angles],
                "length_m": junction.length,
                "nodes": [int(model.numbers[node]) for node in junction.nodes[:MOST_LISTED]],
            }
            for junction in body.junctions[:MOST_LISTED]
        ],
    }


def _place(where: Where) -> dict[str, Any]:
    return {"line": where.line, "file": where.file or None}


def _set(model: FiniteElementModel, name: str) -> dict[str, Any]:
    """A set with its section, area or length, and mass."""
    blocks = [block for block in model.elements if block.set == name]
    size = sum(float(sizes(block, model.nodes).sum()) for block in blocks)
    section = model.sections[name]
    members = {
        "name": name,
        "elements": sum(len(b.nodes) for b in blocks),
        "kinds": sorted({b.kind for b in blocks}),
    }
    if isinstance(section, BeamSection):
        per_length = (
            model.materials[section.material].constants["density"] * section.area
            + section.extra_mass
        )
        own = {"materials": [section.material], "length_m": size, "section_area_m2": section.area}
        return {**members, **own, "mass_kg": per_length * size, **_place(section.where)}
    plies = [ply.thickness for ply in section.plies]
    thickness = mean_thickness(model, name)
    density = float(_densities(model, section) @ plies) / sum(plies)
    per_area = density * thickness + section.extra_mass
    own = {
        "materials": list(dict.fromkeys(ply.material for ply in section.plies)),
        "area_m2": size,
        "thickness_m": thickness,
        "plies": len(section.plies),
    }
    return {**members, **own, "mass_kg": per_area * size, **_place(section.where)}


def _densities(model: FiniteElementModel, section: ShellSection) -> FloatArray:
    return np.array([model.materials[ply.material].constants["density"] for ply in section.plies])
