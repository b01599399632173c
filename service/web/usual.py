"""Refusing numbers that are probably in another unit, unless the client says that they are meant."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

from fastapi import Query

from service.errors import Unusual
from service.web.quantities import unusual

Confirm = Annotated[
    bool, Query(description="take unusual numbers as they are: they are in the unit that the contract says")
]


HOW = "What is meant as it is, confirm (`confirm=true`, `--confirm`)"


def require_usual(body: object, confirm: bool) -> None:
    """Refuse a body whose numbers are probably in another unit.

    Args:
        body: a model, or a list of models.
        confirm: whether the client says that they are meant.

    Raises:
        Unusual: each such number, with what was probably meant.
    """
    if not confirm and (faults := list(unusual(body))):
        last = faults.pop()  # once, where the person has read them all
        raise Unusual([*faults, replace(last, detail=f"{last.detail} {HOW}")])
