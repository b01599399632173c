"""Routes of grid points."""

from __future__ import annotations

from typing import Annotated, Any
from uuid import UUID

from fastapi import Header, Query, Request, Response

from service.access import CurrentUser, SessionDep, SettingsDep, audit
from service.errors import PayloadTooLarge, UnsupportedMediaType
from service.store.campaigns import grid_points
from service.store.campaigns.operations import campaign_for
from service.store.campaigns.schemas import GridPoints
from service.store.campaigns.uploads import UploadDep
from service.web import IF_MATCH, api_router, etag_of, require_match
from service.web.json_body import BULK_VALUES, checked, parse_json
from service.web.negotiation import choose_format, one_of
from service.web.openapi import schema_of
from service.web.routing import Later

router = api_router(tags=["grid points"])

MEDIA_TYPES = {"json": "application/json", "csv": "text/csv"}
BODY = Later(
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

FILES: dict[int | str, dict[str, Any]] = {200: {"content": {"text/csv": {"schema": {"type": "string"}}}}}


@router.get("/campaigns/{campaign_id}/grid-points", response_model=GridPoints, responses=FILES)
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
    campaign = campaign_for(session, user, campaign_id)
    points = grid_points.list_points(session, campaign.id)
    headers = {"ETag": etag_of(points), "Vary": "Accept"}
    if choose_format(file_format, accept, MEDIA_TYPES) == "csv":
        return Response(grid_points.to_csv(points), media_type="text/csv", headers=headers)
    response.headers.update(headers)
    return points


@router.put("/campaigns/{campaign_id}/grid-points", openapi_extra=BODY)
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
    points = _read(upload.file.path.read_bytes(), upload.content_type)
    campaign = campaign_for(session, user, campaign_id, "editor", lock=True)
    before = grid_points.list_points(session, campaign.id)
    if before.items or "if-match" in request.headers:
        after = GridPoints(items=sorted(points.items, key=lambda point: point.label))
        if "if-match" in request.headers or before != after:
            require_match(request, etag_of(before))
    grid_points.replace_points(session, campaign.id, points)
    count = len(points.items)
    audit(
        session,
        user,
        "grid_points.put",
        "campaign",
        campaign.id,
        campaign_for.project_of(session, campaign),
        count=count,
    )
    stored = grid_points.list_points(session, campaign.id)
    response.headers["ETag"] = etag_of(stored)
    return stored


def _read(body: bytes, content_type: str) -> GridPoints:
    if content_type == "text/csv":
        return grid_points.from_csv(body)
    if content_type not in ("application/json", ""):
        raise UnsupportedMediaType(f"the body is {content_type}, expected application/json or text/csv")
    return checked(GridPoints, parse_json(body, most_values=BULK_VALUES))
