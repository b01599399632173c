"""What routes take beside a body: pages of a list, the version that an edit is of, that unusual
numbers are meant.

Lists come in pages by keyset on the UUIDv7 key: a page costs the same at any depth, and a new row
moves nothing. An answer has an ETag, which a change of it must name (If-Match).
"""

import base64
import binascii
import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import accumulate
from typing import Annotated, Any, TypeVar
from uuid import UUID

from fastapi import Depends, Header, Query, Request, Response
from pydantic import BaseModel
from sqlalchemy import ColumnElement, Select, func
from sqlalchemy.orm import Session

from service.platform.errors import Invalid, PreconditionFailed, PreconditionRequired, Unusual
from service.platform.web.bodies import Page
from service.platform.web.negotiation import choose_format, one_of
from service.platform.web.quantities import beyond, unusual

Cursor = Annotated[
    str | None, Query(max_length=100, description="`next_cursor` of the page before")
]
Limit = Annotated[int, Query(ge=1, le=1000, description="rows in a page")]

Row = TypeVar("Row")
Item = TypeVar("Item")


HEAVIEST_BYTES = 1024 * 1024
"""Of the weights of a page's rows together, as they are stored."""


def form_of(media_types: Mapping[str, str], description: str = "default: by Accept") -> Any:
    """The dependency of a route that is the name of the format which a request wants, by `?format=`
    or by Accept.

    Args:
        media_types: name of each format to its media type; the first one is the default.
        description: of the parameter.
    """

    async def chosen(
        file_format: Any = None,
        accept: Annotated[str | None, Header(include_in_schema=False)] = None,
    ) -> str:
        return choose_format(file_format, accept, media_types)

    annotation = Annotated[
        Annotated[str, one_of(media_types)] | None, Query(alias="format", description=description)
    ]
    chosen.__annotations__["file_format"] = annotation
    return Depends(chosen)


def paged(
    session: Session,
    query: Select[Row],
    cursor: Cursor,
    limit: Limit,
    shown: Callable[[Sequence[Row]], Iterable[Item]],
    *,
    key: Any = None,
    newest_first: bool = False,
    weight: ColumnElement[int] | None = None,
) -> Page[Item]:
    """One page of a query's rows, with the cursor of the next one.

    Args:
        session: where to ask.
        query: selects one entity, without order and limit.
        cursor: what the client sent.
        limit: rows in a page.
        shown: rows -> what clients see of them.
        key: the UUIDv7 column that orders them; default: the entity's `id`.
        newest_first: order of creation, reversed.
        weight: bytes of a row, where rows may be heavy: the page ends early, after a row at least,
            where it would become too heavy.

    Raises:
        Invalid: the cursor is not one of ours.
    """
    key = query.column_descriptions[0]["entity"].id if key is None else key
    if cursor is not None:
        after = _decode(cursor)
        query = query.where(key < after if newest_first else key > after)
    query = query.order_by(key.desc() if newest_first else key)
    if weight is not None:
        limit = _light(
            session.scalars(query.with_only_columns(func.coalesce(weight, 0)).limit(limit)), limit
        )
    rows = session.scalars(query.limit(limit + 1)).all()
    following = _encode(getattr(rows[limit - 1], key.key)) if len(rows) > limit else None
    return Page(items=list(shown(rows[:limit])), next_cursor=following)


def _light(weights: Iterable[int], limit: int) -> int:
    """How many of the first rows make a page that is not too heavy; one at least."""
    heavy = next(
        (number for number, total in enumerate(accumulate(weights)) if total > HEAVIEST_BYTES),
        limit,
    )
    return max(1, heavy)


def _encode(key: UUID) -> str:
    return base64.urlsafe_b64encode(key.bytes).rstrip(b"=").decode()


def _decode(cursor: str) -> UUID:
    try:
        return UUID(bytes=base64.urlsafe_b64decode(cursor + "=="))
    except (ValueError, binascii.Error):
        raise Invalid(
            "cursor", "is not a cursor of this list; take `next_cursor` of a page"
        ) from None


IF_MATCH: dict[str, Any] = {
    "parameters": [
        {
            "name": "If-Match",
            "in": "header",
            "schema": {"type": "string"},
            "description": "the ETag of the version that you change, as its GET gave it",
        }
    ]
}
"""`openapi_extra` of a route that calls `require_match`."""


def etag_of(body: BaseModel) -> str:
    """A strong ETag of a representation: half of the SHA-256 of its JSON, in quotes. Two equal
    representations have the same one, on any machine.
    """
    return '"' + hashlib.sha256(body.model_dump_json().encode()).hexdigest()[:32] + '"'


def require_match(request: Request, etag: str) -> None:
    """Refuse an edit of another version than the present one.

    Read the row `with_for_update()` before, so that two edits cannot both match.

    Raises:
        PreconditionRequired: the request has no If-Match.
        PreconditionFailed: If-Match names another version.
    """
    header = request.headers.get("if-match")
    if header is None:
        raise PreconditionRequired("send If-Match with the ETag of the version that you edit")
    if header.strip() != "*" and not _names(header, etag):
        raise PreconditionFailed(
            f"it was changed since: its ETag is now {etag}; read it again, then edit"
        )


def not_modified(request: Request, headers: Mapping[str, str]) -> Response | None:
    """The answer 304 where the client has this version already.

    Returns:
        The answer, with these headers; None where the client needs the full one.
    """
    if _names(request.headers.get("if-none-match", ""), headers["ETag"]):
        return Response(status_code=304, headers=dict(headers))
    return None


def _names(header: str, etag: str) -> bool:
    return etag in (tag.strip() for tag in header.split(","))


Confirm = Annotated[
    bool,
    Query(
        description="take unusual numbers as they are: they are in the unit that the contract says"
    ),
]


UnlessNamed = Annotated[
    bool,
    Query(
        description=(
            "make it only where there is none of this name; where there is, the answer is that one,"
            " and 200"
        )
    ),
]


def there(model: type[BaseModel]) -> dict[int | str, dict[str, Any]]:
    """What a route with `UnlessNamed` says of its answers."""
    return {
        200: {
            "model": model,
            "description": "With `unless_named`: the one of this name that is there",
        }
    }


HOW = "What is meant as it is, confirm (`confirm=true`, `--confirm`)"


def require_usual(body: object, confirm: bool) -> None:
    """Refuse a body whose numbers are probably in another unit.

    Args:
        body: a model, or a list of models.
        confirm: whether the client says that they are meant.

    Raises:
        Invalid: a number is too small or too large to compute with, confirmed or not.
        Unusual: each such number, with what was probably meant.
    """
    if faults := list(beyond(body)):
        raise Invalid(faults)
    if not confirm and (faults := list(unusual(body))):
        last = faults.pop()  # once, where the person has read them all
        raise Unusual([*faults, replace(last, detail=f"{last.detail} {HOW}")])
