"""Routes of the models that users send."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any
from uuid import UUID

from fastapi import Query, Response
from pydantic import Field
from sqlalchemy.orm import Session

from modalbase.formats.cell_types import ELEMENT_NAMES
from modalbase.formats.models.questions import plain
from service.compute.models.meshes import is_of_sections, kind_of_member
from service.nouns.storage.originals import original_sizes
from service.nouns.structures.models import (
    model_of_structure,
    new_model,
    versions_of_models,
)
from service.nouns.structures.operations import structure_for
from service.nouns.structures.shapes import Section
from service.platform.access import CurrentUser, SessionDep, api_router
from service.platform.errors import Invalid, Unusual
from service.platform.queue.resource import JobOut
from service.platform.queue.routes import JobRoutes
from service.platform.web import Confirm, Name, StrictModel
from service.platform.web.json_body import checked, parse_parameter
from service.platform.web.openapi import reads, upload
from service.platform.web.parameters import HOW
from service.platform.web.quantities import unusual
from service.platform.web.uploads import FilenameQuery, UploadDep
from service.tasks.model.task import MODELS, start_model

if TYPE_CHECKING:
    from service.nouns.structures.operations import StructureModel

router = api_router(tags=["models"])


class CountsOut(StrictModel):
    """How many of each there are."""

    nodes: int = Field(description="of the mesh")
    elements: int = Field(description="of all sets")
    masses: int = Field(description="masses at nodes")
    springs: int = Field(description="to the ground or between nodes")
    links: int = Field(description="nodes that others lead")
    supports: int = Field(description="groups of nodes that are held")


class PlacedOut(StrictModel):
    """What stands in a deck or mesh."""

    line: int = Field(description="where it begins")
    file: str | None = Field(None, description="of an include that has it; null of the deck itself")


class SetOut(PlacedOut):
    """Elements of one section."""

    name: str = Field(description="in small letters, as parameters have it")
    elements: int = Field(description="number of them")
    kinds: list[str] = Field(description=ELEMENT_NAMES)
    materials: list[str] = Field(description="names, from the bottom")
    area_m2: float | None = Field(None, description="of shells; null of beams")
    length_m: float | None = Field(None, description="of beams; null of shells")
    thickness_m: float | None = Field(None, description="of shells; null of beams")
    plies: int | None = Field(None, description="number of them; null of beams")
    section_area_m2: float | None = Field(None, description="of a beam's section; null of shells")
    mass_kg: float = Field(description="of its elements")


class ModelMaterialOut(PlacedOut):
    """A material."""

    name: str = Field(description="as the deck has it")
    constants: dict[str, float] = Field(description="SI")


class ModelMassOut(PlacedOut):
    """A mass at a node."""

    node: int = Field(description="the deck's number")
    mass_kg: float = Field(description="kg")


class ModelSupportOut(PlacedOut):
    """Nodes that are held."""

    nodes: int = Field(description="how many")
    dofs: list[int] = Field(description="1, 2, 3 along x, y, z; 4, 5, 6 about them")


class IgnoredOut(StrictModel):
    """Cards that were not used."""

    card: str = Field(description="its name")
    lines: list[int] = Field(description="where they stand")
    file: str | None = Field(
        None, description="of an include that has them; null of the deck itself"
    )
    loss: str = Field(description="what is lost by that")
    changes: bool = Field(description="whether modes change by that; the sender accepted it")


class JunctionWallOut(StrictModel):
    """A wall at a junction."""

    set: str = Field(description="whose elements it is of")
    thickness_m: float = Field(description="m")
    passes: bool = Field(description="whether it goes on beyond the line")


class JunctionOut(StrictModel):
    """A line along which walls meet, with the model of their joint."""

    walls: list[JunctionWallOut] = Field(description="around the line")
    angles_deg: list[float] = Field(description="between each wall and the next")
    length_m: float = Field(description="m")
    nodes: list[int] = Field(description="the deck's numbers")


class FoundModelOut(StrictModel):
    """What was read of a deck or mesh, in SI. Of a mesh lines are 0 where its file has none."""

    format: str = Field(description="inp, bdf, matrices; of meshes msh, vtk, vtu, uff")
    title: str = Field(description="the deck's heading")
    counts: CountsOut = Field(description="how many of each there are")
    size_m: list[float] = Field(description="extent along x, y and z, m")
    mass_kg: float = Field(description="of all it has")
    sets: list[SetOut] = Field(description="elements by section")
    materials: list[ModelMaterialOut] = Field(description="of the sections")
    masses: list[ModelMassOut] = Field(description="at nodes")
    supports: list[ModelSupportOut] = Field(description="nodes that are held")
    ignored: list[IgnoredOut] = Field(description="cards that were not used")
    junctions: list[JunctionOut] = Field(description="lines along which walls meet")
    factors: list[str] | None = Field(
        None, description="of matrices: what parameters of an update can be; null of a deck"
    )
    rows: int | None = Field(None, description="of matrices: degrees of freedom; null of a deck")


class ModelOut(JobOut):
    """A model that was sent to a structure: how far its reading is, and what was found."""

    structure_id: UUID
    filename: str
    size: int = Field(description="bytes")
    sha256: str
    units: str | None = Field(
        description="that its numbers are in: length-force-mass; null: not stated, so not read"
    )
    accepted: list[str] = Field(
        description="cards that may be left out although modes change, unusual values meant so"
    )
    sections: dict[str, Section] | None = Field(
        description="that were stated of a mesh's sets; null of a deck"
    )
    version: int | None = Field(
        description="the structure's version that first was this model; null until it was read"
    )
    found: FoundModelOut | None = Field(description="null until it was read")


def _with_files(session: Session, rows: Sequence[StructureModel]) -> Iterator[dict[str, Any]]:
    sizes = original_sizes(session, [row.sha256 for row in rows])
    versions = versions_of_models(session, [row.id for row in rows])
    for row in rows:
        file = {"size": sizes[row.sha256], "sha256": row.sha256.hex()}
        yield {**file, "version": versions.get(row.id), "found": row.document}


def _require_usual(sections: Mapping[str, Section], accept: Sequence[str], confirm: bool) -> None:
    """Ask of sections what is unusual, as of the values of a deck; `confirm` answers all of it.

    Raises:
        Unusual: a question is open.
        Invalid: an answer is of none.
    """
    faults = list(unusual(sections))
    steps = [fault.pointer.split("/") for fault in faults]
    names = [f"{kind_of_member(members[-1])}:{name}" for _, name, *members in steps]
    answered = {plain(name) for name in accept if is_of_sections(name)} if sections else set()
    if idle := answered - {plain(name) for name in names}:
        raise Invalid("accept", f"{min(idle)!r} answers nothing that is asked of the sections")
    if not confirm and (
        questions := [
            replace(fault, detail=f"{fault.detail} accept={name} takes it as it is.")
            for fault, name in zip(faults, names, strict=True)
            if plain(name) not in answered
        ]
    ):
        raise Unusual(
            [*questions[:-1], replace(questions[-1], detail=f"{questions[-1].detail} {HOW}")]
        )


of_jobs = JobRoutes(router, MODELS, ModelOut, "model_id", _with_files)


THERE: dict[int | str, dict[str, Any]] = {
    200: {"model": ModelOut, "description": "The structure is this model already"}
}
MESH_UPLOAD = upload(
    "ModelForm",
    sections=(
        "of a mesh: what each set is, as JSON",
        '{"skin": {"thickness_m": 0.004,'
        ' "isotropic": {"E_Pa": 7e10, "nu": 0.33, "density_kg_m3": 2700}}}',
    ),
)


@router.post(
    "/structures/{structure_id}/model",
    status_code=202,
    openapi_extra=reads(MESH_UPLOAD),
    responses=THERE,
)
def send_model(
    structure_id: UUID,
    sent: UploadDep,
    session: SessionDep,
    user: CurrentUser,
    response: Response,
    filename: FilenameQuery = None,
    units: Annotated[
        Name | None, Query(description="length-force-mass, such as m-N-kg, mm-N-t, in-lbf-slinch")
    ] = None,
    accept: Annotated[
        list[Name] | None,
        Query(
            description=(
                "answers to what is asked of it: cards that may be left out although modes change,"
                " or what is unusual "
                "and meant so, such as `density:GAUGE`"
            ),
            max_length=100,
        ),
    ] = None,
    sections: Annotated[
        str | None,
        Query(description="of a mesh, as JSON: by set what `Section` says", max_length=20_000),
    ] = None,
    confirm: Confirm = False,
) -> ModelOut:
    """Send a deck: of Abaqus, CalculiX (.inp) or Nastran (.bdf) as raw body or as multipart field
    `file`; a job reads it.

    Or matrices of any solver: a .npz, or a .zip of .mtx, .sti, .mas or .pch with nodes.csv. Or a
    mesh without properties of gmsh (.msh), VTK (.vtu, .vtk) or UFF (.unv, .uff): `sections`, as
    parameter or as multipart field, then states what each set is, in SI; sets are physical groups,
    cell data or property tables.

    A deck has no units, so `units` states them; without, the job fails and says which fit. Once it
    was read, the structure's next version is this model.
    """
    text = sent.text_of("sections", sections)
    stated = (
        None if text is None else checked(dict[str, Section], parse_parameter("sections", text))
    )
    _require_usual(stated or {}, accept or [], confirm)
    draft = new_model(
        filename or sent.filename or "",
        units,
        accept or [],
        stated and {name: each.model_dump(exclude_none=True) for name, each in stated.items()},
    )
    row, new = start_model(session, user, structure_id, sent.file, draft)
    response.status_code = 202 if new else 200
    return of_jobs.made(session, row, response)


of_jobs.getting("get_model_job", "How far the reading of a model is, and what was found in it.")
of_jobs.listing("list_models", "Models that were sent to a structure, newest first.")


@router.get("/structures/{structure_id}/model")
def get_model(structure_id: UUID, session: SessionDep, user: CurrentUser) -> ModelOut:
    """The model that a structure is: counts, sets with area and mass, materials, supports, ignored
    cards, junctions.
    """
    return of_jobs.shown(
        session, model_of_structure(session, structure_for(session, user, structure_id))
    )
