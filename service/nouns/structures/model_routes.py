"""Meshes as an answer: JSON for pages, VTU for viewers, UFF for programs of modal analysis; and the
files of models as they were sent.
"""

from collections.abc import Mapping
from typing import IO, Annotated, Any, Literal
from uuid import UUID

from fastapi import Query, Request, Response
from fastapi.responses import FileResponse
from pydantic import Field

from modalbase.formats.cell_types import ELEMENT_NAMES
from modalbase.formats.meshes import MeshFile, uff_of, write_vtu
from modalbase.formats.uff.write import encode
from service.nouns.storage.originals import copy_original
from service.nouns.structures import models
from service.nouns.structures.models import mesh_of
from service.nouns.structures.operations import current_version, structure_for
from service.platform.access import CurrentUser, SessionDep, api_router
from service.platform.web import StrictModel
from service.platform.web.downloads import fits_memory, in_memory, spooled
from service.platform.web.parameters import form_of, not_modified

MEDIA_TYPES = {
    "json": "application/json",
    "vtu": "application/vnd.kitware.vtu+xml",
    "uff": "application/x-uff",
}
MESH_FILES: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "The mesh.",
        "content": {kind: {} for kind in MEDIA_TYPES.values() if kind != "application/json"},
    }
}


MeshForm = Annotated[str, form_of(MEDIA_TYPES, "default: by Accept, else json")]
"""Name of the format that a request wants."""


def mesh_answer(
    mesh: MeshFile, form: str, name: str, headers: Mapping[str, str] | None = None
) -> Response:
    """A file for download."""

    def write(file: IO[bytes]) -> None:
        file.writelines(write_vtu(mesh) if form == "vtu" else encode(uff_of(mesh)))

    return spooled(write, MEDIA_TYPES[form], f"{name}.{form}", headers or {})


router = api_router(tags=["models"])


class PlacesOut(StrictModel):
    """Nodes by column."""

    x_m: list[float] = Field(description="m")
    y_m: list[float] = Field(description="m")
    z_m: list[float] = Field(description="m")


class MeshNodesOut(PlacesOut):
    """Nodes of a mesh by column."""

    numbers: list[int] = Field(description="the deck's")


class MeshBlockOut(StrictModel):
    """Elements of one kind and set."""

    set: str = Field(description="whose elements they are")
    kind: str = Field(description=ELEMENT_NAMES)
    corners: int = Field(description="of each: 3 or 4 of shells, 2 ends of beams, 1 of a point")
    numbers: list[int] = Field(description="the deck's")
    nodes: list[list[int]] = Field(
        description="rows of `nodes` from 0: corners in order, then middles of sides"
    )


class MeshSupportOut(StrictModel):
    """Nodes that are held alike."""

    nodes: list[int] = Field(description="rows of `nodes` from 0")
    dofs: list[int] = Field(description="1, 2, 3 along x, y, z; 4, 5, 6 about them")


class MeshOut(StrictModel):
    """The mesh of a structure."""

    nodes: MeshNodesOut = Field(description="by column")
    blocks: list[MeshBlockOut] = Field(description="elements of one kind and set each")
    supports: list[MeshSupportOut] = Field(description="what holds it")
    masses: list[int] = Field(description="rows of `nodes` that carry masses, from 0")


@router.get("/structures/{structure_id}/model/mesh", response_model=MeshOut, responses=MESH_FILES)
def get_model_mesh(
    structure_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    request: Request,
    form: MeshForm,
    boundary: Annotated[
        Literal["cantilever", "free", "simply_supported", "as_modelled"] | None,
        Query(
            description="how it is held; default: as a model that was sent says, else not at all"
        ),
    ] = None,
) -> Any:
    """Nodes and elements of the structure, m: of the model that was sent, or of the strip, plate or
    shape that is described.

    As VTU or UFF (sets 2411 and 2412) nodes and elements alone.
    """
    version = current_version(session, structure_for(session, user, structure_id))
    headers = {"ETag": f'"{version.id}-{boundary}-{form}"'}
    if (unchanged := not_modified(request, headers)) is not None:
        return unchanged
    mesh = mesh_of(session, version, boundary)
    name = f"structure-{structure_id}"
    if form != "json":
        return mesh_answer(mesh.file(), form, name, headers)
    send = in_memory if fits_memory(request, mesh.size()) else spooled
    return send(mesh.write_json, MEDIA_TYPES[form], f"{name}.json", headers)


@router.get("/structures/{structure_id}/model/original", response_class=FileResponse)
def get_model_original(
    structure_id: UUID, session: SessionDep, user: CurrentUser, request: Request
) -> Response:
    """The deck as it was sent, byte for byte; its ETag is its SHA-256."""
    row = models.model_of_structure(session, structure_for(session, user, structure_id))
    headers = {"ETag": f'"{row.sha256.hex()}"'}
    return not_modified(request, headers) or spooled(
        lambda file: copy_original(session, row.sha256, file),
        "application/octet-stream",
        row.filename,
        headers,
    )
