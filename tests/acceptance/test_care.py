"""Verify and doctor as an operator meets them, and servers that will not do; backup and restore are in `test_up.py`."""

import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import psycopg
import pytest

from service.db.engine import psycopg_url
from service.db.opening import embedded_server
from service.db.postgres import ACCOUNT
from tests.support.command import modalbase, modalbase_here

POSTGRESQL_15 = Path("/usr/lib/postgresql/15/bin")


def test_doctor_and_verify_say_what_is_wrong_and_a_backup_carries_it(
    database: str, empty_database: str, short_folder: Path, tmp_path: Path
) -> None:
    around = {"MODALBASE_DATABASE_URL": database}
    healthy = modalbase_here("doctor", **around)
    assert healthy.returncode == 0, healthy.stdout + healthy.stderr
    assert "ok       schema: this version's" in healthy.stdout
    assert "warning  workers: none is alive" in healthy.stdout
    with psycopg.connect(psycopg_url(database)) as connection:
        connection.execute("INSERT INTO originals VALUES ('\\x00', 3)")
    for command in ("doctor", "verify"):
        ended = modalbase_here(command, **around)
        assert ended.returncode == 1
        assert "1 damaged" in ended.stdout + ended.stderr
        assert "originals 00: data" in ended.stdout + ended.stderr
    file = tmp_path / "damaged.modalbase"
    written = modalbase_here("backup", file, **around)
    assert (written.returncode, "and so is this damage of the database: originals 00" in written.stderr) == (1, True)
    restored = modalbase_here("restore", file, MODALBASE_DATABASE_URL=empty_database)
    assert (restored.returncode, "but for this damage, which the backup already had" in restored.stderr) == (1, True)
    with psycopg.connect(psycopg_url(database)) as connection:
        connection.execute("UPDATE alembic_version SET version_num = '0009_original_rows'")
    assert "fault    schema: the schema is at 0009" in modalbase_here("doctor", **around).stdout
    nowhere = modalbase_here("doctor", MODALBASE_DATABASE_URL="postgresql://u@127.0.0.1:1/d")
    assert (nowhere.returncode, nowhere.stderr) == (1, "")
    assert nowhere.stdout.startswith("fault    database: ")
    absent = modalbase_here("doctor", "--data", str(short_folder / "absent"))
    assert "fault    data folder: " in absent.stdout
    assert modalbase_here("backup", "x", "--data", str(short_folder / "absent")).returncode == 1
    assert not (short_folder / "absent").exists()


def test_doctor_looks_at_a_data_folder(short_folder: Path) -> None:
    data = short_folder / "looked-at"
    with embedded_server(data):
        pass
    (data / "postgres").chmod(0o750)
    shown = modalbase_here("doctor", "--data", data).stdout
    assert "warning  data folder: other users may read" in shown
    assert "disk: " in shown
    assert "fault    schema: the database has no modalbase schema yet" in shown


@pytest.fixture
def old_server(short_folder: Path, server: str) -> Iterator[str]:
    """URL of a PostgreSQL 15."""
    if not POSTGRESQL_15.is_dir():
        pytest.skip(f"no PostgreSQL 15 in {POSTGRESQL_15}")
    folder = short_folder / "old"
    folder.mkdir()
    assert server  # which made the account where it was missing
    user = ACCOUNT if os.geteuid() == 0 else None
    if user:
        short_folder.chmod(0o755)
        shutil.chown(folder, ACCOUNT, ACCOUNT)

    def run(*words: str) -> None:
        subprocess.run([str(POSTGRESQL_15 / words[0]), *words[1:]], user=user, check=True, stdout=subprocess.DEVNULL)

    run("initdb", "-A", "trust", "-U", "postgres", "-D", str(folder / "d"))
    run("pg_ctl", "-w", "-D", str(folder / "d"), "-l", str(folder / "log"), "-o", f"-h '' -k {folder}", "start")
    yield f"postgresql://postgres@/postgres?host={folder}"
    run("pg_ctl", "-w", "-D", str(folder / "d"), "-m", "fast", "stop")


def test_a_server_that_is_too_old_is_refused_in_one_line(old_server: str) -> None:
    for words in (["db", "upgrade"], ["up", "--port", "0"], ["keys", "create", "--name", "x"], ["verify"]):
        ended = (modalbase if words[0] == "up" else modalbase_here)(*words, MODALBASE_DATABASE_URL=old_server)
        assert ended.returncode == 1
        assert ended.stderr.startswith("modalbase: the server runs PostgreSQL 15.")
        assert "needs 18 or newer" in ended.stderr
        assert len(ended.stderr.splitlines()) == 1
    examined = modalbase_here("doctor", MODALBASE_DATABASE_URL=old_server).stdout
    assert "fault    database: the server runs PostgreSQL 15." in examined
