"""Backup and restore between databases: every row, every schema, every kind of damage."""

import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from uuid import uuid4
from zipfile import ZipFile, ZipInfo

import pytest
from sqlalchemy import Engine, LargeBinary, insert, inspect, select, text

import service.app.composition  # noqa: F401  imports every table
from fecore import __version__
from service.app.backup.archive import (
    MANIFEST,
    BackupError,
    our_tables,
    read_back,
    read_manifest,
    write_backup,
)
from service.app.backup.restoring import restore_backup
from service.app.backup.verification import CHECKED, deleted_by_rules, find_damage
from service.platform.access.tables import Member, Project, User
from service.platform.db.base import Base
from service.platform.db.engine import make_engine, make_sessions
from service.platform.db.schema import LAST_WITH_OLDER, head_revision, require_head, upgrade
from service.platform.queue.tables import Job
from tests.integration.test_db import fill, revisions
from tests.support.command import modalbase_here
from tests.support.lengths import long


@pytest.fixture
def source(empty_database: str) -> Iterator[Engine]:
    engine = make_engine(empty_database)
    yield engine
    engine.dispose()


@pytest.fixture
def target(new_empty_database: Callable[[], str]) -> Iterator[Engine]:
    engine = make_engine(new_empty_database())
    yield engine
    engine.dispose()


def rows_of(engine: Engine) -> dict[str, list[dict[str, Any]]]:
    with engine.connect() as connection:
        return {
            table.name: [
                dict(row)
                for row in connection.execute(
                    select(table).order_by(*table.primary_key.columns)
                ).mappings()
            ]
            for table in our_tables(connection)
        }


def repair_digests(engine: Engine) -> None:
    """Rows that `fill` makes have any bytes; here they are as the service stores them."""
    with engine.begin() as connection:
        catalogue = inspect(connection)
        tables = catalogue.get_table_names()
        for table, _, data, digest in CHECKED:
            if table in tables and data in {
                column["name"] for column in catalogue.get_columns(table)
            }:
                connection.execute(
                    text(f"UPDATE {table} SET {digest} = sha256({data}) WHERE {data} IS NOT NULL")
                )
        names = [
            name
            for name in tables
            if "originals" in {key["referred_table"] for key in catalogue.get_foreign_keys(name)}
        ]
        connection.execute(
            text("INSERT INTO originals SELECT sha256(data), length(data) FROM original_chunks")
        )
        for name in names:
            connection.execute(
                text(f"UPDATE {name} SET sha256 = (SELECT sha256(data) FROM original_chunks)")
            )
        connection.execute(
            text("DELETE FROM originals WHERE sha256 NOT IN (SELECT sha256 FROM original_chunks)")
        )
        connection.execute(text("UPDATE original_chunks SET number = 0"))


@pytest.mark.parametrize("revision", [long(revisions()[0]), revisions()[-1]])
def test_every_row_comes_back_from_every_schema(
    source: Engine, target: Engine, tmp_path: Path, revision: str
) -> None:
    """Of the present one in the short run, beside the file of an older one below."""
    upgrade(source, revision)
    with source.begin() as connection:
        fill(connection)
    repair_digests(source)
    with source.connect() as connection:  # an older schema knows of no retention rule
        assert deleted_by_rules(connection) == ""
        if revision == revisions()[-1]:
            older = "ALTER TABLE originals RENAME COLUMN bytes_deleted_at TO none_yet"
            connection.execute(text(older))
            assert deleted_by_rules(connection) == ""
    seen: list[tuple[int, int]] = []
    manifest = write_backup(source, tmp_path / "backup", lambda *bytes_: seen.append(bytes_))
    assert (manifest.revision, manifest.software, manifest.damaged) == (revision, __version__, [])
    assert stat_mode(tmp_path / "backup") == 0o600
    back: list[tuple[int, int]] = []
    assert (
        restore_backup(target, tmp_path / "backup", lambda *bytes_: back.append(bytes_)) == manifest
    )
    assert seen == sorted(seen)
    assert all(done <= total for done, total in (*seen, *back))
    assert back[-1][0] == back[-1][1]
    assert seen[-1][0] > back[-1][0]  # it was written and read back
    require_head(target)
    upgrade(source)  # what an upgrade in place makes of the same rows
    restored, kept = rows_of(target), rows_of(source)
    for name in (kept["jobs"], restored["jobs"]):
        for row in name:
            row.pop("version"), row.pop("ticket", None)
    for row in [*kept["projects"], *restored["projects"]]:
        row.pop("updated_at")  # the moment of the upgrade, where the schema before had none
    assert restored == kept
    assert find_damage_of(target) == []


