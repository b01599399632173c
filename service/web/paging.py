"""Lists in pages, by keyset on the UUIDv7 key: a page costs the same at any depth, and a new row moves nothing."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Iterable, Sequence
from itertools import accumulate
from typing import Annotated, Any, TypeVar
from uuid import UUID

from fastapi import Query
from sqlalchemy import ColumnElement, Select, func
from sqlalchemy.orm import Session

from service.errors import Invalid

Cursor = Annotated[str | None, Query(max_length=100, description="`next_cursor` of the page before")]
Limit = Annotated[int, Query(ge=1, le=1000, description="rows in a page")]

Row = TypeVar("Row")


HEAVIEST_BYTES = 1024 * 1024
"""Of the weights of a page's rows together, as they are stored."""


def paged(
    session: Session,
    query: Select[Row],
    key: Any,
    cursor: Cursor,
    limit: Limit,
    *,
    newest_first: bool = False,
    weight: ColumnElement[int] | None = None,
) -> tuple[Sequence[Row], str | None]:
    """One page of a query's rows and the cursor of the next one.

    Args:
        session: where to ask.
        query: selects one entity; without order and limit.
        key: the entity's UUIDv7 column, such as `Campaign.id`.
        cursor: what the client sent.
        limit: rows in a page.
        newest_first: order of creation, reversed.
        weight: bytes of a row, where rows may be heavy: the page ends early, after a row at least, where it would become
            too heavy.

    Raises:
        Invalid: the cursor is not one of ours.
    """
    if cursor is not None:
        after = _decode(cursor)
        query = query.where(key < after if newest_first else key > after)
    query = query.order_by(key.desc() if newest_first else key)
    if weight is not None:
        limit = _light(session.scalars(query.with_only_columns(func.coalesce(weight, 0)).limit(limit)), limit)
    rows = session.scalars(query.limit(limit + 1)).all()
    page = rows[:limit]
    return page, _encode(getattr(page[-1], key.key)) if len(rows) > limit else None


def _light(weights: Iterable[int], limit: int) -> int:
    """How many of the first rows make a page that is not too heavy; one at least."""
    heavy = next((number for number, total in enumerate(accumulate(weights)) if total > HEAVIEST_BYTES), limit)
    return max(1, heavy)


def _encode(key: UUID) -> str:
    return base64.urlsafe_b64encode(key.bytes).rstrip(b"=").decode()


def _decode(cursor: str) -> UUID:
    try:
        return UUID(bytes=base64.urlsafe_b64decode(cursor + "=="))
    except (ValueError, binascii.Error):
        raise Invalid("cursor", "is not a cursor of this list; take `next_cursor` of a page") from None
