"""The system's Chromium, watched: what it asks for, what it complains of, and how often somebody
clicked.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import (
        Browser,
        BrowserContext,
        ConsoleMessage,
        Page,
        Request,
        Route,
        ViewportSize,
    )

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-rasterization",
    "--disable-gpu-compositing",
    "--in-process-gpu",
    "--process-per-site",
)
"""A processor plays the graphics card of what is drawn in space; to paint the pages so too would
take it ten times as long. Fewer processes take a quarter less of it.
"""

NO_WEBGL = """
    const get = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
        return kind.startsWith("webgl") ? null : get.call(this, kind, ...more);
    };
"""

PATIENCE_MS = 120_000.0
OWN_SCHEMES = ("data", "blob", "about", "chrome", "chrome-extension")
"""Of what a browser asks itself for: its viewer of PDF is an extension that it brings."""


def chromium() -> Path:
    """The system's browser; the test is skipped where there is none."""
    found = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if found is None:
        pytest.skip("no Chromium on this machine: install Debian's package `chromium`")
    return Path(found)


@contextmanager
def browser() -> Iterator[Browser]:
    """A browser without a window, which ends with the block."""
    from playwright.sync_api import sync_playwright

    program = chromium()
    with sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=program, args=list(FLAGS))
        try:
            yield running
        finally:
            running.close()


@dataclass
class Watched:
    """A page and what was seen of it.

    Attributes:
        context: Playwright's, which the pages of all tests share.
        host: where the service is; a request to any other is noted.
        size: of the window, CSS pixels.
        dark: whether the reader prefers dark pages.
        webgl: whether structures are drawn in space.
        page: Playwright's.
        complaints: errors and warnings of the console, violations of the policy, errors that nobody
            caught.
        strangers: addresses of other hosts that were asked.
        clicks: how many there were.
        fields: how many were filled in by hand.
    """

    context: BrowserContext
    host: str
    size: ViewportSize
    dark: bool
    webgl: bool
    page: Page = field(init=False)
    complaints: list[str] = field(default_factory=list)
    strangers: list[str] = field(default_factory=list)
    clicks: int = 0
    fields: int = 0

    def open(self) -> None:
        """Go to an empty page, in a tab of its own, and note what it complains of."""
        self.page = self.context.new_page()
        if not self.webgl:
            self.page.add_init_script(NO_WEBGL)
        self.page.set_viewport_size(self.size)
        self.page.emulate_media(color_scheme="dark" if self.dark else "light")
        self.page.on("console", self._heard)
        self.page.on(
            "pageerror",
            lambda error: self.complaints.append(f"uncaught: {error} ({self.page.url})"),
        )

    def goto(self, path: str) -> Page:
        """Go to a page in the tab that is open."""
        self.page.goto(path)
        return self.page

    def _heard(self, message: ConsoleMessage) -> None:
        # pixels go to the page by way of memory
        of_the_card = "GL Driver Message (OpenGL, Performance" in message.text
        if message.type in ("error", "warning") and not of_the_card:
            self.complaints.append(f"{message.type}: {message.text} ({self.page.url})")

    def click(self, selector: str) -> None:
        """Click, and count it."""
        self.clicks += 1
        self.page.click(selector)

    def print(self) -> str:
        """Click on the report; the address that is asked for, which tests of REST ask for too."""
        asked: list[str] = []

        def answer(route: Route) -> None:
            asked.append(route.request.url)
            route.fulfill(body="")

        self.context.route("**/report?*", answer)
        with self.context.expect_page() as tab:
            self.click("a.button[data-report]")
        tab.value.wait_for_load_state()
        tab.value.close()
        self.context.unroute("**/report?*", answer)
        return asked[0]

    def fill(self, prefix: str, values: dict[str, Any]) -> None:
        """Type values into fields by their names, or choose them where there is a list, and count
        them.
        """
        for name, value in values.items():
            self.fields += 1
            field = self.page.locator(f"[name='{prefix}{name}']")
            if field.evaluate("one => one.tagName") == "SELECT":
                field.select_option(str(value))
            else:
                field.fill(str(value))

    def drop(self, *files: Path) -> None:
        """Choose files in the place for them, by a click, and wait until all were looked at."""
        with self.page.expect_file_chooser() as chooser:
            self.click("#file")
        chooser.value.set_files(list(files))
        self.page.locator("[data-looked] tbody tr").nth(len(files) - 1).wait_for()

    def visit(self, path: str) -> None:
        """Look at another page, in a tab of its own, until nothing more is loaded.

        In one tab the page before would be asked for once more on the way now and then: it loads
        itself anew where it takes the end of its dark colours, which are the browser's pretence,
        for the reader's wish.
        """
        before = self.page
        self.open()
        before.close()
        self.page.goto(path, wait_until="networkidle")


