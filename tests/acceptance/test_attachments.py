"""Files beside a campaign in the system's Chromium: dropped, shown, removed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from PIL import Image

from service.app.supervisor import LocalService
from tests.acceptance.test_browser import overflow
from tests.support.browser import answered, hindrances, signed_in, watched_page
from tests.support.furnished import MONITOR
from tests.support.laboratory import BEAM
from tests.support.lengths import long
from tests.support.rest import client_at, posted

if TYPE_CHECKING:
    from playwright.sync_api import Browser


@pytest.mark.parametrize(
    ("width", "nouns"), [(390, ["monitors"]), long(1400, ["projects", "structures", "monitors"])]
)
def test_what_is_dropped_is_shown_and_can_be_removed(
    running: Browser, service: LocalService, tmp_path: Path, width: int, nouns: list[str]
) -> None:
    """On the page of each noun, as they share one part; a name is text, whatever it holds."""
    key = service.new_key("photographer")
    with client_at(service.url, key) as api:
        ids = {"projects": posted(api, "projects", {"name": "photos"})["id"]}
        ids["structures"] = posted(api, f"projects/{ids['projects']}/structures", BEAM)["id"]
        path = f"structures/{ids['structures']}/monitors"
        ids["monitors"] = posted(api, path, MONITOR)["id"]
    image, other = tmp_path / "clamp.png", tmp_path / "<img src=x onerror=alert(1)>.txt"
    Image.new("RGB", (400, 300), "red").save(image)
    other.write_text("notes")
    with watched_page(running, service.url, width=width, webgl=False) as seen:
        page = signed_in(seen, key)
        for noun in nouns:
            page.goto(f"/ui/{noun}/{ids[noun]}")
            page.set_input_files("[data-attached] [type=file]", [image, other])
            page.wait_for_selector(f".attached a:has-text('{other.name}')")
            with page.expect_response(lambda answer: answer.request.method == "PATCH") as changed:
                page.fill(f"[aria-label='Caption of {image.name}']", "from behind")
                page.press(f"[aria-label='Caption of {image.name}']", "Tab")
            assert changed.value.status == 200
            shown = page.locator(".attached img[alt='from behind']")
            shown.wait_for()
            shown.scroll_into_view_if_needed()
            page.wait_for_function("document.querySelector('.attached img').naturalWidth === 400")
            assert hindrances(page) == []
            assert overflow(seen) == 0
            page.click(f"[aria-label='Remove {image.name}']")
            answered(page, yes=True)
            shown.wait_for(state="detached")
            assert page.locator(".attached li").count() == 1
