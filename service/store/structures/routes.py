"""Routes of structures."""

from __future__ import annotations

from functools import partial
from typing import Annotated
from uuid import UUID

from fastapi import Query, Request, Response
from sqlalchemy import select

from service.access import CurrentUser, SessionDep, project_for
from service.errors import Invalid, NotFound
from service.store.structures import operations
from service.store.structures.operations import Structure, StructureVersion
from service.store.structures.schemas import StructureIn, StructureOut, StructurePatch
from service.web import IF_MATCH, Confirm, Cursor, Limit, Page, api_router, etag_of, paged, require_match, require_usual

router = api_router(tags=["structures"])


@router.post("/projects/{project_id}/structures", status_code=201)
def create_structure(
    project_id: UUID,
    body: StructureIn,
    session: SessionDep,
    user: CurrentUser,
    response: Response,
    confirm: Confirm = False,
) -> StructureOut:
    """Describe a structure: geometry, density and either plies or a homogenised material, nominal values."""
    require_usual(body, confirm)
    structure = operations.create_structure(session, user, project_id, body)
    response.headers["Location"] = f"/api/v1/structures/{structure.id}"
    return _shown(operations.describe(session, structure), response)


@router.get("/projects/{project_id}/structures")
def list_structures(
    project_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    cursor: Cursor = None,
    limit: Limit = 100,
    deleted: Annotated[bool, Query(description="list deleted structures, which can be restored, instead")] = False,
) -> Page[StructureOut]:
    """Structures of a project."""
    project = project_for(session, user, project_id)
    hidden = Structure.deleted_at.is_not(None) if deleted else Structure.deleted_at.is_(None)
    query = select(Structure).where(Structure.project_id == project.id, hidden)
    return paged(session, query, cursor, limit, partial(operations.describe_all, session))


@router.get("/structures/{structure_id}")
def get_structure(structure_id: UUID, session: SessionDep, user: CurrentUser, response: Response) -> StructureOut:
    """A structure in its current version."""
    structure = operations.structure_for(session, user, structure_id)
    return _shown(operations.describe(session, structure), response)


@router.get("/structures/{structure_id}/versions/{number}")
def get_structure_version(structure_id: UUID, number: int, session: SessionDep, user: CurrentUser) -> StructureIn:
    """What a structure was in an earlier version; results refer to it by number."""
    structure = operations.structure_for(session, user, structure_id)
    if not 1 <= number <= structure.version:
        raise NotFound("version", number)
    version = session.scalars(
        select(StructureVersion).where(StructureVersion.structure_id == structure.id, StructureVersion.number == number)
    ).one()
    return operations.describe_version(version, structure.name)


@router.patch("/structures/{structure_id}", openapi_extra=IF_MATCH)
def change_structure(
    structure_id: UUID,
    body: StructurePatch,
    session: SessionDep,
    user: CurrentUser,
    request: Request,
    response: Response,
    confirm: Confirm = False,
) -> StructureOut:
    """Change a structure. Geometry, density or section make a new version; what a result used stays as it was."""
    structure = operations.structure_for(session, user, structure_id, "editor", lock=True)
    require_match(request, etag_of(operations.describe(session, structure)))
    if not body.model_fields_set:
        raise Invalid("", "names nothing to change")
    require_usual(body, confirm)
    operations.change_structure(session, user, structure, body)
    return _shown(operations.describe(session, structure), response)


@router.delete("/structures/{structure_id}", status_code=204, openapi_extra=IF_MATCH)
def delete_structure(structure_id: UUID, session: SessionDep, user: CurrentUser, request: Request) -> None:
    """Hide a structure with its campaigns and monitors. It stays stored and can be restored."""
    structure = operations.structure_for(session, user, structure_id, "editor", lock=True)
    if "if-match" in request.headers:
        require_match(request, etag_of(operations.describe(session, structure)))
    operations.structure_for.hide(session, user, structure)


@router.post("/structures/{structure_id}/restore")
def restore_structure(structure_id: UUID, session: SessionDep, user: CurrentUser, response: Response) -> StructureOut:
    """Bring a deleted structure back."""
    structure = operations.structure_for(session, user, structure_id, "editor", deleted=True, lock=True)
    operations.structure_for.bring_back(session, user, structure)
    return _shown(operations.describe(session, structure), response)


def _shown(structure: StructureOut, response: Response) -> StructureOut:
    response.headers["ETag"] = etag_of(structure)
    return structure
