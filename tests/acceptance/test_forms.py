"""Forms in the system's Chromium: from raw hits to a result, structures of every kind,
joint updates, plans.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import httpx
import pytest

from service.app.supervisor import LocalService
from tests.acceptance.test_browser import overflow
from tests.acceptance.test_correcting import bar, saved
from tests.support import profiles
from tests.support.browser import (
    Watched,
    hindrances,
    note_on_leaving,
    noted_on_leaving,
    signed_in,
    watched_page,
)
from tests.support.lengths import long
from tests.support.places import shared_file
from tests.support.rest import client_at, finished, ok, posted

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

WALLS = {
    "length_m": "800",
    "width_m": "60",
    "height_m": "100",
    "walls/flange/thickness_m": "6",
    "walls/web/thickness_m": "5",
}
CONSTANTS = {
    "E1_Pa": "23",
    "E2_Pa": "8.5",
    "G12_Pa": "3",
    "G13_Pa": "3",
    "G23_Pa": "2.4",
    "nu_12": "0.27",
}
MATERIAL_OF_HITS = {
    "material/Ex_Pa": 33,
    "material/Ey_Pa": 32,
    "material/Gxy_Pa": 5.7,
    "material/Gxz_Pa": 4.5,
    "material/Gyz_Pa": 4.5,
    "material/nu_xy": 0.2,
}
MOST_CLICKS_OF_HITS, MOST_CLICKS_OF_A_DECK = 7, 8


def fill(page: Page, prefix: str, values: dict[str, Any]) -> None:
    """Type values into the fields of a form."""
    for name, value in values.items():
        page.fill(f"[name='{prefix}{name}']", str(value))


@pytest.mark.long
def test_raw_hits_become_a_result_in_few_clicks(running: Browser, service: LocalService) -> None:
    """A file of voltages, a structure typed in mm and GPa, where the points are: all else the
    service finds or proposes. The deck below and the recording of `test_mapping.py` are the short
    forms.
    """
    file = shared_file("BLIND_OPEN", "blind-open", "hits-cantilever/hits.npz")
    truth = json.loads(file.with_name("truth.json").read_text())
    beam, known = truth["config"], truth["instruments"]
    with watched_page(running, service.url, webgl=False) as seen:
        page = seen.page
        page.goto("/")
        page.fill("#key", service.new_key("hammer"))
        seen.click("button:text('Sign in')")
        page.wait_for_url("**/ui/")
        seen.drop(file)
        assert page.input_value("[name='channels/0/point']") == "point"
        assert page.input_value("[name=sample_rate_hz]") == "fs"
        sizes = {"length_m": f"{beam['L']} m", "width_m": 1e3 * beam["b"]}
        seen.fill("structure/geometry/", {**sizes, "thickness_m": 1e3 * beam["t"]})
        seen.fill("structure/", {**MATERIAL_OF_HITS, "density_kg_m3": beam["rho"]})
        seen.fill("campaign/", {"boundary": "cantilever"})
        assert page.input_value("[name=points]") == ""
        seen.click(f"button:text('Take the {len(truth['points'])} points of x, y')")
        page.wait_for_selector("button:text('as far as the points of x, y reach'):visible")
        for n, name in enumerate(("force_V_per_N", "acceleration_V_per_m_s2")):
            seen.fill(f"channels/{n}/", {"sensitivity": known[name], "direction": 3})
        seen.fill("channels/1/", {"point": known["sensor_point"]})
        assert hindrances(page) == []
        note_on_leaving(page, "location.pathname")
        seen.click("button:text-is('Import 1 file')")
        page.wait_for_url("**/ui/update-jobs/*")
        assert noted_on_leaving(page).endswith("/ui/new")  # nothing was loaded anew
        page.wait_for_selector("#verdict")
        assert page.locator("#parameters tbody tr:has-text('Ex')").count() > 0
        assert seen.clicks <= MOST_CLICKS_OF_HITS


@pytest.mark.parametrize(("modes", "sent"), [(False, False), long(False, True), long(True, True)])
def test_a_deck_becomes_a_printed_report_in_few_clicks(
    running: Browser, service: LocalService, tmp_path: Path, modes: bool, sent: bool
) -> None:
    """A deck and what was measured of it, FRFs or modes alone, by a newcomer: only units and
    support are asked for, and the units that fit are offered. The short run has them filled in.
    """
    files = tmp_path / "angle.inp", tmp_path / "angle.uff"
    files[0].write_bytes(profiles.deck(1e-3))
    files[1].write_bytes(identified(service) if modes else profiles.measured())
    with watched_page(running, service.url, webgl=False) as seen:
        page = seen.page
        page.goto("/")
        page.fill("#key", service.new_key("engineer"))
        seen.click("button:text('Sign in')")
        page.wait_for_url("**/ui/")
        seen.drop(*files)
        seen.click("button:text('Take mm-N-t')")
        seen.fill("campaign/", {"boundary": "free"})
        assert page.input_value("[name='campaign/name']") == "angle"
        page.wait_for_selector("button:text-is('Import 2 files')")
        if not sent:
            return
        seen.click("button:text-is('Import 2 files')")
        page.wait_for_url("**/ui/update-jobs/*")
        page.wait_for_selector("#verdict")
        assert seen.clicks < MOST_CLICKS_OF_A_DECK
        assert seen.print().endswith("/report?format=pdf")


def identified(service: LocalService) -> bytes:
    """Points and modes of the measured angle, as a UFF file."""
    with client_at(service.url, service.new_key("modes")) as api:
        project = posted(api, "projects", {"name": "modes"})["id"]
        structure = posted(api, f"projects/{project}/structures", {"name": "angle"})["id"]
        test = {"name": "modes", "boundary": "free"}
        campaign = posted(api, f"structures/{structure}/campaigns", test)["id"]
        sent = api.post(f"campaigns/{campaign}/imports", content=profiles.measured())
        finished(api, sent.headers["Location"])
        done = api.post(f"campaigns/{campaign}/identifications", json={})
        finished(api, done.headers["Location"])
        key = ok(api.get(f"campaigns/{campaign}/mode-sets"))["items"][0]["id"]
        return api.get(f"mode-sets/{key}", params={"format": "uff"}).content


@pytest.mark.parametrize("made", [False, long(True)])
def test_the_example_is_made_removed_and_had_back_by_a_click_each(
    seen: Watched, api: httpx.Client, made: bool
) -> None:
    """The short run has one without a test."""
    if made:
        page = seen.goto("/ui/")
        page.wait_for_selector("text=No test yet")
        page.click("button:text('Add it')")
        page.wait_for_selector("#verdict")
    else:
        posted(api, "projects", {"name": "example", "tags": ["example"]})
    page = seen.goto("/ui/")
    if made:
        page.locator("[aria-label=tests] .verdict").wait_for()
        assert page.inner_text("[aria-label=tests] tbody td:nth-child(3)") == "33"
        assert hindrances(page) == []
    page.click("button:text('Remove it')")
    page.wait_for_selector("button:text('Add it')")
    with page.expect_navigation():
        page.click("#say button:text('Undo')")
    page.wait_for_selector("button:text('Remove it')")


@pytest.mark.parametrize("whole", [False, long(True)])
def test_structures_of_every_kind_are_made_and_chosen(
    seen: Watched, api: httpx.Client, whole: bool
) -> None:
    """A profile and, in the long run, plies by the form of a new test; one that is there is chosen;
    what is left out is not sent.
    """
    page = seen.goto("/ui/new")
    page.fill("[name='project/name']", "bodies")
    page.fill("[name='structure/name']", "profile")
    page.select_option("select[data-kind]", "i")
    assert not page.locator("[name='structure/geometry/length_m']").is_visible()
    page.fill("[name='structure/density_kg_m3']", "1900")
    fill(page, "structure/shape/", WALLS)
    fill(page, "structure/shape/material/", CONSTANTS)
    stored(page, "free")
    project = ok(api.get("projects"))["items"][0]["id"]
    (profile,) = structures(api, project)
    assert (profile["shape"]["kind"], profile["shape"]["height_m"]) == ("i", 0.1)
    assert profile["shape"]["walls"]["web"]["thickness_m"] == 0.005
    assert (profile["geometry"], profile["material"]) == (None, None)
    if not whole:
        return
    page.goto(f"/ui/new?project={project}")
    page.fill("[name='structure/name']", "laminate")
    page.select_option("select[data-kind]", "laminate")
    page.fill("[name='structure/density_kg_m3']", "1600")
    fill(page, "structure/geometry/", {"length_m": 400, "width_m": 30, "thickness_m": 2})
    for number, angle in enumerate((0, 90)):
        page.click("button:text('Add a ply')")
        fill(
            page,
            f"structure/laminate/plies/{number}/",
            {**CONSTANTS, "thickness_m": 1, "angle_deg": angle},
        )
    stored(page, "cantilever")
    laminate = structures(api, project)[1]["laminate"]
    assert [(ply["angle_deg"], ply["thickness_m"]) for ply in laminate["plies"]] == [
        (0, 0.001),
        (90, 0.001),
    ]

    page.goto("/ui/new")
    page.select_option("#which-structure", profile["id"])
    assert not page.locator("[name='structure/name']").is_visible()
    stored(page, "cantilever")
    tests = ok(api.get(f"structures/{profile['id']}/campaigns"))["items"]
    assert [test["boundary"] for test in tests] == ["free", "cantilever"]
    assert len(structures(api, project)) == 2
    corrected(page, f"structures/{profile['id']}")
    assert structures(api, project)[0]["shape"]["walls"]["web"]["thickness_m"] == 0.0055
    assert structures(api, project)[0]["shape"]["walls"]["flange"]["thickness_m"] == 0.006
    page.goto(f"/ui/campaigns/{tests[0]['id']}/grid-points")
    page.fill("[name=points]", "1, 0, 10\n2 800 -10 50")
    saved(page, "Save the points")
    points = ok(api.get(f"campaigns/{tests[0]['id']}/grid-points"))["items"]
    assert points[1] == {"label": 2, "x_m": 0.8, "y_m": -0.01, "z_m": 0.05}


def structures(api: httpx.Client, project: str) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = ok(api.get(f"projects/{project}/structures"))["items"]
    return found


def stored(page: Page, boundary: str) -> None:
    """Name the test, and store it; its page comes."""
    page.fill("[name='campaign/name']", boundary)
    page.select_option("[name='campaign/boundary']", boundary)
    page.click("button:text('Store the test')")
    page.wait_for_url("**/ui/campaigns/*")


def corrected(page: Page, path: str) -> None:
    """A wall of a profile is edited; the rest of the shape stays."""
    page.goto(f"/ui/edit/{path}")
    page.wait_for_selector("button:has-text('Save what was changed'):enabled")
    page.fill("[name='shape/walls/web/thickness_m']", "0.55 cm")
    saved(page, "Save what was changed")


@pytest.mark.long
def test_campaigns_are_updated_together_and_the_next_one_planned(
    running: Browser, service: LocalService
) -> None:
    key = service.new_key("planner")
    reader = service.new_key("reader")
    with client_at(service.url, key) as api:
        project, structure = bar(api)
        campaigns = [measured(api, structure, name) for name in ("first", "second")]
        ok(api.put(f"projects/{project}/members/reader", json={"role": "viewer"}))
        with watched_page(running, service.url) as seen:
            page = signed_in(seen, key, f"/ui/structures/{structure}")
            for box in page.locator("input[name=campaign]").all():
                box.check()
            page.click("button:has-text('Update them together')")
            page.wait_for_url("**/joint?**")
            for number in (0, 1):
                page.select_option(f"[name='jobs/{number}/recipe/mode_set']", index=1)
                page.fill(f"[name='jobs/{number}/specimen']", "one bar")
            assert hindrances(page) == []
            note_on_leaving(
                page, "document.querySelector('form[data-post] [type=submit]').disabled"
            )
            page.click("button:text('Start the joint update')")
            page.wait_for_selector("h1:has-text('One material from 2 campaigns')")
            # a second click, while the page comes, would start a second one
            assert noted_on_leaving(page)
            request = ok(api.get(f"projects/{project}/joint-updates"))["items"][0]["request"]
            assert [job["campaign_id"] for job in request["jobs"]] == campaigns
            assert {job["specimen"] for job in request["jobs"]} == {"one bar"}
            page.goto(f"/ui/structures/{structure}/plan")
            page.locator("[data-made]").first.check()
            page.click("button:text('Add a test')")
            fill(page, "tests/0/added_masses/0/", {"mass_kg": 50, "x_m": "0.4 m"})
            page.click("button:text('Rank the tests')")
            page.wait_for_selector("[data-answer] th:has-text('with 50 g')")
            assert "GPa" in page.inner_text("[data-answer] tbody")
    with watched_page(running, service.url, width=390, height=844, dark=True) as seen:
        signed_in(seen, key)
        for path in (
            f"projects/{project}/joint",
            f"structures/{structure}/plan",
            "new",
            f"edit/structures/{structure}",
        ):
            seen.visit(f"/ui/{path}")
            assert overflow(seen) == 0, path
            assert hindrances(seen.page) == [], path
    with watched_page(running, service.url) as seen:
        page = signed_in(seen, reader)
        who_only_reads_is_offered_no_change(
            seen,
            [
                f"projects/{project}",
                f"structures/{structure}",
                *(f"campaigns/{c}" for c in campaigns),
            ],
        )


def measured(api: httpx.Client, structure: str, name: str) -> str:
    """A campaign with modes that were typed in."""
    campaign = str(
        posted(api, f"structures/{structure}/campaigns", {"name": name, "boundary": "cantilever"})[
            "id"
        ]
    )
    modes = [{"frequency_hz": hz, "frequency_sd_hz": 0.001 * hz} for hz in (24.9, 156.0)]
    posted(api, f"campaigns/{campaign}/mode-sets", {"name": "typed", "modes": modes})
    return campaign


def who_only_reads_is_offered_no_change(seen: Watched, paths: list[str]) -> None:
    """A viewer sees what there is, and no button that would be refused."""
    for path in paths:
        seen.visit(f"/ui/{path}")
        assert seen.page.locator("h1").is_visible()
        assert (
            seen.page.locator(
                "a:text-is('Edit'), a:text('New'), form[data-post], form[data-upload]"
            ).count()
            == 0
        ), path
