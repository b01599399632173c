"""HTTP for all features: problem documents, strict bodies, paging, conditional requests, formats,
uploads, downloads.

What needs FastAPI is loaded when it is first named: a worker, which answers nobody, has bodies in
common with the API alone.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from service.platform.web.bodies import (
    Day,
    Id,
    Int64,
    LongList,
    Name,
    Page,
    RequestModel,
    StrictModel,
    Text,
    Time,
    example,
    not_null,
    shown_as,
    wrong,
)

if TYPE_CHECKING:
    from service.platform.web.parameters import (
        IF_MATCH,
        Confirm,
        Cursor,
        Limit,
        UnlessNamed,
        etag_of,
        paged,
        require_match,
        require_usual,
    )

__all__ = [
    "IF_MATCH",
    "Confirm",
    "Cursor",
    "Day",
    "Id",
    "Int64",
    "Limit",
    "LongList",
    "Name",
    "Page",
    "RequestModel",
    "StrictModel",
    "Text",
    "Time",
    "UnlessNamed",
    "etag_of",
    "example",
    "not_null",
    "paged",
    "require_match",
    "require_usual",
    "shown_as",
    "wrong",
]

_LATER = {
    "parameters": (
        *("IF_MATCH", "Confirm", "Cursor", "Limit", "UnlessNamed"),
        *("etag_of", "paged", "require_match", "require_usual"),
    ),
}


def __getattr__(name: str) -> Any:
    """What stands in a module that needs FastAPI."""
    for module, names in _LATER.items():
        if name in names:
            return getattr(import_module(f"service.platform.web.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
