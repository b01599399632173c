"""Routes of campaigns and their grid points."""

from __future__ import annotations

from typing import Annotated
from uuid import UUID

from fastapi import Query, Request, Response
from sqlalchemy import select

from service.access import CurrentUser, SessionDep
from service.errors import Invalid
from service.store.campaigns import operations
from service.store.campaigns.schemas import CampaignIn, CampaignOut, CampaignPatch
from service.store.campaigns.tables import Campaign
from service.store.structures.operations import structure_for
from service.web import IF_MATCH, Confirm, Cursor, Limit, Page, api_router, etag_of, paged, require_match, require_usual

router = api_router(tags=["campaigns"])


@router.post("/structures/{structure_id}/campaigns", status_code=201)
def create_campaign(
    structure_id: UUID,
    body: CampaignIn,
    session: SessionDep,
    user: CurrentUser,
    response: Response,
    confirm: Confirm = False,
) -> CampaignOut:
    """Describe a measurement: boundary, date, climate, instruments, and the frame of the file's coordinates."""
    require_usual(body, confirm)
    campaign = operations.create_campaign(session, user, structure_id, body)
    response.headers["Location"] = f"/api/v1/campaigns/{campaign.id}"
    return _shown(campaign, response)


@router.get("/structures/{structure_id}/campaigns")
def list_campaigns(
    structure_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    cursor: Cursor = None,
    limit: Limit = 100,
    deleted: Annotated[bool, Query(description="list deleted campaigns, which can be restored, instead")] = False,
) -> Page[CampaignOut]:
    """Campaigns of a structure."""
    structure = structure_for(session, user, structure_id)
    hidden = Campaign.deleted_at.is_not(None) if deleted else Campaign.deleted_at.is_(None)
    query = select(Campaign).where(Campaign.structure_id == structure.id, hidden)
    rows, following = paged(session, query, Campaign.id, cursor, limit)
    return Page(items=[operations.describe(row) for row in rows], next_cursor=following)


@router.get("/campaigns/{campaign_id}")
def get_campaign(campaign_id: UUID, session: SessionDep, user: CurrentUser, response: Response) -> CampaignOut:
    """A campaign."""
    return _shown(operations.campaign_for(session, user, campaign_id), response)


@router.patch("/campaigns/{campaign_id}", openapi_extra=IF_MATCH)
def change_campaign(
    campaign_id: UUID,
    body: CampaignPatch,
    session: SessionDep,
    user: CurrentUser,
    request: Request,
    response: Response,
    confirm: Confirm = False,
) -> CampaignOut:
    """Change what is known of a campaign; results that exist keep what they used."""
    campaign = operations.campaign_for(session, user, campaign_id, "editor", lock=True)
    require_match(request, etag_of(operations.describe(campaign)))
    if not body.model_fields_set:
        raise Invalid("", "names nothing to change")
    require_usual(body, confirm)
    operations.change_campaign(session, user, campaign, body)
    return _shown(campaign, response)


@router.delete("/campaigns/{campaign_id}", status_code=204, openapi_extra=IF_MATCH)
def delete_campaign(campaign_id: UUID, session: SessionDep, user: CurrentUser, request: Request) -> None:
    """Hide a campaign and what is in it. It stays stored and can be restored."""
    campaign = operations.campaign_for(session, user, campaign_id, "editor", lock=True)
    if "if-match" in request.headers:
        require_match(request, etag_of(operations.describe(campaign)))
    operations.campaign_for.hide(session, user, campaign)


@router.post("/campaigns/{campaign_id}/restore")
def restore_campaign(campaign_id: UUID, session: SessionDep, user: CurrentUser, response: Response) -> CampaignOut:
    """Bring a deleted campaign back."""
    campaign = operations.campaign_for(session, user, campaign_id, "editor", deleted=True, lock=True)
    operations.campaign_for.bring_back(session, user, campaign)
    return _shown(campaign, response)


def _shown(campaign: Campaign, response: Response) -> CampaignOut:
    shown = operations.describe(campaign)
    response.headers["ETag"] = etag_of(shown)
    return shown
