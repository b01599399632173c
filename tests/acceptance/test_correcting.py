"""Corrections in the system's Chromium: a campaign, a structure in another unit, members, a hit; deleted and restored."""

from __future__ import annotations

from typing import TYPE_CHECKING

from service.app.supervisor import LocalService
from tests.acceptance.test_browser import more_pages, overflow, signed_in
from tests.support.browser import hindrances, watched_page
from tests.support.rest import client_at, ok, posted
from tests.support.waiting import until

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

PLATE = {"length_m": 0.5, "width_m": 0.04, "thickness_m": 0.01}
MATERIAL = {"Ex_Pa": 30e9, "Ey_Pa": 30e9, "Gxy_Pa": 5e9, "Gxz_Pa": 5e9, "Gyz_Pa": 5e9, "nu_xy": 0.2}


def saved(page: Page, button: str) -> None:
    """Press a button that leads on to another page, or to this one anew."""
    with page.expect_navigation():
        page.click(f"button:has-text('{button}')")


def test_what_was_typed_is_corrected_deleted_and_restored(running: Browser, service: LocalService) -> None:
    key = service.new_key("corrector")
    service.new_key("colleague")
    with client_at(service.url, key) as api:
        project = posted(api, "projects", {"name": "corrections"})["id"]
        body = {"name": "bar", "geometry": PLATE, "density_kg_m3": 2000, "material": MATERIAL}
        structure = posted(api, f"projects/{project}/structures", body)["id"]
        given = {
            "name": "frist",
            "boundary": "cantilever",
            "temperature_c": 21.5,
            "instruments": {"hammer": {"maker": "PCB"}},
        }
        campaign = posted(api, f"structures/{structure}/campaigns", given)["id"]
        batch, _, hits = more_pages(api, structure)
        ok(api.post(f"campaigns/{hits.rsplit('/', 1)[1]}/processings", json={}), 202)
        with watched_page(running, service.url) as seen:
            page = signed_in(seen, key, f"/ui/edit/campaigns/{campaign}")
            page.wait_for_selector("button:has-text('Save what was changed'):enabled")
            assert page.input_value("[name='temperature_c']") == "21.5"
            assert page.input_value("[name='instruments/hammer']") == "maker: PCB"
            page.fill("[name=name]", "first")
            page.fill("[name='temperature_c']", "")
            page.fill("[name='inputs/window_rate_per_s']", "2.5")
            page.fill("[name='instruments/sensor_mass_kg']", "4.8")
            saved(page, "Save what was changed")
            now = ok(api.get(f"campaigns/{campaign}"))
            assert (now["name"], now["temperature_c"], now["inputs"]["window_rate_per_s"]) == ("first", None, 2.5)
            assert (now["instruments"]["sensor_mass_kg"], now["instruments"]["hammer"]) == (0.0048, {"maker": "PCB"})
            two = [{"frequency_hz": 25.6, "damping_ratio": 0.01}, {"frequency_hz": 50.0, "damping_ratio": 0.02}]
            posted(api, f"campaigns/{campaign}/mode-sets", {"name": "typed", "modes": two})
            a_mode_is_dropped(page, campaign)
            made = ok(api.get(f"campaigns/{campaign}/mode-sets"))["items"]
            assert [[m["frequency_hz"] for m in s["modes"]] for s in made] == [[25.6, 50.0], [25.6]]
            assert "hum of the mains" in str(made[1]["details"])
            a_structure_takes_other_units(page, structure)
            thickness = ok(api.get(f"structures/{structure}"))
            assert (thickness["geometry"]["thickness_m"], thickness["version"]) == (0.012, 2)
            assert thickness["material"] == MATERIAL
            deleted_and_restored(page, campaign, structure)
            assert ok(api.get(f"campaigns/{campaign}"))["deleted_at"] is None
            a_member_comes_and_changes(page, project)
            roles = {m["user"]: m["role"] for m in ok(api.get(f"projects/{project}/members"))["items"]}
            assert roles == {"corrector": "owner", "colleague": "viewer"}
            a_hit_is_refused(page, hits)
            decision = ok(api.get(f"campaigns/{hits.rsplit('/', 1)[1]}/hit-decisions"))["items"][0]
            assert (decision["good"], decision["why"], decision["by"]) == (False, "a cable was touched", "corrector")
            page.goto(batch)
            page.click("summary:has-text('Exclude')")
            page.fill("[name=exclusion_reason]", "slipped in the grip")
            saved(page, "Exclude A1")
            assert "no: slipped in the grip" in page.inner_text("main")
            assert (seen.complaints, seen.strangers) == ([], [])
    with watched_page(running, service.url, width=390, height=844, dark=True) as seen:
        signed_in(seen, key, f"/ui/edit/projects/{project}")
        for noun, item in (("projects", project), ("structures", structure), ("campaigns", campaign)):
            seen.visit(f"/ui/edit/{noun}/{item}")
            assert overflow(seen) == 0, noun
            assert hindrances(seen.page) == [], noun
        assert (seen.complaints, seen.strangers) == ([], [])


