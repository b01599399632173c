"""Reading a user's model in the child process: what is in it, in SI, and the arrays that are kept
of it.
"""

from __future__ import annotations

import io
import re
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.structure import Structure
from modalbase.formats.errors import FormatError
from modalbase.formats.models.bdf import read_bdf
from modalbase.formats.models.check import sizes
from modalbase.formats.models.inp import read_inp
from modalbase.formats.models.model import BeamSection, FiniteElementModel, ShellSection, Where
from modalbase.formats.models.questions import (
    massless,
    of_cards,
    of_materials,
    of_size,
    require_answers,
)
from modalbase.formats.models.units import guess, in_si, units_of
from modalbase.formats.npy import members_of
from service.compute.models.bodies import body_of_model
from service.compute.models.keeping import kept
from service.compute.models.matrices import (
    are_matrices,
    describe_matrices,
    kept_matrices,
    matrices_in_si,
)
from service.compute.models.meshes import MESHES, is_mesh, is_of_sections, mesh_in_si
from service.errors import Fault, Invalid

if TYPE_CHECKING:
    from service.jobs.kinds import Reporter

ZIP, NPZ = ".zip", ".npz"
"""End of the name of an archive of a deck and what it includes, or of matrices; and of matrices in
one file.
"""

MOST_FILES, MOST_BYTES = 1000, 500_000_000  # of an archive, unpacked

_INCLUDE = re.compile(
    rb"(?im)^[ \t]*\*?[ \t]*INCLUDE[ \t]*(?:,[ \t]*INPUT[ \t]*=[ \t]*)?['\"]?([^'\"\r\n,]+)"
)

READERS: Mapping[str, Callable[[bytes, dict[str, bytes]], FiniteElementModel]] = {
    ".inp": read_inp,
    **dict.fromkeys((".bdf", ".dat", ".nas"), read_bdf),
}
"""By the end of a file's name."""

MOST_LISTED = 1000  # of each list in a description

Read = TypeVar("Read")


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


def parsed(content: bytes, filename: str) -> FiniteElementModel:
    """The model of a file, in its own units.

    Raises:
        Invalid: no reader knows its name, or the reader finds it wrong.
    """
    deck = unpacked(content, filename)
    reader = reader_of(deck.name)
    return faults_of(lambda: reader(deck.content, deck.included))


@dataclass(frozen=True)
class Deck:
    """A deck, its name, and the files that it includes, by the names that its lines say."""

    name: str
    content: bytes
    included: dict[str, bytes]


def unpacked(content: bytes, filename: str) -> Deck:
    """The deck of a file: itself, or of a zip the one that no other of its files includes.

    Raises:
        Invalid: it is no zip, has more than it may, or no or several such decks.
    """
    files = files_of(content, filename)
    if PurePosixPath(filename).suffix.lower() != ZIP:
        return Deck(filename, content, {})
    named = {
        PurePosixPath(each.decode("latin-1")).name
        for text in files.values()
        for each in _INCLUDE.findall(text)
    }
    decks = [name for name in files if PurePosixPath(name).suffix.lower() in READERS]
    mains = [name for name in decks if PurePosixPath(name).name not in named]
    if len(mains) != 1:
        raise Invalid(
            "file",
            f"has {', '.join(mains) or 'no deck'}, expected one deck that no other file of it"
            " includes",
        )
    folder = PurePosixPath(mains[0]).parent
    return Deck(
        mains[0],
        files[mains[0]],
        {_beside(name, folder): text for name, text in files.items() if name != mains[0]},
    )


def files_of(content: bytes, filename: str) -> dict[str, bytes]:
    """The files of a zip by name, or the file itself.

    Raises:
        Invalid: it is no zip, or has more than it may.
    """
    if PurePosixPath(filename).suffix.lower() != ZIP:
        return {filename: content}
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            infos = [info for info in members_of(archive) if not info.is_dir()]
            if len(infos) > MOST_FILES or sum(info.file_size for info in infos) > MOST_BYTES:
                raise Invalid(
                    "file", f"has more than {MOST_FILES} files, or {MOST_BYTES // 10**6} MB of them"
                )
            return {info.filename: archive.read(info) for info in infos}
    except (
        FormatError,
        zipfile.BadZipFile,
        RuntimeError,
        NotImplementedError,
        zlib.error,
    ) as error:
        raise Invalid("file", f"is no zip that can be read: {error}") from None


def _beside(name: str, folder: PurePosixPath) -> str:
    """A file's name as a deck in a folder says it."""
    path = PurePosixPath(name)
    return str(path.relative_to(folder)) if path.is_relative_to(folder) else name


def repacked(content: bytes, filename: str, changed: Mapping[str, bytes]) -> bytes:
    """A file as it was sent, with the deck's files that changed; the deck's own has the empty
    name.
    """
    if PurePosixPath(filename).suffix.lower() != ZIP:
        return changed[""]
    deck, buffer = unpacked(content, filename), io.BytesIO()
    folder = PurePosixPath(deck.name).parent
    with (
        zipfile.ZipFile(io.BytesIO(content)) as archive,
        zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as out,
    ):
        for info in archive.infolist():
            key = "" if info.filename == deck.name else _beside(info.filename, folder)
            out.writestr(info, changed.get(key, archive.read(info)))
    return buffer.getvalue()


def reader_of(filename: str) -> Callable[[bytes, dict[str, bytes]], FiniteElementModel]:
    """The reader of files of such a name.

    Raises:
        Invalid: there is none.
    """
    reader = READERS.get(PurePosixPath(filename).suffix.lower())
    if reader is None:
        raise Invalid(
            "filename",
            f"{filename!r} ends in none of {', '.join([*READERS, *MESHES, ZIP, NPZ])}: which kind"
            " of deck is it?",
        )
    return reader


def require_deck(filename: str) -> None:
    """Refuse a file whose name's end says neither a deck, a mesh nor an archive.

    Raises:
        Invalid: as said.
    """
    if PurePosixPath(filename).suffix.lower() not in (ZIP, NPZ, *MESHES):
        reader_of(filename)


def faults_of(read: Callable[[], Read]) -> Read:
    """What a reader returns; its faults name lines of the file."""
    try:
        return read()
    except FormatError as error:
        raise Invalid(
            [
                (
                    Fault(place.replace(".", "/"), what)
                    if place.split(".")[0] in ("units", "filename", "sections", "accept")
                    else Fault("file", f"{place}: {what}" if place else what)
                )
                for place, what in error.faults
            ]
        ) from None


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
    per_area = (
        float(_densities(model, section) @ [ply.thickness for ply in section.plies])
        + section.extra_mass
    )
    own = {
        "materials": list(dict.fromkeys(ply.material for ply in section.plies)),
        "area_m2": size,
        "thickness_m": sum(ply.thickness for ply in section.plies),
        "plies": len(section.plies),
    }
    return {**members, **own, "mass_kg": per_area * size, **_place(section.where)}


def _densities(model: FiniteElementModel, section: ShellSection) -> FloatArray:
    return np.array([model.materials[ply.material].constants["density"] for ply in section.plies])
