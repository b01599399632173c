"""Pages as a browser without scripts gets them: who sees what, what the policy allows, what an
error looks like; the guide.
"""

import gzip
import json
import re
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any
from urllib.parse import unquote
from uuid import uuid4

import httpx
import psycopg
import pytest

from service.app.supervisor import LocalService
from service.pages.guide.contents import addresses
from service.pages.look import FOLDER
from tests.support.rest import ok, session_client
from tests.support.uff import dataset
from tests.support.waiting import until

Imported = Callable[..., dict[str, Any]]


@pytest.fixture
def browser(api: httpx.Client, service: LocalService) -> Iterator[httpx.Client]:
    """A client with a session's cookie alone."""
    with session_client(api, base=service.url) as client:
        yield client


def test_pages_show_what_is_there(
    api: httpx.Client,
    browser: httpx.Client,
    project: str,
    structure: str,
    new_campaign: Callable[..., str],
    imported: Imported,
) -> None:
    points = imported(
        new_campaign(name="with a file"),
        dataset("15", f"{1:10d}{0:10d}{0:10d}{0:10d}" + 3 * f"{1:13.5e}"),
    )
    campaign = new_campaign()
    never_calibrated = api.post(
        f"projects/{project}/instruments", json={"kind": "hammer", "serial": "30517"}
    )
    assert never_calibrated.status_code == 201, never_calibrated.text
    modes = [{"frequency_hz": 10.0, "frequency_sd_hz": 0.02}, {"frequency_hz": 20.0}]
    both, less = (
        ok(api.post(f"campaigns/{campaign}/mode-sets", json={"name": name, "modes": some}), 201)[
            "id"
        ]
        for name, some in (("both", modes), ("less", modes[:1]))
    )
    places = {
        "/ui/": "Recent tests",
        "/ui/trash": "Nothing was deleted",
        "/ui/projects": "tests",
        f"/ui/projects/{project}": "FRP beam",
        f"/ui/structures/{structure}": "33.05 GPa",
        f"/ui/campaigns/{campaign}": "cantilever",
        f"/ui/campaigns/{campaign}/grid-points": "No grid point yet",
        f"/ui/campaigns/{campaign}/update": "Damping models",
        "/ui/new": "Store the test",
        "/ui/update-jobs": "No update yet",
        "/ui/compare": "Choose results",
        "/ui/monitors": "No monitor yet",
        "/ui/search?noun=structures&for=FRP": "1 structures",
        "/ui/search?noun=results&for=Ex < 30e9 AND tag = 'x'": "Nothing is found",
        "/ui/search?noun=modes&for=frequency_sd_hz = 0.02": "± 0.020",
        # the second mode has no partner
        f"/ui/compare?set={both}&set={less}": "<td>20.000</td><td>–</td>",
        "/ui/keys": "Begins with",
        f"/ui/imports/{points['id']}": "1 grid point",
    }
    for path, words in places.items():
        answer = browser.get(path)
        assert answer.status_code == 200, f"{path}: {answer.text}"
        assert words in " ".join(answer.text.split()), path
        assert not re.search(r"\sstyle=|\son\w+=|<style|<script>", answer.text), (
            f"{path} has what the policy forbids"
        )
        named = re.findall(r'(?:src|href)="([^"#]+)', answer.text)
        assert not [name for name in named if "://" in name or name.startswith("//")], path


def test_a_page_shows_one_moment(
    api: httpx.Client, browser: httpx.Client, service: LocalService, campaign: str
) -> None:
    """What is stored while a page gathers what it shows is on none of its parts."""
    waits = "SELECT 1 FROM pg_locks WHERE NOT granted AND relation = 'processings'::regclass"
    path = f"/ui/campaigns/{campaign}"
    with psycopg.connect(service.settings.database_url) as holding, ThreadPoolExecutor(1) as beside:
        holding.execute("LOCK TABLE processings IN ACCESS EXCLUSIVE MODE")
        pending = beside.submit(browser.get, path)
        until(
            lambda: holding.execute(waits).fetchone(),
            "the page waits for the processings, in the middle of its parts",
        )
        ok(
            api.post(
                f"campaigns/{campaign}/mode-sets",
                json={"name": "later", "modes": [{"frequency_hz": 10.0}]},
            ),
            201,
        )
        holding.rollback()
        assert "No modes yet" in pending.result().text
    then = browser.get(path).text
    assert "No modes yet" not in then
    assert "later" in then


def test_the_policy_lets_a_page_ask_nobody_else(browser: httpx.Client) -> None:
    policy = dict(
        rule.split(" ", 1)
        for rule in browser.get("/ui/").headers["content-security-policy"].split("; ")
    )
    assert policy["default-src"] == policy["form-action"] == policy["frame-ancestors"] == "'none'"
    assert policy["script-src"] == policy["connect-src"] == "'self'"
    words = {word for rule in policy.values() for word in rule.split()}
    assert not [
        word for word in words if "unsafe" in word or "*" in word or ":" in word.removesuffix(":")
    ]


def test_who_has_no_session_is_led_to_the_sign_in_and_back(service: LocalService) -> None:
    with httpx.Client(base_url=service.url, trust_env=False, timeout=60) as nobody:
        answer = nobody.get("/ui/update-jobs?status=failed")
        assert answer.status_code == 303
        assert unquote(answer.headers["location"]) == "../sign-in?next=ui/update-jobs?status=failed"
        assert "API key" in nobody.get("/sign-in").text
        piece = nobody.get("/ui/update-jobs", headers={"HX-Request": "true"})
        assert piece.headers["hx-redirect"].endswith("sign-in?next=ui%2Fupdate-jobs")


