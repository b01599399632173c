"""Errors of the service, strict bodies, and how both meet HTTP (RFC 9457 problem details)."""

from service.problems.errors import (
    Conflict,
    Fault,
    Forbidden,
    Invalid,
    NotAcceptable,
    NotFound,
    PayloadTooLarge,
    PreconditionFailed,
    PreconditionRequired,
    ServiceError,
    TooManyRequests,
    Unauthorized,
    Unavailable,
    UnsupportedMediaType,
    not_found_as,
)
from service.problems.routing import api_router
from service.problems.schema import Int64, Name, Page, StrictModel, Text, Time, example

__all__ = [
    "Conflict",
    "Fault",
    "Forbidden",
    "Int64",
    "Invalid",
    "Name",
    "NotAcceptable",
    "NotFound",
    "Page",
    "PayloadTooLarge",
    "PreconditionFailed",
    "PreconditionRequired",
    "ServiceError",
    "StrictModel",
    "Text",
    "Time",
    "TooManyRequests",
    "Unauthorized",
    "Unavailable",
    "UnsupportedMediaType",
    "api_router",
    "example",
    "not_found_as",
]
