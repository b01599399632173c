"""Routers of the contract, whose routes read strictly and create once."""

from collections.abc import Callable
from typing import Any

from fastapi import APIRouter

from service.platform.access.once import answered_once
from service.platform.web.json_body import BULK_VALUES
from service.platform.web.openapi import RESPONSES
from service.platform.web.routing import API, StrictRoute


class ApiRoute(StrictRoute):
    """A route of the contract. One that creates something, a POST that answers 201, or 202 while a
    job makes it, takes an `Idempotency-Key`.
    """

    def __init__(self, path: str, endpoint: Callable[..., Any], **given: Any) -> None:
        creates = given["methods"] == ["POST"] and given["status_code"] in (201, 202)
        super().__init__(path, answered_once(endpoint) if creates else endpoint, **given)


class BulkRoute(ApiRoute):
    """A route whose body carries measured values."""

    most_bytes, most_values = 2**62, BULK_VALUES  # the operator's limit on JSON is smaller


def api_router(*, tags: list[str], bulk: bool = False) -> APIRouter:
    """A router for one feature, to be listed in `service.app.composition`; paths are relative to
    `/api/v1`, operations are called as their functions.

    Args:
        tags: headings on the documentation page.
        bulk: bodies carry measured values, and may be large.
    """
    return APIRouter(
        prefix=API,
        route_class=BulkRoute if bulk else ApiRoute,
        tags=list(tags),
        responses=RESPONSES,
        generate_unique_id_function=lambda route: route.name,
    )
