"""Routes of mode sets."""

from __future__ import annotations

from typing import Annotated, Any
from uuid import UUID

from fastapi import Header, Query, Response
from sqlalchemy import select

from service.access import CurrentUser, SessionDep
from service.store.campaigns.operations import campaign_for
from service.store.modes import editing, operations
from service.store.modes.formats import write_uff
from service.store.modes.schemas import EditIn, ModeSetIn, ModeSetOut
from service.store.modes.tables import ModeSet
from service.web import Cursor, Limit, Page, api_router, paged
from service.web.downloads import spooled
from service.web.negotiation import choose_format, one_of

router = api_router(tags=["mode sets"], bulk=True)

MEDIA_TYPES = {"json": "application/json", "uff": "text/x-uff"}
UFF: dict[int | str, dict[str, Any]] = {200: {"content": {MEDIA_TYPES["uff"]: {}}}}


@router.post("/campaigns/{campaign_id}/mode-sets", status_code=201)
def create_mode_set(
    campaign_id: UUID, body: ModeSetIn, session: SessionDep, user: CurrentUser, response: Response
) -> ModeSetOut:
    """Type in modes that were identified elsewhere: frequencies, and where known damping ratios and shapes."""
    campaign = campaign_for(session, user, campaign_id, "editor")
    mode_set = operations.create_mode_set(session, user, campaign, body)
    response.headers["Location"] = f"/api/v1/mode-sets/{mode_set.id}"
    return operations.describe_all(session, [mode_set])[0]


@router.post("/mode-sets/{mode_set_id}/edits", status_code=201)
def edit_mode_set(
    mode_set_id: UUID, body: EditIn, session: SessionDep, user: CurrentUser, response: Response
) -> ModeSetOut:
    """Keep or drop poles by hand: a new mode set that records who decided what and why; the old one stays as it is."""
    mode_set = operations.mode_set_for(session, user, mode_set_id, "editor")
    edited = editing.edit_mode_set(session, user, mode_set, body)
    response.headers["Location"] = f"/api/v1/mode-sets/{edited.id}"
    return operations.describe_all(session, [edited])[0]


@router.get("/campaigns/{campaign_id}/mode-sets")
def list_mode_sets(
    campaign_id: UUID, session: SessionDep, user: CurrentUser, cursor: Cursor = None, limit: Limit = 100
) -> Page[ModeSetOut]:
    """Mode sets of a campaign."""
    campaign = campaign_for(session, user, campaign_id)
    query = select(ModeSet).where(ModeSet.campaign_id == campaign.id)
    rows, following = paged(session, query, ModeSet.id, cursor, limit)
    return Page(items=operations.describe_all(session, rows), next_cursor=following)


@router.get("/mode-sets/{mode_set_id}", response_model=ModeSetOut, responses=UFF)
def get_mode_set(
    mode_set_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    file_format: Annotated[
        Annotated[str, one_of(MEDIA_TYPES)] | None,
        Query(alias="format", description="uff is set 55; default: by Accept"),
    ] = None,
    accept: Annotated[str | None, Header(include_in_schema=False)] = None,
) -> ModeSetOut | Response:
    """A mode set, as JSON or as a UFF file of grid points and mode shapes."""
    mode_set = operations.mode_set_for(session, user, mode_set_id)
    if choose_format(file_format, accept, MEDIA_TYPES) == "uff":
        media_type = MEDIA_TYPES["uff"]
        return spooled(lambda file: write_uff(session, mode_set, file), media_type, "modes.uff", {"Vary": "Accept"})
    return operations.describe_all(session, [mode_set])[0]
