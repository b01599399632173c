"""Pictures of every page, for a person to look at: `make screens` leaves them in `build/screens`.

A service of its own is filled with the demonstration's beam, a coupon batch and a monitor; each page is then taken at the
width of a desk and of a phone, light and dark.
"""

from __future__ import annotations

import io
import json
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from playwright.sync_api import Browser, Page

from benchmarks.hammer import campaign as simulated
from examples.joint_update import paper_bar_over_rest
from examples.monitoring import State, measured_frfs, post_campaign, structure_body
from service.app.supervisor import LocalService
from service.settings import Settings
from tests.support.browser import browser, watched_page
from tests.support.laboratory import BEAM
from tests.support.rest import client_at, finished, ok
from tests.support.waiting import until

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "build/screens"
FILE = ROOT / "service/app/demo/paper_beam.uff"
LOOKS = [
    ("desk", 1440, 900, False),
    ("desk-dark", 1440, 900, True),
    ("phone", 390, 844, False),
    ("phone-dark", 390, 844, True),
]


def filled(api: httpx.Client) -> dict[str, str]:
    """Fill a service; the address of each page by its name."""
    project = ok(api.post("projects", json={"name": "bridge deck", "description": "spans 1 to 4"}))["id"]
    structure = ok(api.post(f"projects/{project}/structures", json=BEAM))["id"]
    body = {"name": "March", "boundary": "cantilever", "performed_at": "2026-03-02T09:30:00Z", "temperature_c": 21.5}
    campaign = ok(api.post(f"structures/{structure}/campaigns", json=body))["id"]
    sent = api.post(f"campaigns/{campaign}/imports?filename=beam.uff", content=FILE.read_bytes())
    read = finished(api, sent.headers["location"])
    jobs = [_updated(api, campaign, recipe) for recipe in ({}, {"damping_models": ["rayleigh"], "seed": 1})]
    failed = ok(api.post(f"structures/{structure}/campaigns", json={"name": "without data", "boundary": "free"}))["id"]
    lost = _updated(api, failed, {})
    batch = ok(api.post(f"structures/{structure}/coupon-batches", json={"name": "0°, D3039", "constants": ["Ex"]}))[
        "id"
    ]
    coupons = [
        {"specimen": f"A{i}", "E_Pa": e * 1e9, "nu": 0.16, "failure_code": "AGM"}
        for i, e in enumerate((33.1, 32.6, 33.4))
    ]
    ok(api.post(f"coupon-batches/{batch}/coupons", json=coupons))
    curve = _pulled(api, batch)
    hit = ok(api.post(f"structures/{structure}/campaigns", json={"name": "time blocks", "boundary": "cantilever"}))[
        "id"
    ]
    _hit(api, hit)
    bar = paper_bar_over_rest(api)["campaigns"][0]["campaign_id"]
    owner = ok(api.get(f"structures/{ok(api.get(f'campaigns/{bar}'))['structure_id']}"))["project_id"]
    joint = ok(api.get(f"projects/{owner}/joint-updates"))["items"][0]["id"]
    watched = ok(api.post(f"projects/{project}/structures", json=structure_body()))["id"]
    monitor = _watched(api, watched)
    return {
        "start": "ui/",
        "projects": "ui/projects",
        "project": f"ui/projects/{project}",
        "new-test": "ui/new",
        "structure": f"ui/structures/{watched}",
        "campaign": f"ui/campaigns/{campaign}",
        "import": f"ui/imports/{read['id']}",
        "grid-points": f"ui/campaigns/{campaign}/grid-points",
        "new-update": f"ui/campaigns/{campaign}/update?like={jobs[1]}",
        "updates": "ui/update-jobs",
        "result": f"ui/update-jobs/{jobs[0]}",
        "failed": f"ui/update-jobs/{lost}",
        "compare": f"ui/compare?job={jobs[0]}&job={jobs[1]}",
        "batch": f"ui/coupon-batches/{batch}?curve={curve}",
        "hits": f"ui/campaigns/{hit}",
        "joint": f"ui/joint-updates/{joint}",
        "pair": f"ui/update-jobs/{jobs[0]}?hz=161.9~40&shapes=1~2",
        "monitors": "ui/monitors",
        "monitor": f"ui/monitors/{monitor}",
        "keys": "ui/keys",
        "error": "ui/nowhere",
        "docs": "docs",
    }


def _updated(api: httpx.Client, campaign: str, recipe: Mapping[str, Any]) -> str:
    sent = api.post(f"campaigns/{campaign}/update-jobs", json=recipe)
    return str(finished(api, sent.headers["location"])["id"])


