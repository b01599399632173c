"""The wheel and the source archive: what is in them, and that the wheel alone works from an empty folder."""

from __future__ import annotations

import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

from tests.support.command import environment
from tests.support.waiting import PATIENCE

LIGHT = {"httpx", "numpy", "platformdirs", "pyuff", "rich", "typer"}


def test_the_wheel_has_four_packages_and_nothing_else(built: tuple[Path, Path]) -> None:
    with zipfile.ZipFile(built[0]) as wheel:
        names = wheel.namelist()
        metadata = wheel.read(next(name for name in names if name.endswith("METADATA"))).decode()
    tops = {name.split("/")[0] for name in names if not name.split("/")[0].endswith(".dist-info")}
    assert tops == {"fecore", "migrations", "modalbase", "service"}
    assert "service/demo/paper_beam.uff" in names
    assert {"service/guide/pages/index.md", "service/guide/pages/decisions/queue.md"} <= set(names)
    assert any(name.endswith("licenses/LICENSE") for name in names)
    required = [
        line.split(":")[1] for line in metadata.splitlines() if line.startswith("Requires-Dist") and "extra" not in line
    ]
    assert {line.split(">")[0].split("=")[0].split("<")[0].strip() for line in required} == LIGHT


def test_the_source_archive_builds_the_same_packages(built: tuple[Path, Path]) -> None:
    with tarfile.open(built[1]) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {"pyproject.toml", "README.md", "LICENSE", "modalbase/__init__.py", "service/demo/paper_beam.uff"} <= names


def test_the_wheel_alone_runs_from_an_empty_folder(unpacked: Path, tmp_path: Path) -> None:
    place, empty = unpacked, tmp_path / "empty"
    empty.mkdir()
    names = ("modalbase", "fecore", "service", "migrations")
    code = f"import {', '.join(names)}; print(*(p.__file__ for p in ({', '.join(names)})))"
    around = environment(PYTHONPATH=str(place), HOME=str(empty))
    found = subprocess.run(
        [sys.executable, "-c", code], cwd=empty, env=around, capture_output=True, text=True, check=True
    )
    assert all(Path(file).is_relative_to(place) for file in found.stdout.split())
    done = subprocess.run(
        [sys.executable, "-m", "modalbase", "demo"],
        cwd=empty,
        env=around,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "updated parameters" in done.stdout
