"""The OpenAPI document made complete, every name described, every error listed, headings in the
order of the main job; and the page that shows it, from this host alone.
"""

import hashlib
import json
import re
from base64 import b64encode
from collections import Counter
from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.docs import get_swagger_ui_html
from fastapi.responses import RedirectResponse
from fastapi.staticfiles import StaticFiles
from pydantic import BaseModel
from starlette.responses import HTMLResponse

from service.platform.web.middleware import NOTHING
from service.platform.web.terms import OPEN, headings, term

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
_CONTENT = {"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}}
_KEYS = ("/api-keys", "/session", "/audit-events")


def complete(document: Node) -> None:
    """Complete a document in place; doing it twice changes nothing.

    Raises:
        ValueError: two schemas have one name.
    """
    schemas = document.setdefault("components", {}).setdefault("schemas", {})
    schemas["Problem"] = _PROBLEM
    for _, operation in _operations(document):
        for name, schema in operation.pop(MODELS, {}).items():
            if schemas.setdefault(name, schema) != schema:
                raise ValueError(f"two schemas of the document are called {name}")
    for name, schema in schemas.items():
        _describe(name, schema)
    for path, operation in _operations(document):
        operation["tags"] = [_tag(path, operation)]
        operation["summary"] = _title(operation)
        for parameter in operation.get("parameters", []):
            if not (parameter.get("description") or parameter["schema"].get("description")):
                _say(parameter, term(parameter["name"]))
        for body in _bodies(operation):
            _describe("", body)
        _list_errors(path, operation)
    _add_curl(document)
    used = {tag for _, operation in _operations(document) for tag in operation["tags"]}
    own = {tag["name"]: tag["description"] for tag in document.get("tags", ())}
    document["tags"] = [
        {"name": name, "description": text} for name, text in headings(own) if name in used
    ]


_LONGEST_TITLE = 60


def _title(operation: Node) -> str:
    """What a docstring begins with, which is written to be the title: up to its first sign that is
    no comma, or where that is too long up to a comma.
    """
    text = operation["description"].replace("\n", " ")
    whole = re.split(r"[.;:](?: |$)", text)[0]
    return whole if len(whole) <= _LONGEST_TITLE else whole.split(", ")[0]


_STEP = re.compile(r"`(GET|POST|PUT) (/[^`]+)`")
_ASKED = "With curl:"


def _add_curl(document: Node) -> None:
    """Say to each step of the main job, which the document's description lists, how curl does it:
    `$URL` and `$KEY` are the service and a key, `$PROJECT_ID` and so on ids of earlier answers.
    """
    for method, step in _STEP.findall(document["info"].get("description", "")):
        shape = re.compile(re.sub(r"\\\{\w+\\\}", r"\\{\\w+\\}", re.escape(f"/api/v1{step}")))
        for path, methods in document["paths"].items():
            operation = methods.get(method.lower())
            if operation is None or not shape.fullmatch(path):
                continue
            text = operation["description"]
            if _ASKED not in text:
                content = operation.get("requestBody", {}).get("content", {})
                command = _curl(method, path, content, document["components"]["schemas"])
                operation["description"] = f"{text}\n\n{_ASKED}\n\n```sh\n{command}\n```"


def _curl(method: str, path: str, content: Node, schemas: Node) -> str:
    """A command that sends the example of a body, or a file."""
    address = re.sub(r"\{(\w+)\}", lambda name: f"${name[1].upper()}", path)
    send = " -X PUT" if method == "PUT" else ""
    if path.endswith("/report"):
        address, send = f"{address}?format=pdf", " -o report.pdf"
    if "multipart/form-data" in content:
        send += " -F file=@beam.uff"
    elif "application/json" in content:
        schema = content["application/json"]["schema"]
        name = schema.get("anyOf", [schema])[0]["$ref"].rsplit("/", 1)[1]
        body = json.dumps(schemas[name]["examples"][0]).replace("'", "'\\''")
        send += f" -H 'Content-Type: application/json' \\\n  -d '{body}'"
    return f'curl -H "Authorization: Bearer $KEY" "$URL{address}"{send}'


def undescribed(document: Node) -> list[str]:
    """Properties and parameters without a description, headings without a sentence, titles that are
    long or stand twice, and bodies without an example; for the test that there are none.
    """
    missing = [
        f"{name}.{prop}"
        for name, schema in document["components"]["schemas"].items()
        for prop, node in schema.get("properties", {}).items()
        if not node.get("description")
    ]
    titles = Counter(operation["summary"] for _, operation in _operations(document))
    headed = {tag["name"] for tag in document["tags"]}
    for path, operation in _operations(document):
        missing += [
            f"{path} {parameter['name']}"
            for parameter in operation.get("parameters", [])
            if not (parameter.get("description") or parameter["schema"].get("description"))
        ]
        title = operation["summary"]
        if titles[title] > 1 or not 0 < len(title) <= _LONGEST_TITLE:
            missing.append(f"{path} title {title!r}")
        for kind, body in operation.get("requestBody", {}).get("content", {}).items():
            if not _has_example(body["schema"], document["components"]["schemas"]):
                missing.append(f"{path} example of {kind}")
        missing += [f"{path} heading {tag}" for tag in operation["tags"] if tag not in headed]
    return missing


def _has_example(schema: Node, schemas: Node) -> bool:
    """Whether a body has one; of a form each text, and of bytes there is none to show."""
    node = schema.get("anyOf", [schema])[0]
    node = schemas[node["$ref"].rsplit("/", 1)[1]] if "$ref" in node else node
    if node.get("format") == "binary" or node.get("examples"):
        return True
    return bool(node.get("properties")) and all(
        part.get("format") == "binary" or part.get("examples")
        for part in node["properties"].values()
    )


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
            _say(prop, term(name, schema_name))
        if isinstance(prop, dict) and _is_open(prop):
            prop.setdefault("examples", [OPEN.get(name, {})])
    if _is_open(node):
        node.setdefault("examples", [{}])
    for key, part in node.items():
        if key not in ("examples", "example", "default", "enum"):
            _describe(schema_name, part)


def _is_open(node: Node) -> bool:
    options = [node, *node.get("anyOf", [])]
    return any(
        isinstance(each, dict) and each.get("additionalProperties") not in (None, False)
        for each in options
    )


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
        responses.setdefault(code, {"description": ERRORS[code], "content": _CONTENT})


RESPONSES: dict[int | str, dict[str, Any]] = {
    f"{digit}XX": {"description": text, "content": _CONTENT}
    for digit, text in (
        (4, "The request cannot be answered: the body says why"),
        (5, "The service cannot answer now"),
    )
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
        "detail": {
            "type": "string",
            "description": "What was found, what was expected, what to do.",
        },
        "request_id": {
            "type": "string",
            "description": "Name of the request in the service's log.",
        },
        "confirmable": {
            "type": "boolean",
            "description": (
                "True where numbers are probably in another unit: the same with `?confirm=true` is"
                " taken."
            ),
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
                        "description": (
                            "JSON pointer into the body, or name of the query parameter or header."
                        ),
                    },
                    "detail": {
                        "type": "string",
                        "description": "What was found and what was expected.",
                    },
                },
            },
        },
    },
}


