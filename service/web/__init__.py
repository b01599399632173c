"""HTTP for all features: problem documents, strict bodies, paging, conditional requests, formats, uploads, downloads."""

from service.web.bodies import Int64, Name, Page, StrictModel, Text, Time, example, not_null
from service.web.conditional import IF_MATCH, etag_of, require_match
from service.web.paging import Cursor, Limit, paged
from service.web.routing import api_router

__all__ = [
    "IF_MATCH",
    "Cursor",
    "Int64",
    "Limit",
    "Name",
    "Page",
    "StrictModel",
    "Text",
    "Time",
    "api_router",
    "etag_of",
    "example",
    "not_null",
    "paged",
    "require_match",
]
