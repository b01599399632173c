"""Base of all tables: names of constraints, UUIDv7 keys, creation times in UTC; and the database's
clock.
"""

from datetime import datetime
from typing import Annotated, Any, ClassVar
from uuid import UUID

from sqlalchemy import BigInteger, DateTime, Index, MetaData, String, func, select, text
from sqlalchemy.dialects.postgresql import ARRAY, JSONB
from sqlalchemy.orm import DeclarativeBase, Mapped, Session, mapped_column

NAMES = {
    "ix": "ix_%(table_name)s_%(column_0_N_name)s",
    "uq": "uq_%(table_name)s_%(column_0_N_name)s",
    "ck": "ck_%(table_name)s_%(constraint_name)s",
    "fk": "fk_%(table_name)s_%(column_0_N_name)s_%(referred_table_name)s",
    "pk": "pk_%(table_name)s",
}


Big = Annotated[int, mapped_column(BigInteger)]
"""Point labels have up to ten digits in a UFF file, and files may be larger than 2 GiB."""


class Base(DeclarativeBase):
    """Base of every table."""

    metadata = MetaData(naming_convention=NAMES)
    type_annotation_map: ClassVar[dict[Any, Any]] = {
        datetime: DateTime(timezone=True),
        dict[str, Any]: JSONB,
        list[Any]: JSONB,
    }


class Identified:
    """A row with a UUIDv7 of the server as key, so that the order of keys is the order of creation,
    and that time.

    `id` and `created_at` are there after `session.flush()`.
    """

    id: Mapped[UUID] = mapped_column(
        primary_key=True, server_default=text("uuidv7()"), sort_order=-2
    )
    created_at: Mapped[datetime] = mapped_column(server_default=func.now(), sort_order=-1)


class Labelled:
    """A row with tags and free metadata; most have none, so that indexes have only those that
    do.
    """

    tags: Mapped[list[str]] = mapped_column(ARRAY(String), server_default="{}", default=list)
    meta: Mapped[dict[str, Any]] = mapped_column(server_default="{}", default=dict)


def label_indexes(table: str) -> tuple[Index, Index]:
    """The indexes by which a search finds tags and metadata of a table's rows."""
    return tuple(
        Index(
            f"ix_{table}_{name}",
            name,
            postgresql_using="gin",
            postgresql_where=text(f"{name} <> '{{}}'"),
        )
        for name in ("tags", "meta")
    )  # type: ignore[return-value]


def one_at_a_time(session: Session, key: str) -> None:
    """Hold up other transactions that come with the same key until this one ends."""
    session.execute(select(func.pg_advisory_xact_lock(func.hashtextextended(key, 0))))


def at_one_moment(session: Session) -> None:
    """Have all that the session reads from here on be of one moment; what it changed is kept."""
    session.commit()
    session.connection(execution_options={"isolation_level": "REPEATABLE READ"})


def transaction_time(session: Session) -> datetime:
    """When the session's transaction began, by the database's clock: all rows that one transaction
    changes get the same time.
    """
    return session.execute(select(func.now())).scalar_one()