def test_what_is_not_ones_own_is_not_found_on_a_page(
    browser: httpx.Client,
    new_client: Callable[[], httpx.Client],
    service: LocalService,
    campaign: str,
) -> None:
    with session_client(new_client(), base=service.url) as other:
        for path in (
            f"/ui/campaigns/{campaign}",
            f"/ui/campaigns/{uuid4()}",
            "/ui/campaigns/x",
            "/ui/nowhere",
        ):
            answer = other.get(path)
            assert answer.status_code == 404, path
            assert answer.headers["content-type"].startswith("text/html"), path
            assert "<h1>Not Found</h1>" in answer.text
    assert browser.get(f"/ui/campaigns/{campaign}").status_code == 200
    wrong = browser.put("/ui/projects", headers={"Origin": service.url})
    assert (wrong.status_code, "GET" in wrong.headers["allow"]) == (405, True)
    many = browser.get("/ui/compare", params={"job": [str(uuid4()) for _ in range(51)]})
    assert many.status_code == 422
    assert "names 51 results, at most 50 are compared at a time" in many.text


def test_names_are_shown_and_not_run(
    api: httpx.Client, browser: httpx.Client, structure: str
) -> None:
    name = "<script>alert(1)</script>"
    campaign = ok(
        api.post(f"structures/{structure}/campaigns", json={"name": name, "boundary": "free"}), 201
    )["id"]
    text = browser.get(f"/ui/campaigns/{campaign}").text
    assert name not in text
    assert "&lt;script&gt;alert(1)" in text


def test_files_of_pages_are_kept_by_browsers_and_sent_compressed(browser: httpx.Client) -> None:
    (address,) = re.findall(r'src="\.\./(static/[^"]+/pages\.js)"', browser.get("/ui/").text)
    answer = browser.get(f"/{address}", headers={"Accept-Encoding": "gzip"})
    assert answer.text == (FOLDER / "pages.js").read_text()
    assert "immutable" in answer.headers["cache-control"]
    assert answer.headers["content-encoding"] == "gzip"
    assert int(answer.headers["content-length"]) < len(gzip.compress(answer.content)) + 100
    assert (
        browser.get(f"/{address}", headers={"If-None-Match": answer.headers["etag"]}).status_code
        == 304
    )
    for wrong in (
        "/static/0/pages.js",
        "/static/0/../../settings.py",
        "/static/0/%2e%2e/%2e%2e/settings.py",
    ):
        assert browser.get(wrong).status_code == 404


# --- the guide as the service gives it
# ----------------------------------------------------------------------------------


def test_every_page_of_the_guide_is_served_to_anybody(service: LocalService) -> None:
    with httpx.Client(base_url=f"{service.url}/guide/", trust_env=False, timeout=60) as anybody:
        for address in addresses():
            answer = anybody.get(address)
            assert answer.status_code == 200, address
            policy = answer.headers["content-security-policy"]
            assert policy.startswith("default-src 'none'")
            assert "script" not in policy
            assert "unsafe" not in policy
        front = anybody.get("")
        assert front.text == anybody.get("index.html").text
        assert anybody.get("images/beam.svg").headers["content-type"] == "image/svg+xml"
        assert anybody.get("", headers={"if-none-match": front.headers["etag"]}).status_code == 304
        assert anybody.get(f"{service.url}/guide").headers["location"] == "guide/"
        for wrong in (
            "nowhere.html",
            "index.md",
            "../app.py",
            "%2e%2e/app.py",
            "decisions/",
            "x" * 5000,
        ):
            assert anybody.get(wrong).status_code == 404, wrong
        style = front.text.partition('rel="stylesheet" href="')[2].partition('"')[0]
        assert anybody.get(style).headers["content-type"].startswith("text/css")


def test_points_are_joined_along_the_files_trace_lines(
    browser: httpx.Client, new_campaign: Callable[..., str], imported: Imported
) -> None:
    campaign = new_campaign()
    rows = [
        f"{n:10d}{0:10d}{0:10d}{0:10d}{x:13.5e}{y:13.5e}{0:13.5e}"
        for n, x, y in ((1, 0, 0), (2, 1, 0), (3, 0, 1))
    ]
    line = dataset(
        "82", f"{1:10d}{4:10d}{0:10d}", "edge", "".join(f"{point:10d}" for point in (2, 3, 0, 1))
    )
    read = imported(campaign, dataset("15", *rows) + line)
    assert [(each["type"], each["outcome"]) for each in read["datasets"]] == [
        ("15", "read"),
        ("82", "read"),
    ]
    page = browser.get(f"/ui/campaigns/{campaign}").text
    match = re.search(r'id="in-space">(.*?)</script>', page)
    assert match
    assert json.loads(match.group(1))["joined"] == [[1, 2]]


@pytest.mark.parametrize(
    ("question", "first", "text"),
    [
        ("zweifel prior", None, "No section has all of"),
        ("", None, "Type words that a page has"),
        ("<scriptum> & 'x'", None, "No section has all of"),
        ("Restore backup", "database.html", "<mark>backup</mark>"),
        ("COUPON prior", "coupons.html", "<mark>prior"),
    ],
)
def test_the_guide_is_searched(
    service: LocalService, question: str, first: str | None, text: str
) -> None:
    with httpx.Client(base_url=f"{service.url}/guide/", trust_env=False, timeout=60) as anybody:
        answer = anybody.get("search", params={"q": question})
        assert answer.status_code == 200
        assert text in answer.text
        assert "<script" not in answer.text
        hits = re.findall(r'<li><a href="([^"#]+\.html)#([^"]+)">', answer.text.partition("<ol")[2])
        assert (hits[0][0] if hits else None) == first
        for address, anchor in hits[:3]:
            assert f'id="{anchor}"' in anybody.get(address).text
