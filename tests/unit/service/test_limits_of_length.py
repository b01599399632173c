"""Limits of length: what stands in the code holds, and stands in OpenAPI; texts of one character
more are refused.
"""

import re
from collections.abc import Iterator
from typing import Any

import pytest
from pydantic import BaseModel

import service.app.composition  # noqa: F401  imports every body
from service.platform.errors import Fault, Invalid
from service.platform.web.bodies import StrictModel
from service.platform.web.json_body import checked


def bodies(model: type[BaseModel] = StrictModel) -> Iterator[type[BaseModel]]:
    """Every model of a body."""
    for one in model.__subclasses__():
        yield one
        yield from bodies(one)


def stated(model: type[BaseModel]) -> dict[str, int]:
    """Members that are texts, with the least of the limits that the code states."""
    limits_by_name = {}
    for name, field in model.model_fields.items():
        text = repr((field.metadata, field.annotation))
        limits = [int(one) for one in re.findall(r"max_length=(\d+)", text)]
        if limits and "list" not in repr(field.annotation) and "dict" not in repr(field.annotation):
            limits_by_name[name] = min(limits)
    return limits_by_name


LIMITED = [
    (model, name, most) for model in dict.fromkeys(bodies()) for name, most in stated(model).items()
]


def in_openapi(schema: dict[str, Any], name: str) -> set[int]:
    node = schema["properties"][name]
    return {one["maxLength"] for one in [node, *node.get("anyOf", [])] if "maxLength" in one}


@pytest.mark.parametrize(
    ("model", "name", "most"), LIMITED, ids=lambda one: getattr(one, "__name__", str(one))
)
def test_one_character_more_than_a_limit_is_refused_in_words(
    model: type[BaseModel], name: str, most: int
) -> None:
    assert in_openapi(model.model_json_schema(), name) == {most}
    with pytest.raises(Invalid) as refused:
        checked(model, {name: "x" * (most + 1)})
    assert Fault(f"/{name}", f"has {most + 1} characters, expected at most {most}") in [
        Fault("/" + fault.pointer.split("/")[1], fault.detail) for fault in refused.value.faults
    ]


def test_the_limits_are_found() -> None:
    assert len(LIMITED) > 30
    assert ("model", 200) in {(name, most) for _, name, most in LIMITED}
