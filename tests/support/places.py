"""Where the project lies, its code, and the data beside it that other people measured or
computed.
"""

import ast
import os
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SHARED = ROOT.parent / "shared"


@cache
def parsed(folder: str) -> dict[Path, ast.Module]:
    """The modules of a folder of the project, each parsed once for all tests."""
    return {path: ast.parse(path.read_text()) for path in sorted((ROOT / folder).rglob("*.py"))}


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
