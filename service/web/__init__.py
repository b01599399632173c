"""HTTP for all features: problem documents, strict bodies, paging, conditional requests, formats, uploads, downloads.

What needs FastAPI is loaded when it is first named: a worker, which answers nobody, has bodies in common with the API alone.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from service.web.bodies import Int64, Name, Page, StrictModel, Text, Time, example, not_null

if TYPE_CHECKING:
    from service.web.conditional import IF_MATCH, etag_of, require_match
    from service.web.paging import Cursor, Limit, paged
    from service.web.routing import api_router
    from service.web.usual import Confirm, require_usual

__all__ = [
    "IF_MATCH",
    "Confirm",
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
    "require_usual",
]

_LATER = {
    "conditional": ("IF_MATCH", "etag_of", "require_match"),
    "paging": ("Cursor", "Limit", "paged"),
    "routing": ("api_router",),
    "usual": ("Confirm", "require_usual"),
}


def __getattr__(name: str) -> Any:
    """What stands in a module that needs FastAPI."""
    for module, names in _LATER.items():
        if name in names:
            return getattr(import_module(f"service.web.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
