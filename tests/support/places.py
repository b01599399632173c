"""Where the project lies, and the data beside it that other people measured or computed."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SHARED = ROOT.parent / "shared"


def shared_folder(variable: str, name: str) -> Path:
    """The folder that an environment variable names, or `../shared/name`; the test is skipped where
    neither is there.
    """
    folder = Path(os.environ.get(variable, SHARED / name))
    if not folder.is_dir():
        pytest.skip(f"{folder} is not there; set {variable}")
    return folder


def shared_file(variable: str, name: str, file: str) -> Path:
    """A file of such a folder; the test is skipped where it is not there."""
    path = shared_folder(variable, name) / file
    if not path.exists():
        pytest.skip(f"{path} is not there; set {variable}")
    return path
