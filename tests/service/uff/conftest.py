"""Fixtures of the UFF tests."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from uff.files import Reading, load

from service.campaigns.uff import Limits

ROOT = Path(__file__).parents[3]


@pytest.fixture
def read(tmp_path: Path) -> Callable[..., Reading]:
    """Reads bytes as a file."""

    def read_bytes(data: bytes, limits: Limits | None = None) -> Reading:
        path = tmp_path / "file.uff"
        path.write_bytes(data)
        return load(path, limits)

    return read_bytes


def _shared(variable: str, default: str) -> Path:
    folder = Path(os.environ.get(variable, ROOT / default))
    if not folder.is_dir():
        pytest.skip(f"{folder} is not there; set {variable}")
    return folder


@pytest.fixture
def corpus() -> Path:
    """Other people's UFF files."""
    return _shared("UFF_CORPUS", "../shared/uff-corpus")


@pytest.fixture
def blind() -> Path:
    """Independent FRFs of beams."""
    return _shared("BLIND_OPEN", "../shared/blind-open")
