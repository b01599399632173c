"""The FRF viewer in the system's Chromium: what is chosen, read at cursors, converted, copied, and
kept in the address.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs
from xml.etree import ElementTree

import httpx
import numpy as np
import pytest

from service.app.supervisor import LocalService
from tests.acceptance.test_browser import overflow
from tests.support.browser import Watched, drawn, held, hindrances, signed_in, watched_page
from tests.support.lengths import long
from tests.support.rest import client_at, ok, posted
from tests.support.waiting import until

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

F0, ZETA, STEP, LINES, AVERAGES, COHERENCE = 100.0, 0.01, 0.05, 2400, 5, 0.98
VIEWER = "[data-frf-viewer]"


def accelerance(factor: float) -> np.ndarray[Any, Any]:
    """Of one degree of freedom, with noise that hides it below 5 Hz."""
    f = STEP * np.arange(LINES)
    noise = 0.002 * np.random.default_rng(57).standard_normal((2, LINES))
    return np.asarray(
        factor * (f**2 / (F0**2 - f**2 + 2j * ZETA * F0 * f) + noise[0] + 1j * noise[1])
    )


def new_campaign(api: httpx.Client, structure: str, name: str, factors: tuple[float, ...]) -> str:
    """With an FRF of each factor, hit at point 1, and a mode set with the mode."""
    campaign: str = posted(
        api, f"structures/{structure}/campaigns", {"name": name, "boundary": "free"}
    )["id"]
    frfs = [
        {
            "response_point": k, "response_direction": 3, "reference_point": 1, "reference_direction": 3,
            "real": accelerance(factor).real.tolist(), "imag": accelerance(factor).imag.tolist(),
            "coherence": [COHERENCE] * LINES, "averages": AVERAGES,
        }
        for k, factor in enumerate(factors, start=1)
    ]  # fmt: skip
    body = {
        "quantity": "accelerance",
        "frequency_hz": (STEP * np.arange(LINES)).tolist(),
        "frfs": frfs,
    }
    ok(
        api.post(
            f"campaigns/{campaign}/frfs",
            content=json.dumps(body),
            headers={"Content-Type": "application/json"},
        ),
        201,
    )
    modes = [{"frequency_hz": F0, "damping_ratio": ZETA}]
    posted(api, f"campaigns/{campaign}/mode-sets", {"name": "known", "modes": modes})
    return campaign


def said(page: Page) -> dict[str, str]:
    """What the address says."""
    return {
        key: values[0]
        for key, values in parse_qs(page.evaluate("location.search.slice(1)")).items()
    }


def cells(page: Page, row: int) -> list[str]:
    """Readings of a chosen FRF."""
    return page.locator("[data-readings] tbody tr").nth(row).locator("th, td").all_inner_texts()


def options(page: Page) -> None:
    """Open the viewer's menu."""
    if page.get_attribute(f"{VIEWER} .menu", "open") is None:
        page.click(f"{VIEWER} summary")


def copied(page: Page, kind: str) -> str:
    """What a button of the viewer puts on the clipboard, as text."""
    options(page)
    page.click(f"[data-do={kind}]")
    page.wait_for_selector(f"[data-note]:has-text('{kind.upper()} copied')")
    return str(page.evaluate("navigator.clipboard.readText()"))


@pytest.mark.parametrize("whole", [False, long(True)])
def test_frfs_are_laid_over_one_another_read_and_copied(
    running: Browser, service: LocalService, whole: bool
) -> None:
    key = service.new_key("viewer")
    factors = (1.0, 0.5, -0.25)
    with client_at(service.url, key) as api:
        project = posted(api, "projects", {"name": "viewer"})["id"]
        plate = {"length_m": 0.5, "width_m": 0.04, "thickness_m": 0.01}
        stiff = (
            dict.fromkeys(("Ex_Pa", "Ey_Pa"), 30e9)
            | dict.fromkeys(("Gxy_Pa", "Gxz_Pa", "Gyz_Pa"), 5e9)
            | {"nu_xy": 0.2}
        )
        body = {"name": "bar", "geometry": plate, "density_kg_m3": 2000, "material": stiff}
        structure = posted(api, f"projects/{project}/structures", body)["id"]
        campaign, other = (
            new_campaign(api, structure, name, factors) for name in ("first", "second")
        )
    path = f"/ui/campaigns/{campaign}"
    with watched_page(running, service.url, webgl=False) as seen:
        page = signed_in(seen, key, path)
        page.context.grant_permissions(["clipboard-read", "clipboard-write"])
        drawn(page, VIEWER)
        cursors_read_what_was_made(page)
        what_is_still_read_is_copied_whole(page, factors)
        if whole:
            singular_values_are_those_of_one_column(page, factors)
        options(page)
        page.select_option("[data-other]", other)
        page.wait_for_selector("[data-frfs] tr:has-text('second')", state="attached")
        page.select_option("[data-view]", "nyquist")
        page.reload()
        drawn(page, VIEWER)
        assert (said(page)["v"], said(page)["c"], page.input_value("[data-view]")) == (
            "nyquist",
            other,
            "nyquist",
        )
        assert page.locator("[data-frfs] tbody tr").count() == 2 * len(factors)
    if not whole:
        return
    with watched_page(running, service.url, width=390, height=844, dark=True, webgl=False) as seen:
        page = signed_in(seen, key, path)
        page.click(".phone button:text('Curves')")
        drawn(page, VIEWER)
        a_finger_moves_the_band(seen)
        assert overflow(seen) == 0
        assert hindrances(page) == []


