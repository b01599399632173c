"""The wheel and the source archive: what is in them, and that the wheel alone runs the demonstration."""

import json
import os
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from tests.support.command import environment, modalbase
from tests.support.waiting import until

POISON = """import os
open(os.environ["POISONED"], "a").write(__name__ + "\\n")
raise ImportError("this is a laboratory's own file")
"""
LIGHT = {"httpx", "numpy", "platformdirs", "pyuff", "rich", "typer"}


def test_the_wheel_has_four_packages_and_nothing_else(built: tuple[Path, Path]) -> None:
    with zipfile.ZipFile(built[0]) as wheel:
        names = wheel.namelist()
        metadata = wheel.read(next(name for name in names if name.endswith("METADATA"))).decode()
    tops = {name.split("/")[0] for name in names if not name.split("/")[0].endswith(".dist-info")}
    assert tops == {"fecore", "migrations", "modalbase", "service"}
    assert {"modalbase/client/routes.json", "service/app/demo/paper_beam.uff"} <= set(names)
    assert {"service/show/guide/pages/index.md", "service/show/guide/pages/decisions/queue.md"} <= set(names)
    assert any(name.endswith("licenses/LICENSE") for name in names)
    required = [
        line.split(":")[1] for line in metadata.splitlines() if line.startswith("Requires-Dist") and "extra" not in line
    ]
    assert {line.split(">")[0].split("=")[0].split("<")[0].strip() for line in required} == LIGHT


def test_the_source_archive_builds_the_same_packages(built: tuple[Path, Path]) -> None:
    with tarfile.open(built[1]) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {
        "pyproject.toml",
        "README.md",
        "LICENSE",
        "modalbase/__init__.py",
        "service/app/demo/paper_beam.uff",
    } <= names


def test_the_wheel_alone_runs_in_a_laboratorys_own_folder_and_leaves_nothing_running(
    unpacked: Path, tmp_path: Path
) -> None:
    """The folder's `signal.py` is no reason to stop, its `service.py` nothing to run, in no process."""
    mark = f"demo-test-{os.getpid()}"
    folder, poisoned = tmp_path / "laboratory", tmp_path / "poisoned"
    folder.mkdir()
    for name in ("signal", "service", "numpy", "json", "fecore", "modalbase", "multiprocessing", "migrations"):
        (folder / f"{name}.py").write_text(POISON)
    around = {"PYTHONPATH": str(unpacked), "HOME": str(tmp_path)}
    names = ("modalbase", "fecore", "service", "migrations")
    code = f"import {', '.join(names)}; print(*(p.__file__ for p in ({', '.join(names)})))"
    found = subprocess.check_output(
        [sys.executable, "-P", "-c", code], cwd=folder, env=environment(**around), text=True
    )
    assert all(Path(file).is_relative_to(unpacked) for file in found.split())
    ended = modalbase("demo", "--json", cwd=folder, MODALBASE_TEST_MARK=mark, POISONED=str(poisoned), **around)
    assert ended.returncode == 0, ended.stderr
    assert not poisoned.exists()
    result = json.loads(ended.stdout)  # the document and nothing else
    rows = {row["name"]: row for row in result["parameters"]}
    assert rows["Ex"]["estimate"] == pytest.approx(31.66e9, rel=0.005)  # the paper's; docs/results.md
    assert rows["Gxy"]["estimate"] == pytest.approx(6.30e9, rel=0.02)
    assert not rows["Ey"]["identifiable"]
    assert any("rayleigh" in warning for warning in result["warnings"])
    assert "The demonstration takes a cantilever" in ended.stderr
    assert "updated parameters" in ended.stderr
    assert "the paper's own measured damping, not its print" in " ".join(ended.stderr.split())
    assert "next: modalbase up" in ended.stderr
    until(lambda: not _processes_with(mark), "the end of all that it started", lambda: _processes_with(mark))


def _processes_with(mark: str) -> list[str]:
    """Processes whose environment carries the mark: whatever the demonstration started and did not end."""
    left = []
    for process in Path("/proc").iterdir():
        if process.name.isdigit() and int(process.name) != os.getpid():
            try:
                if mark.encode() in (process / "environ").read_bytes():
                    left.append((process / "cmdline").read_text())
            except OSError:
                continue  # it ended meanwhile, or is not ours
    return left
