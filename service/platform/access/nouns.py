"""Routes of a noun of the contract: make and list under what it belongs to, get, change, delete,
restore. Each noun says which it has.

What a noun does in a way of its own is a function in its room. A function here is given the name by
which the client calls it, and a text for the documentation.
"""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from inspect import signature
from typing import Any, Generic, TypeVar
from uuid import UUID

from fastapi import APIRouter, Path, Query, Request, Response
from pydantic import BaseModel
from sqlalchemy import ColumnElement, select
from sqlalchemy.orm import Session

from service.platform.access.dependencies import CurrentUser, SessionDep
from service.platform.access.lookup import Lookup, present, project_for
from service.platform.access.tables import User
from service.platform.db.base import Base
from service.platform.errors import Invalid
from service.platform.web import (
    IF_MATCH,
    Confirm,
    Cursor,
    Limit,
    Page,
    UnlessNamed,
    etag_of,
    paged,
    require_match,
    require_usual,
)
from service.platform.web.parameters import there

Row = TypeVar("Row", bound=Base)
Out = TypeVar("Out", bound=BaseModel)


class NounRoutes(Generic[Row, Out]):
    """Adds routes of a noun to a router; what they answer is here for pages too."""

    newest_first = False
    """The order of a list."""
    listed: tuple[ColumnElement[bool], ...] = ()
    """Conditions of the rows that are in lists."""

    def __init__(
        self,
        router: APIRouter,
        find: Lookup[Row],
        model: type[Out],
        describe: Callable[[Session, Sequence[Row]], Iterable[Out]],
        address: str,
        key: str,
        *,
        weight: ColumnElement[int] | None = None,
    ) -> None:
        """State a noun.

        Args:
            router: takes the routes.
            find: finds a row.
            model: of what clients see of a row.
            describe: (session, rows) -> what clients see of them, in the same order.
            address: such as `mode-sets`.
            key: name of a row's id in paths, such as `mode_set_id`.
            weight: bytes of a row, as `paged` takes it.
        """
        self._router, self._find, self._model, self._describe = router, find, model, describe
        self._address, self._id, self._path, self._weight = (
            address,
            key,
            f"/{address}/{{{key}}}",
            weight,
        )

    def all_shown(self, session: Session, rows: Sequence[Row]) -> list[Out]:
        """Rows as clients see them, in the order given."""
        return list(self._describe(session, rows))

    def shown(self, session: Session, row: Row) -> Out:
        """A row as clients see it."""
        return self.all_shown(session, [row])[0]

    def tagged(self, session: Session, row: Row, response: Response) -> Out:
        """The same, with its ETag in the answer."""
        shown = self.shown(session, row)
        response.headers["ETag"] = etag_of(shown)
        return shown

    def made(self, session: Session, row: Row, response: Response) -> Out:
        """A new row as clients see it, with its address in the answer."""
        shown = self.shown(session, row)
        response.headers["Location"] = f"/api/v1/{self._address}/{shown.id}"  # type: ignore[attr-defined]
        return shown

    def one(self, session: Session, user: User, key: UUID) -> Out:
        """A row as clients see it."""
        return self.shown(session, self._find(session, user, key))

    def page(
        self,
        session: Session,
        user: User,
        owner_id: UUID,
        cursor: Cursor = None,
        limit: Limit = 100,
        *,
        deleted: bool | None = None,
        newest_first: bool | None = None,
        superseded: bool = False,
    ) -> Page[Out]:
        """Rows of one owner, such as a campaign, as clients see them.

        Args:
            session: where to ask.
            user: who asks.
            owner_id: of the owner.
            cursor: of the page before.
            limit: rows in a page.
            deleted: those that are deleted, or those that are not; None where no row can be.
            newest_first: their order; None for the noun's own.
            superseded: whether those that were made anew are listed too.
        """
        table: Any = self._find.table
        owner = (self._find.owner or project_for)(session, user, owner_id)
        its = getattr(table, self._find.owner_key) == owner.id
        query = select(table).where(its, *self._find.among, *self.listed)
        if deleted:
            query = query.where(table.deleted_at.is_not(None))
        elif deleted is not None or not hasattr(table, "deleted_at"):
            query = query.where(*present(table, superseded=superseded))
        shown = partial(self.all_shown, session)
        newest_first = self.newest_first if newest_first is None else newest_first
        return paged(
            session, query, cursor, limit, shown, newest_first=newest_first, weight=self._weight
        )

    def creating(
        self,
        name: str,
        text: str,
        model: type[BaseModel],
        create: Callable[[Session, User, UUID, Any], Row],
        *,
        tagged: bool = False,
        measured: bool = False,
        status: int = 201,
        scope: str | None = None,
    ) -> None:
        """Add `POST /{owners}/{owner_id}/{address}`, whose answer names the address of the new row.

        Args:
            name: of the operation.
            text: for the documentation.
            model: of the body.
            create: (session, user, key of the owner, body) -> the row that it stores.
            tagged: whether the answer has an ETag too.
            measured: whether the body has numbers whose unit may be mistaken, so that unusual ones
                must be confirmed.
            status: of the answer.
            scope: of keys that may; None: as the path says.
        """
        owner = Path(alias=self._find.owner_key)

        def post(
            session: SessionDep,
            user: CurrentUser,
            response: Response,
            body: Any,
            owner_id: UUID = owner,
            confirm: Confirm = False,
            unless_named: UnlessNamed = False,
        ) -> Any:
            if measured:
                require_usual(body, confirm)
            row = (
                self.first_named(session, user, owner_id, body.name, response)
                if unless_named
                else None
            )
            shown = self.made(session, row or create(session, user, owner_id, body), response)
            if tagged:
                response.headers["ETag"] = etag_of(shown)
            return shown

        post.__annotations__["body"] = model
        post.scope = scope  # type: ignore[attr-defined]  # see `require_scope`
        # a job's name is of what it makes
        named = "name" in model.model_fields and hasattr(self._find.table, "name")
        without = {"confirm": measured, "unless_named": named}
        taken = signature(post)
        post.__signature__ = taken.replace(  # type: ignore[attr-defined]
            parameters=[one for one in taken.parameters.values() if without.get(one.name, True)]
        )
        given: dict[str, Any] = {"responses": there(self._model)} if named else {}
        self._add(
            name, text, post, self._below_owner(), methods=["POST"], status_code=status, **given
        )

    def first_named(
        self, session: Session, user: User, owner_id: UUID, name: str, response: Response
    ) -> Row | None:
        """The row of an owner that has a name, which is answered 200; None where there is none,
        until the transaction ends.
        """
        owner = (self._find.owner or project_for)(session, user, owner_id, "editor")
        row = self._find.first_named(session, owner.id, name)
        if row is not None:
            response.status_code = 200
        return row

    def listing(
        self,
        name: str,
        text: str,
        rows: int = 100,
        owners: str | None = None,
        *,
        hides: bool = False,
    ) -> None:
        """Add `GET /{owners}/{owner_id}/{address}`.

        Args:
            name: of the operation.
            text: for the documentation.
            rows: in a page by default.
            owners: as the path has them; default: by the key's name.
            hides: whether rows can be deleted, so that the list is of the others, or with `deleted`
                of them.
        """
        owner = Path(alias=self._find.owner_key)
        old = Query(False, description=f"list {self._address} that were made anew since too")
        gone = Query(
            False, description=f"list deleted {self._address}, which can be restored, instead"
        )

        def get_page(
            session: SessionDep,
            user: CurrentUser,
            owner_id: UUID = owner,
            cursor: Cursor = None,
            limit: Limit = rows,
        ) -> Any:
            return self.page(session, user, owner_id, cursor, limit)

        def get_either(
            session: SessionDep,
            user: CurrentUser,
            owner_id: UUID = owner,
            cursor: Cursor = None,
            limit: Limit = rows,
            deleted: bool = gone,
        ) -> Any:
            return self.page(session, user, owner_id, cursor, limit, deleted=deleted)

        def get_all(
            session: SessionDep,
            user: CurrentUser,
            owner_id: UUID = owner,
            cursor: Cursor = None,
            limit: Limit = rows,
            superseded: bool = old,
        ) -> Any:
            return self.page(session, user, owner_id, cursor, limit, superseded=superseded)

        path = self._below_owner(owners)
        replaced = hasattr(self._find.table, "superseded_by")
        get = get_either if hides else get_all if replaced else get_page
        self._add(name, text, get, path, response_model=Page[self._model])  # type: ignore[name-defined]

    def getting(self, name: str, text: str, *, tagged: bool = False) -> None:
        """Add `GET …/{id}`; `tagged`, its answer has an ETag."""
        row_id = Path(alias=self._id)

        def get(
            session: SessionDep, user: CurrentUser, response: Response, key: UUID = row_id
        ) -> Any:
            row = self._find(session, user, key)
            return self.tagged(session, row, response) if tagged else self.shown(session, row)

        self._add(name, text, get)

    def changing(
        self,
        name: str,
        text: str,
        patch: type[BaseModel],
        change: Callable[[Session, User, Row, Any], None],
        *,
        measured: bool = False,
    ) -> None:
        """Add `PATCH …/{id}`, which needs the ETag of the version that it changes.

        Args:
            name: of the operation.
            text: for the documentation.
            patch: model of the body.
            change: applies a patch to a locked row.
            measured: whether the body has numbers whose unit may be mistaken, so that unusual ones
                must be confirmed.
        """
        row_id = Path(alias=self._id)

        def edit(
            session: SessionDep,
            user: CurrentUser,
            request: Request,
            response: Response,
            body: Any,
            key: UUID = row_id,
        ) -> Any:
            return edited(session, user, request, response, body, key, confirm=True)

        def edit_measured(
            session: SessionDep,
            user: CurrentUser,
            request: Request,
            response: Response,
            body: Any,
            key: UUID = row_id,
            confirm: Confirm = False,
        ) -> Any:
            return edited(session, user, request, response, body, key, confirm=confirm)

        def edited(
            session: Session,
            user: User,
            request: Request,
            response: Response,
            body: Any,
            key: UUID,
            *,
            confirm: bool,
        ) -> Any:
            row = self._find(session, user, key, "editor", lock=True)
            require_match(request, etag_of(self.shown(session, row)))
            if not body.model_fields_set:
                raise Invalid("", "names nothing to change")
            require_usual(body, confirm)
            change(session, user, row, body)
            return self.tagged(session, row, response)

        chosen = edit_measured if measured else edit
        chosen.__annotations__["body"] = patch
        self._add(name, text, chosen, methods=["PATCH"], openapi_extra=IF_MATCH)

    def deleting(self, name: str, text: str) -> None:
        """Add `DELETE …/{id}`, which hides a row."""
        row_id = Path(alias=self._id)

        def delete(
            session: SessionDep, user: CurrentUser, request: Request, key: UUID = row_id
        ) -> None:
            row = self._find(session, user, key, "editor", lock=True)
            if "if-match" in request.headers:
                require_match(request, etag_of(self.shown(session, row)))
            self._find.hide(session, user, row)

        given: dict[str, Any] = {
            "status_code": 204,
            "openapi_extra": IF_MATCH,
            "response_model": None,
        }
        self._add(name, text, delete, methods=["DELETE"], **given)

    def restoring(
        self, name: str, text: str, then: Callable[[Session, Row], None] | None = None
    ) -> None:
        """Add `POST …/{id}/restore`, which brings a hidden row back, and does `then` with it."""
        row_id = Path(alias=self._id)

        def restore(
            session: SessionDep, user: CurrentUser, response: Response, key: UUID = row_id
        ) -> Any:
            row = self._find(session, user, key, "editor", deleted=True, lock=True)
            self._find.restore(session, user, row)
            if then is not None:
                then(session, row)
            return self.tagged(session, row, response)

        self._add(name, text, restore, f"{self._path}/restore", methods=["POST"])

    def _below_owner(self, owners: str | None = None) -> str:
        owner_key = self._find.owner_key
        return f"/{owners or owner_key.removesuffix('_id') + 's'}/{{{owner_key}}}/{self._address}"

    def _add(
        self, name: str, text: str, route: Callable[..., Any], path: str | None = None, **given: Any
    ) -> None:
        route.__name__, route.__doc__ = name, text
        self._router.add_api_route(
            path or self._path, route, **({"response_model": self._model} | given)
        )