def test_a_file_of_an_older_schema_is_restored(target: Engine) -> None:
    """`rows-0057.modalbase` was written at revision 0057: a row in each of its tables."""
    file = Path(__file__).parent / "files" / "rows-0057.modalbase"
    manifest = restore_backup(target, file)
    assert (manifest.revision, manifest.damaged) == ("0057_superseded", [])
    require_head(target)
    restored = rows_of(target)
    for table in manifest.tables:
        if table.name in restored:  # a later revision has no use for some
            assert len(restored[table.name]) >= table.rows >= 1, table.name
    assert sum(table.rows for table in manifest.tables) >= 43
    assert find_damage_of(target) == []
    (frf,) = restored["frfs"]
    assert (frf["data"], frf["label"], frf["step_hz"]) == (b"\x00\xff", "µε, °", 0.5)


def stat_mode(path: Path) -> int:
    return path.stat().st_mode & 0o777


def find_damage_of(engine: Engine) -> list[str]:
    with engine.connect() as connection:
        return find_damage(connection)


def test_a_backup_shows_one_moment(engine: Engine, target: Engine, tmp_path: Path) -> None:
    """Beside somebody who writes: a project and its owner are both in it, or neither."""
    sessions, written = make_sessions(engine), threading.Event()

    def write_on() -> None:
        while not written.is_set():
            with sessions.begin() as session:
                user, project = User(name=uuid4().hex), Project(name="x")
                session.add_all([user, project])
                session.flush()
                session.add(Member(user_id=user.id, project_id=project.id, role="owner"))

    writer = threading.Thread(target=write_on)
    writer.start()
    try:
        manifest = write_backup(engine, tmp_path / "backup")
        rows = {table.name: table.rows for table in manifest.tables}
        assert rows["users"] == rows["projects"] == rows["members"]
    finally:
        written.set()
        writer.join()
    restore_backup(target, tmp_path / "backup")
    assert len(rows_of(target)["members"]) == rows["members"]


def backup_of(engine: Engine, file: Path) -> Path:
    with make_sessions(engine).begin() as session:
        session.add(User(name="Ünal"))
    write_backup(engine, file)
    return file


def test_a_backup_overwrites_nothing(engine: Engine, tmp_path: Path) -> None:
    file = tmp_path / "backup"
    file.write_text("mine")
    with pytest.raises(BackupError, match="exists; a backup overwrites nothing"):
        write_backup(engine, file)
    assert [path.read_text() for path in tmp_path.iterdir()] == ["mine"]
    with pytest.raises(BackupError, match=r"cannot write .*: No such file or directory"):
        write_backup(engine, tmp_path / "nowhere" / "backup")


def test_only_an_empty_database_is_filled(engine: Engine, target: Engine, tmp_path: Path) -> None:
    file = backup_of(engine, tmp_path / "backup")
    with pytest.raises(BackupError, match="not empty: users has rows"):
        restore_backup(engine, file)
    with target.begin() as connection:
        connection.execute(text("CREATE TABLE theirs (id int)"))
    with pytest.raises(BackupError, match="it has a table theirs"):
        restore_backup(target, file)
    assert inspect(target).get_table_names() == ["theirs"]


