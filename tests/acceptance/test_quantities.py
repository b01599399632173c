"""Quantities typed in the system's Chromium: read with unit and decimal comma, shown as understood,
sent as shown.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from service.app.supervisor import LocalService
from tests.acceptance.test_browser import overflow
from tests.acceptance.test_correcting import bar, saved
from tests.support.browser import Watched, answered, hindrances, signed_in, watched_page
from tests.support.lengths import long
from tests.support.rest import client_at, ok, posted

if TYPE_CHECKING:
    import httpx
    from playwright.sync_api import Browser, Page

TYPED = {
    "structure/density_kg_m3": ("1850 kg/m3", "= 1850 kg/m³"),
    "structure/geometry/length_m": ("0,5 m", "= 500 mm"),
    "structure/geometry/width_m": ("40", "= 40 mm"),
    "structure/geometry/thickness_m": ("1.012 cm", "= 10.12 mm"),
    "structure/material/Ex_Pa": ("33000 MPa", "= 33 GPa"),
    "structure/material/Ey_Pa": ("31,8", "= 31.8 GPa"),
    "structure/material/Gxy_Pa": ("5.73e9 Pa", "= 5.73 GPa"),
    "structure/material/Gxz_Pa": ("4.5", "= 4.5 GPa"),
    "structure/material/Gyz_Pa": ("4.5", "= 4.5 GPa"),
    "structure/material/nu_xy": ("0,15", "= 0.15"),
    "campaign/temperature_c": ("70 °F", "= 21.11111111 °C"),
    "campaign/instruments/sensor_mass_kg": ("4,8", "= 4.8 g"),
    "campaign/inputs/window_rate_per_s": ("2,5", "= 2.5 1/s"),
    "points": ("1; 0,5; -20\n2; 10; -20", "= 2 points"),
}


def typed(page: Page, name: str, text: str, understood: str) -> None:
    """Type into a field, and wait for what stands below it."""
    field = page.locator(f"[name='{name}']:enabled")
    field.fill(text)
    field.locator(
        f"xpath=../small[contains(@class, 'understood')][normalize-space() = '{understood}']"
    ).wait_for()


def test_what_is_typed_is_shown_as_understood_and_sent_so(seen: Watched, api: httpx.Client) -> None:
    page = seen.goto("/ui/new")
    assert page.locator("input[type=number]").count() == 0
    page.fill("[name='project/name']", "typed")
    page.fill("[name='structure/name']", "plate")
    page.fill("[name='campaign/name']", "first")
    page.select_option("[name='campaign/boundary']", "cantilever")
    page.click("summary:has-text('When, temperature')")
    for name, (text, understood) in TYPED.items():
        typed(page, name, text, understood)
    typed(
        page,
        "structure/density_kg_m3",
        "2,012 g/cm3",
        "“2,012 g/cm3” is 2012 or 2.012: write which, without a comma Take 2.012 g/cm3",
    )
    page.click("button:text('Store the test')")
    assert page.url.endswith("/ui/new")
    page.click("button:text('Take 2.012 g/cm3')")
    page.wait_for_selector("small.understood:text-is('= 2012 kg/m³')")
    typed(page, "structure/density_kg_m3", "1.85 g/cm³", "= 1850 kg/m³")
    with page.expect_navigation(url="**/ui/campaigns/*"):
        page.click("button:text('Store the test')")
    campaign = ok(api.get(f"campaigns/{page.url.rsplit('/', 1)[1]}"))
    structure = ok(api.get(f"structures/{campaign['structure_id']}"))
    assert structure["density_kg_m3"] == 1850
    assert structure["geometry"] == {"length_m": 0.5, "width_m": 0.04, "thickness_m": 0.01012}
    constants = [33e9, 31.8e9, 5.73e9, 4.5e9, 4.5e9, 0.15]
    assert [
        structure["material"][name.rsplit("/", 1)[1]] for name in TYPED if "material/" in name
    ] == constants
    assert campaign["temperature_c"] == 190 / 9
    assert campaign["instruments"]["sensor_mass_kg"] == 0.0048
    assert campaign["inputs"]["window_rate_per_s"] == 2.5
    points = ok(api.get(f"campaigns/{campaign['id']}/grid-points"))["items"]
    assert [(p["label"], p["x_m"], p["y_m"]) for p in points] == [
        (1, 0.0005, -0.02),
        (2, 0.01, -0.02),
    ]


@pytest.mark.long
def test_an_unusual_number_is_asked_about_by_its_label(seen: Watched, api: httpx.Client) -> None:
    """33 in GPa is not asked about, 3300 is, as a thickness is in `test_browser.py`, in short."""
    _, structure = bar(api)
    page = seen.goto(f"/ui/edit/structures/{structure}")
    page.wait_for_selector("button:has-text('Save what was changed'):enabled")
    typed(page, "material/Ex_Pa", "3300", "= 3300 GPa")
    page.click("button:has-text('Save what was changed')")
    asked = answered(page, yes=False)
    page.wait_for_selector(".faults:has-text('Ex [GPa]')")
    assert asked.startswith("Ex [GPa]: is 3.3e12 Pa")
    assert "confirm" not in asked
    assert "Ex_Pa" not in asked + page.inner_text("form[data-edit] .faults")
    seen.complaints.clear()  # the console names the 422
    typed(page, "material/Ex_Pa", "33000 MPa", "= 33 GPa")
    saved(page, "Save what was changed")
    assert ok(api.get(f"structures/{structure}"))["material"]["Ex_Pa"] == 33e9


@pytest.mark.parametrize("sent", [False, long(True)])
def test_priors_are_in_the_unit_of_their_parameter(
    running: Browser, service: LocalService, sent: bool
) -> None:
    """A prior of a modulus is in GPa, and comes back so where a recipe is repeated."""
    key = service.new_key("prior")
    with (
        client_at(service.url, key) as api,
        watched_page(running, service.url, width=390, height=844, dark=True, webgl=False) as seen,
    ):
        _, structure = bar(api)
        test = posted(
            api, f"structures/{structure}/campaigns", {"name": "first", "boundary": "cantilever"}
        )["id"]
        posted(
            api, f"campaigns/{test}/mode-sets", {"name": "typed", "modes": [{"frequency_hz": 25.6}]}
        )
        page = signed_in(seen, key, f"/ui/campaigns/{test}/update")
        page.click("[data-rows=parameters] [data-add-row]")
        typed(
            page,
            "parameters/0/prior_mean",
            "33",
            "name the parameter first: the value is in its unit",
        )
        page.fill("[name='parameters/0/name']", "Ex")
        page.wait_for_selector("small.understood:text-is('= 33 GPa')")
        typed(page, "parameters/0/prior_sd", "3300 MPa", "= 3.3 GPa")
        if not sent:
            return
        assert overflow(seen) == 0
        assert hindrances(page) == []
        with page.expect_navigation(url="**/ui/update-jobs/*"):
            page.locator("button:text('Start the update')").first.click()
        job = page.url.rsplit("/", 1)[1]
        (parameter,) = ok(api.get(f"update-jobs/{job}"))["recipe"]["parameters"]
        assert (parameter["prior_mean"], parameter["prior_sd"]) == (33e9, 3.3e9)
        again = page.context.new_page()  # the job's own page goes to its result when it ends
        again.goto(f"/ui/campaigns/{test}/update?like={job}")
        assert again.input_value("[name='parameters/0/prior_mean']") == "33 GPa"
