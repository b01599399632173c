"""Fixtures at the level a user stands: a real PostgreSQL, real processes, real HTTP.

server      URL of an embedded PostgreSQL that lives as long as the test session
database    URL of a migrated database without rows: a new one, or one that another test has used, emptied
sessions    SQLAlchemy sessions on `database`
new_service running services, each with settings and a database of its own
service     a running modalbase for the session: API process and worker process, on free ports
new_api     running APIs without a worker, in a thread of the test's process
idle        one of these, which is asked as much as can be
api         an httpx client of `service`, with a key of a user of its own: sees nothing of other tests
"""

import os

# Before numpy is loaded, also by the processes that tests start: threads of the linear algebra would
# wait for one another.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import gc
import shutil
import tempfile
from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any
from uuid import uuid4

import httpx
import psycopg
import pytest
from sqlalchemy import Engine, make_url

from service.app.supervisor import LocalService
from service.platform.access.keys import create_key, user_named
from service.platform.db.engine import Sessions, make_engine, make_sessions, psycopg_url
from service.platform.db.opening import embedded_server
from service.platform.db.schema import upgrade
from service.platform.settings import Settings
from tests.support.emptying import empty_tables, schema_print
from tests.support.here import served_here
from tests.support.places import shared_folder
from tests.support.rest import ASKED_FREELY, client_of

