"""Pages at addresses that nobody meant: the page or an error page says what is wrong, never that
the service is at fault.
"""

from collections.abc import Callable, Iterator
from itertools import product
from typing import Any
from urllib.parse import quote, urlencode
from uuid import uuid4

import httpx
import pytest
from fastapi import FastAPI

from service.app.supervisor import LocalService
from service.pages import add_pages
from service.platform.web.routing import PageRoute, query_names
from tests.support.lengths import long
from tests.support.rest import ok, session_client


@pytest.fixture
def browser(api: httpx.Client, service: LocalService) -> Iterator[httpx.Client]:
    """A client with a session's cookie alone."""
    with session_client(api, base=service.url) as client:
        yield client


MUTATED = (
    *(
        "",
        " ",
        "0",
        "-1",
        "1e400",
        "9" * 40,
        "null",
        "true",
        "x" * 5000,
        "%",
        "'",
        '"',
        "ä\u202e",
        "\x00",
        "<b>",
        "../..",
    ),
    *("[]", "a,b", "1_000", str(uuid4()), "AA==", "name", "-name", "nothing > 3", "CASEI(1,2)='a'"),
)
"""What stands in the place of a parameter of an address."""


@pytest.mark.parametrize("every", [10, long(1)])
def test_no_page_fails_at_a_mutated_address(
    browser: httpx.Client, project: str, structure: str, campaign: str, every: int
) -> None:
    """Finds the address at which a page fails: each parameter of each page in turn replaced by each
    of these values, or by every tenth, others from page to page.
    """
    ids = {
        "project_id": project,
        "structure_id": structure,
        "campaign_id": campaign,
        "item_id": project,
    }
    failed, count = [], 0
    pages = FastAPI()
    add_pages(pages)
    for number, route in enumerate(pages.routes):
        if not isinstance(route, PageRoute) or "GET" not in route.methods:
            continue
        mutated = MUTATED[number % every :: every]
        usual = {name: ids.get(name, str(uuid4())) for name in route.param_convertors} | {
            "noun": "projects"
        }
        queries = product(sorted(query_names(route.dependant)), mutated)
        addresses = [
            route.path.format(**usual),
            *(
                f"{route.path.format(**usual)}?{urlencode({name: value})}"
                for name, value in queries
            ),
            *(
                route.path.format(**(usual | {name: quote(v, safe="")}))
                for name in usual
                for v in mutated
                if v
            ),
        ]
        for address in dict.fromkeys(addresses):
            answer = browser.get(address)
            count += 1
            if answer.status_code >= 500 or (
                answer.status_code < 300 and "<!DOCTYPE html>" not in answer.text[:20]
            ):
                failed.append((answer.status_code, address[:120]))
    assert not failed
    assert count > 500 / every


@pytest.mark.parametrize(
    ("query", "beside"),
    [
        ("for=nothing > 3", 'id="fault">there is no field &#39;nothing&#39;'),
        ("for=CASEI(1,2)='a'", 'id="fault">CASEI takes one text'),
        ("for=T_DURING()", 'id="fault">T_DURING takes a field and a time'),
        ("sort=nothing", "Order: there is no field &#39;nothing&#39;"),
        ("sort=tag", "Order: tag has no order"),
        ("fields=nothing", '<p class="faults" role="alert">there is no field &#39;nothing&#39;'),
        ("cursor=xx", "This page of what was found is not there in this order"),
    ],
)
@pytest.mark.parametrize("noun", ["campaigns", "results"])
def test_what_is_refused_stands_beside_its_field(
    browser: httpx.Client, noun: str, query: str, beside: str
) -> None:
    answer = browser.get(f"/ui/search?noun={noun}&{query}")
    assert answer.status_code == 422
    assert beside in answer.text
    assert "Saved searches" in answer.text or "<h1>Find</h1>" in answer.text


def test_a_value_that_cannot_be_followed_leaves_what_was_found(
    api: httpx.Client, browser: httpx.Client, new_campaign: Callable[..., str]
) -> None:
    campaign = new_campaign()
    modes: list[dict[str, Any]] = [{"frequency_hz": 10.0}]
    ok(api.post(f"campaigns/{campaign}/mode-sets", json={"name": "typed", "modes": modes}), 201)
    answer = browser.get("/ui/search?noun=modes&trend=nothing")
    assert answer.status_code == 422
    assert 'id="no-trend">is &#39;nothing&#39;, expected one of' in answer.text
    assert "1 modes" in answer.text