MODELS = "x-models"
"""Where a route that reads its body itself keeps the schemas that its body names, until the document
is completed.
"""


def schemas_of(model: type[BaseModel]) -> dict[str, Node]:
    """The JSON schemas of a model and of those that it names, by their names."""
    whole = model.model_json_schema(ref_template=_REF)
    return {**whole.pop("$defs", {}), model.__name__: whole}


_REF = "#/components/schemas/{model}"


def reads(content: Mapping[str, Any], **more: Any) -> dict[str, Any]:
    """What a route says to OpenAPI that reads its body itself.

    Args:
        content: media type to schema, in which a model stands for its own. One with a `title` gets a
            name by it.
        more: what else the route says.
    """
    named: dict[str, Node] = {}

    def filled(node: Any) -> Any:
        if isinstance(node, type):
            named.update(schemas_of(node))
            return {"$ref": _REF.format(model=node.__name__)}
        if isinstance(node, dict) and "title" in node and "type" in node:
            title = node["title"]
            named[title] = {key: filled(value) for key, value in node.items()}
            return {"$ref": _REF.format(model=title)}
        if isinstance(node, dict):
            return {key: filled(value) for key, value in node.items()}
        return [filled(item) for item in node] if isinstance(node, list) else node

    by_type = {kind: {"schema": filled(schema)} for kind, schema in content.items()}
    return {**more, MODELS: named, "requestBody": {"required": True, "content": by_type}}