TEMPLATE = "test_template"
MEMORY = Path("/dev/shm")  # a file system in memory, of Linux
ROOM_BYTES = 4 * 2**30  # the databases and logs of four servers take half of it
pytest_plugins = [
    "tests.support.laboratory",
    "tests.support.slowest",
    "tests.support.wheel",
    "tests.support.working",
]


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """What is collected lives to the end: to look through it for garbage, again and again, takes a
    second of each process.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def _on(server: str, database: str) -> str:
    return make_url(server).set(database=database).render_as_string(hide_password=False)


def _admin(server: str, statement: str) -> None:
    with psycopg.connect(_on(server, "postgres"), autocommit=True) as connection:
        connection.execute(statement)


def _is_there(server: str, database: str) -> bool:
    with psycopg.connect(_on(server, "postgres")) as connection:
        return bool(
            connection.execute(
                "SELECT 1 FROM pg_database WHERE datname = %s", [database]
            ).fetchone()
        )


@pytest.fixture(scope="session")
def short_folder() -> Iterator[Path]:
    """A folder whose path is short enough for a Unix socket, which pytest's are not.

    It lies in memory where there is room: a database has hundreds of files, and some disks take
    milliseconds to delete each.
    """
    roomy = MEMORY.is_dir() and shutil.disk_usage(MEMORY).free > ROOM_BYTES
    folder = Path(tempfile.mkdtemp(prefix="mb-", dir=MEMORY if roomy else None))
    yield folder
    shutil.rmtree(folder)


@pytest.fixture(scope="session")
def server(short_folder: Path) -> Iterator[str]:
    if given := os.environ.get("MODALBASE_TEST_SERVER"):  # one that runs for many runs of the tests
        yield given
        return
    with embedded_server(short_folder) as url:
        # Nothing here survives a power cut, so nothing waits for the disk; what a killed server
        # keeps is the same. Its log of changes stays short, as it may lie in memory.
        _admin(url, "ALTER SYSTEM SET fsync = off")
        _admin(url, "ALTER SYSTEM SET max_wal_size = '256MB'")
        _admin(url, "SELECT pg_reload_conf()")
        yield url


@pytest.fixture(scope="session")
def new_database(server: str) -> Callable[[], str]:
    """Makes migrated databases: each call a fresh one."""
    if not _is_there(server, TEMPLATE):
        _admin(server, f"CREATE DATABASE {TEMPLATE}")
        engine = make_engine(_on(server, TEMPLATE))
        upgrade(engine)
        engine.dispose()

    def make() -> str:
        name = f"test_{uuid4().hex}"
        _admin(server, f"CREATE DATABASE {name} TEMPLATE {TEMPLATE} STRATEGY file_copy")
        return _on(server, name)

    return make


def _drop(server: str, url: str) -> None:
    _admin(server, f"DROP DATABASE {make_url(url).database} WITH (FORCE)")


@pytest.fixture(scope="session")
def emptied() -> list[tuple[str, str]]:
    """Databases that a test has done with, each with its schema's print; copying the template takes
    ten times as long.
    """
    return []


@pytest.fixture
def database(
    server: str, new_database: Callable[[], str], emptied: list[tuple[str, str]]
) -> Iterator[str]:
    url, made = emptied.pop() if emptied else (new_database(), "")
    made = made or schema_print(url)
    yield url
    if empty_tables(url) == made:
        emptied.append((url, made))
    else:
        _drop(server, url)


@pytest.fixture
def new_empty_database(server: str) -> Iterator[Callable[[], str]]:
    """Makes databases without a schema."""
    made: list[str] = []

    def make() -> str:
        made.append(_on(server, f"test_{uuid4().hex}"))
        _admin(server, f"CREATE DATABASE {make_url(made[-1]).database}")
        return made[-1]

    yield make
    for url in made:
        _drop(server, url)


@pytest.fixture
def empty_database(new_empty_database: Callable[[], str]) -> str:
    return new_empty_database()


@pytest.fixture
def empty(empty_database: str) -> Iterator[Engine]:
    """An engine on a database without any table."""
    engine = make_engine(empty_database)
    yield engine
    engine.dispose()


@pytest.fixture
def engine(database: str) -> Iterator[Engine]:
    engine = make_engine(database)
    yield engine
    engine.dispose()


@pytest.fixture
def sessions(engine: Engine) -> Sessions:
    return make_sessions(engine)


@pytest.fixture(scope="session")
def new_service(new_database: Callable[[], str]) -> Callable[..., LocalService]:
    """Makes services, each on a database of its own and a free port, that run within a `with`."""

    def make(*, worker: bool = True, **settings: Any) -> LocalService:
        given = {"database_url": new_database(), "port": 0, "log_level": "error", **settings}
        return LocalService(Settings(**given), worker=worker)

    return make


RUNNING = pytest.StashKey[LocalService]()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item,
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """What the service was at when a test failed, whichever test had it do that."""
    report = yield
    if report.failed and (running := item.session.stash.get(RUNNING, None)) is not None:
        ends = {name: process.poll() for name, process in running.processes.items()}
        jobs = "SELECT id, kind, queue, state, stage, worker FROM jobs WHERE finished_at IS NULL"
        try:
            with psycopg.connect(psycopg_url(running.settings.database_url or "")) as connection:
                lines = map(str, [ends, *connection.execute(jobs)])
        except psycopg.Error as error:
            lines = map(str, [ends, error])
        report.sections.append(("the service's processes and jobs", "\n".join(lines)))
    return report


@pytest.fixture(scope="session")
def service(
    new_service: Callable[..., LocalService], request: pytest.FixtureRequest
) -> Iterator[LocalService]:
    with new_service(
        log_level="warning",
        request_wait_seconds=600,  # what waits for its turn does so however slow the machine is
        webhook_networks="127.0.0.0/8",
        webhook_ports="1-65535",
        delivery_pause_seconds=0.05,
        campaign_settle_seconds=0.0,
        retention_sweep_seconds=0.5,
    ) as running:
        request.session.stash[RUNNING] = running
        yield running
        del request.session.stash[RUNNING]


@pytest.fixture(scope="session")
def new_api(
    new_database: Callable[[], str],
) -> Callable[..., AbstractContextManager[LocalService]]:
    """Makes APIs, each on a database of its own, that run within a `with`."""

    def make(**settings: Any) -> AbstractContextManager[LocalService]:
        return served_here(Settings(database_url=new_database(), **settings))

    return make


@pytest.fixture(scope="session")
def idle(
    new_api: Callable[..., AbstractContextManager[LocalService]],
) -> Iterator[LocalService]:
    with new_api(import_wait_seconds=0.2, **ASKED_FREELY) as running:
        yield running


@pytest.fixture
def new_client(service: LocalService) -> Iterator[Callable[[], httpx.Client]]:
    """Makes clients of the running service, each with a new user's key."""
    clients: list[httpx.Client] = []

    def make() -> httpx.Client:
        clients.append(client_of(service, f"tester-{uuid4().hex}"))
        return clients[-1]

    yield make
    for client in clients:
        client.close()


@pytest.fixture
def api(new_client: Callable[[], httpx.Client]) -> httpx.Client:
    return new_client()


@pytest.fixture
def key_of(sessions: Sessions) -> Callable[[str], str]:
    """Makes a key in `database` for a user of that name."""

    def make(name: str) -> str:
        with sessions.begin() as session:
            return create_key(session, user_named(session, name), "test")[1]

    return make


@pytest.fixture
def blind_open() -> Path:
    """FRFs of beams by another finite element code, with the truth beside them."""
    return shared_folder("BLIND_OPEN", "blind-open")


@pytest.fixture
def uff_corpus() -> Path:
    """Other people's UFF files."""
    return shared_folder("UFF_CORPUS", "uff-corpus")
