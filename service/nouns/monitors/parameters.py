"""What requests about monitors have in common."""

from datetime import datetime
from typing import Annotated

from fastapi import Query

Version = Annotated[
    int | None,
    Query(ge=1, le=1_000_000, description="of the series; default: the one that is judged"),
]

From = Annotated[
    datetime | None, Query(alias="from", description="campaigns performed then or later")
]
To = Annotated[datetime | None, Query(alias="to", description="campaigns performed then or before")]
