"""Jobs in the system's Chromium: of whatever kind, each is shown as it is, and what came of it once
it has ended.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from service.app.supervisor import LocalService
from tests.acceptance.test_browser import more_pages
from tests.acceptance.test_correcting import bar
from tests.integration.test_monitoring import UPDATES, Lab, worker_stopped
from tests.support.browser import Watched, drawn
from tests.support.lengths import long
from tests.support.rest import ok, posted

if TYPE_CHECKING:
    import httpx
    from playwright.sync_api import Page

TWO = [
    {"frequency_hz": 25.6, "damping_ratio": 0.01},
    {"frequency_hz": 160.5, "damping_ratio": 0.01},
]


def begun(page: Page, path: str) -> None:
    """Go to a page that shows something which waits, and mark it, so that one that was loaded anew
    differs.
    """
    page.goto(path)
    page.wait_for_selector("[data-job]", state="attached")
    page.evaluate("document.body.dataset.before = 'yes'")


def renewed(page: Page, selector: str) -> None:
    """Wait until the page was loaded anew by itself, and shows this."""
    ended = "body:not([data-before]):not(:has([data-job]))"
    page.wait_for_selector(
        ", ".join(f"{ended} {one}" for one in selector.split(", ")), state="attached"
    )


@pytest.mark.long
def test_processing_and_identification_show_themselves(
    seen: Watched, api: httpx.Client, service: LocalService
) -> None:
    """Pages of updates are the short form."""
    hits = more_pages(api, bar(api)[1])[2]
    campaign = hits.rsplit("/", 1)[1]
    page = seen.page
    with worker_stopped(service):
        ok(api.post(f"campaigns/{campaign}/processings", json={}), 202)
        begun(page, hits)
        assert page.inner_text("#hits .state[data-job]") == "queued"
        drawn(page, figure := "figure[data-figure$='/figures/hits']")
        assert "good hits (3)" in (page.text_content(f"{figure} .main-svg .legend") or "")
    renewed(page, "[data-frf-viewer]")
    with worker_stopped(service):
        ok(api.post(f"campaigns/{campaign}/identifications", json={"name": "found"}), 202)
        begun(page, hits)
        assert page.inner_text("aside .state[data-job]") == "queued"
    renewed(
        page,
        "#stabilisation summary:has-text('Stabilisation diagram of found'), aside .state.failed",
    )


@pytest.mark.parametrize("every_page", [False, long(True)])
def test_updates_show_themselves_on_every_page_that_lists_them(
    seen: Watched, api: httpx.Client, service: LocalService, every_page: bool
) -> None:
    """On its own page and in lists, one stream a page; what somebody types is not taken away."""
    project, structure = bar(api)
    test = posted(
        api, f"structures/{structure}/campaigns", {"name": "first", "boundary": "cantilever"}
    )["id"]
    posted(api, f"campaigns/{test}/mode-sets", {"name": "typed", "modes": TWO})
    page = seen.page
    with worker_stopped(service):
        job = ok(api.post(f"campaigns/{test}/update-jobs", json={}), 202)["id"]
        paths = [f"/ui/campaigns/{test}"]
        if every_page:
            ok(api.post(f"campaigns/{test}/update-jobs", json={"seed": 1}), 202)
            paths += [
                f"/ui/update-jobs/{job}",
                "/ui/update-jobs",
                "/ui/",
                f"/ui/projects/{project}",
            ]
        pages = [page, *(page.context.new_page() for _ in paths[1:])]
        for each, path in zip(pages, paths, strict=True):
            each.bring_to_front()
            begun(each, path)
    for each in pages:
        each.bring_to_front()
        renewed(each, ".state.succeeded, .state.failed, .verdict")


def test_an_end_does_not_take_away_what_is_typed(
    seen: Watched, api: httpx.Client, service: LocalService
) -> None:
    _, structure = bar(api)
    page = seen.page
    with worker_stopped(service):
        ok(
            api.post(f"structures/{structure}/forecasts", json={"boundary": "free", "modes": 4}),
            202,
        )
        begun(page, f"/ui/structures/{structure}")
        page.click("summary:text('New monitor')")
        page.fill("#monitors ~ details [name=name]", "half a name")
    page.wait_for_selector("#say:has-text('A computation has ended')")
    assert page.input_value("#monitors ~ details [name=name]") == "half a name"
    assert page.inner_text("#progress .state") == "succeeded"


@pytest.mark.long
def test_runs_of_a_monitor_show_themselves(
    seen: Watched, api: httpx.Client, service: LocalService
) -> None:
    """Pages of updates are the short form."""
    lab = Lab(service, api, watch="update", **UPDATES, runs_on="hand")
    lab.campaign(0)
    page = seen.page
    with worker_stopped(service):
        assert len(ok(api.post(f"monitors/{lab.monitor}/runs", json={}), 202)["items"]) == 1
        begun(page, f"/ui/monitors/{lab.monitor}")
        assert page.locator("#runs ~ div tbody .state.running").count() == 1
    renewed(page, "#runs ~ div tbody tr .state.succeeded")
    assert page.locator("#runs ~ div tbody .state.running").count() == 0
    assert len(lab.series()["parameters"][0]["points"]) == 1  # judged
