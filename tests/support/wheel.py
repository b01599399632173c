"""The wheel and the source archive of this tree, and the wheel unpacked in front of everything."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from fasteners import InterProcessLock

from tests.support.places import ROOT

# it rewrites sys.argv
BUILD = "import setuptools.build_meta as build; build.build_wheel(%r); build.build_sdist(%r)"


@pytest.fixture(scope="session")
def wheelhouse(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of all of pytest's processes: whichever of them first wants something of it makes it
    for all.
    """
    base = tmp_path_factory.getbasetemp()
    place = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "wheel"
    place.mkdir(exist_ok=True)
    return place


@pytest.fixture(scope="session")
def built(wheelhouse: Path) -> tuple[Path, Path]:
    """The wheel and the source archive of this tree."""
    with InterProcessLock(wheelhouse / "lock"):
        if not (wheelhouse / "dist").is_dir():
            _build(wheelhouse / "modalbase", wheelhouse / "unfinished")
            (wheelhouse / "unfinished").rename(wheelhouse / "dist")
    (wheel,), (archive,) = (
        (wheelhouse / "dist").glob("*.whl"),
        (wheelhouse / "dist").glob("*.tar.gz"),
    )
    return wheel, archive


def _build(copy: Path, out: Path) -> None:
    out.mkdir()
    for name in ("fecore", "migrations", "modalbase", "service"):
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, copy / name)
    subprocess.run(
        [sys.executable, "-c", BUILD % (str(out), str(out))],
        cwd=copy,
        check=True,
        capture_output=True,
    )


@pytest.fixture(scope="session")
def unpacked(built: tuple[Path, Path], wheelhouse: Path) -> Path:
    """A folder for PYTHONPATH: with it no file of this tree is imported. What one test's processes
    compile serves the next.
    """
    place = wheelhouse / "site"
    with InterProcessLock(wheelhouse / "lock"):
        if not place.is_dir():
            with zipfile.ZipFile(built[0]) as wheel:
                wheel.extractall(wheelhouse / "extracted")
            (wheelhouse / "extracted").rename(place)
    return place
