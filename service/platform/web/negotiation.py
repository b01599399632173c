"""What kind a body is, and which format a client wants: `?format=` before Accept."""

from collections.abc import Mapping

from pydantic import WithJsonSchema

from service.platform.errors import Invalid, NotAcceptable


def content_type(header: str | None) -> str:
    """The media type of a Content-Type header, without its parameters; empty where it states none.

    >>> content_type("Application/JSON; charset=utf-8"), content_type(None)
    ('application/json', '')
    """
    return (header or "").split(";")[0].strip().lower()


def is_json(kind: str) -> bool:
    """Whether a media type is JSON or based on it (RFC 6839).

    >>> is_json("application/json"), is_json("application/merge-patch+json"), is_json("text/csv")
    (True, True, False)
    """
    return kind == "application/json" or kind.endswith("+json")


def one_of(media_types: Mapping[str, str]) -> WithJsonSchema:
    """What OpenAPI says of the parameter `?format=`: these names and no others. `choose_format`
    checks it.
    """
    return WithJsonSchema({"type": "string", "enum": list(media_types)})


def choose_format(requested: str | None, accept: str | None, media_types: Mapping[str, str]) -> str:
    """The name of the format that the client wants: by `?format=`, else the one that Accept
    prefers, else the first.

    >>> formats = {"json": "application/json", "csv": "text/csv"}
    >>> choose_format(None, "text/csv, application/json;q=0.5", formats), choose_format(None, None, formats)
    ('csv', 'json')

    Args:
        requested: `?format=`.
        accept: the Accept header.
        media_types: name of each format to its media type; the first one is the default.

    Raises:
        Invalid: there is no format of that name.
        NotAcceptable: none of the formats is acceptable.
    """
    if requested is not None:
        if requested not in media_types:
            raise Invalid(
                "format", f"is {requested[:40]!r}, expected one of {', '.join(media_types)}"
            )
        return requested
    if not accept or not accept.strip():
        return next(iter(media_types))
    best, quality = None, 0.0
    for name, media_type in media_types.items():
        q = _quality(media_type, accept)
        if q > quality:
            best, quality = name, q
    if best is None:
        raise NotAcceptable(
            f"none of {', '.join(media_types.values())} is acceptable to the client"
            f" ({accept[:200]})"
        )
    return best


def _quality(media_type: str, accept: str) -> float:
    """The q value of the most specific range of Accept that matches (RFC 9110, 12.5.1); 0 where
    none does.
    """
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
