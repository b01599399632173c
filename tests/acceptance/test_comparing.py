"""Identification at work and sides compared, in the system's Chromium: a pole of the diagram
dropped, sets and tests by MAC.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import httpx
import pytest

from service.app.supervisor import LocalService
from tests.acceptance.test_browser import overflow
from tests.acceptance.test_correcting import saved
from tests.support.browser import Watched, drawn, hindrances, signed_in, watched_page
from tests.support.laboratory import BEAM
from tests.support.places import shared_file
from tests.support.rest import client_at, finished, ok, posted
from tests.support.waiting import until

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

DIAGRAM = "figure[data-figure$='/figures/stabilisation']"


def measured(api: httpx.Client, structure: str, **stated: object) -> str:
    """A campaign with FRFs and the modes that an identification found in them."""
    campaign = str(
        posted(api, f"structures/{structure}/campaigns", {"boundary": "cantilever", **stated})["id"]
    )
    file = shared_file("BLIND_OPEN", "blind-open", "paper-like.uff").read_bytes()
    sent = api.post(f"campaigns/{campaign}/imports", params={"filename": "paper.uff"}, content=file)
    finished(api, sent.headers["Location"])
    queued = api.post(
        f"campaigns/{campaign}/identifications", json={"name": "found", "band_hz": [5, 500]}
    )
    finished(api, queued.headers["Location"])
    return campaign


def test_sets_and_campaigns_are_compared(seen: Watched, api: httpx.Client) -> None:
    """By MAC, of modes that were typed in."""
    project = posted(api, "projects", {"name": "judged"})["id"]
    structure = str(posted(api, f"projects/{project}/structures", BEAM)["id"])
    shapes = [
        [{"point": n, "direction": 3, "real": (n - 3) ** k, "imag": 0} for n in range(1, 6)]
        for k in (0, 1)
    ]
    modes = [{"frequency_hz": 20.0 + n, "shape": shape} for n, shape in enumerate(shapes)]
    for stated in ({"name": "dry"}, {"name": "wet", "temperature_c": 30}):
        test = {"boundary": "cantilever", **stated}
        campaign = posted(api, f"structures/{structure}/campaigns", test)["id"]
        for name, some in (("found", modes), ("less", modes[:1])):
            posted(api, f"campaigns/{campaign}/mode-sets", {"name": name, "modes": some})
    page = seen.goto(f"/ui/campaigns/{campaign}")
    sets_are_compared(page, "less")
    campaigns_are_compared(page, structure)


@pytest.mark.long
def test_poles_and_campaigns_are_judged_by_eye(running: Browser, service: LocalService) -> None:
    """A pole of the diagram is dropped by a click, sets and tests are compared by MAC. The short
    forms are the test above, and the mode that is dropped by a key in `test_correcting.py`.
    """
    key = service.new_key("judge")
    with client_at(service.url, key) as api:
        project = posted(api, "projects", {"name": "judged"})["id"]
        structure = str(posted(api, f"projects/{project}/structures", BEAM)["id"])
        one = measured(api, structure, name="dry")
        measured(api, structure, name="wet", temperature_c=30)
        with watched_page(running, service.url) as seen:
            page = signed_in(seen, key, f"/ui/campaigns/{one}")
            a_pole_is_dropped_in_the_diagram(page)
            whole, less = ok(api.get(f"campaigns/{one}/mode-sets"))["items"]
            assert len(less["modes"]) == len(whole["modes"]) - 1
            assert less["details"]["decisions"][0]["reason"] == "a tone of the fan"
            pairs = len(whole["modes"]) * len(less["modes"])
            sets_are_compared(page, less["name"])
            as_bars(page, pairs)
            address = campaigns_are_compared(page, structure)
            page.click("a:has-text('Lay their FRFs over each other')")
            page.wait_for_selector("[data-frfs] tr:has-text('wet')", state="attached")
            hz = a_pole_is_fitted_too(page, one)
            # that page follows the job, and would load itself anew while the browser closes it
            page.goto("about:blank")
            until(
                lambda: len(ok(api.get(f"campaigns/{one}/mode-sets"))["items"]) == 3,
                "the set of the fit",
                lambda: ok(api.get(f"campaigns/{one}/identifications")),
            )
            fitted = ok(api.get(f"campaigns/{one}/mode-sets"))["items"][-1]
            [decision] = fitted["details"]["decisions"]
            assert decision["reason"] == "seen by eye"
            assert abs(decision["frequency_hz"] / hz - 1) < 0.05
    with watched_page(running, service.url, width=390, height=844, dark=True) as seen:
        signed_in(seen, key)
        seen.visit(address)
        drawn(seen.page, "figure[data-figure*='/figures/mac']")
        as_bars(seen.page, len(fitted["modes"]) * len(whole["modes"]))
        assert overflow(seen) == 0
        assert hindrances(seen.page) == []
        seen.visit(f"/ui/campaigns/{one}#stabilisation")
        drawn(seen.page, f"{DIAGRAM}:visible")
        assert overflow(seen) == 0


def a_pole_is_dropped_in_the_diagram(page: Page) -> None:
    """The first of the fitted poles, which stand in a row on top; the table shows it, and a new set
    is made of the rest.
    """
    page.click(".tabs a:text('Stabilisation')")
    drawn(page, DIAGRAM)
    page.wait_for_selector(f"{DIAGRAM} .files a")  # it listens to clicks
    names = page.eval_on_selector(
        f"{DIAGRAM} .js-plotly-plot", "plot => plot.data.map(trace => trace.name)"
    )
    assert names[0] == "CMIF"
    assert names[-1] == "fitted pole"
    marker = (
        page.locator(f"{DIAGRAM} .scatterlayer .trace:has(.point)").last.locator(".point").first
    )
    marker.scroll_into_view_if_needed()
    box = marker.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2, steps=3)
    # A click counts for what the figure has found below the pointer, which was elsewhere on the way.
    page.wait_for_selector(f"{DIAGRAM} .hoverlayer .hovertext:has-text(', P ')")
    page.mouse.down()
    page.mouse.up()
    page.wait_for_selector("#say:has-text('dropped')")
    page.click(".tabs a:text('Measurement')")
    assert not page.locator("[data-pole]").first.is_checked()
    page.fill("form[data-poles] [name=reason]", "a tone of the fan")
    saved(page, "Save as a new mode set")
    page.wait_for_selector("[data-sets] option:has-text('found, checked')", state="attached")


def a_pole_is_fitted_too(page: Page, campaign: str) -> float:
    """A grey pole, which stands for none of the fitted ones, comes into a form and is fitted with
    them; gives its frequency.
    """
    page.goto(f"/ui/campaigns/{campaign}#stabilisation")
    drawn(page, DIAGRAM)
    page.wait_for_selector(f"{DIAGRAM} .files a")  # it listens to clicks
    hz = page.eval_on_selector(
        f"{DIAGRAM} .js-plotly-plot",
        """plot => {
            const grey = plot.data.find((trace) => trace.marker && !trace.customdata);
            const k = Math.floor(grey.x.length / 2);
            plot.emit("plotly_click", { points: [{ x: grey.x[k], text: grey.text[k] }] });
            return grey.x[k];
        }""",
    )
    page.wait_for_selector("#say:has-text('to be fitted')")
    page.fill("form[data-fit] [data-field=reason]", "seen by eye")
    saved(page, "Fit again with these poles")
    return float(hz)


def sets_are_compared(page: Page, name: str) -> None:
    """Two sets of a campaign: each mode that is in both is itself, and that which was dropped has
    no partner.
    """
    form = page.locator("aside section:visible form[data-choose]").first
    assert "found" in form.locator("select").inner_text()
    with page.expect_navigation():
        form.locator("button").click()
    table = page.locator("table[class=compare]").last
    assert name in page.inner_text("#shapes")
    assert set(table.locator("td:nth-child(5)").all_inner_texts()) == {"1.000"}
    drawn(page, "figure[data-figure*='/figures/mac']")


def as_bars(page: Page, pairs: int) -> None:
    """The MAC as bars in space: a bar for each pair, the keys choose one, and what it is stands
    below.
    """
    page.click("summary:has-text('as bars in space')")
    page.wait_for_selector("[data-bars][data-ready=webgl]")
    listed = page.locator("[data-bars] [data-space-legend] li").all_inner_texts()
    assert sum(int(words.split()[-2]) for words in listed) == pairs
    assert listed[-1].startswith("0.9 to 1, ")
    page.focus("[data-bars] canvas")
    page.keyboard.press("n")
    page.wait_for_selector("[data-bars] [data-space-said]:has-text(' Hz: MAC ')")
    assert hindrances(page) == []


def campaigns_are_compared(page: Page, structure: str) -> str:
    """Two tests of a structure: what differs is the climate alone; the shapes are the same, the
    dropped mode apart. Returns the address of the page.
    """
    page.goto(f"/ui/structures/{structure}")
    for box in page.locator("input[name=campaign]").all():
        box.check()
    with page.expect_navigation():
        page.click("button:has-text('Compare the chosen tests')")
    differences = page.locator("table.compare").first.locator("tbody tr")
    assert [row.split() for row in differences.all_inner_texts()] == [
        ["temperature", "–", "30", "°C"]
    ]
    assert page.locator(".meter rect").count() >= 1
    drawn(page, "figure[data-figure*='/figures/mac']")
    return page.url
