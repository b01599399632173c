"""What the tests of pages share."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from service.app.supervisor import LocalService
from tests.support.browser import Watched, browser, signed_in, watched_page

if TYPE_CHECKING:
    import httpx
    from playwright.sync_api import Browser

MODULES = ("signal", "service", "numpy", "json", "fecore", "modalbase", "migrations")


@pytest.fixture
def laboratory(tmp_path: Path) -> Iterator[Path]:
    """A folder with files that have the names of modules, none of which may be imported."""
    folder, poisoned = tmp_path / "laboratory", tmp_path / "poisoned"
    folder.mkdir()
    own = f"open({str(poisoned)!r}, 'a').write(__name__)\n"
    for name in MODULES:
        (folder / f"{name}.py").write_text(f'{own}raise ImportError("this is our own file")\n')
    yield folder
    assert not poisoned.exists()


@pytest.fixture(scope="session")
def running() -> Iterator[Browser]:
    """The browser of all tests."""
    with browser() as found:
        yield found


@pytest.fixture
def seen(running: Browser, service: LocalService, api: httpx.Client) -> Iterator[Watched]:
    """A page on the desk of the user of `api`, without WebGL, which `test_space` is about."""
    with watched_page(running, service.url, webgl=False) as page:
        signed_in(page, api.headers["authorization"].split()[1])
        yield page
