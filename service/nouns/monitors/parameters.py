"""What requests about monitors have in common."""

from datetime import datetime
from typing import Annotated

from fastapi import Depends, Query

from service.nouns.monitors.points import MOST, Part
from service.platform.errors import Invalid

Version = Annotated[
    int | None,
    Query(ge=1, le=1_000_000, description="of the series; default: the one that is judged"),
]

From = Annotated[
    datetime | None, Query(alias="from", description="campaigns performed then or later")
]
To = Annotated[datetime | None, Query(alias="to", description="campaigns performed then or before")]


def part_of(
    begin: From = None,
    end: To = None,
    limit: Annotated[int, Query(ge=1, le=10_000, description="at most so many campaigns")] = MOST,
    stride: Annotated[
        int | None,
        Query(
            ge=1,
            le=1_000_000,
            description="every so many-th campaign; default: as many as `limit` makes necessary",
        ),
    ] = None,
) -> Part:
    """The part that a request states.

    Raises:
        Invalid: a date has no time zone.
    """
    for name, date in (("from", begin), ("to", end)):
        if date is not None and date.tzinfo is None:
            raise Invalid(name, "has no time zone; end it with Z for UTC")
    return Part(begin, end, limit, stride)


PartDep = Annotated[Part, Depends(part_of)]
