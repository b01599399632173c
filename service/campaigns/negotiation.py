"""Which format a client wants: `?format=` before Accept."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import WithJsonSchema

from service.problems import Invalid, NotAcceptable


def one_of(media_types: Mapping[str, str]) -> WithJsonSchema:
    """What OpenAPI says of `?format=`; `choose_format` checks it."""
    return WithJsonSchema({"type": "string", "enum": list(media_types)})


def choose_format(wanted: str | None, accept: str | None, media_types: Mapping[str, str]) -> str:
    """The name of the format.

    Args:
        wanted: `?format=`.
        accept: the Accept header.
        media_types: name of each format to its media type; the first one is the default.

    Raises:
        Invalid: there is no format of that name.
        NotAcceptable: none of the formats is acceptable.
    """
    if wanted is not None:
        if wanted not in media_types:
            raise Invalid("format", f"is {wanted[:40]!r}, expected one of {', '.join(media_types)}")
        return wanted
    if not accept or not accept.strip():
        return next(iter(media_types))
    best, quality = None, 0.0
    for name, media_type in media_types.items():
        q = _quality(media_type, accept)
        if q > quality:
            best, quality = name, q
    if best is None:
        raise NotAcceptable(f"none of {', '.join(media_types.values())} is acceptable to the client ({accept[:200]})")
    return best


def _quality(media_type: str, accept: str) -> float:
    """The q value of the most specific range of Accept that matches (RFC 9110, 12.5.1); 0 where none does."""
    specificity, quality = -1, 0.0
    for entry in accept.split(","):
        media_range, *parameters = (part.strip().lower() for part in entry.split(";"))
        ranges = {"*/*": 0, media_type.split("/")[0] + "/*": 1, media_type: 2}
        if ranges.get(media_range, -1) > specificity:
            specificity, quality = ranges[media_range], _q(parameters)
    return quality


def _q(parameters: list[str]) -> float:
    for parameter in parameters:
        name, _, value = parameter.partition("=")
        if name.strip() == "q":
            try:
                return min(1.0, max(0.0, float(value)))
            except ValueError:
                return 0.0
    return 1.0
