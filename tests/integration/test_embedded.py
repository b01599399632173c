"""The embedded PostgreSQL in folders of every kind, and who reaches it."""

import os
import shutil
import signal
import stat
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from threading import Event, Thread

import psutil
import psycopg
import pytest
from sqlalchemy import make_url

from service.platform.db.opening import (
    DataFolderError,
    embedded_server,
    keep_running,
    open_database,
)
from service.platform.db.postgres import Cluster, PostgresError, programs
from service.platform.settings import Settings
from tests.support.command import living
from tests.support.waiting import until

LONG = "a-folder-with-a-long-name" * 6
ROOT = os.geteuid() == 0


@pytest.fixture
def folder(short_folder: Path) -> Iterator[Path]:
    """A folder that only its owner passes, as `/root` and most homes are."""
    made = short_folder / "private"
    made.mkdir(mode=0o700)
    yield made
    shutil.rmtree(made)


@pytest.fixture(scope="module")
def cluster(short_folder: Path) -> Iterator[Path]:
    """Files of a server that a test may copy, which is quicker than making new ones."""
    with embedded_server(short_folder / "cluster"):
        pass
    made = short_folder / "cluster" / "postgres"
    with (made / "postgresql.conf").open("a") as file:
        file.write("fsync = off\n")  # nothing here survives a power cut
    yield made
    shutil.rmtree(short_folder / "cluster")


def filled(data: Path, cluster: Path) -> Path:
    data.mkdir(mode=0o700, parents=True, exist_ok=True)
    subprocess.run(["cp", "-a", str(cluster), str(data / "postgres")], check=True)
    return data


def socket_of(url: str) -> Path:
    return Path(str(make_url(url).query["host"]))


def lets_in(user: str | None, url: str) -> bool:
    """Whether a user's question is answered."""
    command = [str(programs() / "psql"), "--no-password", url, "-c", "SELECT 1"]
    done = subprocess.run(
        command, user=user, extra_groups=[], capture_output=True, check=False, env={}, cwd="/"
    )
    return done.returncode == 0


def psql_is_open() -> bool:
    """Whether another user may run it."""
    command = [str(programs() / "psql"), "--version"]
    try:
        return not subprocess.run(
            command, user="nobody", check=False, capture_output=True
        ).returncode
    except PermissionError:
        return False


@pytest.mark.parametrize("name", ["a b, Prüfstand µε $HOME`id`\"'\\", LONG])
def test_any_path_will_do_and_another_local_user_does_not_reach_the_database(
    folder: Path, cluster: Path, name: str
) -> None:
    data = filled(folder / name / "data", cluster)
    with embedded_server(data) as url, psycopg.connect(url) as connection:
        assert connection.execute("SELECT current_database()").fetchone() == ("modalbase",)
        assert stat.S_IMODE(socket_of(url).stat().st_mode) == 0o700
        if ROOT and psql_is_open():  # a second user is needed, whom root can be
            assert lets_in(None, url)
            assert not lets_in("nobody", url)
            socket = socket_of(url)
            for path in (
                *data.parents,
                data,
                data / "postgres",
                socket,
                next(socket.glob(".s.*2")),
            ):
                if folder.parent in (path, *path.parents):
                    path.chmod(0o777)  # whatever the modes: the server itself refuses
            assert not lets_in("nobody", url)
            (data / "postgres").chmod(0o700)
    with embedded_server(data) as again, psycopg.connect(again):
        pass
    assert not (data / ".socket").exists()
    # nothing stays in the temporary folder
    assert data in socket_of(again).parents or not socket_of(again).exists()


def test_a_start_that_is_interrupted_leaves_no_server(folder: Path, cluster: Path) -> None:
    """While `pg_ctl start` runs, which is over soon: until one of the starts was met."""
    data = filled(folder / "data", cluster)
    before = signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    try:
        for _ in range(50):
            over = Event()
            watching = Thread(target=interrupt_the_start, args=(over,))
            watching.start()
            try:
                with embedded_server(data):
                    over.set()
            except SystemExit:
                break
            finally:
                over.set()
                watching.join()
        else:
            pytest.fail("no start was met")
    finally:
        signal.signal(signal.SIGTERM, before)
    assert not living(data)


def interrupt_the_start(over: Event) -> None:
    while not over.is_set():
        for child in psutil.Process().children():
            with suppress(psutil.Error):
                if child.name() == "pg_ctl" and "start" in child.cmdline():
                    os.kill(os.getpid(), signal.SIGTERM)
                    return


def test_files_are_made_under_any_path_and_no_folder_of_others_changes_its_mode(
    folder: Path,
) -> None:
    """Half a cluster, of a start that was cut off, is made anew."""
    data = folder / 'Prüf stand $HOME"`' / "data"
    data.parent.mkdir(mode=0o700)
    watched = [folder, data.parent, programs(), *programs().parents, Path.home()]
    before = [path.stat().st_mode for path in watched]
    data.mkdir(mode=0o700)
    (data / "postgres.new").mkdir()
    (data / "postgres.new" / "PG_VERSION").write_text("18\n")
    with embedded_server(data) as url, psycopg.connect(url) as connection:
        assert connection.execute("SHOW data_checksums").fetchone() == ("on",)
    assert [path.stat().st_mode for path in watched] == before
    assert stat.S_IMODE(data.stat().st_mode) == 0o700


