"""Optimistic editing: an answer's ETag, and If-Match before a change."""

from __future__ import annotations

import hashlib
from typing import Any

from fastapi import Request
from pydantic import BaseModel

from service.problems.errors import PreconditionFailed, PreconditionRequired

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
    """A strong ETag of a representation: a digest of its JSON."""
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
    if header.strip() != "*" and etag not in (tag.strip() for tag in header.split(",")):
        raise PreconditionFailed(f"it was changed since: its ETag is now {etag}; read it again, then edit")
