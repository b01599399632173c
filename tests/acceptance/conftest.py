"""What the tests of pages share."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from service.app.supervisor import LocalService
from tests.support.browser import Watched, browser, signed_in, watched_page

if TYPE_CHECKING:
    import httpx
    from playwright.sync_api import Browser


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