def _pulled(api: httpx.Client, batch: str) -> str:
    """A coupon with a raw curve; its id."""
    coupon = {
        "specimen": "A4",
        "dimensions": {"unit": "mm", "width": [25.0, 25.1], "thickness": [2.0, 2.01]},
        "columns": {
            name: {"header": name, "unit": unit}
            for name, unit in (("force", "N"), ("strain", "µε"), ("transverse_strain", "µε"))
        },
        "failure_code": "LGM",
    }
    rows = [f"{e},{1.66 * e * (1 - 3e-6 * e):.1f},{-0.16 * e:.1f}" for e in range(0, 11500, 50)]
    text = "\n".join(["strain,force,transverse_strain", *rows, "11500,30,-1800"])
    sent = {"files": {"file": ("a4.csv", text.encode())}, "data": {"coupon": json.dumps(coupon)}}
    return str(ok(api.post(f"coupon-batches/{batch}/coupons", **sent))["items"][0]["id"])


def _hit(api: httpx.Client, campaign: str) -> None:
    """Hits of three points, good and bad, as time blocks, processed."""
    hits = [each.hit for each in simulated(np.random.default_rng(16), "clamped", 3, 5, 0.25, 0.0)[2]]
    file = io.BytesIO()
    np.savez(
        file,
        force=np.array([hit.force.samples for hit in hits]),
        acceleration=np.array([hit.responses[0].samples for hit in hits]),
        point=np.array([hit.force.dof.point for hit in hits]),
        hit=np.array([hit.number for hit in hits]),
        fs=np.array(hits[0].sample_rate_hz),
    )
    mapping = {
        "sample_rate_hz": {"variable": "fs"},
        "hit": {"variable": "hit"},
        "channels": [
            {"variable": "force", "quantity": "force", "point": {"variable": "point"}},
            {"variable": "acceleration", "quantity": "acceleration", "point": 99},
        ],
    }
    query = {"filename": "hits.npz", "mapping": json.dumps(mapping)}
    headers = {"Content-Type": "application/octet-stream"}
    ok(api.post(f"campaigns/{campaign}/records", content=file.getvalue(), params=query, headers=headers))
    finished(api, api.post(f"campaigns/{campaign}/processings", json={}).headers["location"])


def _watched(api: httpx.Client, structure: str) -> str:
    """A monitor of a structure that loses stiffness after five months, judged."""
    recipe = {"damping_models": ["rayleigh"], "parameters": [{"name": "Ex"}, {"name": "Gxy", "tied_to": "Ex"}]}
    watch = {"name": "stringer 1", "recipe": recipe, "parameters": [{"name": "Ex"}], "baseline": {"campaigns": 4}}
    monitor = str(ok(api.post(f"structures/{structure}/monitors", json=watch))["id"])
    for month in range(1, 9):
        body = {"name": f"month {month}", "performed_at": f"2026-{month:02}-15T12:00:00Z"}
        post_campaign(api, structure, body, measured_frfs(State(stiffness=1 - 0.03 * max(0, month - 5)), month))
    until(lambda: ok(api.get(f"monitors/{monitor}"))["state"] == "alarm", "the alarm of the monitor")
    return monitor


def take(running: Browser, url: str, key: str, pages: Mapping[str, str], wanted: set[str]) -> list[str]:
    """A picture of each page in each look; what the browser complained of."""
    complaints = []
    for look, width, height, dark in LOOKS:
        with watched_page(running, url, width=width, height=height, dark=dark) as seen:
            seen.page.goto("sign-in")
            _picture(seen.page, "sign-in", look)
            seen.page.fill("#key", key)
            seen.page.press("#key", "Enter")
            seen.page.wait_for_url("**/ui/")
            for name, path in pages.items():
                if not wanted or name in wanted:
                    seen.page.goto(path)
                    _settle(seen.page)
                    _picture(seen.page, name, look)
            complaints += [c for c in seen.complaints if "404" not in c] + seen.strangers
    return complaints


def _settle(page: Page) -> None:
    """Have every figure come into sight and wait until it is drawn."""
    page.wait_for_load_state("networkidle")
    plots = page.locator("figure[data-figure], [data-frf-viewer], [data-over-time] .draw")
    for i in range(plots.count()):
        plot = plots.nth(i)
        plot.scroll_into_view_if_needed()
        plot.locator(".main-svg, .wait:not(:text('Drawing …'))").first.wait_for(state="attached")
    page.evaluate("scrollTo(0, 0)")


def _picture(page: Page, name: str, look: str) -> None:
    page.screenshot(path=FOLDER / f"{name}-{look}.png", full_page=True)


def main() -> int:
    """Take all pictures, or those of the pages that the command line names."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="mb-") as data:
        settings = Settings(data=Path(data), port=0, log_level="error")
        with LocalService(settings) as service, browser() as running:
            key = service.new_key("looker")
            with client_at(service.url, key) as api:
                pages = filled(api)
            complaints = take(running, service.url, key, pages, set(sys.argv[1:]))
    print(f"{len(list(FOLDER.glob('*.png')))} pictures in {FOLDER}")
    print(*complaints, sep="\n")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