@cache
def _context(running: Browser, url: str) -> BrowserContext:
    """What all pages of a service share: a script that one has loaded and compiled serves the next
    as it serves a reader's.
    """
    context = running.new_context(base_url=url, reduced_motion="reduce")
    context.set_default_timeout(PATIENCE_MS)
    context.new_page().goto("/healthz")  # the pages' process ends with the last of them
    return context


@contextmanager
def watched_page(
    running: Browser,
    url: str,
    *,
    width: int = 1440,
    height: int = 900,
    dark: bool = False,
    webgl: bool = True,
) -> Iterator[Watched]:
    """A page without cookies of others, of a reader who prefers reduced motion, with a notebook
    beside it, in which no complaint and no other host may stand at the end.

    Args:
        running: the browser.
        url: of the service.
        width, height: of the window, CSS pixels.
        dark: whether the reader prefers dark pages.
        webgl: whether structures are drawn in space, which takes a processor a third of a page; a
            still picture stands there otherwise.
    """
    context = _context(running, url)
    size: ViewportSize = {"width": width, "height": height}
    seen = Watched(context, urlsplit(url).netloc, size, dark, webgl)
    seen.open()

    def on_request(request: Request) -> None:
        asked = urlsplit(request.url)
        if asked.scheme not in OWN_SCHEMES and asked.netloc != seen.host:
            seen.strangers.append(request.url)

    context.on("request", on_request)
    try:
        yield seen
        noted = seen.complaints + seen.strangers
        assert not noted, noted
    finally:
        context.remove_listener("request", on_request)
        for page in context.pages[1:]:
            page.close()
        context.clear_cookies()
        context.clear_permissions()


def signed_in(seen: Watched, key: str, path: str = "") -> Page:
    """Begin a session, as the form of the sign-in does, and go to a page where one is named."""
    begun = seen.context.request.post("/api/v1/session", headers={"Authorization": f"Bearer {key}"})
    assert begun.status == 201
    return seen.goto(path) if path else seen.page


def answered(page: Page, yes: bool) -> str:
    """Answer the question that a page asks before it acts; its words."""
    dialog = page.locator("dialog[open]")
    asked = dialog.inner_text()
    dialog.locator("button").nth(int(yes)).click()
    return asked


@contextmanager
def held(page: Page, address: str) -> Iterator[Callable[[], list[Route]]]:
    """Hold requests for an address back, as a slow network does, and yield a function that lists
    them.
    """
    waiting: list[Route] = []

    def hold(route: Route) -> None:
        waiting.append(route)

    def asked() -> list[Route]:
        page.wait_for_timeout(0)  # Playwright hears of requests only within its own calls
        return waiting

    page.route(address, hold)
    try:
        yield asked
    finally:
        for route in waiting:
            route.continue_()
        page.unroute(address, hold)


def note_on_leaving(page: Page, what: str) -> None:
    """Keep the value that an expression has when the browser leaves the page, for
    `noted_on_leaving`.
    """
    page.evaluate(
        "addEventListener('pagehide', () => sessionStorage.setItem('noted',"
        f" JSON.stringify({what})))"
    )


def noted_on_leaving(page: Page) -> Any:
    """The value that `note_on_leaving` kept."""
    return page.evaluate("JSON.parse(sessionStorage.getItem('noted'))")


AXE = """axe.run(
    { exclude: [[".js-plotly-plot"]] },
    { resultTypes: ["violations"], preload: false },
).then((found) => found.violations.filter((rule) => /serious|critical/.test(rule.impact)))"""
"""It loads no style sheets anew, which none of its rules that are on needs."""


def hindrances(page: Page) -> list[str]:
    """What axe-core finds on a page that seriously hinders people: rule, help, first element.
    Plotly's drawings have a table or a caption beside them and are left out.
    """
    from axe_playwright_python.base import AXE_SCRIPT

    if not page.evaluate("'axe' in window"):
        page.evaluate(AXE_SCRIPT)
    grave = page.evaluate(AXE)
    return [
        f"{rule['id']}: {rule['help']}: {rule['nodes'][0]['html'][:200]} ({page.url})"
        for rule in grave
    ]


def drawn(page: Page, figure: str) -> None:
    """Wait until a figure is drawn, or says why it is not."""
    page.locator(figure).scroll_into_view_if_needed()
    page.wait_for_selector(f"{figure} .main-svg, {figure} .uplot, {figure}.quiet", state="attached")
