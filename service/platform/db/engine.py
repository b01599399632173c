"""Engine and sessions: synchronous SQLAlchemy on psycopg 3; documents on their way into the
database, as JSON has them.
"""

import json
import math
import select
import time
from collections.abc import Iterator
from typing import Any

from psycopg import Error as PsycopgError
from sqlalchemy import Engine, create_engine, event, make_url
from sqlalchemy.exc import ArgumentError, InvalidatePoolError
from sqlalchemy.orm import Session, sessionmaker

from service.platform.errors import NotFinite

Sessions = sessionmaker[Session]
# after which a connection is asked whether it still lives though nothing came on it
IDLE_SECONDS = 30.0
QUOTA = "project_quota_bytes"
"""Name in `Session.info` of the bytes that one project may store."""


class DatabaseUrlError(ValueError):
    """The database's URL is none, or names another system than PostgreSQL; the message says what is
    expected, and never the password.
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
        raise DatabaseUrlError(
            "the database's URL cannot be read, expected postgresql://user@host/database"
        ) from None
    if "@" in (parsed.host or ""):  # would name the rest of the password in every error
        raise DatabaseUrlError(
            "the database's URL has more than one @; write one in the user or password as %40"
        )
    if parsed.get_backend_name() not in ("postgresql", "postgres"):
        raise DatabaseUrlError(
            f"the database is {parsed.get_backend_name()!r}, expected a postgresql:// URL"
        )
    return parsed.set(drivername="postgresql+psycopg").render_as_string(hide_password=False)


def psycopg_url(url: str) -> str:
    """A PostgreSQL URL as libpq wants it.

    >>> psycopg_url("postgresql+psycopg://lab@db.example/modalbase")
    'postgresql://lab@db.example/modalbase'

    Raises:
        DatabaseUrlError: it is no URL, or names another database system.
    """
    rendered = (
        make_url(sqlalchemy_url(url))
        .set(drivername="postgresql")
        .render_as_string(hide_password=False)
    )
    address, mark, query = rendered.partition("?")
    # libpq takes a + as it stands, and no space: SQLAlchemy writes both, in a password and in a
    # socket's path.
    return address.replace(" ", "%20") + mark + query.replace("+", "%20")


def make_engine(
    url: str, *, pool_size: int = 5, overflow: int | None = None, name: str = "modalbase"
) -> Engine:
    """An engine that checks a connection before it hands it out, so that a restarted server goes
    unnoticed.

    A server that ends closes its connections, which shows on this side without asking. So only a
    connection on which something came, or which was idle for long, is asked; asking each time costs
    a way to the server and back a request.

    Args:
        url: the database.
        pool_size: connections that are kept.
        overflow: connections beside them while all are taken; as many again by default.
        name: by which the database knows the connections.
    """
    engine = create_engine(
        sqlalchemy_url(url),
        json_serializer=dumps,
        pool_size=pool_size,
        max_overflow=pool_size if overflow is None else overflow,
        connect_args={
            "application_name": name,
            "options": "-c timezone=UTC",
            "connect_timeout": 10,
        },
    )
    event.listen(engine, "checkin", _put_back)
    event.listen(engine, "checkout", _require_alive)
    return engine


def for_reading(engine: Engine) -> Engine:
    """The same connections, for what only reads: each statement is a transaction of its own.

    At PostgreSQL's level READ COMMITTED a statement sees what is committed when it begins, within a
    transaction or without one, so nothing is lost but the ways to the server and back that begin
    and end a transaction.
    """
    return engine.execution_options(isolation_level="AUTOCOMMIT")


def _put_back(_: Any, record: Any) -> None:
    record.info["idle_since"] = time.monotonic()


def _require_alive(connection: Any, record: Any, _: Any) -> None:
    """Have the pool replace a connection whose server has gone; a new one needs no look."""
    since = record.info.get("idle_since")
    if since is None or (
        time.monotonic() - since < IDLE_SECONDS and not _something_came(connection.pgconn.socket)
    ):
        return
    try:
        connection.autocommit = True
        connection.execute("SELECT 1")
        connection.autocommit = False
    except PsycopgError as error:
        raise InvalidatePoolError from error


def _something_came(socket: int) -> bool:
    poll = select.poll()
    poll.register(socket, select.POLLIN)
    return bool(poll.poll(0))


def make_sessions(engine: Engine, *, project_quota_bytes: int | None = None) -> Sessions:
    """Makes sessions on an engine. Their objects stay readable after commit, so that a route can
    describe what it has stored.

    Args:
        engine: on the database.
        project_quota_bytes: that one project may store through these sessions; no limit by default.
    """
    return sessionmaker(engine, expire_on_commit=False, info={QUOTA: project_quota_bytes})


MOST_PLACES = 3  # that a message names


def dumps(document: Any) -> str:
    """A document as JSON, for every column that holds one.

    Raises:
        NotFinite: a number is NaN or infinite; names the first places.
    """
    try:
        return json.dumps(document, allow_nan=False)
    except ValueError:
        places = [
            place for place, _ in zip(_not_finite(document, ""), range(MOST_PLACES), strict=False)
        ]
        raise NotFinite(places) from None


def _not_finite(value: Any, at: str) -> Iterator[str]:
    if isinstance(value, float):
        if not math.isfinite(value):
            yield at
        return
    inside = (
        value.items()
        if isinstance(value, dict)
        else enumerate(value)
        if isinstance(value, list | tuple)
        else ()
    )
    for key, member in inside:
        yield from _not_finite(member, f"{at}/{key}")
