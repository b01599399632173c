"""Routes of campaigns and of their grid points."""

from typing import Annotated, Any
from uuid import UUID

from fastapi import Query, Request, Response

from service.nouns.campaigns import operations
from service.nouns.campaigns.schemas import (
    CampaignIn,
    CampaignOut,
    CampaignPatch,
    GridPoints,
    GridPointsPage,
)
from service.platform.access import CurrentUser, SessionDep, SettingsDep, api_router
from service.platform.access.nouns import NounRoutes
from service.platform.errors import Invalid, PayloadTooLarge, UnsupportedMediaType
from service.platform.web import IF_MATCH, Cursor, etag_of, require_match
from service.platform.web.json_body import BULK_VALUES, checked, parse_json
from service.platform.web.openapi import TEXT, reads
from service.platform.web.parameters import form_of
from service.platform.web.routing import require_used
from service.platform.web.uploads import UploadDep

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
    "Describe a measurement: boundary, date, climate, instruments, and the frame of the file's"
    " coordinates.",
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
    measured=True,
)
nouns.deleting(
    "delete_campaign", "Hide a campaign and what is in it. It stays stored and can be restored."
)
nouns.restoring("restore_campaign", "Bring a deleted campaign back.")


points_router = api_router(tags=["grid points"])

MEDIA_TYPES = {"json": "application/json", "csv": "text/csv"}
POINTS_FILES: dict[int | str, dict[str, Any]] = {
    200: {"content": {"text/csv": {"schema": {"type": "string"}}}}
}


@points_router.get(
    "/campaigns/{campaign_id}/grid-points",
    response_model=GridPointsPage,
    response_model_exclude_unset=True,
    responses=POINTS_FILES,
)
def get_grid_points(
    campaign_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    request: Request,
    response: Response,
    form: Annotated[str, form_of(MEDIA_TYPES)],
    cursor: Cursor = None,
    limit: Annotated[
        int | None, Query(ge=1, le=1000, description="rows in a page; default: all at once")
    ] = None,
) -> GridPoints | Response:
    """All grid points of a campaign, in the file's coordinates, as JSON or CSV; JSON in pages where
    a limit is stated.
    """
    campaign = operations.campaign_for(session, user, campaign_id)
    points = operations.list_points(session, campaign.id)
    headers = {"ETag": etag_of(points), "Vary": "Accept"}
    if form == "csv":
        require_used(request, "the csv of grid points", {"cursor", "limit"}, "it has all points")
        return Response(operations.to_csv(points), media_type="text/csv", headers=headers)
    response.headers.update(headers)
    return points if cursor is None and limit is None else _page(points, cursor, limit or 100)


def _page(points: GridPoints, cursor: str | None, limit: int) -> GridPointsPage:
    """A page of points, which are ordered by their labels; its cursor is the last one's.

    Raises:
        Invalid: the cursor is none of this list.
    """
    if cursor is not None and not cursor.isdecimal():
        raise Invalid("cursor", "is not a cursor of this list; take `next_cursor` of a page")
    rest = [point for point in points.items if cursor is None or point.label > int(cursor)]
    following = str(rest[limit - 1].label) if len(rest) > limit else None
    return GridPointsPage(items=rest[:limit], next_cursor=following)


@points_router.put(
    "/campaigns/{campaign_id}/grid-points",
    openapi_extra=reads(
        {
            "application/json": GridPoints,
            "text/csv": {**TEXT, "examples": ["label,x_m,y_m,z_m\n1,0,-0.02,0\n"]},
        },
        **IF_MATCH,
    ),
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
    """Store these points in place of all that are there, from JSON
    `{items: [{label, x_m, y_m, z_m}]}` or CSV.

    Where points are there that would change, If-Match must name the version that is replaced.
    """
    if upload.file.size > settings.json_limit_bytes:
        raise PayloadTooLarge(
            f"the body has {upload.file.size} bytes, the operator allows"
            f" {settings.json_limit_bytes}"
        )
    points = _points_of(upload.file.path.read_bytes(), upload.content_type)
    campaign = operations.campaign_for(session, user, campaign_id, "editor", lock=True)
    before = operations.list_points(session, campaign.id)
    changed = before != GridPoints(items=sorted(points.items, key=lambda point: point.label))
    if "if-match" in request.headers or (before.items and changed):
        require_match(request, etag_of(before))
    if changed:  # else the results of the campaign would be outdated by nothing
        operations.replace_points(session, campaign.id, points)
        operations.campaign_for.note(
            session, user, campaign, "grid_points.put", count=len(points.items)
        )
    stored = operations.list_points(session, campaign.id)
    response.headers["ETag"] = etag_of(stored)
    return stored


def _points_of(body: bytes, content_type: str) -> GridPoints:
    if content_type == "text/csv":
        return operations.from_csv(body)
    if content_type not in ("application/json", ""):
        raise UnsupportedMediaType(
            f"the body is {content_type}, expected application/json or text/csv"
        )
    return checked(GridPoints, parse_json(body, most_values=BULK_VALUES))
