"""Pictures of the pages at two sizes, light and dark: `python -m tools.screens [FOLDER]`,
`build/screens` by default.
"""

import sys
import tempfile
from pathlib import Path

import httpx

import modalbase
from examples.joint_update import paper_bar_together
from examples.monitoring import State, measured_frfs, post_campaign, structure_body
from service.app.demo.run import Laboratory, _settings
from service.app.supervisor import LocalService
from tests.acceptance.test_browser import more_pages
from tests.support.browser import browser, signed_in, watched_page
from tests.support.profiles import deck
from tests.support.rest import client_at, finished, ok, plain_client, posted
from tests.support.waiting import until

LOOKS = [
    (*size, dark) for size in (("desk", 1400, 900), ("phone", 390, 844)) for dark in (False, True)
]
LISTS = ("", "new", "projects", "update-jobs", "monitors", "trash", "keys", "kit", "nowhere")
RESULT_TABS = ("correlation", "damping", "budget", "convergence", "recipe", "report")
TO_THE_TOP = """scrollTo(0, 0);
for (const part of document.querySelectorAll(".sheet-page")) part.scrollTop = 0"""
LONG = "pultruded GFRP stringer of the second bridge, north abutment, after the third winter"
DRAWN = ".main-svg, .uplot, .wait:not(:text('Drawing …'))"  # or says why not
WATCH = {
    "name": "stringer",
    "recipe": {},
    "parameters": [{"name": "Ex"}],
    "baseline": {"campaigns": 4},
}


def filled(url: str, key: str) -> list[str]:
    """Fill a service with the demonstration's beam, a joint update, a monitor, coupons and hits;
    addresses of its pages.
    """
    with client_at(url, key) as api, modalbase.connect(url, key) as lab:
        done = Laboratory(plain_client(url, dict(api.headers))).update_beam()["provenance"]
        campaign, job = done["campaign"], done["update_job"]
        paper_bar_together(lab)
        joint = ok(api.get(f"projects/{lab.project('one bar, two tests').id}/joint-updates"))[
            "items"
        ][0]["id"]
        bridge = posted(
            api, f"projects/{lab.project('demonstration').id}/structures", structure_body()
        )["id"]
        monitor = posted(api, f"structures/{bridge}/monitors", WATCH)["id"]
        for month in range(1, 8):
            body = {"name": f"month {month}", "performed_at": f"2026-{month:02}-15T12:00:00Z"}
            post_campaign(
                api, bridge, body, measured_frfs(State(stiffness=0.9 if month > 5 else 1.0), month)
            )
        until(
            lambda: ok(api.get(f"monitors/{monitor}"))["state"] == "alarm",
            "the alarm of the monitor",
        )
        bracket = posted(
            api, f"projects/{lab.project('demonstration').id}/structures", {"name": "bracket"}
        )["id"]
        query = {"filename": "angle.inp", "units": "m-N-kg"}
        sent = api.post(f"structures/{bracket}/model", params=query, content=deck())
        finished(api, sent.headers["Location"])
        project = lab.project("demonstration").id
        own = [f"projects/{project}/joint", f"structures/{bridge}/plan", f"compare?job={job}"]
        own += [
            f"structures/{bridge}",
            f"structures/{bracket}",
            f"monitors/{monitor}",
            f"update-jobs/{job}",
        ]
        own += [f"update-jobs/{job}#{tab}" for tab in RESULT_TABS]
        parts = ("", "#files", "#updates", "/update", "/grid-points")
        own += [f"joint-updates/{joint}", *(f"campaigns/{campaign}{part}" for part in parts)]
        own += [f"edit/campaigns/{campaign}", *_empty(api, project)]
        return [*(f"/ui/{path}" for path in (*LISTS, *own)), *more_pages(api, bridge)]


def _empty(api: httpx.Client, project: str) -> list[str]:
    """Pages of a structure with a long name of which nothing was measured."""
    structure = posted(api, f"projects/{project}/structures", {"name": LONG})["id"]
    test = {"name": LONG, "boundary": "free"}
    campaign = posted(api, f"structures/{structure}/campaigns", test)["id"]
    batch = {"name": LONG, "constants": ["Ex"]}
    coupons = posted(api, f"structures/{structure}/coupon-batches", batch)["id"]
    return [f"structures/{structure}", f"campaigns/{campaign}", f"coupon-batches/{coupons}"]


def main(folder: Path) -> None:
    """Take a picture of each page in each look, once its figures are drawn."""
    with (
        tempfile.TemporaryDirectory(prefix="mb-") as data,
        LocalService(_settings(Path(data))) as service,
    ):
        key = service.new_key("screens")
        pages = filled(service.url, key)
        with browser() as running:
            for size, width, height, dark in LOOKS:
                with watched_page(
                    running, service.url, width=width, height=height, dark=dark
                ) as seen:
                    signed_in(seen, key)
                    for number, path in enumerate(pages):
                        seen.visit(path)
                        for figure in seen.page.locator(
                            "figure[data-figure]:visible, [data-frf-viewer]:visible"
                        ).all():
                            figure.scroll_into_view_if_needed()
                            figure.locator(DRAWN).first.wait_for(state="attached")
                        for place in seen.page.locator("[data-space]:visible").all():
                            place.scroll_into_view_if_needed()
                            seen.page.wait_for_selector("[data-space][data-ready]:visible")
                        # Else the head, which stays in sight, would cover its middle.
                        seen.page.evaluate(TO_THE_TOP)
                        look = f"{size}{'-dark' if dark else ''}"
                        name = f"{number:02}-{path.split('/')[2].split('?')[0]}-{look}.png"
                        seen.page.screenshot(path=folder / name, full_page=True)
                        if path.endswith("/nowhere"):
                            seen.complaints.clear()  # the console names the 404


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "build/screens"))
