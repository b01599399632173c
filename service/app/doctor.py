"""What is wrong with a service, in words: its data folder, its database, its schema, its workers,
what it stores.
"""

import os
import pwd
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from sqlalchemy import Connection, Engine, text

from service.app.backup.verification import find_damage, first_line
from service.platform.db.opening import opened_engine
from service.platform.db.schema import SchemaError, require_head, require_version
from service.platform.settings import Settings

FREE_BYTES = 1024**3
FREE_SHARE = 0.05
WAITING = "10 minutes"
SHOWN = 5

Level = Literal["ok", "warning", "fault"]


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at."""

    level: Level  # `fault` keeps the service from working, or has harmed data
    subject: str  # what was looked at
    words: str  # what was found, and for a warning or a fault what to do


def examine(settings: Settings, *, stored: bool = True) -> Iterator[Finding]:
    """Look at everything, the cheapest first; what cannot be looked at for an earlier fault is left
    out.

    Args:
        settings: of the service.
        stored: read everything stored and compare its SHA-256, which takes as long as reading the
            database.
    """
    embedded = settings.database_url is None
    if embedded:
        folder = settings.data.expanduser()
        finding = _folder(folder)
        yield finding
        if finding.level == "fault":
            return
        yield _disk(folder)
    try:
        with opened_engine(settings, migrate_new=False) as engine:
            yield from _database(engine, settings, stored=stored)
    except Exception as error:  # noqa: BLE001  whatever it is, it is what is wrong
        yield Finding("fault", "database", first_line(error))


def _folder(folder: Path) -> Finding:
    if not folder.is_dir():
        return Finding(
            "fault",
            "data folder",
            f"{folder} does not exist; `modalbase up` makes it, --data names another",
        )
    if not os.access(folder, os.R_OK | os.W_OK | os.X_OK):
        owner = _user(folder.stat().st_uid)
        return Finding(
            "fault",
            "data folder",
            f"{folder} belongs to {owner} and is closed to you; run this as {owner}",
        )
    files = folder / "postgres"
    if files.is_dir() and files.stat().st_mode & 0o077:
        return Finding(
            "warning", "data folder", f"other users may read {files}; close it: chmod 700 '{files}'"
        )
    return Finding("ok", "data folder", str(folder))


def _disk(folder: Path) -> Finding:
    usage = shutil.disk_usage(folder)
    words = f"{usage.free / 1e9:.1f} GB of {usage.total / 1e9:.1f} GB are free"
    if usage.free < max(FREE_BYTES, FREE_SHARE * usage.total):
        return Finding("warning", "disk", f"{words}; PostgreSQL stops when it is full")
    return Finding("ok", "disk", words)


def _database(engine: Engine, settings: Settings, *, stored: bool) -> Iterator[Finding]:
    with engine.connect() as connection:
        require_version(connection)
        version, size = connection.execute(text(
            "SELECT current_setting('server_version'), pg_size_pretty(pg_database_size(current_database()))"
        )).one()  # fmt: skip
    yield Finding("ok", "database", f"PostgreSQL {version} answers; {size} are stored")
    try:
        require_head(engine)
    except SchemaError as error:
        yield Finding("fault", "schema", str(error))
        return
    yield Finding("ok", "schema", "this version's")
    with engine.connect() as connection:
        yield _workers(connection, settings)
        yield from _jobs(connection)
        if stored:
            yield _stored(connection)


def _workers(connection: Connection, settings: Settings) -> Finding:
    alive = connection.scalar(
        text(
            "SELECT count(*) FROM procrastinate_workers WHERE last_heartbeat > now() -"
            " make_interval(secs => :lease)"
        ),
        {"lease": settings.job_lease_seconds},
    )
    if not alive:
        return Finding(
            "warning",
            "workers",
            "none is alive, so no job runs; start `modalbase worker` or `modalbase up`",
        )
    return Finding("ok", "workers", f"{alive} alive")


def _jobs(connection: Connection) -> Iterator[Finding]:
    waiting, running = connection.execute(text(
        "SELECT count(*) FILTER (WHERE state = 'queued'), count(*) FILTER (WHERE state = 'running') FROM jobs"
    )).one()  # fmt: skip
    stuck = connection.scalar(
        text(
            "SELECT count(*) FROM jobs WHERE state = 'queued' AND queued_at < now() - interval"
            f" '{WAITING}'"
        )
    )
    counts = f"{waiting} waiting, {running} running"
    if stuck and not running:
        yield Finding(
            "warning",
            "jobs",
            f"{counts}; {stuck} have waited over {WAITING} while none runs: see the workers",
        )
    else:
        yield Finding("ok", "jobs", counts)
    lost = connection.scalar(text("SELECT count(*) FROM jobs WHERE error->>'reason' = 'lost'"))
    if lost:
        yield Finding(
            "warning",
            "jobs",
            f"{lost} were given up because their workers died; the workers' logs say why",
        )


def _stored(connection: Connection) -> Finding:
    damaged = find_damage(connection)
    if not damaged:
        return Finding("ok", "stored data", "every spectrum, curve and file has its SHA-256")
    shown = ", ".join(damaged[:SHOWN]) + (", …" if len(damaged) > SHOWN else "")
    return Finding(
        "fault", "stored data", f"{len(damaged)} damaged: {shown}; restore them from a backup"
    )


def _user(number: int) -> str:
    try:
        return pwd.getpwuid(number).pw_name
    except KeyError:
        return f"user {number}"
