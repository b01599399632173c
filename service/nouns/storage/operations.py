"""The account of what each project stores, and its limit.

The limit travels with the session (`service.platform.db.engine.make_sessions`), since it holds for whatever
a transaction stores, a request's and a job's alike. A session without one has no limit: the
operator's commands.

Bytes are compared with the limit twice. Before they are stored, so that what has no room costs
little; transactions that store at the same moment do not see each other's bytes then. So each
compares again when it commits, one after the other within a project: what does not fit by then is
rolled back. A project's account is held for the commit alone.
"""

from collections import Counter
from typing import Literal, TypeVar
from uuid import UUID

from sqlalchemy import ForeignKey, Index, event, func, insert, select
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.platform.access import Lookup
from service.platform.db.base import Base, Big, Identified
from service.platform.db.engine import QUOTA
from service.platform.errors import QuotaExceeded


class StoredBytes(Identified, Base):
    """Bytes that one request or job stored; negative where it removed some. It goes with what it
    was stored for.
    """

    __tablename__ = "stored_bytes"
    __table_args__ = (
        Index(None, "project_id", "kind", "size"),  # sums are read from the index alone
        Index(None, "structure_id"),
        Index(None, "campaign_id"),
    )

    project_id: Mapped[UUID] = mapped_column(ForeignKey("projects.id", ondelete="CASCADE"))
    structure_id: Mapped[UUID | None] = mapped_column(
        ForeignKey("structures.id", ondelete="CASCADE")
    )
    campaign_id: Mapped[UUID | None] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"))
    kind: Mapped[str]
    size: Mapped[Big]


BOOKED = "booked_bytes"
"""Name in `Session.info` of the bytes by project that the transaction has booked."""

Row = TypeVar("Row", bound=Base)
Kind = Literal["files", "frfs", "records", "spectra", "curves", "modes", "results", "attachments"]


def used_bytes(session: Session, project_id: UUID) -> dict[str, int]:
    """Bytes that a project stores, by kind; what is deleted counts until it is purged."""
    query = (
        select(StoredBytes.kind, func.sum(StoredBytes.size))
        .where(StoredBytes.project_id == project_id)
        .group_by(StoredBytes.kind)
    )
    return {kind: int(size) for kind, size in session.execute(query)}


def require_room(session: Session, project_id: UUID, size: int = 1) -> None:
    """Refuse what a project has no room for.

    Args:
        session: the transaction.
        project_id: which project.
        size: bytes that are about to be stored; 1 asks whether there is any room, before a job is
            queued that will store.

    Raises:
        QuotaExceeded: the project would have more bytes than it may.
    """
    allowed: int | None = session.info.get(QUOTA)
    if allowed is None:
        return
    used = sum(used_bytes(session, project_id).values())
    if used + size > allowed:
        raise QuotaExceeded(used, allowed, size)


def book(session: Session, find: Lookup[Row], owner: Row, kind: Kind, size: int) -> None:
    """Enter bytes into a project's account, in the transaction that stores them and before it does
    where they are known.

    Args:
        session: the transaction.
        find: of the owner's kind.
        owner: what they belong to; with a campaign or a structure they go when it is purged.
        kind: what they are.
        size: how many; negative where they are removed.

    Raises:
        QuotaExceeded: the project would have more bytes than it may. At the transaction's commit
            too.
    """
    if not size:
        return
    project_id = find.project_of(session, owner)
    if size > 0:
        require_room(session, project_id, size)
    with_which = {f"{find.kind}_id": owner.id} if find.kind in ("campaign", "structure") else {}  # type: ignore[attr-defined]
    session.execute(
        insert(StoredBytes).values(project_id=project_id, **with_which, kind=kind, size=size)
    )
    if size > 0:
        booked: Counter[UUID] = session.info.setdefault(BOOKED, Counter())
        booked[project_id] += size
        event.listen(session, "before_commit", _require_that_all_fits)


def _require_that_all_fits(session: Session) -> None:
    """What `book` cannot see: the bytes of transactions that have committed since. The lock ends
    with the transaction.
    """
    booked: Counter[UUID] = session.info.pop(BOOKED, Counter())
    allowed: int | None = session.info.get(QUOTA)
    if allowed is None:
        return
    for project_id, size in sorted(booked.items()):
        session.execute(
            select(func.pg_advisory_xact_lock(func.hashtextextended(f"storage {project_id}", 0)))
        )
        used = sum(used_bytes(session, project_id).values())
        if used > allowed:
            raise QuotaExceeded(used - size, allowed, size)
