"""Fixtures of the UFF tests."""

from collections.abc import Callable
from pathlib import Path

import pytest

from modalbase.formats.uff import Limits
from tests.support.uff import Reading, load


@pytest.fixture
def read(tmp_path: Path) -> Callable[..., Reading]:
    """Reads bytes as a file."""

    def read_bytes(data: bytes, limits: Limits | None = None) -> Reading:
        path = tmp_path / "file.uff"
        path.write_bytes(data)
        return load(path, limits)

    return read_bytes
