"""Optimistic editing: an answer's ETag, and If-Match before a change."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any

from fastapi import Request, Response
from pydantic import BaseModel

from service.errors import PreconditionFailed, PreconditionRequired

IF_MATCH: dict[str, Any] = {
    "parameters": [
        {
            "name": "If-Match",
            "in": "header",
            "schema": {"type": "string"},
            "description": "the ETag of the version that you change, as its GET gave it",
        }
    ]
}
"""`openapi_extra` of a route that calls `require_match`."""


def etag_of(body: BaseModel) -> str:
    """A strong ETag of a representation: half of the SHA-256 of its JSON, in quotes. Two equal representations have the
    same one, on any machine.
    """
    return '"' + hashlib.sha256(body.model_dump_json().encode()).hexdigest()[:32] + '"'


def require_match(request: Request, etag: str) -> None:
    """Refuse an edit of another version than the present one.

    Read the row `with_for_update()` before, so that two edits cannot both match.

    Raises:
        PreconditionRequired: the request has no If-Match.
        PreconditionFailed: If-Match names another version.
    """
    header = request.headers.get("if-match")
    if header is None:
        raise PreconditionRequired("send If-Match with the ETag of the version that you edit")
    if header.strip() != "*" and not _names(header, etag):
        raise PreconditionFailed(f"it was changed since: its ETag is now {etag}; read it again, then edit")


def not_modified(request: Request, headers: Mapping[str, str]) -> Response | None:
    """The answer 304 where the client has this version already.

    Args:
        request: whose If-None-Match is compared.
        headers: of the full answer; `ETag` is among them.

    Returns:
        The answer, with these headers; None where the client needs the full one.
    """
    if _names(request.headers.get("if-none-match", ""), headers["ETag"]):
        return Response(status_code=304, headers=dict(headers))
    return None


def _names(header: str, etag: str) -> bool:
    return etag in (tag.strip() for tag in header.split(","))
