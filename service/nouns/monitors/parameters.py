"""What requests about monitors have in common."""

from typing import Annotated

from fastapi import Query

Version = Annotated[
    int | None,
    Query(ge=1, le=1_000_000, description="of the series; default: the one that is judged"),
]
