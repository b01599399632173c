"""The structure in space, in the system's Chromium: what is drawn, turned, zoomed and chosen, by
mouse and by keyboard, on a desk and on a phone; and the still picture of a browser without WebGL.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import httpx
import pytest

from service.app.supervisor import LocalService
from tests.acceptance.test_browser import overflow
from tests.support.browser import Watched, drawn, held, hindrances, signed_in, watched_page
from tests.support.laboratory import BEAM
from tests.support.lengths import long
from tests.support.profiles import deck, points
from tests.support.rest import client_at, finished, ok, posted
from tests.support.waiting import until

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

READY = "[data-space][data-ready=webgl]"


@pytest.fixture(scope="module")
def bracket(service: LocalService) -> dict[str, str]:
    """A key, and the addresses of a deck and of a test of it with FRFs at two points and one
    measured shape.
    """
    key = service.new_key("space")
    with client_at(service.url, key) as api:
        project = posted(api, "projects", {"name": "in space"})["id"]
        structure = posted(api, f"projects/{project}/structures", {"name": "bracket"})["id"]
        query = {"filename": "angle.inp", "units": "m-N-kg"}
        sent = api.post(f"structures/{structure}/model", params=query, content=deck())
        finished(api, ok(sent, 202) and sent.headers["Location"])
        return {
            "key": key,
            "structure": f"/ui/structures/{structure}",
            "campaign": measured(api, structure),
        }


def measured(api: httpx.Client, structure: str) -> str:
    campaign = posted(
        api, f"structures/{structure}/campaigns", {"name": "hung", "boundary": "as_modelled"}
    )["id"]
    places = {**points(), 90: (0.2, 0.0, 0.0)}  # the last lies in the air
    items = [{"label": n, "x_m": x, "y_m": y, "z_m": z} for n, (x, y, z) in places.items()]
    ok(
        api.put(
            f"campaigns/{campaign}/grid-points", json={"items": items}, headers={"If-Match": "*"}
        )
    )
    spectrum = {"real": [1.0, 2.0, 3.0], "imag": [0.0, 0.5, 1.0]}
    rows = [
        {
            "response_point": point,
            "response_direction": 3,
            "reference_point": 1,
            "reference_direction": -2,
            **spectrum,
        }
        for point in (1, 2)
    ]
    ok(
        api.post(
            f"campaigns/{campaign}/frfs",
            json={"quantity": "accelerance", "frequency_hz": [1.0, 2.0, 3.0], "frfs": rows},
        ),
        201,
    )
    shape = [{"point": n, "direction": 3, "real": 0.1 * n, "imag": 0.0} for n in places]
    modes = {"name": "typed in", "modes": [{"frequency_hz": 25.0, "shape": shape}]}
    posted(api, f"campaigns/{campaign}/mode-sets", modes)
    return f"/ui/campaigns/{campaign}"


def picture(page: Page) -> bytes:
    """What the canvas shows."""
    return page.locator("[data-space-canvas]").screenshot(type="jpeg", quality=90)


def opened(seen: Watched, path: str) -> Page:
    seen.visit(path)
    seen.page.locator("[data-space]").scroll_into_view_if_needed()
    seen.page.wait_for_selector(READY)
    return seen.page


@pytest.mark.parametrize(
    ("width", "height", "dark", "whole"),
    [(1400, 900, False, False), long(1400, 900, False, True), long(390, 844, True, True)],
)
def test_a_structure_is_turned_zoomed_and_its_points_chosen(
    running: Browser,
    service: LocalService,
    bracket: dict[str, str],
    width: int,
    height: int,
    dark: bool,
    whole: bool,
) -> None:
    """What is drawn by WebGL is seen in its pixels alone. The short run has the structure, not the
    test of it.
    """
    with watched_page(running, service.url, width=width, height=height, dark=dark) as seen:
        signed_in(seen, bracket["key"])
        page = opened(seen, bracket["structure"])
        legend = page.inner_text("[data-space-legend]")
        assert all(
            words in legend
            for words in ("flange, 60 elements", "web, 80 elements", "held: 15 nodes", "junctions")
        )
        assert "GFRP" in page.inner_text("[aria-label=Sets]")
        views_differ(page, ("ArrowLeft", "ArrowUp", "+", "Shift+ArrowLeft") if whole else ("+",))
        if not whole:
            return
        assert (hindrances(page), overflow(seen)) == ([], 0)
        page = opened(seen, bracket["campaign"])
        a_point_is_chosen(page)
        a_shape_moves(page)
        page.click("[data-space] summary")
        page.click("[data-space-distances]")
        until(
            lambda: "1 point further than an update takes: 90" in said(page),
            "the distances of the points",
        )
        assert "points off the structure" in page.inner_text("[data-space-legend]")
        assert (hindrances(page), overflow(seen)) == ([], 0)


def pane(page: Page, name: str) -> None:
    """Go to a pane, where a phone shows one at a time."""
    if page.evaluate("innerWidth") < 500:
        page.click(f".phone button:text-is('{name}')")


def said(page: Page) -> str:
    return page.inner_text("[data-space-said]")


def views_differ(page: Page, keys: tuple[str, ...]) -> None:
    """Each key and each way of the mouse shows another view; Home is the first one again."""
    page.focus("[data-space-canvas]")
    page.keyboard.press("Home")
    first, views = picture(page), set()
    for key in keys:
        page.keyboard.press(key)
        views.add(picture(page))
    box: Any = page.locator("[data-space-canvas]").bounding_box()
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.wheel(0, -200)
    views.add(picture(page))
    page.mouse.down()
    page.mouse.move(box["x"] + 160, box["y"] + 130, steps=4)
    page.mouse.up()
    views.add(picture(page))
    assert len(views) == 2 + len(keys)
    assert first not in views
    page.keyboard.press("Home")
    assert picture(page) == first


def a_point_is_chosen(page: Page) -> None:
    """From the list and by key it is marked, named in the address, and its FRF is shown."""
    before = picture(page)
    page.click("[data-space] summary")
    page.select_option(
        "[data-space-point]",
        label=next(
            o
            for o in page.locator("[data-space-point] option").all_inner_texts()
            if o.startswith("2:")
        ),
    )
    assert said(page).startswith("Point 2: ")
    assert "1 FRF" in said(page)
    assert "point=2" in page.evaluate("location.search")
    pane(page, "Table")
    page.click("[data-tab=frfs]")
    page.wait_for_selector("[data-frfs] [aria-selected=true]:has-text('2+z/1−y')")
    pane(page, "Space")
    assert picture(page) != before
    page.focus("[data-space-canvas]")
    page.keyboard.press("p")
    assert said(page).startswith("Point 1: ")
    pane(page, "Table")
    page.select_option("[data-all]", "*")
    page.reload()
    pane(page, "Curves")
    drawn(page, "[data-frf-viewer]")
    pane(page, "Space")
    page.locator("[data-space]").scroll_into_view_if_needed()
    page.wait_for_selector(READY)
    assert said(page).startswith("Point 1: ")
    assert (
        page.locator("[data-frfs] [aria-selected=true]").count() == 2
    )  # not those of the point alone, whichever comes first
    place = page.eval_on_selector(
        "[data-space-labels] span:text-is('5')", "label => label.style.transform"
    )
    x, y = (float(part) for part in re.findall(r"-?[\d.]+", place))
    page.locator("[data-space-canvas]").click(position={"x": x, "y": y})
    assert said(page).startswith("Point 5: ")


def a_shape_moves(page: Page) -> None:
    """Who prefers stillness sees it at its largest; the phase turns it over; Move moves it."""
    pane(page, "Table")
    page.click("[data-tab=modes]")
    page.locator("[data-shape] td").nth(1).click()
    pane(page, "Space")
    until(lambda: "typed in, mode 1: 25 Hz" in said(page), "the shape of the mode set")
    assert page.inner_text("[data-space-run]") == "Move"
    largest = picture(page)
    page.click("[data-space] summary")
    page.locator("[data-space-phase]").fill("180")
    assert picture(page) != largest
    page.click("[data-space-run]")
    assert page.inner_text("[data-space-run]") == "Stop"
    one = picture(page)
    until(lambda: picture(page) != one, "the shape in motion")
    page.click("[data-space-run]")


@pytest.fixture
def drawing(running: Browser, service: LocalService, api: httpx.Client) -> Iterator[Watched]:
    """A page of the user of `api` that draws in space."""
    with watched_page(running, service.url) as seen:
        signed_in(seen, api.headers["authorization"].split()[1])
        yield seen


@pytest.mark.long
def test_a_structure_is_solved_before_it_is_measured_and_a_deck_is_its_next_version(
    drawing: Watched, api: httpx.Client
) -> None:
    """Pages of a forecast are in `test_live.py` and those of a deck in `test_forms.py`, in short."""
    project = posted(api, "projects", {"name": "corrected"})["id"]
    structure = posted(api, f"projects/{project}/structures", BEAM)["id"]
    page = drawing.goto(f"/ui/structures/{structure}")
    page.click("summary:text('Solve the nominal model')")
    page.fill("[name=modes]", "3")
    page.fill("[name=damping_ratio]", "0.01")
    page.click("button:text('Solve')")
    page.wait_for_selector("[aria-label='Modes of the nominal model'] td:text('torsion')")
    card = page.locator("section[aria-labelledby=forecast]")
    assert "shows mode" in card.inner_text()
    card.locator("[data-space]").scroll_into_view_if_needed()
    page.wait_for_selector(f"section[aria-labelledby=forecast] {READY}")
    card.locator("[data-space-model]").select_option("2")
    until(
        lambda: "model mode 2" in card.locator("[data-space-said]").inner_text(),
        "the second mode",
    )
    with held(page, "**/mesh/shapes?model=1") as waiting:
        card.locator("[data-space-model]").select_option("1")
        until(waiting, "the first mode, on its way")
        card.locator("[data-space-model]").select_option("3")
        until(
            lambda: "model mode 3" in card.locator("[data-space-said]").inner_text(),
            "the third mode",
        )
        with page.expect_response("**/mesh/shapes?model=1") as late:
            waiting().pop().continue_()
        late.value.finished()
        # what was waiting for it has gone on
        page.evaluate("new Promise((done) => setTimeout(done))")
    assert "model mode 3" in card.locator("[data-space-said]").inner_text()
    assert card.locator("[data-space-measured]").is_hidden()
    with page.expect_download() as download:
        card.locator("a:text('UFF')").last.click()
    assert download.value.suggested_filename == "forecast.uff"
    assert (hindrances(page), overflow(drawing)) == ([], 0)
    a_deck_is_sent(page)
    assert ok(api.get(f"structures/{structure}"))["version"] == 2


def a_deck_is_sent(page: Page) -> None:
    """Without its units the report says which fit; with them the structure is the model."""
    # (a click may miss it where the body above grows as it is drawn)
    page.press("summary:text('A model of your own')", "Enter")
    page.set_input_files(
        "[data-deck] [name=deck]",
        {"name": "angle.inp", "mimeType": "text/plain", "buffer": deck(1e-3)},
    )
    page.click("button:text('Send the model')")
    page.wait_for_selector("#progress .faults:has-text('units=mm-N-t?')")
    page.fill("[data-deck] [name=units]", "mm-N-t")
    page.set_input_files(
        "[data-deck] [name=deck]",
        {"name": "angle.inp", "mimeType": "text/plain", "buffer": deck(1e-3)},
    )
    page.click("button:text('Send the model')")
    page.wait_for_selector("[aria-label=Sets] :text('flange')")


def test_a_browser_without_webgl_has_a_still_picture(
    running: Browser, service: LocalService, bracket: dict[str, str]
) -> None:
    with watched_page(running, service.url, webgl=False) as seen:
        signed_in(seen, bracket["key"], bracket["structure"])
        page = seen.page
        page.locator("[data-space]").scroll_into_view_if_needed()
        page.wait_for_selector("[data-space][data-ready=still] svg path")
        assert page.locator("[data-space-canvas]").is_hidden()
        page.goto(bracket["campaign"])
        seen.page.wait_for_selector("[data-space][data-ready=still] svg circle")
        seen.page.locator("[data-shape] td").nth(1).click()
        until(lambda: "mode 1: 25 Hz" in said(seen.page), "the still shape")
