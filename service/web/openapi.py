"""What OpenAPI says of errors: every operation may answer with a problem document."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from pydantic import BaseModel

from service.web.openapi_document import complete

_REFERENCE = {"$ref": "#/components/schemas/Problem"}

RESPONSES: dict[int | str, dict[str, Any]] = {
    "4XX": {
        "description": "The request cannot be answered: what was found, what was expected, what to do",
        "content": {"application/problem+json": {"schema": _REFERENCE}},
    },
    "5XX": {
        "description": "The service cannot answer now",
        "content": {"application/problem+json": {"schema": _REFERENCE}},
    },
}
"""Responses that every operation has besides its own."""

_PROBLEM = {
    "title": "Problem",
    "description": "RFC 9457 problem details.",
    "type": "object",
    "required": ["type", "title", "status", "detail", "request_id"],
    "properties": {
        "type": {"type": "string", "format": "uri-reference", "description": "Always about:blank."},
        "title": {"type": "string", "description": "The status in words."},
        "status": {"type": "integer", "description": "Of HTTP."},
        "detail": {"type": "string", "description": "What was found, what was expected, what to do."},
        "request_id": {"type": "string", "description": "Name of the request in the service's log."},
        "confirmable": {
            "type": "boolean",
            "description": "True where numbers are probably in another unit: the same with `?confirm=true` is taken.",
        },
        "errors": {
            "type": "array",
            "description": "Each wrong value, of a request that was understood but is wrong.",
            "items": {
                "type": "object",
                "required": ["pointer", "detail"],
                "properties": {
                    "pointer": {
                        "type": "string",
                        "description": "JSON pointer into the body, or name of the query parameter or header.",
                    },
                    "detail": {"type": "string", "description": "What was found and what was expected."},
                },
            },
        },
    },
}


def schema_of(model: type[BaseModel]) -> dict[str, Any]:
    """The JSON schema of a body that a route reads itself, such as one field of a form. It stands alone: what it refers
    to is put in its place.
    """
    whole = model.model_json_schema()
    definitions = whole.pop("$defs", {})

    def inline(node: Any) -> Any:
        if isinstance(node, dict):
            if "$ref" in node:
                return inline(definitions[node["$ref"].rsplit("/", 1)[1]])
            return {key: inline(value) for key, value in node.items()}
        return [inline(item) for item in node] if isinstance(node, list) else node

    return dict(inline(whole))


def describe_problems(app: FastAPI) -> None:
    """Complete the app's OpenAPI document: the schema that `RESPONSES` refers to, descriptions, errors, headings."""
    without = app.openapi

    def openapi() -> dict[str, Any]:
        document = without()
        document.setdefault("components", {}).setdefault("schemas", {})["Problem"] = _PROBLEM
        complete(document)
        return document

    app.openapi = openapi  # type: ignore[method-assign]  # FastAPI's own way to extend the document
