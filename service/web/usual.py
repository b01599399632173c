"""Refusing numbers that are probably in another unit, unless the client says that they are meant."""

from __future__ import annotations

from typing import Annotated

from fastapi import Query

from service.errors import Unusual
from service.web.quantities import unusual

Confirm = Annotated[
    bool, Query(description="take unusual numbers as they are: they are in the unit that the contract says")
]


def require_usual(body: object, confirm: bool) -> None:
    """Refuse a body whose numbers are probably in another unit.

    Args:
        body: a model, or a list of models.
        confirm: whether the client says that they are meant.

    Raises:
        Unusual: each such number, with what was probably meant.
    """
    if not confirm and (faults := list(unusual(body))):
        raise Unusual(faults)
