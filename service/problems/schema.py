"""Base of all request and response bodies: strict, finite, storable."""

from __future__ import annotations

from typing import Annotated, Generic, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from service.problems.json_body import refuse_unstorable_text

Item = TypeVar("Item")
INT64_MAX = 2**63 - 1

Text = Annotated[str, AfterValidator(refuse_unstorable_text)]
"""A string that PostgreSQL can store: no NUL, no lone surrogate."""

Name = Annotated[str, AfterValidator(refuse_unstorable_text), Field(min_length=1, max_length=200)]
"""A name given by a person: 1 to 200 characters, storable."""

Int64 = Annotated[int, Field(ge=-INT64_MAX - 1, le=INT64_MAX)]
"""An integer that fits a bigint."""


class StrictModel(BaseModel):
    """A body: unknown fields, NaN and infinity are refused."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, str_strip_whitespace=False)


class Page(BaseModel, Generic[Item]):
    """One page of a list.

    Attributes:
        items: the rows.
        next_cursor: hand it in as `cursor` to get the next page; none on the last one.
    """

    items: list[Item]
    next_cursor: str | None = None