def cursors_read_what_was_made(page: Page) -> None:
    """The next peak is the mode and none of the noise, half-power gives its damping, values carry the random error and
    follow the quantity.
    """
    assert page.locator(f"{VIEWER} .uplot").count() == 3  # magnitude, phase, coherence
    page.click("[data-do=next]")
    until(lambda: said(page).get("a") == "100", "cursor A at the peak")
    at_peak = accelerance(1.0)[round(F0 / STEP)]
    error = np.sqrt((1 - COHERENCE) / (2 * AVERAGES * COHERENCE)) * abs(at_peak)
    name, value, phase, *_, damping = cells(page, 0)
    assert name == "1+z/1+z"
    assert [float(part) for part in value.split(" ± ")] == pytest.approx(
        [abs(at_peak), error], rel=0.02
    )
    assert float(phase.removesuffix("°")) == pytest.approx(np.degrees(np.angle(at_peak)), abs=0.1)
    assert float(damping.split(" %")[0]) == pytest.approx(100 * ZETA, rel=0.02)
    options(page)
    page.select_option("[data-quantity]", "receptance")
    receptance = abs(at_peak) / (2 * np.pi * F0) ** 2
    assert float(cells(page, 0)[1].split(" ± ")[0]) == pytest.approx(receptance, rel=0.02)
    page.select_option("[data-quantity]", "")
    page.click("[data-cursor='1']")
    page.focus("[data-panels]")
    for _ in range(3):
        page.keyboard.press("ArrowRight")
    assert said(page)["b"] == "0.15"
    assert "B − A: -99.85 Hz" in page.inner_text("[data-readings] thead")


def what_is_still_read_is_copied_whole(page: Page, factors: tuple[float, ...]) -> None:
    """A copy that is asked for while FRFs are on their way has all that were chosen."""
    page.click("[data-tab=frfs]")
    with held(page, "**/data?format=npz") as waiting:
        page.select_option("[data-all]", "1+z")
        until(
            lambda: said(page).get("s") == "*" and len(waiting()) == len(factors) - 1,
            "all, two on their way",
        )
        options(page)
        page.click("[data-do=csv]")
    page.wait_for_selector("[data-note]:has-text('CSV copied')")
    rows = str(page.evaluate("navigator.clipboard.readText()")).splitlines()
    assert len(rows) == 1 + len(factors) * LINES


def singular_values_are_those_of_one_column(page: Page, factors: tuple[float, ...]) -> None:
    """Of one reference the only singular value is the length of the column; the copy has the lines
    that are seen.
    """
    page.select_option("[data-view]", "cmif")
    page.click("[data-do=closer]")
    until(lambda: "z" in said(page), "a closer view")
    low, high = (float(end) for end in said(page)["z"].split("~"))
    lines = np.array(
        [[float(v) for v in row.split(",")] for row in copied(page, "csv").splitlines()[1:]]
    )
    inside = np.arange(LINES)[(STEP * np.arange(LINES) >= low) & (STEP * np.arange(LINES) <= high)]
    assert lines[:, 0] == pytest.approx(STEP * inside)
    assert lines[:, 1] == pytest.approx(
        np.linalg.norm(factors) * np.abs(accelerance(1.0))[inside], rel=1e-5
    )
    page.select_option("[data-view]", "complex")
    drawing = ElementTree.fromstring(copied(page, "svg"))
    assert len(drawing.findall(".//{*}path")) == 3 * len(factors)  # real, imaginary, coherence
    rows = copied(page, "csv").splitlines()
    assert len(rows) == 1 + len(factors) * len(inside)
    options(page)
    page.click("[data-do=png]")
    page.wait_for_selector("[data-note]:has-text('PNG copied')")
    page.click("[data-do=whole]")
    until(lambda: "z" not in said(page), "the whole band")


def a_finger_moves_the_band(seen: Watched) -> None:
    """A finger's width to the left moves the band up by as much."""
    page = seen.page
    page.click("[data-do=closer]")
    until(lambda: "z" in said(page), "a closer view")
    before = [float(end) for end in said(page)["z"].split("~")]
    over = page.locator(f"{VIEWER} .u-over").first
    box = over.bounding_box()
    assert box is not None
    for kind, x in (("pointerdown", 200), ("pointermove", 150), ("pointerup", 150)):
        over.dispatch_event(
            kind, {"pointerType": "touch", "pointerId": 7, "clientX": x, "clientY": box["y"] + 20}
        )
    until(lambda: float(said(page)["z"].split("~")[0]) > before[0], "the band moved")
    moved = float(said(page)["z"].split("~")[0]) - before[0]
    assert moved == pytest.approx(50 / box["width"] * (before[1] - before[0]), rel=0.02)