@pytest.mark.parametrize("everywhere", [False, long(True)])
def test_half_a_restore_leaves_nothing(
    engine: Engine, target: Engine, tmp_path: Path, everywhere: bool
) -> None:
    """Whatever is wrong with the file, and wherever; in the short run with its rows or manifest."""
    content = backup_of(engine, tmp_path / "backup").read_bytes()
    with ZipFile(tmp_path / "backup") as archive:
        *tables, manifest = archive.infolist()
    users = next(table for table in tables if table.filename == "tables/users")
    last = max(tables, key=lambda table: table.header_offset)
    flipped = {
        "a table's rows": middle(content, users),
        "the last table's rows": middle(content, last),
        "the manifest": middle(content, manifest),
        "a table's name before its rows": users.header_offset + HEADER_BYTES,
        "a table's name in the list": content.rindex(users.filename.encode()),
    }
    # A whole byte: one bit may be that of a distance within a run of zeros, and then the rows are
    # what they were.
    broken = {
        name: content[:position] + bytes([content[position] ^ 0xFF]) + content[position + 1 :]
        for name, position in flipped.items()
    }
    file = tmp_path / "damaged"
    spoilt = [content[: len(content) // 2], *broken.values(), b"", b"no zip at all"]
    for other in spoilt if everywhere else spoilt[2:4]:
        file.write_bytes(other)
        with pytest.raises(BackupError):
            restore_backup(target, file)
        assert inspect(target).get_table_names() == []
    with ZipFile(tmp_path / "backup") as source, ZipFile(file, "w") as cut:
        for name in source.namelist():
            rows = source.read(name)
            cut.writestr(name, rows[:-9] if name == "tables/users" else rows)
    with pytest.raises(BackupError, match=r"the backup's table users is damaged: [^\n]+$"):
        restore_backup(target, file)
    for old, new, says in (
        (
            b'"name": "users"',
            b'"name": "people"',
            "tables are not those of its schema; the file is",
        ),
        (b'"rows": 1,', b'"rows": 2,', "table users is damaged: it is not what was written"),
    ):
        with pytest.raises(BackupError, match=says):
            restore_backup(target, changed(tmp_path / "backup", old, new))
    assert inspect(target).get_table_names() == []
    with pytest.raises(BackupError, match=r"cannot read .*: No such file or directory"):
        restore_backup(target, tmp_path / "absent")


HEADER_BYTES = 30  # of a member of a zip; its name and more fields follow


def middle(content: bytes, member: ZipInfo) -> int:
    """Where the middle of a member's compressed bytes is in the file."""
    lengths = content[member.header_offset + HEADER_BYTES - 4 : member.header_offset + HEADER_BYTES]
    before = (
        HEADER_BYTES + int.from_bytes(lengths[:2], "little") + int.from_bytes(lengths[2:], "little")
    )
    return member.header_offset + before + member.compress_size // 2


@pytest.mark.parametrize("damage", ["a table's rows", long("the manifest"), long("the end")])
def test_a_backup_that_cannot_be_read_back_is_none(
    engine: Engine, database: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, damage: str
) -> None:
    """A disk that keeps something else than it was given."""
    content = backup_of(engine, tmp_path / "sound").read_bytes()
    with ZipFile(tmp_path / "sound") as archive:
        *tables, manifest = archive.infolist()
    place = {
        "a table's rows": middle(content, tables[-1]),
        "the manifest": middle(content, manifest),
    }.get(damage)
    file, flush = tmp_path / "backup", os.fsync

    def rot(descriptor: int) -> None:
        flush(descriptor)
        with file.with_name("backup.part").open("r+b") as disk:
            if place is None:
                disk.truncate(len(content) // 2)
            else:
                disk.seek(place)
                byte = disk.read(1)[0]
                disk.seek(place)
                disk.write(bytes([byte ^ 1]))

    monkeypatch.setattr(os, "fsync", rot)
    message = modalbase_here("backup", file, code=1, MODALBASE_DATABASE_URL=database).stderr
    assert message.startswith(
        "modalbase: the backup was written and cannot be read back; is the disk sound?"
    ), message
    assert len(message.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["sound"]


def test_rows_are_counted_when_a_backup_is_read_back(engine: Engine, tmp_path: Path) -> None:
    file = backup_of(engine, tmp_path / "backup")
    for old, new, says in (
        (b'"rows": 1,', b'"rows": 2,', "its table users is not what was written"),
        (b'"name": "users"', b'"name": "people"', "its manifest is not what was written"),
    ):
        other = changed(file, old, new)
        with ZipFile(other if "rows" in str(old) else file) as archive:
            expected = read_manifest(file, archive)
        with pytest.raises(BackupError, match=says):
            read_back(other, expected)


def test_a_backup_of_an_unknown_schema_is_refused(
    engine: Engine, target: Engine, tmp_path: Path
) -> None:
    with engine.begin() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '9999_future'"))
    with pytest.raises(Exception, match="newer modalbase"):
        write_backup(engine, tmp_path / "backup")
    with engine.begin() as connection:
        connection.execute(text(f"UPDATE alembic_version SET version_num = '{head_revision()}'"))
    file = backup_of(engine, tmp_path / "backup")
    unknown = {
        "a newer modalbase made; install that version": (head_revision().encode(), b"9999_future"),
        f"0031_search, .* commit {LAST_WITH_OLDER}": (head_revision().encode(), b"0031_search"),
        "is a backup of format 2; install a newer modalbase": (b'"format": 1', b'"format": 2'),
    }
    for says, change in unknown.items():
        with pytest.raises(BackupError, match=says):
            restore_backup(target, changed(file, *change))


def changed(file: Path, old: bytes, new: bytes) -> Path:
    """The backup with other words in its manifest."""
    other = file.with_name("changed")
    with ZipFile(file) as source, ZipFile(other, "w") as target:
        for name in source.namelist():
            content = source.read(name)
            target.writestr(name, content.replace(old, new) if name == MANIFEST else content)
    return other


def test_damage_of_the_database_is_named_and_carried(
    engine: Engine, target: Engine, tmp_path: Path
) -> None:
    with engine.begin() as connection:  # every table has a row
        assert fill(connection).keys() == Base.metadata.tables.keys()
    repair_digests(engine)
    with engine.begin() as connection:
        frf = connection.scalar(text("UPDATE frfs SET data = '\\x01' RETURNING id"))
        original = connection.scalar(
            text("UPDATE original_chunks SET data = '\\x02' RETURNING encode(sha256, 'hex')")
        )
    damage = [f"frfs {frf}: data", f"originals {original}: data"]
    assert find_damage_of(engine) == damage
    assert write_backup(engine, tmp_path / "backup").damaged == damage
    hidden = changed(tmp_path / "backup", damage[0].encode(), b"nothing that is there")
    with pytest.raises(BackupError, match=f"1 of the restored data are damaged, first {damage[0]}"):
        restore_backup(target, hidden)
    restore_backup(target, tmp_path / "backup")  # the rest is worth having
    assert find_damage_of(target) == damage


def test_every_column_of_bytes_is_checked() -> None:
    columns = {
        (table.name, column.name)
        for table in Base.metadata.tables.values()
        for column in table.columns
        if isinstance(column.type, LargeBinary) and "sha256" not in column.name
    }
    checked = {(table, data) for table, _, data, _ in CHECKED}
    elsewhere = {("original_chunks", "data")}  # checked as whole files
    without_digest = {("frfs", "axis"), ("job_checkpoints", "data")}
    assert columns >= checked | elsewhere
    assert {
        name for name in columns - checked - elsewhere - without_digest if has_digest(*name)
    } == set()


def has_digest(table: str, column: str) -> bool:
    return {f"{column}_sha256", "sha256"} & set(Base.metadata.tables[table].columns.keys()) != set()


def test_jobs_that_waited_or_ran_wait_again(engine: Engine, target: Engine, tmp_path: Path) -> None:
    """Also in a schema without rows, as `modalbase db upgrade`, which a deployment runs first,
    leaves it.
    """
    upgrade(target)
    with make_sessions(engine).begin() as session:
        project = Project(name="x")
        session.add(project)
        session.flush()
        for state in ("queued", "running", "succeeded"):
            job = {
                "kind": "import",
                "project_id": project.id,
                "queue": "jobs",
                "state": state,
                "worker": "gone",
            }
            session.execute(insert(Job).values(**job))
    write_backup(engine, tmp_path / "backup")
    restore_backup(target, tmp_path / "backup")
    with target.connect() as connection:
        jobs = connection.execute(text("SELECT state, worker FROM jobs ORDER BY id")).all()
        assert [tuple(job) for job in jobs] == [
            ("queued", None),
            ("queued", None),
            ("succeeded", "gone"),
        ]
        queued = connection.scalars(
            text("SELECT args->>'job_id' FROM procrastinate_jobs WHERE status = 'todo'")
        ).all()
        waiting = connection.scalars(text("SELECT id::text FROM jobs WHERE state = 'queued'")).all()
        assert sorted(queued) == sorted(waiting)
