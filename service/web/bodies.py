"""Base of all request and response bodies: strict, finite, storable."""

import json
import re
from typing import Annotated, Any, Generic, TypeVar

from pydantic import (
    AfterValidator,
    AwareDatetime,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    JsonValue,
    ValidationInfo,
    field_validator,
)
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from service.web.json_body import refuse_unstorable_text

Item = TypeVar("Item")
Shown = TypeVar("Shown", bound=BaseModel)
INT64_MAX = 2**63 - 1
LONG = 1000  # items of a list beyond which its faults are not listed one by one


class _Storable:
    """Of a text: that PostgreSQL can store it, and its usual limit, where a member states none of
    its own.

    A `Field(max_length=10_000)` in its place would win over the member's own limit.
    """

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """The text's schema, whose limits a member has set by now, with what was not set."""
        text = dict(handler(source))
        text.setdefault("max_length", 10_000)
        return core_schema.no_info_after_validator_function(refuse_unstorable_text, text)


Text = Annotated[str, _Storable()]
"""A text of at most 10,000 characters, if a member says no less, that PostgreSQL can store: no NUL,
no lone surrogate.
"""

Name = Annotated[
    str, Field(min_length=1, max_length=200, pattern=r"\S"), AfterValidator(refuse_unstorable_text)
]
"""A name given by a person: 1 to 200 characters, not all of them blank, storable."""


def wrong(why: str) -> PydanticCustomError:
    """What a validator raises to say in its own words what is wrong with a value, where a
    `ValueError` would add to them.
    """
    return PydanticCustomError("wrong", "{why}", {"why": why})


def _written_out(value: object) -> object:
    """Refuse the numbers that pydantic takes for seconds since 1970: 20260302 would be a day of
    that year.
    """
    if isinstance(value, int | float) or (
        isinstance(value, str) and not re.match(r"\s*\d{4}-", value)
    ):
        raise wrong("Input should be a time with its zone, such as 2026-03-02T09:30:00Z")
    return value


Time = Annotated[AwareDatetime, BeforeValidator(_written_out)]
"""A moment, written as ISO 8601 with its time zone."""

Int64 = Annotated[int, Field(ge=-INT64_MAX - 1, le=INT64_MAX)]
"""An integer that fits a bigint."""


def _as_written(schema: Any, model: Any) -> None:
    """Have every number in a schema of pydantic's core refuse text and truth values, and every
    truth value all but true and
    false: "no" and "off" are texts. 3.0 may stand for the integer 3.

    A list that may be long stops at its first wrong item. Strict models within this one have been
    through here already.
    """
    if isinstance(schema, list | tuple):
        for part in schema:
            _as_written(part, model)
    elif isinstance(schema, dict) and not _has_check(schema) and not _is_another(schema, model):
        for part in schema.values():
            _as_written(part, model)
        if schema.get("type") == "list" and schema.get("max_length", LONG + 1) > LONG:
            # the first wrong item says enough, and a million faults would fill the memory
            schema["fail_fast"] = True
        if schema.get("type") == "bool":
            schema["strict"] = True
        if schema.get("type") in ("float", "int"):
            inner = core_schema.with_info_before_validator_function(_number, dict(schema))
            schema.clear()
            schema.update(inner)


def _is_another(schema: dict[str, Any], model: Any) -> bool:
    """Whether a schema is that of another strict model."""
    declared = schema.get("cls") if schema.get("type") == "model" else None
    return declared is not None and declared is not model and issubclass(declared, StrictModel)


def _has_check(schema: dict[str, Any]) -> bool:
    """Whether a number is checked already, as those of a model within a model are."""
    function = schema.get("function")
    return isinstance(function, dict) and function.get("function") is _number


def _number(value: object, info: ValidationInfo) -> object:
    # in the cells of a table all is text
    if isinstance(value, str | bool) and info.mode in ("python", "json"):
        raise wrong("Input should be a number")
    return value


class StrictModel(BaseModel):
    """A body of a request. Unknown fields, NaN, infinity, numbers given as text or as true and
    false, and truth values given as text or numbers are refused, each with its pointer, so that a
    misspelt field is not ignored.
    """

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, str_strip_whitespace=False)

    @classmethod
    def __get_pydantic_core_schema__(
        cls, source: Any, handler: GetCoreSchemaHandler, /
    ) -> CoreSchema:
        """Pydantic's own strictness would also refuse what JSON cannot say otherwise, such as
        dates.
        """
        schema = handler(source)
        _as_written(schema, cls)
        return schema


def _short(value: dict[str, JsonValue]) -> dict[str, JsonValue]:
    """Refuse more than a page: every list shows it."""
    if (size := len(json.dumps(value))) > MOST_DETAILS:
        raise wrong(f"has {size} characters as JSON, at most {MOST_DETAILS} are kept")
    return value


def _once(value: list[str]) -> list[str]:
    if twice := sorted({one for one in value if value.count(one) > 1}):
        raise wrong(f"has {twice[0]} twice")
    return value


MOST_DETAILS = 10_000
Details = Annotated[
    dict[str, JsonValue],
    AfterValidator(_short),
    Field(description=f"at most {MOST_DETAILS} characters as JSON"),
]
Tag = Annotated[str, Field(max_length=100, pattern=r"^[^\s,]([^,\x00-\x1f]*[^\s,])?$")]
Tags = Annotated[
    list[Tag],
    AfterValidator(_once),
    Field(max_length=50, description="words to find it by, no commas"),
]
Meta = Annotated[
    dict[str, JsonValue],
    AfterValidator(_short),
    Field(description=f"free JSON to find it by, at most {MOST_DETAILS} characters"),
]


def not_null(*fields: str) -> Any:
    """A validator of a patch's fields that may be left out and may not be null."""
    return field_validator(*fields)(_not_null)


def _not_null(value: object) -> object:
    if value is None:
        raise wrong("cannot be null; leave it out to keep it")
    return value


SOME_ID = "00000000-0000-0000-0000-000000000000"
"""In an example, where an id of one's own stands."""


def example(**fields: Any) -> ConfigDict:
    """The configuration of a body with an example, which the documentation page fills in. It works
    as it stands, once its ids are one's own; an acceptance test sends each.
    """
    return ConfigDict(json_schema_extra={"examples": [fields]})


class Labels(StrictModel):
    """Tags and free metadata of a thing, by which a search finds it."""

    model_config = example(tags=["winter"], meta={"client": "ACME", "hammer_tip": "steel"})

    tags: Tags = Field([])
    meta: Meta = Field({})


def shown_as(model: type[Shown], row: object, /, **own: Any) -> Shown:
    """A row as clients see it: what the model has in common with the row, and these members."""
    same = {
        name: getattr(row, name)
        for name in model.model_fields
        if name not in own and hasattr(row, name)
    }
    return model(**same, **own)


class Page(BaseModel, Generic[Item]):
    """One page of a list.

    Attributes:
        items: the rows.
        next_cursor: hand it in as `cursor` to get the next page; none on the last one.
    """

    items: list[Item]
    next_cursor: str | None = None
