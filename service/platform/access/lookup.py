"""Projects and roles: what a user may see and do. Rows of one kind: found by key with the role that
an act needs, hidden and brought back, traced to their project.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import datetime
from functools import cache
from itertools import pairwise
from typing import Any, Generic, Literal, TypeVar, get_args
from uuid import UUID

from sqlalchemy import ColumnElement, Select, bindparam, delete, select, text
from sqlalchemy.exc import InvalidRequestError
from sqlalchemy.orm import Session

from service.platform.access.tables import Member, Project, User
from service.platform.access.users import audit
from service.platform.db.base import Base, one_at_a_time, transaction_time
from service.platform.errors import Conflict, Forbidden, Invalid, NotFound, not_found_as

Role = Literal["viewer", "editor", "owner"]

_RANK: dict[str, int] = {role: rank for rank, role in enumerate(get_args(Role))}


def project_for(
    session: Session, user: User, project_id: UUID, role: Role = "viewer", *, resting: bool = False
) -> Project:
    """The project, if the user has at least this role in it.

    Args:
        session: the request's transaction.
        user: who asks.
        project_id: which one.
        role: what the act needs.
        resting: find a deleted one too, and let an archived one be changed.

    Raises:
        NotFound: there is no such project, it is deleted, or the user is not a member.
        Forbidden: the user is a member of a lower role.
        Conflict: the act would change a project that is archived.
    """
    row = session.execute(
        select(Project, Member.role)
        .join(Member, Member.project_id == Project.id)
        .where(Project.id == project_id, Member.user_id == user.id)
    ).one_or_none()
    if row is None:
        raise NotFound("project", project_id)
    require_role(row[0], row[1], role, resting=resting)
    return row[0]


def role_in(session: Session, user: User, project_id: UUID) -> Role | None:
    """The user's role in a project; None of who is no member. For what is shown: `project_for`
    decides what may be done.
    """
    query = select(Member.role).where(Member.project_id == project_id, Member.user_id == user.id)
    role: Role | None = session.scalar(query)
    return role


def require_role(project: Project, held: str | None, role: Role, *, resting: bool = False) -> None:
    """Refuse what a user may not do in a project.

    Args:
        project: which one.
        held: the user's role in it; None of who is no member.
        role: what the act needs.
        resting: a deleted one will do, and an archived one may be changed.

    Raises:
        NotFound: it is deleted, or the user is not a member.
        Forbidden: the user is a member of a lower role.
        Conflict: the act would change a project that is archived.
    """
    if held is None or (project.deleted_at is not None and not resting):
        raise NotFound("project", project.id)
    if _RANK[held] < _RANK[role]:
        raise Forbidden(f"this needs the role {role} in the project; yours is {held}")
    if project.archived_at is not None and role != "viewer" and not resting:
        raise Conflict(
            'the project is archived; PATCH it with {"archived": false} to change what is in it'
        )


def projects_at_work() -> Select[UUID]:
    """Keys of the projects that are neither archived nor deleted, as part of a query."""
    return select(Project.id).where(Project.archived_at.is_(None), Project.deleted_at.is_(None))


def projects_of(user: User) -> Select[UUID]:
    """Keys of the projects that a user is a member of, as part of a query."""
    return (
        select(Member.project_id)
        .join(Project, Project.id == Member.project_id)
        .where(Member.user_id == user.id, Project.deleted_at.is_(None))
    )


Row = TypeVar("Row", bound=Base)


class Lookup(Generic[Row]):
    """Finds rows of one kind; what is not there, deleted, or other people's is equally not found.

    Attributes:
        table: its rows.
        kind: what a person calls one.
        among: conditions by which its rows are known among those of the table.
    """

    def __init__(
        self,
        table: type[Row],
        kind: str,
        owner_key: str,
        owner: Lookup[Any] | None = None,
        *,
        deleted_owner: bool = False,
        among: ColumnElement[bool] | None = None,
    ) -> None:
        """State a kind.

        Args:
            table: its rows; one with `deleted_at` may be hidden.
            kind: what a person calls one, such as `campaign`.
            owner_key: the column that names the row which it belongs to.
            owner: how that is found; None where it is a project.
            deleted_owner: whether it is found though its owner is deleted.
            among: which rows of the table are of this kind; default: all.
        """
        self.table, self.kind, self.owner_key, self.owner = table, kind, owner_key, owner
        self._deleted_owner = deleted_owner
        self.among = () if among is None else (among,)

    def __call__(
        self,
        session: Session,
        user: User,
        key: UUID,
        role: Role = "viewer",
        *,
        deleted: bool = False,
        lock: bool = False,
    ) -> Row:
        """The row, if the user has at least this role in its project.

        Args:
            session: the request's transaction.
            user: who asks.
            key: which one.
            role: what the act needs.
            deleted: find a deleted one too.
            lock: read it again, and keep other edits off it until the transaction ends. Rows that
                refer to it still come in.

        Raises:
            NotFound: there is none, it is other people's, or it is deleted.
            Forbidden: the user's role is too low.
        """
        chain = self._chain()
        match = session.execute(self._query(), {"key": key, "user_id": user.id}).one_or_none()
        if match is None:
            raise NotFound(self.kind, key)
        *rows, project, held = match  # the row, what it belongs to, and so on
        row: Any = rows[0]
        with not_found_as(self.kind, key):
            require_role(project, held, role)
            for child, owner, owner_row in zip(chain, chain[1:], rows[1:], strict=False):
                if not child._deleted_owner and getattr(owner_row, "deleted_at", None) is not None:
                    raise NotFound(owner.kind, owner_row.id)
        if lock:
            try:
                session.refresh(row, with_for_update={"key_share": True, "of": self.table})
            except InvalidRequestError:  # it was removed since it was found
                raise NotFound(self.kind, key) from None
        if not deleted and getattr(row, "deleted_at", None) is not None:
            raise NotFound(self.kind, key)
        shown: Row = row
        return shown

    def _chain(self) -> list[Lookup[Any]]:
        """This kind, the one that it belongs to, and so on."""
        return [self, *(self.owner._chain() if self.owner is not None else ())]

    @cache  # noqa: B019 - there are few kinds, and they stay
    def _query(self) -> Select[Any]:
        """A row with all that it belongs to and the user's role in their project, in one way to the
        database.
        """
        return self._with_owners().where(_key(self.table) == bindparam("key"))

    def _with_owners(self) -> Select[Any]:
        """Rows with all that they belong to and the user's role in their project."""
        chain = self._chain()
        query = select(*(link.table for link in chain), Project, Member.role).where(*self.among)
        for child, owner in pairwise(chain):
            query = query.join(
                owner.table, _key(owner.table) == getattr(child.table, child.owner_key)
            )
        query = query.join(Project, Project.id == getattr(chain[-1].table, chain[-1].owner_key))
        mine = (Member.project_id == Project.id) & (Member.user_id == bindparam("user_id"))
        return query.outerjoin(Member, mine)

    def deleted_rows(self, session: Session, user: User, most: int) -> list[tuple[Row, list[Any]]]:
        """Deleted rows that a user may restore, the newest first, each with what it belongs to, its
        project last; none of what is deleted itself.
        """
        table: Any = self.table
        owners: list[Any] = [link.table for link in self._chain()[1:]]
        query = self._with_owners().where(
            table.deleted_at.is_not(None),
            Member.role.in_(("editor", "owner")),
            *(owner.deleted_at.is_(None) for owner in (*owners, Project)),
            Project.archived_at.is_(None),
        )
        rows = session.execute(
            query.order_by(table.deleted_at.desc()).limit(most), {"user_id": user.id}
        )
        return [(row, belongs) for row, *belongs, _ in rows]

    def named(self, session: Session, user: User, key: UUID, pointer: str) -> Row:
        """The row that a body names.

        Raises:
            Invalid: it is not found, which is a fault at this place of the body.
        """
        try:
            return self(session, user, key)
        except NotFound as error:
            raise Invalid(pointer, str(error)) from None

    def row(self, session: Session, key: UUID, *, lock: bool = False) -> Row:
        """The row of a key that is known to be one, whoever asks."""
        return session.get_one(self.table, key, with_for_update=lock or None)

    def rows(self, session: Session, keys: Iterable[UUID]) -> dict[UUID, Row]:
        """Rows by key, whoever asks; keys of none are left out."""
        table: Any = self.table
        return {
            row.id: row for row in session.scalars(select(table).where(table.id.in_(set(keys))))
        }

    def all(self, session: Session, **among: Iterable[UUID]) -> Sequence[Row]:
        """The present rows that name one of some keys in a column, such as `campaign_id`, oldest
        first, whoever asks.
        """
        table: Any = self.table
        named = (getattr(table, column).in_(set(keys)) for column, keys in among.items())
        return session.scalars(
            select(table).where(*named, *present(table)).order_by(table.id)
        ).all()

    def first_named(
        self, session: Session, owner_id: UUID, name: str, among: ColumnElement[bool] | None = None
    ) -> Row | None:
        """The oldest row of an owner with a name, deleted ones left out; None where there is none,
        and until the transaction ends no other that asks for the same gets an answer: what asks can
        make one.

        Args:
            session: the request's transaction.
            owner_id: of the owner.
            name: what it is called.
            among: which rows are the owner's; default: by `owner_key`.
        """
        table: Any = self.table
        one_at_a_time(session, f"{table.__tablename__} {owner_id} {name}")
        its = getattr(table, self.owner_key) == owner_id if among is None else among
        query = (
            select(table)
            .where(its, table.name == name, *present(table))
            .order_by(table.id)
            .limit(1)
        )
        first: Row | None = session.scalar(query)
        return first

    def add(self, session: Session, user: User, row: Row, **noted: Any) -> Row:
        """Store a new row, with what the database gives it, and note it in the audit trail."""
        session.add(row)
        session.flush()
        session.refresh(row)
        self.note(session, user, row, "create", **noted)
        return row

    def project_of(self, session: Session, row: Row) -> UUID:
        """The project that a row belongs to."""
        key: UUID = getattr(row, self.owner_key)
        if self.owner is None:
            return key
        return self.owner.project_of(session, session.get_one(self.owner.table, key))

    def note(self, session: Session, user: User, row: Any, act: str, **detail: Any) -> None:
        """Record in the audit trail what was done with a row, such as `change`; or with a part of
        it, as `grid_points.put`.
        """
        name = self.kind.replace(" ", "_")
        action = act if "." in act else f"{name}.{act}"
        audit(session, user, action, name, row.id, self.project_of(session, row), **detail)

    def hide(self, session: Session, user: User, row: Row) -> None:
        """Delete a locked row so that nothing is lost: it is hidden with the moment, and can be
        brought back.
        """
        self._set_deleted(session, user, row, "delete", transaction_time(session))

    def restore(self, session: Session, user: User, row: Row) -> None:
        """Undo `hide`.

        Raises:
            Conflict: the row is not deleted.
        """
        if getattr(row, "deleted_at", None) is None:
            raise Conflict(f"the {self.kind} is not deleted")
        self._set_deleted(session, user, row, "restore", None)

    def purge(self, session: Session, user: User, row: Any) -> None:
        """Remove a deleted row with all that belongs to it for good. The audit trail keeps who did
        it, and its name.

        Raises:
            Conflict: it is not deleted.
        """
        if row.deleted_at is None:
            raise Conflict(
                f"the {self.kind} is not deleted; delete it first, and purge it when nobody"
                " misses it"
            )
        self.note(session, user, row, "purge", name=row.name)
        session.flush()
        session.expunge(row)
        # what belongs to it goes in whatever order
        session.execute(text("SET CONSTRAINTS ALL DEFERRED"))
        session.execute(
            delete(self.table).where(_key(self.table) == row.id),
            execution_options={"synchronize_session": False},
        )
        session.execute(text("SET CONSTRAINTS ALL IMMEDIATE"))

    def _set_deleted(
        self, session: Session, user: User, row: Any, act: str, deleted_at: datetime | None
    ) -> None:
        row.deleted_at, row.updated_at = deleted_at, transaction_time(session)
        self.note(session, user, row, act)


def _key(table: Any) -> Any:
    return table.id


def present(columns: Any, *, superseded: bool = False) -> list[ColumnElement[bool]]:
    """What lists, searches, figures, archives and computations see of a table: rows that are
    neither deleted nor superseded by what was made anew of the same.

    Args:
        columns: a table's class, or the columns of one in a query.
        superseded: whether superseded rows are seen too.
    """
    names = ("deleted_at",) if superseded else ("deleted_at", "superseded_by")
    return [getattr(columns, name).is_(None) for name in names if hasattr(columns, name)]


projects = Lookup(Project, "project", "id")
"""What is done with the rows of projects themselves; `project_for` finds one."""
