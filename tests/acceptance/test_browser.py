"""The main job in the system's Chromium: a key, a file, an update, its result; by mouse, on a desk and on a phone."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from service.supervisor import LocalService
from tests.support.browser import Watched, browser, chromium, drawn, hindrances, watched_page
from tests.support.places import shared_file

MOST_CLICKS = 8
PARTS = (
    "verdict",
    "parameters",
    "modes",
    "correlation",
    "frfs",
    "damping",
    "budget",
    "convergence",
    "recipe",
    "report",
)
LOOKS = [(1440, 900, False), (1440, 900, True), (390, 844, False), (390, 844, True)]


@pytest.fixture(scope="module")
def running() -> Iterator[Browser]:
    chromium()
    with browser() as found:
        yield found


@pytest.fixture(scope="module")
def measured() -> Path:
    return shared_file("BLIND_OPEN", "blind-open", "paper-like.uff")


def main_job(seen: Watched, key: str, file: Path) -> str:
    """From a key to a result, in the words that a person reads; the address of the result."""
    page = seen.page
    page.goto("/")
    page.fill("#key", key)
    seen.click("button:text('Sign in')")
    page.wait_for_url("**/ui/")
    seen.click("a:text('New test')")
    with page.expect_file_chooser() as chooser:
        seen.click("#file")
    chooser.value.set_files(file)
    seen.click("button:text('Store the test')")
    page.wait_for_url("**/ui/campaigns/*")
    drawn(page, "[data-frf-viewer]")  # the page is loaded anew when the file is read
    seen.click("a.button:text('New update') >> nth=0")
    seen.click("button:text('Start the update') >> nth=0")
    page.wait_for_url("**/ui/update-jobs/*")
    page.wait_for_selector("#verdict")
    return page.url


def look_at_every_part(seen: Watched) -> None:
    """Every part of a result is on its page; each figure is drawn as it comes into sight."""
    page = seen.page
    for part in PARTS:
        page.locator(f"#{part}").scroll_into_view_if_needed()
        assert page.locator(f"#{part} h2").is_visible()
    figures = page.locator("figure[data-figure]")
    for i in range(figures.count()):
        figure = figures.nth(i)
        figure.scroll_into_view_if_needed()
        figure.locator(".main-svg").first.wait_for()
    assert overflow(seen) == 0


def overflow(seen: Watched) -> int:
    """By how many pixels a page is wider than its window."""
    wide: int = seen.page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
    return wide


def test_the_main_job_takes_few_clicks_and_asks_nobody_else(
    running: Browser, service: LocalService, measured: Path
) -> None:
    key = service.new_key("browser")
    with watched_page(running, service.url) as seen:
        result = main_job(seen, key, measured)
        look_at_every_part(seen)
        assert seen.page.locator("[data-report]").first.is_visible()
        seen.clicks += 1  # the report, whose address the link has
        assert seen.clicks <= MOST_CLICKS
        assert seen.complaints == []
        assert seen.strangers == []
        cookies = seen.page.context.cookies()
        links = seen.page.locator(".crumbs a").evaluate_all("links => links.map(link => link.pathname.slice(1))")
        around = [*links, f"{links[-1]}/update"]
    assert [(c["httpOnly"], c["sameSite"]) for c in cookies] == [(True, "Strict")]
    for width, height, dark in LOOKS:
        with watched_page(running, service.url, width=width, height=height, dark=dark) as seen:
            seen.page.goto(result)
            seen.page.fill("#key", key)
            seen.page.press("#key", "Enter")
            seen.page.wait_for_url(result)
            look_at_every_part(seen)
            assert hindrances(seen.page) == [], (width, dark)
            for path in ("ui/", "ui/new", "ui/update-jobs", "ui/keys", "ui/monitors", *around):
                seen.page.goto(f"/{path}")
                seen.page.wait_for_load_state("networkidle")
                assert hindrances(seen.page) == [], (path, width, dark)
                assert overflow(seen) == 0, (path, width)
            assert (seen.complaints, seen.strangers) == ([], []), (width, dark)


def test_a_mistake_is_shown_where_it_was_made(running: Browser, service: LocalService) -> None:
    with watched_page(running, service.url) as seen:
        page = seen.page
        page.goto("/ui/new")
        page.fill("#key", service.new_key("mistaken"))
        page.press("#key", "Enter")
        page.wait_for_url("**/ui/new")
        page.fill("[name='structure/geometry/thickness_m']", "900")
        page.click("button:text('Store the test')")
        page.wait_for_selector("[name='structure/geometry/thickness_m'][aria-invalid=true]")
        assert "thickness of 0.9 m is not below the length" in page.inner_text(".faults")
        assert page.evaluate("document.activeElement.name") == "structure/geometry/thickness_m"


def test_a_wrong_key_opens_nothing(running: Browser, service: LocalService) -> None:
    with watched_page(running, service.url) as seen:
        seen.page.goto("/sign-in")
        seen.page.fill("#key", "mb_0123_wrong")
        seen.page.press("#key", "Enter")
        seen.page.wait_for_selector(".faults:not(:empty)")
        assert "not valid" in seen.page.inner_text(".faults")
        assert seen.page.context.cookies() == []
