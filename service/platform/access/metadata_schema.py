"""JSON Schemas that a project demands of what is entered in it: of structures, campaigns, and the
labels of FRFs and results.

A schema is read with patterns whose time is linear, and without references: one to another machine
would be fetched, and a few that refer to one another can make a check last for hours.
"""

import json
from typing import Annotated, Any, Literal

import jsonschema_rs
from pydantic import AfterValidator, Field, JsonValue
from sqlalchemy.orm import Session

from service.platform.access.tables import Project
from service.platform.errors import MOST_FAULTS, Fault, Invalid, pointer
from service.platform.web.bodies import wrong

SchemaSubject = Literal["structure", "campaign", "frfs", "result"]
"""What a project can demand something of."""

LONGEST = 20_000
"""Characters of a schema as JSON."""
_REFERENCES = {"$ref", "$dynamicRef", "$recursiveRef", "$schema", "$id", "$vocabulary"}


def _schema(value: dict[str, JsonValue]) -> dict[str, JsonValue]:
    """Refuse what is no JSON Schema of draft 2020-12, is too long, or refers to another."""
    if (size := len(json.dumps(value))) > LONGEST:
        raise wrong(f"has {size} characters as JSON, at most {LONGEST} are read")
    if references := sorted(_keys(value) & _REFERENCES):
        raise wrong(f"has {references[0]}; a schema must stand alone, without references")
    try:
        _validator(value)
    except (jsonschema_rs.ValidationError, ValueError) as error:
        why = getattr(error, "message", str(error))[:300]
        raise wrong(f"is no JSON Schema: {why}") from None
    return value


def _keys(value: Any) -> set[str]:
    keys: set[str] = set()
    waiting = [value]
    while waiting:
        one = waiting.pop()
        if isinstance(one, dict):
            keys |= one.keys()
            waiting += one.values()
        elif isinstance(one, list):
            waiting += one
    return keys


def _validator(schema: Any) -> jsonschema_rs.Draft202012Validator:
    return jsonschema_rs.Draft202012Validator(schema, pattern_options=jsonschema_rs.RegexOptions())


Schemas = Annotated[
    dict[SchemaSubject, Annotated[dict[str, JsonValue], AfterValidator(_schema)]],
    Field(json_schema_extra={"examples": [{"campaign": {"required": ["temperature_c"]}}]}),
]


def require_metadata(
    session: Session, project_id: Any, kind: SchemaSubject, document: dict[str, Any]
) -> None:
    """Refuse what does not fulfil the schema that its project demands of its kind.

    Args:
        session: where to ask.
        project_id: of its project.
        kind: what it is.
        document: what it would be, as JSON; members that are null count as not stated.

    Raises:
        Invalid: each fault with its pointer.
    """
    schema = session.get_one(Project, project_id).schemas.get(kind)
    if schema is None:
        return
    stated = {name: value for name, value in document.items() if value is not None}
    faults = [
        Fault(_pointer(error), f"{error.message[:300]}; the project demands it of each {kind}")
        for error, _ in zip(
            _validator(schema).iter_errors(stated), range(MOST_FAULTS), strict=False
        )
    ]
    if faults:
        raise Invalid(faults)


def _pointer(error: jsonschema_rs.ValidationError) -> str:
    """Where a fault is; of a member that is missing, where it would be."""
    path = [
        *error.instance_path,
        *([missing] if (missing := getattr(error.kind, "property", None)) else []),
    ]
    return pointer(path)
