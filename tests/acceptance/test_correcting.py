"""Corrections in the system's Chromium: a campaign, a structure in another unit, members, a hit;
deleted and restored.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from service.app.supervisor import LocalService
from tests.acceptance.test_browser import more_pages, overflow
from tests.integration.test_coupons import CURVE, machine_file
from tests.support.browser import (
    Watched,
    answered,
    held,
    hindrances,
    signed_in,
    watched_page,
)
from tests.support.lengths import long
from tests.support.rest import client_at, finished, ok, posted
from tests.support.waiting import until

if TYPE_CHECKING:
    import httpx
    from playwright.sync_api import Browser, Page

PLATE = {"length_m": 0.5, "width_m": 0.04, "thickness_m": 0.01}
MATERIAL = {"Ex_Pa": 30e9, "Ey_Pa": 30e9, "Gxy_Pa": 5e9, "Gxz_Pa": 5e9, "Gyz_Pa": 5e9, "nu_xy": 0.2}


def bar(api: httpx.Client) -> tuple[str, str]:
    """A project, and a structure in it."""
    project = posted(api, "projects", {"name": "bars"})["id"]
    body = {"name": "bar", "geometry": PLATE, "density_kg_m3": 2000, "material": MATERIAL}
    return project, posted(api, f"projects/{project}/structures", body)["id"]


def saved(page: Page, button: str) -> None:
    """Press a button that leads on to another page, or to this one anew."""
    with page.expect_navigation():
        page.click(f"button:has-text('{button}'):visible")


@pytest.mark.parametrize("whole", [False, long(True)])
def test_what_was_typed_is_corrected_deleted_and_restored(
    running: Browser, service: LocalService, whole: bool
) -> None:
    """A campaign and its modes; in the long run each form of corrections once, from
    the page that it stands on, and on a phone.
    """
    key = service.new_key("corrector")
    service.new_key("colleague")
    with client_at(service.url, key) as api:
        project, structure = bar(api)
        given = {
            "name": "frist",
            "boundary": "cantilever",
            "temperature_c": 21.5,
            "instruments": {"hammer": {"maker": "PCB"}},
        }
        campaign = posted(api, f"structures/{structure}/campaigns", given)["id"]
        with watched_page(running, service.url, webgl=False) as seen:
            page = signed_in(seen, key)
            with held(page, f"**/api/v1/campaigns/{campaign}") as waiting:
                page.goto(f"/ui/edit/campaigns/{campaign}")
                until(waiting, "what is to be corrected")
                assert not page.is_visible("[name=name]")  # what was typed now would be lost
            page.wait_for_selector("button:has-text('Save what was changed'):enabled")
            assert page.input_value("[name='temperature_c']") == "21.5"
            assert page.input_value("[name='instruments/hammer']") == "maker: PCB"
            page.fill("[name=name]", "first")
            page.fill("[name='temperature_c']", "")
            page.fill("[name='inputs/window_rate_per_s']", "2.5")
            page.fill("[name='instruments/sensor_mass_kg']", "4.8")
            saved(page, "Save what was changed")
            now = ok(api.get(f"campaigns/{campaign}"))
            assert (now["name"], now["temperature_c"], now["inputs"]["window_rate_per_s"]) == (
                "first",
                None,
                2.5,
            )
            assert (now["instruments"]["sensor_mass_kg"], now["instruments"]["hammer"]) == (
                0.0048,
                {"maker": "PCB"},
            )
            two = [
                {"frequency_hz": 25.6, "damping_ratio": 0.01},
                {"frequency_hz": 50.0, "damping_ratio": 0.02},
            ]
            posted(api, f"campaigns/{campaign}/mode-sets", {"name": "typed", "modes": two})
            a_mode_is_dropped(page, campaign)
            made = ok(api.get(f"campaigns/{campaign}/mode-sets"))["items"]
            both = [25.6, 50.0]
            assert [[m["frequency_hz"] for m in s["modes"]] for s in made] == [both, [25.6], both]
            assert "hum of the mains" in str(made[1]["details"])
            deleted_and_restored(page, campaign, from_the_trash=whole)
            assert ok(api.get(f"campaigns/{campaign}"))["deleted_at"] is None
            if not whole:
                return
            a_structure_takes_other_units(page, structure)
            thickness = ok(api.get(f"structures/{structure}"))
            assert (thickness["geometry"]["thickness_m"], thickness["version"]) == (0.012, 2)
            assert thickness["material"] == MATERIAL
            a_member_comes_and_changes(page, project)
            roles = {
                m["user"]: m["role"] for m in ok(api.get(f"projects/{project}/members"))["items"]
            }
            assert roles == {"corrector": "owner", "colleague": "viewer"}
            batch, _, hits = more_pages(api, structure)
            judged = api.post(f"campaigns/{hits.rsplit('/', 1)[1]}/processings", json={})
            finished(api, judged.headers["Location"])
            a_hit_is_refused(page, hits)
            decision = ok(api.get(f"campaigns/{hits.rsplit('/', 1)[1]}/hit-decisions"))["items"][0]
            assert (decision["good"], decision["why"], decision["by"]) == (
                False,
                "a cable was touched",
                "corrector",
            )
            page.goto(batch)
            page.click("button:text('Curve')")
            page.wait_for_selector("[data-curve-view] .main-svg")
            assert "curve=" in page.evaluate("location.search")
            page.click("summary:has-text('Exclude')")
            page.fill("[name=exclusion_reason]", "slipped in the grip")
            saved(page, "Exclude A1")
            assert "no: slipped in the grip" in page.inner_text("main")
    with watched_page(running, service.url, width=390, height=844, dark=True) as seen:
        signed_in(seen, key, f"/ui/edit/projects/{project}")
        for noun, item in (
            ("projects", project),
            ("structures", structure),
            ("campaigns", campaign),
        ):
            seen.visit(f"/ui/edit/{noun}/{item}")
            assert overflow(seen) == 0, noun
            assert hindrances(seen.page) == [], noun


def a_mode_is_dropped(page: Page, campaign: str) -> None:
    """R drops the mode that is chosen; the form then asks why and makes a new set, from which the
    mode can be taken back.
    """
    page.goto(f"/ui/campaigns/{campaign}")
    reason = page.locator("form[data-poles] [name=reason]")
    assert not reason.is_visible()
    row = page.locator("tr:has([data-pole='50.0'])")
    row.locator("td").nth(1).click()
    row.press("r")
    assert not page.is_checked("[data-pole='50.0']")
    reason.fill("hum of the mains")
    saved(page, "Save as a new mode set")
    page.wait_for_selector("[data-sets] option:has-text('typed, checked')", state="attached")
    page.locator("[data-pole='50.0']").last.check()
    reason.last.fill("it moves with the mass")
    saved(page, "Save as a new mode set")
    twice = "[data-sets] option:has-text('typed, checked, checked')"
    page.wait_for_selector(twice, state="attached")


def a_structure_takes_other_units(page: Page, structure: str) -> None:
    """What is typed with another unit is shown in the field's own; what is none is refused in
    place.
    """
    page.goto(f"/ui/edit/structures/{structure}")
    page.wait_for_selector("button:has-text('Save what was changed'):enabled")
    assert "is version 2" in page.inner_text("form .hint")
    field = page.locator("[name='geometry/thickness_m']")
    assert field.input_value() == "10"
    field.fill("12 kg")
    page.wait_for_selector(
        "small.understood:has-text('“kg” is no unit of this field; there is mm')"
    )
    assert "is no unit" in field.evaluate("input => input.validationMessage")
    field.fill("0.012 m")
    page.wait_for_selector("small.understood:text-is('= 12 mm')")
    saved(page, "Save what was changed")


def deleted_and_restored(page: Page, campaign: str, from_the_trash: bool) -> None:
    """Deleting says what it hides, and asks; it is taken back at once, or from the trash later."""
    ways = ("#say button:text('Undo')", "[aria-label='Restore first']")
    for words in ways if from_the_trash else ways[:1]:
        page.goto(f"/ui/edit/campaigns/{campaign}")
        page.click("button:has-text('Delete first')")
        with page.expect_navigation():
            asked = answered(page, yes=True)
        assert "hides 0 FRFs and 3 mode sets" in asked
        page.wait_for_selector("#say:has-text('The campaign was deleted.')")
        if "Restore" in words:
            page.goto("/ui/trash")
        with page.expect_navigation():
            page.click(words)
    if from_the_trash:
        page.wait_for_selector("text=Nothing was deleted")


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
    page.goto(f"{hits}#modes")
    page.click("[data-tab=judged]")
    page.locator("summary:text-is('Refuse')").first.click()
    page.locator("[name=why]").first.fill("a cable was touched")
    with page.expect_navigation():
        page.locator("button:has-text('Refuse hit')").first.click()
    page.wait_for_selector("text=refused by corrector")


@pytest.mark.long
def test_pieces_masses_and_what_things_are_found_by_are_corrected(
    running: Browser, service: LocalService
) -> None:
    """Rows are read, added and removed; tags and metadata keep the kinds of their values; what was
    not touched stays. The short form is the test above; rows are added in `test_mapping.py`.
    """
    key = service.new_key("corrector of rows")
    with (
        client_at(service.url, key) as api,
        watched_page(running, service.url, width=390, height=844, dark=True) as seen,
    ):
        project = posted(api, "projects", {"name": "kept"})["id"]
        pieces = [
            {"from_m": 0.1, "to_m": 0.2, "thickness_m": 0.012},
            {"from_m": 0.3, "to_m": 0.4, "thickness_m": 0.009},
        ]
        body = {
            "name": "bar",
            "geometry": PLATE,
            "density_kg_m3": 2000,
            "material": MATERIAL,
            "pieces": pieces,
        }
        meta = {"client": "ACME", "order": "017", "layers": 12}
        structure = posted(
            api, f"projects/{project}/structures", {**body, "tags": ["winter"], "meta": meta}
        )["id"]
        given = {
            "name": "June",
            "boundary": "free",
            "instruments": {"added_masses": [{"x_m": 0.5, "mass_kg": 0.02}]},
        }
        campaign = posted(api, f"structures/{structure}/campaigns", given)["id"]
        page = signed_in(seen, key, f"/ui/edit/structures/{structure}")
        page.wait_for_selector("button:has-text('Save what was changed'):enabled")
        assert page.input_value("[name='pieces/1/thickness_m']") == "9"
        assert set(page.input_value("[name=meta]").split("\n")) == {
            "client: ACME",
            "order: 017",
            "layers: 12",
        }
        assert (overflow(seen), hindrances(page)) == (0, [])
        page.fill("[name='pieces/0/end_thickness_m']", "1.5 cm")
        page.click(
            "[data-rows=pieces] .one:has([name='pieces/1/from_m']) button:has-text('Remove')"
        )
        page.fill("[name=tags]", "winter, pultruded")
        page.fill("[name=meta]", "client: ACME\norder: 017\nlayers: 14")
        page.fill("[name='inputs/thickness_sd_m']", "0.05")
        saved(page, "Save what was changed")
        now = ok(api.get(f"structures/{structure}"))
        assert now["pieces"] == [{**pieces[0], "end_thickness_m": 0.015}]
        assert (now["tags"], now["meta"]) == (["winter", "pultruded"], {**meta, "layers": 14})
        assert (now["inputs"]["thickness_sd_m"], now["inputs"]["length_sd_m"]) == (5e-5, None)
        assert (now["version"], now["material"]) == (2, MATERIAL)
        page.goto(f"/ui/edit/campaigns/{campaign}")
        page.wait_for_selector("button:has-text('Save what was changed'):enabled")
        page.click("[data-rows='instruments/added_masses'] button:has-text('Add one')")
        page.fill("[name='instruments/added_masses/1/x_m']", "250")
        page.fill("[name='instruments/added_masses/1/mass_kg']", "8")
        assert (overflow(seen), hindrances(page)) == (0, [])
        saved(page, "Save what was changed")
        masses = ok(api.get(f"campaigns/{campaign}"))["instruments"]["added_masses"]
        assert [(mass["x_m"], mass["mass_kg"]) for mass in masses] == [(0.5, 0.02), (0.25, 0.008)]


@pytest.mark.long
def test_raw_curves_are_reduced_and_the_next_begins_as_the_one_before(
    seen: Watched, api: httpx.Client
) -> None:
    """A German machine's file: its columns are offered, unknown sizes are asked for again; the
    second needs its sizes alone. `integration/test_coupons.py` has the file by REST, and
    `test_mapping.py` a form of columns, in short.
    """
    project = posted(api, "projects", {"name": "coupons"})["id"]
    structure = posted(api, f"projects/{project}/structures", {"name": "bar"})["id"]
    body = {"name": "0 degrees", "constants": ["Ex", "nu_xy"]}
    batch = posted(api, f"structures/{structure}/coupon-batches", body)["id"]
    page = seen.goto(f"/ui/coupon-batches/{batch}")
    page.click("summary:has-text('Record a raw curve')")
    for number in (1, 2):  # the second time it stands open, filled in
        data = machine_file(CURVE).replace(b"Nr. 17", f"Nr. {number}".encode())
        page.set_input_files(
            "[data-raw-curve] [name=file]",
            {"name": f"A{number}.csv", "mimeType": "text/csv", "buffer": data},
        )
        page.wait_for_selector("[data-raw-curve] datalist option", state="attached")
        found = [
            page.input_value(f"[name='columns/{series}/header']")
            for series in ("force", "strain", "transverse_strain")
        ]
        assert found == ["Kraft", "Längsdehnung", "Querdehnung"]
        page.fill("[name='dimensions/width']", "25.02, 25.00, 24.98" if number == 1 else "25.0")
        page.fill("[name='dimensions/thickness']", "2.01, 2.00, 1.99" if number == 1 else "2.0")
        assert hindrances(page) == []
        saved(page, "Reduce and record it")
    data = machine_file([(row[0] + 228_000, *row[1:]) for row in CURVE])
    page.set_input_files(
        "[data-raw-curve] [name=file]",
        {"name": "A3.csv", "mimeType": "text/csv", "buffer": data},
    )
    page.fill("[name='dimensions/width']", "25.0")
    page.fill("[name='dimensions/thickness']", "2.0")
    page.click("button:has-text('Reduce and record it')")
    page.wait_for_selector(".faults:has-text('zero it at its first reading')")
    assert '"' not in page.inner_text("[data-raw-curve] .faults")
    page.select_option("[name='zero/strain']", "first")
    saved(page, "Reduce and record it")
    specimens = ok(api.get(f"coupon-batches/{batch}/coupons"))["items"]
    assert [row["specimen"] for row in specimens] == ["A1", "A2", "A3"]
    # by hand in docs/coupons.md
    assert [row["E_Pa"] for row in specimens] == pytest.approx([39.5074e9] * 3, rel=2e-6)
    # of the curve that was refused
    assert ["422" in complaint for complaint in seen.complaints] == [True]
    seen.complaints.clear()