def a_mode_is_dropped(page: Page, campaign: str) -> None:
    """A box that is turned shows the form, which asks why and makes a new set."""
    page.goto(f"/ui/campaigns/{campaign}")
    reason = page.locator("form[data-poles] [name=reason]")
    assert not reason.is_visible()
    page.click("[data-pole='50.0']")
    reason.fill("hum of the mains")
    saved(page, "Save as a new mode set")
    page.wait_for_selector("summary:has-text('typed, checked')")


def a_structure_takes_other_units(page: Page, structure: str) -> None:
    """What is typed with another unit stands in the field's own; what is none is refused in place."""
    page.goto(f"/ui/edit/structures/{structure}")
    page.wait_for_selector("button:has-text('Save what was changed'):enabled")
    assert "is version 2" in page.inner_text("form .hint")
    field = page.locator("[name='geometry/thickness_m']")
    assert field.input_value() == "10"
    field.fill("12 kg")
    assert "A number in mm" in field.evaluate("input => input.validationMessage")
    field.fill("0.012 m")
    field.blur()
    assert field.input_value() == "12"
    saved(page, "Save what was changed")


def deleted_and_restored(page: Page, campaign: str, structure: str) -> None:
    """Deleting says what it hides, and asks; the structure's page of corrections brings it back."""
    page.goto(f"/ui/edit/campaigns/{campaign}")
    asked: list[str] = []
    page.once("dialog", lambda dialog: (asked.append(dialog.message), dialog.accept()))
    saved(page, "Delete first")
    assert "hides 0 FRFs and 2 mode sets" in asked[0]
    page.goto(f"/ui/edit/structures/{structure}")
    with page.expect_navigation():
        page.click("[aria-label='Restore first']")


def a_member_comes_and_changes(page: Page, project: str) -> None:
    """A user is added by name, and another role is given."""
    page.goto(f"/ui/edit/projects/{project}")
    page.fill("[name=who]", "colleague")
    page.click("#members ~ form button:has-text('Add')")
    page.wait_for_selector("[aria-label='Role of colleague']")
    page.select_option("[aria-label='Role of colleague']", "viewer")
    with page.expect_navigation():
        page.click("[aria-label='Change the role of colleague']")


def a_hit_is_refused(page: Page, hits: str) -> None:
    """A hit that was used is refused with a reason, and the page says who did."""

    def judged() -> bool:
        page.goto(hits)
        return page.locator("summary:text-is('Refuse')").count() > 0

    until(judged, "the hits are judged")
    page.locator("summary:text-is('Refuse')").first.click()
    page.locator("[name=why]").first.fill("a cable was touched")
    with page.expect_navigation():
        page.locator("button:has-text('Refuse hit')").first.click()
    page.wait_for_selector("text=refused by corrector")
