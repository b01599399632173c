"""Routes of campaigns and of their grid points."""

from typing import Annotated, Any
from uuid import UUID

from fastapi import Request, Response

from service.access import CurrentUser, SessionDep, SettingsDep
from service.access.nouns import NounRoutes
from service.errors import PayloadTooLarge, UnsupportedMediaType
from service.store.campaigns import operations
from service.store.campaigns.schemas import CampaignIn, CampaignOut, CampaignPatch, GridPoints
from service.web import IF_MATCH, api_router, etag_of, require_match
from service.web.json_body import BULK_VALUES, checked, parse_json
from service.web.openapi import TEXT, reads
from service.web.parameters import form_of
from service.web.uploads import UploadDep

router = api_router(tags=["campaigns"])
nouns = NounRoutes(
    router,
    operations.campaign_for,
    CampaignOut,
    lambda _, rows: map(operations.describe, rows),
    "campaigns",
    "campaign_id",
)


nouns.creating(
    "create_campaign",
    "Describe a measurement: boundary, date, climate, instruments, and the frame of the file's coordinates.",
    CampaignIn,
    operations.create_campaign,
    tagged=True,
    measured=True,
)
nouns.listing("list_campaigns", "Campaigns of a structure.", hides=True)
nouns.getting("get_campaign", "A campaign.", tagged=True)
nouns.changing(
    "change_campaign",
    "Change what is known of a campaign; results that exist keep what they used.",
    CampaignPatch,
    operations.change_campaign,
)
nouns.deleting("delete_campaign", "Hide a campaign and what is in it. It stays stored and can be restored.")
nouns.restoring("restore_campaign", "Bring a deleted campaign back.")


points_router = api_router(tags=["grid points"])

MEDIA_TYPES = {"json": "application/json", "csv": "text/csv"}
POINTS_FILES: dict[int | str, dict[str, Any]] = {200: {"content": {"text/csv": {"schema": {"type": "string"}}}}}


@points_router.get("/campaigns/{campaign_id}/grid-points", response_model=GridPoints, responses=POINTS_FILES)
def get_grid_points(
    campaign_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    response: Response,
    form: Annotated[str, form_of(MEDIA_TYPES)],
) -> GridPoints | Response:
    """All grid points of a campaign, in the file's coordinates, as JSON or CSV."""
    campaign = operations.campaign_for(session, user, campaign_id)
    points = operations.list_points(session, campaign.id)
    headers = {"ETag": etag_of(points), "Vary": "Accept"}
    if form == "csv":
        return Response(operations.to_csv(points), media_type="text/csv", headers=headers)
    response.headers.update(headers)
    return points


@points_router.put(
    "/campaigns/{campaign_id}/grid-points",
    openapi_extra=reads({"application/json": GridPoints, "text/csv": TEXT}, **IF_MATCH),
)
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
    changed = before != GridPoints(items=sorted(points.items, key=lambda point: point.label))
    if "if-match" in request.headers or (before.items and changed):
        require_match(request, etag_of(before))
    if changed:  # else the results of the campaign would be outdated by nothing
        operations.replace_points(session, campaign.id, points)
        operations.campaign_for.note(session, user, campaign, "grid_points.put", count=len(points.items))
    stored = operations.list_points(session, campaign.id)
    response.headers["ETag"] = etag_of(stored)
    return stored


def _points_of(body: bytes, content_type: str) -> GridPoints:
    if content_type == "text/csv":
        return operations.from_csv(body)
    if content_type not in ("application/json", ""):
        raise UnsupportedMediaType(f"the body is {content_type}, expected application/json or text/csv")
    return checked(GridPoints, parse_json(body, most_values=BULK_VALUES))