TEXT, BINARY = {"type": "string"}, {"type": "string", "format": "binary"}


def upload(title: str, **fields: tuple[str, str]) -> dict[str, Any]:
    """Both forms in which a file may be uploaded, as `reads` takes them.

    Args:
        title: name of the form's schema.
        fields: the texts that the form may have beside the file, each with its description and an
            example.
    """
    return {
        # first, since the documentation page sends the first, and this one keeps the file's name
        "multipart/form-data": {
            "title": title,
            "type": "object",
            "required": ["file"],
            "properties": {
                "file": {**BINARY, "description": "the file, with its name"},
                **{
                    name: {**TEXT, "description": text, "examples": [example]}
                    for name, (text, example) in fields.items()
                },
            },
        },
        "application/octet-stream": BINARY,
    }


def describe_problems(app: FastAPI) -> None:
    """Complete the app's OpenAPI document: the schema that `RESPONSES` refers to, descriptions,
    errors, headings.
    """
    without = app.openapi

    def openapi() -> dict[str, Any]:
        document = without()
        complete(document)
        return document

    app.openapi = openapi  # type: ignore[method-assign]  # FastAPI's own way to extend the document


ASSETS = "static-offline-docs"


def add_documentation(app: FastAPI) -> None:
    """`/docs`, and the files that it needs; `/redoc` leads there."""
    page = _page(app)
    # The bundle sets styles in place and draws icons from data: addresses; scripts are ours alone.
    scripts = f"script-src 'self' {_inline_scripts(page)}"
    others = "style-src 'self'; img-src 'self' data:; connect-src 'self'"
    headers = {"Content-Security-Policy": f"{NOTHING}; {scripts}; {others}"}
    app.mount(f"/{ASSETS}", StaticFiles(directory=_assets()), name=ASSETS)

    @app.get("/docs", include_in_schema=False)
    async def documentation() -> HTMLResponse:
        """Every operation, to read and to try."""
        return HTMLResponse(page, headers=headers)

    @app.get("/redoc", include_in_schema=False)
    async def to_documentation() -> RedirectResponse:
        """A browser that was given the address of a page that was."""
        return RedirectResponse("docs")


def _page(app: FastAPI) -> str:
    """Addresses in it are relative, so that it works below a prefix of a proxy; nobody else checks
    the document.
    """
    answer = get_swagger_ui_html(
        openapi_url="openapi.json",
        title=f"{app.title}: documentation",
        swagger_js_url=f"{ASSETS}/swagger-ui-bundle.js",
        swagger_css_url=f"{ASSETS}/swagger-ui.css",
        swagger_favicon_url=f"{ASSETS}/favicon.png",
        swagger_ui_parameters={
            "validatorUrl": None,
            "persistAuthorization": True,  # the key is kept over a reload, in this browser
            "docExpansion": "none",
            "defaultModelsExpandDepth": 0,
            "filter": True,
        },
    )
    return bytes(answer.body).decode()


def _inline_scripts(page: str) -> str:
    """The scripts within a page, as a Content-Security-Policy allows them: by their digest."""
    scripts = re.findall(r"<script>(.*?)</script>", page, flags=re.DOTALL)
    digests = (b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts)
    return " ".join(f"'sha256-{digest}'" for digest in digests)


def _assets() -> Path:
    package = find_spec("fastapi_offline")
    if package is None or package.origin is None:
        raise RuntimeError("fastapi-offline is not installed; install modalbase again")
    return Path(package.origin).parent / "static"
