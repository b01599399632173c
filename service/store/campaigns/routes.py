"""Routes of campaigns and of their grid points."""

from __future__ import annotations

from functools import partial
from typing import Annotated, Any
from uuid import UUID

from fastapi import Header, Query, Request, Response
from sqlalchemy import select

from service.access import CurrentUser, SessionDep, SettingsDep, audit
from service.errors import Invalid, PayloadTooLarge, UnsupportedMediaType
from service.store.campaigns import operations
from service.store.campaigns.operations import Campaign
from service.store.campaigns.schemas import CampaignIn, CampaignOut, CampaignPatch, GridPoints
from service.store.structures.operations import structure_for
from service.web import IF_MATCH, Confirm, Cursor, Limit, Page, api_router, etag_of, paged, require_match, require_usual
from service.web.json_body import BULK_VALUES, checked, parse_json
from service.web.negotiation import choose_format, one_of
from service.web.openapi import schema_of
from service.web.routing import Later
from service.web.uploads import UploadDep

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
    return paged(session, query, cursor, limit, partial(map, operations.describe))


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


points_router = api_router(tags=["grid points"])

MEDIA_TYPES = {"json": "application/json", "csv": "text/csv"}
POINTS_BODY = Later(
    lambda: {
        **IF_MATCH,
        "requestBody": {
            "required": True,
            "content": {
                "application/json": {"schema": schema_of(GridPoints)},
                "text/csv": {"schema": {"type": "string"}},
            },
        },
    }
)

POINTS_FILES: dict[int | str, dict[str, Any]] = {200: {"content": {"text/csv": {"schema": {"type": "string"}}}}}


@points_router.get("/campaigns/{campaign_id}/grid-points", response_model=GridPoints, responses=POINTS_FILES)
def get_grid_points(
    campaign_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    response: Response,
    accept: Annotated[str | None, Header(include_in_schema=False)] = None,
    file_format: Annotated[
        Annotated[str, one_of(MEDIA_TYPES)] | None, Query(alias="format", description="default: by Accept")
    ] = None,
) -> GridPoints | Response:
    """All grid points of a campaign, in the file's coordinates, as JSON or CSV."""
    campaign = operations.campaign_for(session, user, campaign_id)
    points = operations.list_points(session, campaign.id)
    headers = {"ETag": etag_of(points), "Vary": "Accept"}
    if choose_format(file_format, accept, MEDIA_TYPES) == "csv":
        return Response(operations.to_csv(points), media_type="text/csv", headers=headers)
    response.headers.update(headers)
    return points


@points_router.put("/campaigns/{campaign_id}/grid-points", openapi_extra=POINTS_BODY)
def put_grid_points(
    campaign_id: UUID,
    upload: UploadDep,
    session: SessionDep,
    user: CurrentUser,
    settings: SettingsDep,
    request: Request,
    response: Response,
) -> GridPoints:
    """Store these points in place of all that are there, from JSON `{items: [{label, x_m, y_m, z_m}]}` or CSV.

    Where points are there that would change, If-Match must name the version that is replaced.
    """
    if upload.file.size > settings.json_limit_bytes:
        raise PayloadTooLarge(f"the body has {upload.file.size} bytes, the operator allows {settings.json_limit_bytes}")
    points = _points_of(upload.file.path.read_bytes(), upload.content_type)
    campaign = operations.campaign_for(session, user, campaign_id, "editor", lock=True)
    before = operations.list_points(session, campaign.id)
    if before.items or "if-match" in request.headers:
        after = GridPoints(items=sorted(points.items, key=lambda point: point.label))
        if "if-match" in request.headers or before != after:
            require_match(request, etag_of(before))
    operations.replace_points(session, campaign.id, points)
    project_id = operations.campaign_for.project_of(session, campaign)
    audit(session, user, "grid_points.put", "campaign", campaign.id, project_id, count=len(points.items))
    stored = operations.list_points(session, campaign.id)
    response.headers["ETag"] = etag_of(stored)
    return stored


def _points_of(body: bytes, content_type: str) -> GridPoints:
    if content_type == "text/csv":
        return operations.from_csv(body)
    if content_type not in ("application/json", ""):
        raise UnsupportedMediaType(f"the body is {content_type}, expected application/json or text/csv")
    return checked(GridPoints, parse_json(body, most_values=BULK_VALUES))
