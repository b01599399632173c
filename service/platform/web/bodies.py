"""Base of all request and response bodies: strict, finite, storable."""

import json
import re
from datetime import date
from typing import Annotated, Any, Generic, TypeVar
from uuid import UUID

from pydantic import (
    AfterValidator,
    AwareDatetime,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    JsonValue,
    field_validator,
)
from pydantic_core import PydanticCustomError

from service.platform.web.json_body import refuse_unstorable_text

Item = TypeVar("Item")
Shown = TypeVar("Shown", bound=BaseModel)
INT64_MAX = 2**63 - 1


Text = Annotated[str, Field(max_length=10_000), AfterValidator(refuse_unstorable_text)]
"""A text of at most 10,000 characters that PostgreSQL can store: no NUL, no lone surrogate."""

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


Time = Annotated[AwareDatetime, Field(strict=False), BeforeValidator(_written_out)]
"""A moment, written as ISO 8601 with its time zone."""

Day = Annotated[date, Field(strict=False)]
"""A day, written as ISO 8601."""

Id = Annotated[UUID, Field(strict=False)]
"""Of a thing in the database, written as text."""

LongList = Annotated[list[Item], Field(fail_fast=True)]
"""A list that may be long: the first wrong item says enough, and a million faults would fill the
memory.
"""


def whole(value: object) -> object:
    """3.0 may stand for the integer 3. That a zero is negative no integer says."""
    if not (isinstance(value, float) and value.is_integer() and abs(value) < INT64_MAX):
        return value
    return value if str(value) == "-0.0" else int(value)


Int64 = Annotated[int, Field(ge=-INT64_MAX - 1, le=INT64_MAX), BeforeValidator(whole)]
"""An integer that fits a bigint."""


class StrictModel(BaseModel):
    """A body. Unknown fields, NaN and infinity are refused, each with its pointer, so that a
    misspelt field is not ignored.
    """

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, str_strip_whitespace=False)


class RequestModel(StrictModel):
    """A body of a request. Numbers given as text or as true and false, and truth values given as
    text or numbers are refused too.

    What JSON cannot say otherwise than in text or as a list has a type that is not strict: `Id`,
    `Time`, `Day`, pairs.
    """

    model_config = ConfigDict(strict=True)

    _whole = field_validator("*", mode="before")(whole)

    @field_validator("*")
    @classmethod
    def _storable(cls, value: object) -> object:
        return refuse_unstorable_text(value) if isinstance(value, str) else value


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
    LongList[Tag],
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


class Labels(RequestModel):
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
