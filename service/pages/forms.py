"""The form of a recipe, made from its schema: whatever the contract takes, the form has."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

from pydantic import BaseModel

from fecore.body.specimen import CONSTANTS
from service.figures.marks import mode_words
from service.nouns.campaigns.schemas import CampaignIn
from service.nouns.coupons.schemas import CouponIn
from service.nouns.instruments.routes import InstrumentIn
from service.nouns.monitors.schemas import MonitorIn
from service.nouns.structures.schemas import StructureIn
from service.nouns.updates.schemas import RecipeIn
from service.pages.numbers import minus, words
from service.pages.quantities import SENT, units_of_field
from service.platform.web.typed import SHOWN_AS, in_words

CHECKED_LIST = "choices"
_SI = re.compile(r"^(?:kg/m³|kg|m/m|m|Pa)(?:[;,] |(?= along)|$)")
"""The unit that REST has, at the beginning of what it says of a member; a field has its own."""
OF_PARAMETER = ("prior_mean", "prior_sd")
"""Members in the unit of the parameter that their row names."""
SIMPLE = {"number": "number", "integer": "whole", "boolean": "switch"}
FORMATS = {"date-time": "datetime-local", "date": "date"}
ASKED: dict[str, type[BaseModel]] = {
    "structures": StructureIn,
    "campaigns": CampaignIn,
    "coupons": CouponIn,
    "instruments": InstrumentIn,
    "monitors": MonitorIn,
}
"""Bodies whose members forms ask for by their names."""


@dataclass(frozen=True)
class FormField:
    """One question of a form."""

    name: str  # JSON pointer of its value without the first slash
    label: str  # in words
    # `number`, `whole`, `text`, `list`, `select`, `choices`, `pair`, `numbers`, `switch`, `group`, …
    kind: str
    help: str = ""  # what the contract says of it
    default: Any = None  # its value where nothing is said
    options: list[tuple[str, str]] = field(default_factory=list)  # value and words of each choice
    fields: list[FormField] = field(default_factory=list)  # of a group, or of one row of a table
    nullable: bool = False  # whether nothing can be said
    of: str = ""  # question of the same row that names the parameter in whose unit the value is
    required: bool = False  # whether it must be answered where it is asked

    @property
    def placeholder(self) -> str:
        """What an empty field shows: the default in the field's unit, of a list how one is
        written.
        """
        if self.kind == "numbers":
            return "120; 250"
        if isinstance(self.default, bool) or not isinstance(self.default, int | float):
            return ""
        return in_words(self.default, *units_of_field(self.name, self.label)).split()[0]


def fields_of(
    model: type[BaseModel], choices: Mapping[str, list[tuple[str, str]]]
) -> list[FormField]:
    """The questions of a body, in the order of its members.

    Args:
        model: of the body.
        choices: value and words to choose from, of members that name something which is stored.
    """
    schema = model.model_json_schema()
    return _Schema(schema.get("$defs", {}), choices).members(schema, "")


@dataclass(frozen=True)
class _Schema:
    """What the nodes of a JSON schema mean: its definitions, and what there is to choose from by
    name.
    """

    definitions: Mapping[str, Any]
    choices: Mapping[str, list[tuple[str, str]]]

    def members(self, node: Mapping[str, Any], prefix: str) -> list[FormField]:
        must = node.get("required", ())
        return [
            self._field(prefix + name, name, inner, required=name in must)
            for name, inner in node.get("properties", {}).items()
        ]

    def _field(
        self, name: str, label: str, outer: Mapping[str, Any], *, required: bool
    ) -> FormField:
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
            "of": "name" if label in OF_PARAMETER else "",
            "required": required,
        }
        if name in self.choices:
            return FormField(kind="select", options=self.choices[name], **common)
        if "enum" in node:
            named = OWN_OPTIONS.get(label, {})
            options = [(value, named.get(value, words(value))) for value in node["enum"]]
            common["help"] = "" if named else common["help"]
            return FormField(kind="select", options=options, **common)
        if node.get("type") == "object":
            return FormField(kind="group", fields=self.members(node, f"{name}/"), **common)
        if node.get("type") == "array":
            return self._list(node, common)
        kind = FORMATS.get(node.get("format", "")) or SIMPLE.get(node.get("type", ""), "text")
        return FormField(kind=kind, **common)

    def _list(self, node: Mapping[str, Any], common: dict[str, Any]) -> FormField:
        if "prefixItems" in node:
            return FormField(kind="pair", **common)
        item = self._resolved(node["items"])
        if "enum" in item:
            return FormField(
                kind=CHECKED_LIST,
                options=[(value, words(value)) for value in item["enum"]],
                **common,
            )
        if item.get("type") == "object":
            return FormField(kind="table", fields=self.members(item, ""), **common)
        return FormField(kind="list" if item.get("type") == "string" else "numbers", **common)

    def _resolved(self, node: Mapping[str, Any]) -> Mapping[str, Any]:
        while "$ref" in node:
            node = self.definitions[str(node["$ref"]).rsplit("/", 1)[1]]
        return node


@cache
def _named_questions(noun: str) -> dict[str, FormField]:
    """The questions of a body by their names, those within groups too."""
    named: dict[str, FormField] = {}

    def gather(fields: list[FormField]) -> None:
        for one in fields:
            named[one.name] = one
            if one.kind != "table":
                gather(one.fields)

    gather(fields_of(ASKED[noun], {}))
    return named


def questions(noun: str, names: str, prefix: str = "") -> list[FormField]:
    """Questions of a form, by the names of members of a body, parted by blanks; those with `*` are
    the members of a group. Each is called by its name behind the prefix.
    """
    fields = []
    for name in names.split():
        field = _named_questions(noun)[name.removesuffix("/*")]
        fields += field.fields if name.endswith("/*") else [field]
    return [_behind(prefix, one) for one in fields]


def _behind(prefix: str, one: FormField) -> FormField:
    inner = one.fields if one.kind == "table" else [_behind(prefix, each) for each in one.fields]
    return replace(one, name=prefix + one.name, fields=inner)


def _without_json(text: str) -> str:
    """What the contract says of a member, for someone who fills in a field and writes no JSON.

    >>> _without_json("1/τ; null: nobody knows"), _without_json("m, at its end")
    ('1/τ; empty: nobody knows', 'at its end')
    """
    plain = re.sub(r"; \[\]: [^;]*", "", re.sub(r"\bnull\b", "empty", text)).replace(
        "`{}` will do", "everything may stay empty"
    )
    return _SI.sub("", plain)


OWN_LABELS = {
    "performed_at": "Performed (local time)",
    "strength_Pa": "Strength [MPa]",
    "ultimate_strain": "Ultimate strain [%]",
    "sensor_mass_kg": "Mass of the sensor [g]",
    "sensor_point": "Sensor at grid point",
    "window_rate_per_s": "Exponential window, 1/τ [1/s]",
    "serial": "Serial number",
    "campaigns": "Campaigns of the baseline",
    "retention_days": "Files are kept [days]",
}
"""Where people call a member otherwise than its name does."""
OWN_OPTIONS = {
    "watch": {
        "update": "constants of the model, updated with every test",
        "modes": "frequencies and damping of the modes, without a model",
    }
}
"""The same of what a member may be."""


def _label(name: str) -> str:
    """A member's name as words, with its unit where the name has one, as people write it.

    >>> _label("band_hz"), _label("mass_kg")
    ('Band [Hz]', 'Mass [g]')
    """
    if name in OWN_LABELS:
        return OWN_LABELS[name]
    for ending, unit in SENT.items():
        if name.endswith(ending):
            return f"{_label(name.removesuffix(ending))} [{SHOWN_AS.get(unit, unit)}]"
    text = words(name).replace(" sd", " standard deviation")
    return re.sub(r"^Nu ?", "ν", text[:1].upper() + text[1:])


@cache
def _members() -> dict[str, str]:
    """Labels of the members of recipes, campaigns and structures, by the last step of their
    names.
    """
    labels: dict[str, str] = {}

    def gather(fields: list[FormField]) -> None:
        for one in fields:
            labels.setdefault(one.name.rsplit("/", 1)[-1], re.sub(r" \[.*\]", "", one.label))
            gather(one.fields)

    for model in (RecipeIn, CampaignIn, StructureIn):
        gather(fields_of(model, {}))
    return labels


_PARENTHESIS = re.compile(r" ?[^.;:?(]*\((?:`[^`]*`(?:, )?)+\)")
_CALL = re.compile(r"\b(?:GET|POST|PUT|PATCH|DELETE) /[\w/{}…-]+")
_NAME = re.compile(r"`?(?<![\w/.@-])/?((?:[A-Za-z]\w*[./])*)([A-Za-z]\w*)(?![\w@/-])`?")


def page_words(text: str | None) -> str:
    """A sentence of REST for a page: members have the labels of their fields, calls and options are
    left out.

    >>> page_words("did you mean 33 GPa? What is meant as it is, confirm (`confirm=true`, `--confirm`)")
    'did you mean 33 GPa?'
    >>> page_words("measure a wider band, or put `modal` first in damping_models; inputs.thickness_sd_m is stated")
    'measure a wider band, or put modal first in “Damping models”; “Thickness standard deviation” is stated'
    """

    def member(match: re.Match[str]) -> str:
        name, marked = match[2], match[0].startswith("`")
        # a constant is called so
        if name in _members() and name not in CONSTANTS and (marked or "_" in name):
            return f"“{_members()[name]}”"
        return match[0].strip("`")

    plain = _CALL.sub("this page", _PARENTHESIS.sub("", text or ""))
    named = _NAME.sub(member, re.sub(r"\?([a-z_]+)=(\w*)", r"`\1` \2", plain))
    spaced = re.sub(r"(?<=\d)%", " %", mode_words(named).replace(" ;", ";"))
    return minus(spaced.strip())


def labelled(pointer: str) -> str:
    """A JSON pointer, or the name of a parameter, in words.

    >>> labelled("/inputs/thickness_sd_m"), labelled("next_cursor"), labelled("")
    ('Thickness standard deviation', 'next cursor', 'what was sent')
    """
    steps = [step for step in re.split(r"[/.]", pointer) if step]
    if not steps:
        return "what was sent"
    return _members().get(steps[-1]) or words(" ".join(steps))
