"""Three years of a footbridge, with fewer campaigns: each question has the same answer by page,
library and command.
"""

import html
import json
import re
import sys
from collections.abc import Callable
from types import SimpleNamespace

import httpx
import numpy as np
import pytest

import modalbase
from examples.footbridge import HAMMERS, LOSS, PER_KELVIN, QUESTIONS, campaign_of, main
from examples.monitoring import State, grid_points
from modalbase.objects.campaigns import Campaign
from service.app.supervisor import LocalService
from tests.support.command import modalbase_here
from tests.support.lengths import long
from tests.support.places import ROOT
from tests.support.rest import session_client

CAMPAIGNS = 5
PAGE = (ROOT / "docs" / "footbridge.md").read_text(encoding="utf-8")


def expected(stringers: int) -> dict[str, int]:
    """What the first questions must find, from what is made."""
    made = [campaign_of(number, CAMPAIGNS) for number in range(CAMPAIGNS)]
    lapsed = sum("2024-04-01" <= f"{when:%Y-%m-%d}" < "2024-10-01" for _, when in made)
    counts = {
        "campaigns above 25 °C": stringers
        * sum(stated["temperature_c"] > 25 for stated, _ in made),
        "winters of the north stringer": sum(stated["tags"] == ["winter"] for stated, _ in made),
        "what was measured with the other hammer": (
            stringers
            * sum(stated["instruments"]["hammer"]["model"] != HAMMERS[0] for stated, _ in made)
        ),
        "what the expired calibration touched": stringers * lapsed,
        "driving-point FRFs of sensor 30517": stringers * CAMPAIGNS,
        "FRFs of 2024 with the force at point 3": stringers
        * sum(when.year == 2024 for _, when in made),
        "first bending modes": stringers * CAMPAIGNS,
    }
    assert all(counts.values())
    return counts


def typed(campaign: Campaign) -> SimpleNamespace:
    """A bending mode, in the place of an update."""
    campaign.new_mode_set("typed", [{"frequency_hz": 25.0}])
    return SimpleNamespace(wait=lambda: SimpleNamespace(check=lambda: None))


def few_lines(_: State, seed: int) -> np.ndarray:
    """FRFs of three lines, in the place of those of a model."""
    return np.full((len(grid_points()), 3), 1.0 + seed, complex)


@pytest.fixture
def key(service: LocalService, stringers: int, updated: bool) -> str:
    """The key of a laboratory that has run the script as a user does, on one stringer or both."""
    key = service.new_key(f"bridge warden of {stringers}")
    with pytest.MonkeyPatch.context() as patch:
        if not updated:
            patch.setattr(Campaign, "update", typed)
            patch.setattr("examples.footbridge.LINES_HZ", np.arange(1.0, 4.0))
            patch.setattr("examples.footbridge.measured_frfs", few_lines)
        for name in list(LOSS)[stringers:]:
            patch.delitem(LOSS, name)
        words = ["--url", service.url, "--key", key, "--campaigns", str(CAMPAIGNS)]
        patch.setattr(sys, "argv", ["examples.footbridge", *words])
        main()
    return key


def test_every_question_is_on_the_page_of_the_documents() -> None:
    for number, (words, noun, text) in enumerate(QUESTIONS, 1):
        assert f"| {number} | {words} | `{noun}` | `{text}` |" in PAGE
    assert len(QUESTIONS) == 10


@pytest.mark.parametrize(("stringers", "updated"), [(1, False), long(2, True)])
def test_page_library_and_command_give_one_answer(
    service: LocalService,
    key: str,
    new_client: Callable[..., httpx.Client],
    stringers: int,
    updated: bool,
) -> None:
    """Ten questions of the guide by three doors, over updated campaigns in the long run."""
    place = {"MODALBASE_URL": service.url, "MODALBASE_API_KEY": key}
    headers = {"Authorization": f"Bearer {key}"}
    known = expected(stringers)
    with (
        modalbase.connect(service.url, key) as lab,
        session_client(new_client(), headers, service.url) as browser,
    ):
        for words, noun, text in QUESTIONS:
            count = lab.find(noun, text).count
            assert count == known.get(words, count), words
            assert (count > 0) is (updated or noun != "results"), words
            said = modalbase_here("find", noun, text, "--json", **place)
            assert json.loads(said.stdout)["count"] == count, said.stderr
            page = browser.get("/ui/search", params={"noun": noun, "for": text}).text
            shown = re.search(r'<h2 id="count">([\d,]+) |Nothing is found', page)
            assert shown is not None, html.unescape(page)
            assert int((shown[1] or "0").replace(",", "")) == count
        if not updated:
            return
        trends_have_what_was_made(lab)


def trends_have_what_was_made(lab: modalbase.Laboratory) -> None:
    constants = lab.find(*QUESTIONS[-1][1:]).trend("Ex").series
    modes = lab.find(*QUESTIONS[-2][1:]).trend().series
    for series, share in [*((one, 1.0) for one in constants), *((one, 0.5) for one in modes)]:
        beside = series["lines"][1]
        low, high = beside["relative_interval_95"]
        made = -LOSS[series["structure_name"]] * share
        # the loss is of the stiffness when new
        assert low - 0.001 < made < high + 0.001, series["structure_name"]
        effect, _ = beside["effects"]["temperature_c"]
        mean = sum(point["value"] for point in series["points"]) / len(series["points"])
        assert effect / mean == pytest.approx(-PER_KELVIN * share, rel=0.2)
    assert {series["name"] for series in modes} == {"mode 1"}
