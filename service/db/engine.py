"""Engine and sessions: synchronous SQLAlchemy on psycopg 3."""

from __future__ import annotations

from sqlalchemy import Engine, create_engine, make_url
from sqlalchemy.exc import ArgumentError
from sqlalchemy.orm import Session, sessionmaker

Sessions = sessionmaker[Session]
QUOTA = "project_quota_bytes"
"""Name in `Session.info` of the bytes that one project may store."""


class DatabaseUrlError(ValueError):
    """The database's URL is none, or names another system than PostgreSQL; the message says what is expected, and never
    the password.
    """


def sqlalchemy_url(url: str) -> str:
    """A PostgreSQL URL as SQLAlchemy wants it for psycopg 3.

    >>> sqlalchemy_url("postgres://lab@db.example/modalbase")
    'postgresql+psycopg://lab@db.example/modalbase'

    Raises:
        DatabaseUrlError: it is no URL, or names another database system.
    """
    try:
        parsed = make_url(url)
    except ArgumentError:
        raise DatabaseUrlError("the database's URL cannot be read, expected postgresql://user@host/database") from None
    if "@" in (parsed.host or ""):  # would name the rest of the password in every error
        raise DatabaseUrlError("the database's URL has more than one @; write one in the user or password as %40")
    if parsed.get_backend_name() not in ("postgresql", "postgres"):
        raise DatabaseUrlError(f"the database is {parsed.get_backend_name()!r}, expected a postgresql:// URL")
    return parsed.set(drivername="postgresql+psycopg").render_as_string(hide_password=False)


def psycopg_url(url: str) -> str:
    """A PostgreSQL URL as libpq wants it.

    >>> psycopg_url("postgresql+psycopg://lab@db.example/modalbase")
    'postgresql://lab@db.example/modalbase'

    Raises:
        DatabaseUrlError: it is no URL, or names another database system.
    """
    rendered = make_url(sqlalchemy_url(url)).set(drivername="postgresql").render_as_string(hide_password=False)
    address, mark, query = rendered.partition("?")
    # libpq takes a + as it stands, and no space: SQLAlchemy writes both, in a password and in a socket's path.
    return address.replace(" ", "%20") + mark + query.replace("+", "%20")


def make_engine(url: str, *, pool_size: int = 5, overflow: int | None = None, name: str = "modalbase") -> Engine:
    """An engine that checks a connection before it hands it out, so that a restarted server goes unnoticed.

    Args:
        url: the database.
        pool_size: connections that are kept.
        overflow: connections beside them while all are taken; as many again by default.
        name: by which the database knows the connections.
    """
    return create_engine(
        sqlalchemy_url(url),
        pool_size=pool_size,
        max_overflow=pool_size if overflow is None else overflow,
        pool_pre_ping=True,
        connect_args={"application_name": name, "options": "-c timezone=UTC", "connect_timeout": 10},
    )


def make_sessions(engine: Engine, *, project_quota_bytes: int | None = None) -> Sessions:
    """Makes sessions on an engine. Their objects stay readable after commit, so that a route can describe what it has
    stored.

    Args:
        engine: on the database.
        project_quota_bytes: that one project may store through these sessions; no limit by default.
    """
    return sessionmaker(engine, expire_on_commit=False, info={QUOTA: project_quota_bytes})
