"""The wheel and the source archive of this tree, and the wheel unpacked in front of everything."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.support.places import ROOT

BUILD = "import setuptools.build_meta as build; build.build_wheel(%r); build.build_sdist(%r)"  # it rewrites sys.argv


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The wheel and the source archive of this tree."""
    copy, out = tmp_path_factory.mktemp("tree") / "modalbase", tmp_path_factory.mktemp("dist")
    for name in ("fecore", "migrations", "modalbase", "service"):
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, copy / name)
    subprocess.run([sys.executable, "-c", BUILD % (str(out), str(out))], cwd=copy, check=True, capture_output=True)
    (wheel,), (archive,) = out.glob("*.whl"), out.glob("*.tar.gz")
    return wheel, archive


@pytest.fixture(scope="session")
def unpacked(built: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for PYTHONPATH: with it no file of this tree is imported."""
    place = tmp_path_factory.mktemp("site")
    with zipfile.ZipFile(built[0]) as wheel:
        wheel.extractall(place)
    return place