def test_a_server_that_died_comes_back_where_it_was(folder: Path, cluster: Path) -> None:
    data = filled(folder / LONG, cluster)
    with embedded_server(data) as url:
        pid = int((data / "postgres" / "postmaster.pid").read_text().split()[0])
        subprocess.run(["kill", "-9", str(pid)], check=True)

        def runs_again() -> bool:
            try:
                return keep_running(data)
            except PostgresError:  # its processes are still dying
                return False

        until(runs_again, "the server runs again")
        with psycopg.connect(url) as connection:
            assert connection.execute("SELECT 1").fetchone() == (1,)
    assert not socket_of(url).exists()


def test_everybody_who_connects_is_asked_who_they_are(folder: Path, cluster: Path) -> None:
    """Also in a folder that an earlier version made, which let everybody in."""
    filled(folder, cluster)
    (folder / "postgres" / "pg_hba.conf").write_text("local all all trust\n")
    with embedded_server(folder) as url, psycopg.connect(url) as connection:
        methods = connection.execute(
            "SELECT DISTINCT auth_method FROM pg_hba_file_rules"
        ).fetchall()
        assert methods == [("peer",)]


@pytest.mark.skipif(not ROOT, reason="only root can give a folder away")
def test_root_starts_the_folder_of_an_ordinary_user(folder: Path, cluster: Path) -> None:
    filled(folder, cluster)
    for path in [folder / "postgres", *(folder / "postgres").rglob("*")]:
        os.chown(path, 65534, 65534)
    with embedded_server(folder) as url, psycopg.connect(url) as connection:
        assert connection.execute("SELECT 1").fetchone() == (1,)
    assert (folder / "postgres").stat().st_uid == 65534


@pytest.mark.parametrize(
    ("file", "content", "says"),
    [
        ("PG_VERSION", "16\n", "PostgreSQL 16, this version of modalbase brings 18"),
        ("x", "", "holds no files of PostgreSQL"),
    ],
)
def test_files_that_are_not_ours_are_left_alone(
    folder: Path, file: str, content: str, says: str
) -> None:
    (folder / "postgres").mkdir()
    (folder / "postgres" / file).write_text(content)
    with pytest.raises(DataFolderError, match=says), open_database(Settings(data=folder)):
        pass
    assert (folder / "postgres" / file).read_text() == content


def test_the_log_says_why_it_does_not_start(folder: Path, cluster: Path) -> None:
    filled(folder, cluster)
    with (folder / "postgres" / "postgresql.conf").open("a") as file:
        file.write("shared_buffers = 'much'\n")
    cluster = Cluster(folder / "postgres")
    with pytest.raises(PostgresError, match=r"configuration file .* contains errors"):
        cluster.start()
    assert not cluster.runs()


def running(folder: Path) -> bool:
    """Is there a living server of that folder?"""
    return any(
        p.info["status"] != psutil.STATUS_ZOMBIE and p.info["cwd"] == str(folder / "postgres")
        for p in psutil.process_iter(["status", "cwd"])
    )


HOLD = """
import sys
from pathlib import Path
from service.platform.db.opening import embedded_server
with embedded_server(Path(sys.argv[1])) as url:
    print("in", flush=True)
    sys.stdin.read()
"""


def test_embedded_server_lives_from_the_first_to_the_last_that_is_in(
    folder: Path, cluster: Path
) -> None:
    filled(folder, cluster)
    with embedded_server(folder) as url:
        other = subprocess.Popen(
            [sys.executable, "-c", HOLD, str(folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert other.stdin is not None
        assert other.stdout.readline() == "in\n"
    assert running(folder)  # the other is still in
    with psycopg.connect(url) as connection:
        assert connection.execute("SELECT 1").fetchone() == (1,)
    other.communicate("")
    assert other.returncode == 0
    assert not running(folder)


def test_embedded_server_survives_the_death_of_its_starter(folder: Path, cluster: Path) -> None:
    filled(folder, cluster)
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, str(folder)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as starter:
        assert starter.stdout.readline() == "in\n"
        starter.kill()
    assert running(folder)  # nobody was there to stop it
    with embedded_server(folder) as url, psycopg.connect(url) as connection:
        assert connection.execute("SELECT 1").fetchone() == (1,)
    assert not running(folder)


def test_embedded_server_starts_over_a_stale_pid_file(folder: Path, cluster: Path) -> None:
    """After a power cut the file is cut off, or names a process id that may be another program's by
    now: here, ours.
    """
    file = filled(folder, cluster) / "postgres" / "postmaster.pid"
    with embedded_server(folder):
        _, *rest = file.read_text().splitlines()
    for left in ("\n".join([str(psutil.Process().pid), *rest]) + "\n", ""):
        file.write_text(left)
        with embedded_server(folder) as url, psycopg.connect(url) as connection:
            assert connection.execute("SELECT 1").fetchone() == (1,)
