"""The main job in the system's Chromium: a key, a file, an update, its result, the report; by mouse
and by keyboard, on a desk and on a phone. A light desk and a dark phone together show every width
and every theme once.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import parse_qs, urlsplit

import httpx
import numpy as np
import pytest

from service.app.supervisor import LocalService
from tests.support.browser import (
    Watched,
    answered,
    drawn,
    held,
    hindrances,
    signed_in,
    watched_page,
)
from tests.support.lengths import long
from tests.support.places import shared_file
from tests.support.rest import client_at, ok, posted
from tests.support.waiting import until

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

MOST_CLICKS, MOST_FIELDS, MOST_FIELDS_OF_KNOWN = 5, 11, 6
STRIP = {
    "density_kg_m3": 2012,
    "geometry/length_m": 500,
    "geometry/width_m": 40,
    "geometry/thickness_m": 10.12,
    "material/Ex_Pa": 33.05,
    "material/Ey_Pa": 31.8,
    "material/Gxy_Pa": 5.73,
    "material/Gxz_Pa": 4.5,
    "material/Gyz_Pa": 4.5,
    "material/nu_xy": 0.15,
}
"""What no file says of a strip, in the units of the form."""

PANES = ("shapes", "frfs", "parameters", "modes", "verdict")
TABS = ("correlation", "damping", "budget", "convergence", "recipe", "report")


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
    seen.drop(file)
    assert page.url.endswith("/ui/new")
    assert page.input_value("[name='structure/name']") == "PAPER"  # as the file calls it
    assert not page.locator("[name=points]").is_visible()  # the file has them
    seen.fill("structure/", STRIP)
    seen.fill("campaign/", {"boundary": "cantilever"})
    seen.click("button:text-is('Import 1 file')")
    page.wait_for_url("**/ui/update-jobs/*")
    page.wait_for_selector("#verdict")
    return page.url


def look_at_every_part(seen: Watched, tabs: tuple[str, ...] = TABS) -> None:
    """Panes of a result fill a desk's window, or a phone's one by one; each figure is drawn as its
    tab is opened.
    """
    page = seen.page
    on_a_phone = page.locator(".phone button").first.is_visible()
    for number, pane in enumerate(PANES):
        if on_a_phone:
            page.locator(".phone button").nth(number).click()
        page.locator(f"#{pane}").wait_for()
        assert overflow(seen) == 0, pane
    height = "document.documentElement.scrollHeight - innerHeight"
    assert page.evaluate(height) == 0
    for tab in tabs:
        page.click(f".tabs [href='#{tab}']")
        page.locator(f"#{tab} h2").wait_for()
        figures = page.locator("figure[data-figure]:visible")
        for i in range(figures.count()):
            figure = figures.nth(i)
            figure.scroll_into_view_if_needed()
            figure.locator(".main-svg").first.wait_for()
            silent = "one => one.data.filter(t => !t.hovertemplate && t.hoverinfo !== 'skip')"
            assert figure.locator(".draw").evaluate(silent) == []
        assert overflow(seen) == 0
        assert spilled(seen) == []
    page.click(".tabs [href='#overview']")
    if on_a_phone:
        page.click(".phone button:text('Curves')")
    drawn(page, "[data-frf-viewer]")


def overflow(seen: Watched) -> int:
    """By how many pixels a page is wider than its window."""
    return seen.page.evaluate(
        "document.documentElement.scrollWidth - document.documentElement.clientWidth"
    )


def spilled(seen: Watched) -> list[str]:
    """Figures that reach over the border of their frame."""
    over: list[str] = seen.page.eval_on_selector_all(
        ".main-svg",
        """pictures => pictures.filter(picture => {
            const inner = picture.getBoundingClientRect(), frame = picture.closest(".plot").getBoundingClientRect();
            return inner.right > frame.right || inner.bottom > frame.bottom;
        }).map(picture => picture.closest("section").innerText.split("\\n")[0])""",
    )
    return over


@pytest.mark.parametrize("every_page", [False, long(True)])
def test_the_main_job_takes_few_clicks_and_asks_nobody_else(
    running: Browser, service: LocalService, measured: Path, every_page: bool
) -> None:
    """What a newcomer sees first: on a desk, and the result on a dark phone; with the structure in
    space, what one does there and every page in the long run.
    """
    key = service.new_key("browser")
    with watched_page(running, service.url, webgl=every_page) as seen:
        page = seen.page
        result = urlsplit(main_job(seen, key, measured)).path
        look_at_every_part(seen, TABS if every_page else ("damping", "report"))
        a_result_opens_with_what_was_found(page)
        job = result.rpartition("/")[2]
        assert seen.print().endswith(f"/update-jobs/{job}/report?format=pdf")
        assert seen.clicks <= MOST_CLICKS
        assert seen.fields <= MOST_FIELDS
        page.locator("tr[data-zoom] a").nth(1).click()
        until(lambda: highest_line(page) < 400, "the FRF zoomed to the mode")
        if every_page:
            a_mode_zooms_and_a_cell_opens_its_shapes(page)
        assert hindrances(page) == []
        cookies = page.context.cookies()
        links = page.locator(".crumbs a").evaluate_all("links => links.map(link => link.pathname)")
        assert [(c["httpOnly"], c["sameSite"]) for c in cookies] == [(True, "Strict")]
        structure, campaign = (link.rsplit("/", 1)[1] for link in links[-2:])
        with client_at(service.url, key) as api:
            others = more_pages(api, structure) if every_page else []
        if every_page:
            a_file_is_dropped(seen, f"/ui/campaigns/{campaign}")
            a_second_specimen_takes_its_material(seen, measured)
    by_themselves = [
        "/ui/",
        "/ui/update-jobs",
        "/ui/keys",
        "/ui/monitors",
        "/ui/trash",
        "/ui/search?noun=results",
    ]
    around = [*links, f"{links[-1]}/update", f"/ui/compare?job={job}", *others]
    further = ["/ui/new", *by_themselves, *around] if every_page else []
    with watched_page(running, service.url, width=390, height=844, dark=True) as seen:
        signed_in(seen, key, result)
        if every_page:
            look_at_every_part(seen)
            assert hindrances(seen.page) == []
        assert overflow(seen) == 0
        for path in further:
            seen.visit(path)
            assert hindrances(seen.page) == [], path
            assert overflow(seen) == 0, path
            assert spilled(seen) == [], path


def a_result_opens_with_what_was_found(page: Page) -> None:
    """Each parameter has a bar of its interval; at most three findings say what to do and lead
    there; the rest is folded.
    """
    rows = page.locator("#parameters tbody tr")
    assert rows.locator("svg.span .posterior").count() == rows.count() > 0
    steps = page.locator("#steps .step")
    assert steps.count() <= 3
    assert steps.locator("a").count() == 2 * steps.count()  # where to do it, and the guide
    assert not page.locator("#steps details li").first.is_visible()


def a_mode_zooms_and_a_cell_opens_its_shapes(page: Page) -> None:
    """A mode is chosen by its row, a key or a cell of the MAC, and seen in space, over the curves
    and in the figure of shapes; its number zooms the FRF, also before any is read. All of it stands
    in the address, and nothing that stood there is lost.
    """
    page.wait_for_selector("[data-space-said]:has-text('Measured mode 2')")
    page.locator("tr[data-zoom]").nth(1).press("ArrowRight")
    page.wait_for_selector("[data-space-said]:has-text('Measured mode 3')")
    page.click("[data-tab=mac]")
    page.click("[data-pair='1~3']")
    page.wait_for_selector("[data-space-said]:has-text('Measured mode 1'):has-text('model mode 3')")
    until(lambda: highest_line(page) < 400, "the band that follows the mode")
    assert "space-measured=1&space-model=3" in page.evaluate("location.search")
    page.reload()
    assert page.get_attribute("[data-pair='1~3']", "aria-pressed") == "true"
    page.click(".tabs [href='#correlation']")
    shapes = "figure[data-figure$='/figures/shapes']"
    page.wait_for_selector("figure[data-figure$='/figures/mac'] .main-svg")
    page.locator(shapes).scroll_into_view_if_needed()
    page.wait_for_selector(f"{shapes} :text('updated model, mode 3')")
    assert highest_line(page) < 400
    with held(page, "**/data?format=npz") as waiting:
        # as earlier versions wrote it
        page.goto(f"{page.url.split('?')[0]}?hz=160~40&space-measured=2&space-model=4&s=*")
        until(lambda: highest_line(page) == 200, "the FRF zoomed by an old address")
        page.wait_for_selector("[data-space-said]:has-text('model mode 4')")
        page.locator("tr[data-zoom] a").nth(1).click()
        until(waiting, "FRFs to be read")
    until(lambda: highest_line(page) < 400, "the FRF zoomed to the mode")
    drawn(page, "[data-frf-viewer]")
    assert "s=*" in page.evaluate("decodeURIComponent(location.search)")


def highest_line(page: Page) -> float:
    """Hz, of the band that the viewer shows by its address; infinite of the whole band."""
    zoom = parse_qs(page.evaluate("location.search.slice(1)")).get("z", ["0~inf"])[0]
    return float(zoom.split("~")[1])


def more_pages(api: httpx.Client, structure: str) -> list[str]:
    """A coupon with its curve, a monitor, a campaign with hits; the addresses of their pages."""
    batch = posted(
        api, f"structures/{structure}/coupon-batches", {"name": "0°", "constants": ["Ex"]}
    )["id"]
    coupon = {
        "specimen": "A1",
        "dimensions": {"unit": "mm", "width": [25.0], "thickness": [2.0]},
        "columns": {
            "force": {"header": "force", "unit": "N"},
            "strain": {"header": "strain", "unit": "µε"},
        },
    }
    rows = "".join(f"{strain},{1.6 * strain}\n" for strain in range(0, 12000, 100))
    files = {"file": ("a1.csv", f"strain,force\n{rows}".encode())}
    ok(
        api.post(
            f"coupon-batches/{batch}/coupons", files=files, data={"coupon": json.dumps(coupon)}
        ),
        201,
    )
    watch = {
        "name": "watch",
        "recipe": {},
        "parameters": [{"name": "Ex"}],
        "baseline": {"campaigns": 6},
    }
    monitor = posted(api, f"structures/{structure}/monitors", watch)["id"]
    hit = posted(api, f"structures/{structure}/campaigns", {"name": "hits", "boundary": "free"})[
        "id"
    ]
    time = np.arange(2048) / 2048
    force = 200 * np.exp(-(((time - 0.05) / 0.0008) ** 2))
    ringing = np.where(time > 0.05, np.exp(-8 * (time - 0.05)) * np.sin(600 * (time - 0.05)), 0.0)
    for number, share in enumerate((1.0, 0.9, 1.1), start=1):
        blocks = {
            "fs": 2048.0,
            "point": 1,
            "hit": number,
            "force": list(share * force),
            "a": list(share * 50 * ringing),
        }
        mapping = {
            "sample_rate_hz": {"variable": "fs"},
            "hit": {"variable": "hit"},
            "channels": [
                {"variable": "force", "quantity": "force", "point": {"variable": "point"}},
                {"variable": "a", "quantity": "acceleration", "point": 2},
            ],
        }
        posted(api, f"campaigns/{hit}/records", {"variables": blocks, "mapping": mapping})
    return [f"/ui/coupon-batches/{batch}", f"/ui/monitors/{monitor}", f"/ui/campaigns/{hit}"]


def a_file_is_dropped(seen: Watched, campaign: str) -> None:
    """A file that is dropped is sent, unless one cancels it; what was wrong with it is said."""
    seen.page.goto(f"{campaign}#files")
    dropped = seen.page.evaluate_handle(
        "() => { const t = new DataTransfer(); t.items.add(new File(['no sets in here'],"
        " 'dropped.uff')); return t; }"
    )
    seen.page.dispatch_event(".drop", "dragover", {"dataTransfer": dropped})
    assert "over" in (seen.page.get_attribute(".drop", "class") or "")
    with held(seen.page, "**/imports?*") as waiting:
        seen.page.dispatch_event(".drop", "drop", {"dataTransfer": dropped})
        until(waiting, "the file on its way")
        seen.page.click("p:has-text('Sending dropped.uff') button:text('Cancel')")
        seen.page.wait_for_selector(".faults:text('dropped.uff was not sent.')")
        waiting().clear()
    seen.page.dispatch_event(".drop", "drop", {"dataTransfer": dropped})
    seen.page.wait_for_selector("#uploaded .state.failed")
    assert "dropped.uff" in seen.page.inner_text("#uploaded")


def a_second_specimen_takes_its_material(seen: Watched, file: Path) -> None:
    """A material that another structure has is chosen; sizes and boundary are asked for alone."""
    seen.page.goto("/ui/")
    seen.drop(file)
    seen.fields = 1
    seen.page.select_option("[data-material]", index=1)
    seen.page.locator("button:text-is('Import 1 file: 4 missing')").wait_for()
    seen.fill("structure/geometry/", {"length_m": 400, "width_m": 40, "thickness_m": 8})
    seen.fill("campaign/", {"boundary": "free"})
    seen.page.locator("button:text-is('Import 1 file')").wait_for()
    assert seen.fields <= MOST_FIELDS_OF_KNOWN


@pytest.mark.parametrize("keys", [False, long(True)])
def test_who_has_no_mouse_gets_everywhere(
    running: Browser, service: LocalService, keys: bool
) -> None:
    """Mistakes are said where they were made; the order of the tab key is that of the page; dialogs
    ask before they act.
    """
    with watched_page(running, service.url) as seen:
        page = seen.page
        page.goto("/sign-in")
        page.fill("#key", "mb_0123_wrong")
        page.press("#key", "Enter")
        page.wait_for_selector(".faults:not(:empty)")
        assert "not valid" in page.inner_text(".faults")
        assert page.context.cookies() == []
        seen.complaints.clear()  # the console names the 401
        page.goto("/ui/new")
        page.fill("#key", service.new_key("keyboard"))
        page.press("#key", "Enter")
        page.wait_for_url("**/ui/new")
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.className") == "skip"
        assert page.evaluate("document.activeElement.getBoundingClientRect().left") >= 0
        order = []
        for _ in range(6):
            page.keyboard.press("Tab")
            order.append(page.evaluate("document.activeElement.innerText"))
            assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") == "solid"
        assert order == page.locator(".top a").all_inner_texts()[:6]
        page.focus(".skip")
        page.keyboard.press("Enter")
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.closest('main') !== null")
        seen.fill("structure/", {"name": "strip", **STRIP, "geometry/thickness_m": 900})
        seen.fill("campaign/", {"name": "first", "boundary": "cantilever"})
        page.focus("button:text('Store the test')")
        page.keyboard.press("Enter")
        page.wait_for_selector("[name='structure/geometry/thickness_m'][aria-invalid=true]")
        assert "thickness of 0.9 m is not below the length" in page.inner_text(".faults")
        assert page.evaluate("document.activeElement.name") == "structure/geometry/thickness_m"
        page.fill("[name='structure/geometry/thickness_m']", "400")
        page.click("button:text('Store the test')")
        doubts = answered(page, yes=False)
        page.wait_for_selector(".faults:has-text('usual is')")
        assert (
            "is 0.4 m (400 mm), usual is 5e-5 m (0.05 mm) to 0.3 m (300 mm); did you mean 0.0004 m"
            in doubts
        )
        page.click("button:text('Store the test')")
        with page.expect_navigation():
            answered(page, yes=True)
        assert "/ui/campaigns/" in page.url
        seen.complaints.clear()  # the console names each 422
        if not keys:
            return
        page.goto("/ui/keys")
        page.fill("[name=name]", "spare")
        page.press("[name=name]", "Enter")
        page.wait_for_selector("output.key:not(:empty)")
        page.reload()
        revoke = page.locator("[aria-label='Revoke spare']")
        revoke.press("Enter")
        assert "opens nothing" in answered(page, yes=False)
        assert revoke.count() == 1
        revoke.press("Enter")
        with page.expect_navigation():
            answered(page, yes=True)
        assert revoke.count() == 0


@pytest.mark.parametrize("whole", [False, long(True)])
def test_a_search_is_typed_with_suggestions_and_kept(
    running: Browser, service: LocalService, whole: bool
) -> None:
    """By keyboard from a few letters to a row; a facet narrows it down, a name keeps it, the
    address says all of it.
    """
    key = service.new_key("finder")
    with client_at(service.url, key) as api:
        project = posted(api, "projects", {"name": "footbridges"})["id"]
        structure = posted(api, f"projects/{project}/structures", {"name": "north's bridge"})["id"]
        for name, boundary, temperature in (
            ("warm", "free", 28.5),
            ("hot", "cantilever", 31),
            ("cold", "free", -3),
        ):
            body = {
                "name": name,
                "boundary": boundary,
                "temperature_c": temperature,
                "tags": [f"{name} day"],
            }
            body["performed_at"] = f"2026-03-{abs(int(temperature)):02d}T12:00:00Z"
            campaign = posted(api, f"structures/{structure}/campaigns", body)["id"]
            modes = {"name": "typed", "modes": [{"frequency_hz": 5 - 0.01 * temperature}]}
            posted(api, f"campaigns/{campaign}/mode-sets", modes)
    with watched_page(running, service.url) as seen:
        page = signed_in(seen, key, "/ui/search")
        box = page.locator("[data-suggest]")
        box.press_sequentially("temp")
        page.wait_for_selector("#suggestions li:has-text('air temperature')")
        box.press("ArrowDown")
        box.press("Tab")
        page.wait_for_selector("#suggestions li:text('BETWEEN')")
        box.press_sequentially("> 25")
        box.press("Enter")
        page.wait_for_selector("h2:text('2 campaigns')")
        page.click("aside a:text('cantilever')")
        page.wait_for_selector("h2:text('1 campaigns')")
        assert (
            page.input_value("[data-suggest]") == "temperature_c > 25 AND boundary = 'cantilever'"
        )
        assert page.inner_text("tbody tr").split("\t")[:2] == ["hot", "north's bridge"]
        page.click("summary:text('Save this search')")
        page.fill("[name=name]", "clamped and warm")
        page.press("[name=name]", "Enter")
        page.wait_for_selector(".kept")
        if not whole:
            return
        page.goto("/ui/search")
        box.press_sequentially("tag = '")
        page.wait_for_selector("#suggestions li:has-text('cold day')")
        box.press("Escape")
        page.click("summary:text('Columns')")
        page.check("[name=fields][value='structure.name']")
        page.check("[name=fields][value='tag']")
        box.fill("structure.name = 'north''s bridge'")
        box.press("Enter")
        page.wait_for_selector("h2:text('3 campaigns')")
        assert page.locator("thead th").all_inner_texts() == ["tag", "structure name"]
        with page.expect_download() as file:
            page.click(".files a:text('CSV')")
        assert file.value.path().read_text().splitlines()[1:2] == ["warm day,north's bridge"]
        page.click(".kept a:text('clamped and warm')")
        page.wait_for_selector("h2:text('1 campaigns')")
        page.click("[aria-label='Forget clamped and warm']")
        answered(page, yes=True)
        page.wait_for_selector("#saved", state="detached")
        page.goto("/ui/search?noun=modes&for=frequency_hz > 4")
        page.click("button:text('Draw')")
        figure = "[data-figure^='search/modes/trend/figure']"
        drawn(page, figure)
        assert page.locator(f"{figure}.quiet").count() == 0
        assert "north's bridge\tmode 1\t3" in page.inner_text(
            "[aria-label='Change over time'] tbody"
        )
        assert hindrances(page) == []
