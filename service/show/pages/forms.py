"""The form of a recipe, made from its schema: whatever the contract takes, the form has."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pydantic import BaseModel

from service.show.pages.numbers import words
from service.web.quantities import UNITS

CHECKED_LIST = "choices"
SCALES = {"_m": ("mm", "0.001"), "_Pa": ("GPa", "1e9"), "_kg": ("g", "0.001")}
"""What people write in place of the SI unit at the end of a name, and its size."""
SIMPLE = {"number": "number", "integer": "whole", "boolean": "switch"}


@dataclass(frozen=True)
class Field:
    """One question of a form."""

    name: str  # JSON pointer of its value without the first slash
    label: str  # in words
    kind: str  # `number`, `whole`, `text`, `select`, `choices`, `pair`, `numbers`, `switch`, `group`, `table`
    help: str = ""  # what the contract says of it
    default: Any = None  # its value where nothing is said
    options: list[tuple[str, str]] = field(default_factory=list)  # value and words of each choice
    fields: list[Field] = field(default_factory=list)  # of a group, or of one row of a table
    nullable: bool = False  # whether nothing can be said
    scale: str = ""  # SI of one unit of the field, where people write another one: mm, GPa, g


def fields_of(model: type[BaseModel], choices: Mapping[str, list[tuple[str, str]]]) -> list[Field]:
    """The questions of a body, in the order of its members.

    Args:
        model: of the body.
        choices: value and words to choose from, of members that name something which is stored.
    """
    schema = model.model_json_schema()
    return _Schema(schema.get("$defs", {}), choices).members(schema, "")


@dataclass(frozen=True)
class _Schema:
    """What the nodes of a JSON schema mean: its definitions, and what there is to choose from by name."""

    definitions: Mapping[str, Any]
    choices: Mapping[str, list[tuple[str, str]]]

    def members(self, node: Mapping[str, Any], prefix: str) -> list[Field]:
        return [self._field(prefix + name, name, inner) for name, inner in node.get("properties", {}).items()]

    def _field(self, name: str, label: str, outer: Mapping[str, Any]) -> Field:
        node, nullable = self._resolved(outer), False
        if "anyOf" in node:
            kinds = [self._resolved(option) for option in node["anyOf"]]
            nullable = any(kind.get("type") == "null" for kind in kinds)
            node = next(kind for kind in kinds if kind.get("type") != "null")
        common: dict[str, Any] = {
            "name": name,
            "label": _label(label),
            "help": _without_json(outer.get("description") or node.get("description", "")),
            "default": outer.get("default"),
            "nullable": nullable,
            "scale": _scale(label)[1],
        }
        if name in self.choices:
            return Field(kind="select", options=self.choices[name], **common)
        if "enum" in node:
            return Field(kind="select", options=[(value, words(value)) for value in node["enum"]], **common)
        if node.get("type") == "object":
            return Field(kind="group", fields=self.members(node, f"{name}/"), **common)
        if node.get("type") == "array":
            return self._list(node, common)
        return Field(kind=SIMPLE.get(node.get("type", ""), "text"), **common)

    def _list(self, node: Mapping[str, Any], common: dict[str, Any]) -> Field:
        if "prefixItems" in node:
            return Field(kind="pair", **common)
        item = self._resolved(node["items"])
        if "enum" in item:
            return Field(kind=CHECKED_LIST, options=[(value, words(value)) for value in item["enum"]], **common)
        if item.get("type") == "object":
            return Field(kind="table", fields=self.members(item, ""), **common)
        return Field(kind="numbers", **common)

    def _resolved(self, node: Mapping[str, Any]) -> Mapping[str, Any]:
        while "$ref" in node:
            node = self.definitions[str(node["$ref"]).rsplit("/", 1)[1]]
        return node


def _without_json(said: str) -> str:
    """What the contract says of a member, for someone who fills in a field and writes no JSON.

    >>> _without_json("1/τ; null: nobody knows")
    '1/τ; empty: nobody knows'
    """
    return re.sub(r"\bnull\b", "empty", said).replace("`{}` will do", "everything may stay empty")


def _scale(name: str) -> tuple[str, str]:
    """The unit that people write in place of the one that the name ends in, and its size; nothing where it is the same."""
    ending = next((ending for ending in UNITS if name.endswith(ending)), "")
    return SCALES.get(ending, ("", ""))


def _label(name: str) -> str:
    """A member's name as words, with its unit where the name has one, as people write it.

    >>> _label("band_hz"), _label("mass_kg")
    ('Band [Hz]', 'Mass [g]')
    """
    for ending, unit in UNITS.items():
        if name.endswith(ending):
            return f"{_label(name.removesuffix(ending))} [{_scale(name)[0] or unit}]"
    text = words(name).replace(" sd", " standard deviation")
    return (text[:1].upper() + text[1:]).replace("Nu xy", "νxy")
