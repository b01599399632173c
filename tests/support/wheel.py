"""The wheel and the source archive of this tree, and the wheel unpacked in front of everything."""

import os
import shutil
import subprocess
import sys
import zipfile
from importlib.util import cache_from_source
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
    """A folder for PYTHONPATH: with it no file of this tree is imported. What was compiled here
    serves there, where the files are the same: each process would compile for ten seconds.
    """
    place, made = wheelhouse / "site", wheelhouse / "extracted"
    with InterProcessLock(wheelhouse / "lock"):
        if not place.is_dir():
            with zipfile.ZipFile(built[0]) as wheel:
                wheel.extractall(made)
            for file in made.rglob("*.py"):
                ours = ROOT / file.relative_to(made)
                if ours.is_file() and ours.read_bytes() == file.read_bytes():
                    shutil.copystat(ours, file)
                    compiled = Path(cache_from_source(str(ours)))
                    if compiled.is_file():
                        (file.parent / "__pycache__").mkdir(exist_ok=True)
                        shutil.copy(compiled, file.parent / "__pycache__")
            made.rename(place)
    return place
