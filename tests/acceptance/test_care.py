"""Backup, restore, verify and doctor as an operator meets them; and servers that will not do."""

from __future__ import annotations

import io
import os
import re
import shutil
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import psycopg
import pytest

from service.db.embedded import embedded_server
from service.db.engine import psycopg_url
from service.db.postgres import ACCOUNT
from tests.support.command import living, modalbase, modalbase_here, status, up, wait_until_gone
from tests.support.laboratory import BEAM
from tests.support.waiting import PATIENCE

POSTGRESQL_15 = Path("/usr/lib/postgresql/15/bin")


def measured(count: int, lines: int) -> bytes:
    rng = np.random.default_rng(14)
    values = rng.standard_normal((count, lines)) + 1j * rng.standard_normal((count, lines))
    file = io.BytesIO()
    np.savez(
        file,
        frequency_hz=np.arange(1, lines + 1) * 0.5,
        values=values,
        response_point=np.arange(1, count + 1),
        response_direction=np.full(count, 3),
        reference_point=np.int64(33),
        reference_direction=np.int64(-3),
        quantity=np.array("mobility"),
    )
    return file.getvalue()


def client(url: str, key: str) -> httpx.Client:
    return httpx.Client(base_url=f"{url}/", headers={"Authorization": f"Bearer {key}"}, timeout=120, trust_env=False)


def post(api: httpx.Client, path: str, **body: Any) -> str:
    return str(api.post(path, **body).raise_for_status().json()["id"])


def test_a_service_is_begun_backed_up_ended_and_restored(short_folder: Path, empty_database: str) -> None:
    """The first start makes a key and prints it, keys can be made meanwhile, and the end leaves nothing running. From the
    backup, in another data folder and in a server of one's own, the same key opens it and the same bits come out.
    """
    data, file = short_folder / "care", short_folder / "care.modalbase"
    with up(data) as (process, url, key), client(url, key) as api:
        made = modalbase("keys", "create", "--name", "ada", "--data", str(data))
        assert made.returncode == 0, made.stderr
        assert re.fullmatch(r"mb_[0-9a-f]{12}_\S+\n", made.stdout)
        assert status(url, made.stdout.strip()) == 200
        structure = post(api, f"projects/{post(api, 'projects', json={'name': 'x'})}/structures", json=BEAM)
        campaign = post(api, f"structures/{structure}/campaigns", json={"name": "x", "boundary": "cantilever"})
        npz = {"Content-Type": "application/x-npz"}
        api.post(f"campaigns/{campaign}/frfs", content=measured(300, 801), headers=npz).raise_for_status()
        before = api.get(f"campaigns/{campaign}/frfs/data?format=npz").content
        modalbase_here("backup", file, "--data", data, code=0)
        assert modalbase("backup", str(file), "--data", str(data)).stderr == (
            f"modalbase: {file} exists; a backup overwrites nothing\n"
        )
        assert len(living(data)) >= 4  # the command, the API, the worker, PostgreSQL
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE) == 0
    wait_until_gone(data)
    copy = short_folder / "copy"
    assert modalbase("restore", str(file), "--data", str(copy)).returncode == 0
    again = modalbase_here("restore", file, "--data", copy, code=1)
    assert len(again.stderr.splitlines()) == 1
    assert "the database is not empty" in again.stderr
    modalbase_here("restore", file, code=0, MODALBASE_DATABASE_URL=empty_database)
    modalbase_here("verify", code=0, MODALBASE_DATABASE_URL=empty_database)  # every spectrum by its SHA-256
    with up(copy, HOME=str(short_folder)) as (process, url, second), client(url, key) as api:
        assert second == ""  # there is a key already
        after = api.get(f"campaigns/{campaign}/frfs/data?format=npz").raise_for_status().content
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE) == 0
    wait_until_gone(copy)
    assert same(before, after)


def same(one: bytes, other: bytes) -> bool:
    with np.load(io.BytesIO(one)) as ours, np.load(io.BytesIO(other)) as theirs:
        return all(ours[name].tobytes() == theirs[name].tobytes() for name in ours)


def test_doctor_and_verify_say_what_is_wrong(database: str, short_folder: Path) -> None:
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
