"""What requests about monitors have in common."""

from dataclasses import replace
from datetime import datetime
from typing import Annotated

from fastapi import Depends, Query

from service.nouns.monitors.points import MOST, VALUES, Part
from service.platform.errors import Invalid

Version = Annotated[
    int | None,
    Query(ge=1, le=1_000_000, description="of the series; default: the one that is judged"),
]

From = Annotated[
    datetime | None, Query(alias="from", description="campaigns performed then or later")
]
To = Annotated[datetime | None, Query(alias="to", description="campaigns performed then or before")]


def part_of(begin: datetime | None, end: datetime | None, limit: int = MOST) -> Part:
    """The part of a series between two dates.

    Raises:
        Invalid: a date has no time zone.
    """
    for name, date in (("from", begin), ("to", end)):
        if date is not None and date.tzinfo is None:
            raise Invalid(name, "has no time zone; end it with Z for UTC")
    return Part(begin, end, limit)


def _stated(
    begin: From = None,
    end: To = None,
    limit: Annotated[
        int | None,
        Query(
            ge=1,
            le=10_000,
            description=f"at most so many campaigns; default: {MOST}, fewer where these have more"
            f" than {VALUES} values of all parameters together",
        ),
    ] = None,
    stride: Annotated[
        int | None,
        Query(
            ge=1,
            le=1_000_000,
            description="every so many-th campaign; default: as many as `limit` makes necessary",
        ),
    ] = None,
) -> Part:
    values = None if limit else VALUES
    return replace(part_of(begin, end, limit or MOST), stride=stride, values=values)


PartDep = Annotated[Part, Depends(_stated)]
