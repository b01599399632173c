"""The OpenAPI document made complete: every name described, every error listed, headings in the order of the main job."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from service.web.terms import OPEN, TAGS, TERMS

Node = dict[str, Any]

ERRORS = {
    "401": "No key, or one that is not valid: **Authorize**, or send `Authorization: Bearer KEY`",
    "403": "The key's scope or your role in the project is too low",
    "404": "There is no such thing, or it is not yours to see",
    "406": "The format that you accept is not written here",
    "409": "It contradicts what is stored, such as a result of a job that has none",
    "412": "It was changed since the version that `If-Match` names: read it again",
    "413": "The body has more bytes than the operator allows",
    "415": "The body's media type is not read here",
    "422": "A value is wrong: each with a JSON pointer, what was found and what was expected",
    "428": "An edit must say with `If-Match` which version it edits",
    "429": "Too many at a time; `Retry-After` says when to try again",
    "503": "The service cannot answer now; `Retry-After` says when to try again",
}
_PROBLEM = {"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}}
_KEYS = ("/api-keys", "/session", "/audit-events")


def complete(document: Node) -> None:
    """Complete a document in place; doing it twice changes nothing."""
    for name, schema in document["components"]["schemas"].items():
        _describe(name, schema)
    for path, operation in _operations(document):
        operation["tags"] = [_tag(path, operation)]
        for parameter in operation.get("parameters", []):
            if not (parameter.get("description") or parameter["schema"].get("description")):
                _say(parameter, TERMS.get(parameter["name"]))
        for body in _bodies(operation):
            _describe("", body)
        _list_errors(path, operation)
    used = {tag for _, operation in _operations(document) for tag in operation["tags"]}
    document["tags"] = [{"name": name, "description": text} for name, text in TAGS if name in used]


def undescribed(document: Node) -> list[str]:
    """Properties and parameters without a description, and headings without a sentence; for the test that there are none."""
    found = [
        f"{name}.{prop}"
        for name, schema in document["components"]["schemas"].items()
        for prop, node in schema.get("properties", {}).items()
        if not node.get("description")
    ]
    for path, operation in _operations(document):
        found += [
            f"{path} {parameter['name']}"
            for parameter in operation.get("parameters", [])
            if not (parameter.get("description") or parameter["schema"].get("description"))
        ]
        found += [f"{path} heading {tag}" for tag in operation["tags"] if tag not in dict(TAGS)]
    return found


def _operations(document: Node) -> Iterator[tuple[str, Node]]:
    for path, methods in document["paths"].items():
        for operation in methods.values():
            yield path, operation


def _bodies(operation: Node) -> Iterator[Node]:
    places = [operation.get("requestBody", {}), *operation.get("responses", {}).values()]
    for place in places:
        for content in place.get("content", {}).values():
            if isinstance(content.get("schema"), dict):
                yield content["schema"]


def _describe(schema_name: str, node: Any) -> None:
    """Describe all properties below, and give objects with names of the client's own an example."""
    if isinstance(node, list):
        for part in node:
            _describe(schema_name, part)
    if not isinstance(node, dict):
        return
    for name, prop in node.get("properties", {}).items():
        if isinstance(prop, dict) and not prop.get("description"):
            _say(prop, TERMS.get(f"{schema_name}.{name}", TERMS.get(name)))
        if isinstance(prop, dict) and _is_open(prop):
            prop.setdefault("examples", [OPEN.get(name, {})])
    if _is_open(node):
        node.setdefault("examples", [{}])
    for key, part in node.items():
        if key not in ("examples", "example", "default", "enum"):
            _describe(schema_name, part)


def _is_open(node: Node) -> bool:
    options = [node, *node.get("anyOf", [])]
    return any(isinstance(each, dict) and each.get("additionalProperties") not in (None, False) for each in options)


def _say(node: Node, text: str | None) -> None:
    if text:
        node["description"] = text


def _tag(path: str, operation: Node) -> str:
    tag: str = operation.get("tags", ["health"])[0]
    if tag != "access":
        return tag
    return "keys" if any(step in path for step in _KEYS) else "projects"


def _list_errors(path: str, operation: Node) -> None:
    """The errors that this operation can answer with."""
    if not path.startswith("/api/"):
        return
    responses = operation["responses"]
    for wide in ("4XX", "5XX"):
        responses.pop(wide, None)
    names = {parameter["name"].lower() for parameter in operation.get("parameters", [])}
    codes = ["401", "403", "404", "409", "422", "429", "503"]
    codes += ["412", "428"] if "if-match" in names else []
    codes += ["413", "415"] if "requestBody" in operation else []
    codes += ["406"] if "format" in names else []
    for code in sorted(codes):
        responses.setdefault(code, {"description": ERRORS[code], "content": _PROBLEM})
