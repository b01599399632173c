"""The parts that pages are made of, each in each state, in the system's Chromium: their size, that
none covers another, their contrast; and what they do.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from urllib.parse import parse_qs

import pytest

from service.app.supervisor import LocalService
from tests.acceptance.test_browser import overflow
from tests.support.browser import Watched, answered, hindrances, signed_in, watched_page

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

CONTROLS = "a, button, input, select, textarea, summary, [role=separator]"
LEAST = 16  # pixels of a box to tick, the smallest of them; its label is clicked too
MEASURED = f"""() => [...document.querySelectorAll("main :is({CONTROLS})")]
    .filter(one => one.checkVisibility({{ visibilityProperty: true }}))
    .map(one => [one, one.getBoundingClientRect(), one.closest(".fill, .pane, section")])
    .filter(([one, box, within]) => {{
        const frame = within.getBoundingClientRect();
        return box.width && box.bottom <= frame.bottom && box.right <= frame.right;
    }})"""
SMALL = f"""() => ({MEASURED})().filter(([one, box]) => !one.matches("a, [role=separator]")
    && Math.min(box.width, box.height) < {LEAST}).map(([one]) => one.outerHTML)"""
COVERED = f"""() => {{
    const all = ({MEASURED})().filter(([one]) => !one.matches("[role=separator]"));
    return all.flatMap(([one, a], i) => all.slice(i + 1)
        .filter(([other, b]) => !one.contains(other) && !other.contains(one)
            && a.left < b.right - 1 && b.left < a.right - 1 && a.top < b.bottom - 1
            && b.top < a.bottom - 1)
        .map(([other]) => one.outerHTML + " covers " + other.outerHTML));
}}"""
BARE = """() => [...document.querySelectorAll(
    "select, progress, input:is([type=checkbox], [type=radio], [type=range], [type=search])")]
    .filter(one => getComputedStyle(one).appearance !== "none").map(one => one.outerHTML)"""


@pytest.mark.long
@pytest.mark.parametrize(("width", "dark"), [(1400, False), (390, True)])
def test_each_part_has_its_size_its_place_and_its_contrast(
    running: Browser, service: LocalService, width: int, dark: bool
) -> None:
    """In short the controls are looked at below."""
    key = service.new_key("kit")
    with watched_page(running, service.url, width=width, height=900, dark=dark) as seen:
        page = signed_in(seen, key, "/ui/kit")
        for part in ("controls", "work", "said"):
            page.click(f".tabs [href='#{part}']")
            for pane in page.locator(".phone button:visible").all() if part == "work" else [None]:
                if pane is not None:
                    pane.click()
                assert page.evaluate(SMALL) == []
                assert page.evaluate(COVERED) == []
                assert overflow(seen) == 0
            assert hindrances(page) == []
        assert page.evaluate(BARE) == []


def chosen(page: Page) -> list[str]:
    """First cells of the rows that are chosen."""
    return page.locator("[aria-label=many] [aria-selected=true] td:first-child").all_inner_texts()


def test_parts_do_what_they_show(seen: Watched) -> None:
    page = seen.goto("/ui/kit")
    for found in (page.evaluate(SMALL), page.evaluate(COVERED), hindrances(page)):
        assert found == []
    page.click(".tabs [href='#work']")
    page.locator("[aria-label=many] tbody tr").first.wait_for()
    assert {row["height"] for row in boxes(page, "[aria-label=many] tbody tr")} == {28}
    rows_are_sorted_filtered_and_chosen(page)
    lines_move_and_are_kept(page)
    page.click(".tabs [href='#said']")
    page.click("[data-ask]")
    page.keyboard.press("Escape")
    page.wait_for_selector("#say:text('Kept.')")
    page.click("[data-ask]")
    assert "north abutment" in answered(page, yes=True)
    page.wait_for_selector("#say:text('Deleted.')")
    page.click("[data-say]")
    page.click("#say button:text('Undo')")
    page.wait_for_selector("#say:text('Taken back.')")
    page.click(".tabs summary")
    assert page.locator(".tabs .downloads a").first.is_visible()
    page.keyboard.press("Escape")
    assert not page.locator(".tabs .downloads a").first.is_visible()


def boxes(page: Page, selector: str) -> list[dict[str, float]]:
    found: list[dict[str, float]] = page.eval_on_selector_all(
        selector, "all => all.map(one => one.getBoundingClientRect().toJSON())"
    )
    return found


def rows_are_sorted_filtered_and_chosen(page: Page) -> None:
    """A head sorts by number, words leave rows out, a click chooses, with Shift up to there."""
    frequency = page.locator("[aria-label=many] th button").nth(1)
    frequency.click()
    frequency.click()
    first = page.locator("[aria-label=many] tbody tr").first
    assert first.locator("td").first.inner_text() == "point 300"
    first.locator("td").first.click()
    page.locator("[aria-label=many] tbody tr td").nth(6).click(modifiers=["Shift"])
    assert chosen(page) == ["point 300", "point 299", "point 298"]
    page.keyboard.press("Escape")
    page.locator("[aria-label=many] [aria-selected=true]").first.press("ArrowDown")
    assert chosen(page) == ["point 299"]
    page.fill("[data-filter-rows]", "point 29 failed")
    seen = page.locator("[aria-label=many] tbody tr:visible").all_inner_texts()
    assert 3 < len(seen) < 20
    assert all("29" in row and "failed" in row for row in seen)
    with page.expect_download() as file:
        page.click("[data-copy=csv]")
    lines = file.value.path().read_text().splitlines()
    assert (lines[0], len(lines)) == ("Name,Frequency [Hz],State", 1 + len(seen))


def lines_move_and_are_kept(page: Page) -> None:
    """A line is moved by the mouse and by keys; the address keeps where it is."""
    line = page.locator(".split.z")
    box = line.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 4, 400)
    page.mouse.down()
    page.mouse.move(box["x"] - 96, 400, steps=3)
    page.mouse.up()
    page.focus(".split.y")
    page.keyboard.press("ArrowUp")
    kept = parse_qs(page.evaluate("location.search.slice(1)"))["w"][0]
    x, y, z = (float(part) for part in kept.split("~"))
    assert (x, y, z) == pytest.approx((41.5, 52, 360), abs=2)
    page.reload()
    assert boxes(page, "[data-pane='To do']")[0]["width"] == pytest.approx(360, abs=2)
