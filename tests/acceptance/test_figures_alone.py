"""Figures in the system's Chromium: a drawing opened alone has its colours; a zoom into hits
fetches what is in view.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from urllib.parse import parse_qs, urlsplit

import pytest

from tests.acceptance.test_correcting import bar
from tests.support.browser import Watched, drawn
from tests.support.lengths import long
from tests.support.rest import posted

if TYPE_CHECKING:
    import httpx
    from playwright.sync_api import Page

HITS = "figure[data-figure$='/figures/hits']"
X_OF_THE_RESPONSE = (
    f'document.querySelector("{HITS} .js-plotly-plot").data.find((trace) => trace.xaxis ==='
    " 'x2').x"
)
STYLES = 'document.querySelectorAll("path, use")].map((one) => getComputedStyle(one))'
COLORS = f"() => [...{STYLES}.map((style) => [style.fill, style.stroke])"


def a_drawing_opened_alone_has_its_colours(page: Page, campaign: str) -> None:
    for theme, ground in (("light", "rgb(255, 255, 255)"), ("dark", "rgb(20, 23, 26)")):
        page.goto(f"/api/v1/campaigns/{campaign}/figures/hits?format=svg&theme={theme}")
        first, *_ = colors = page.evaluate(COLORS)
        assert first[0] == ground
        assert len({fill for fill, _ in colors}) > 2
        assert len({stroke for _, stroke in colors}) > 3


@pytest.mark.parametrize("alone", [False, long(True)])
def test_what_a_zoom_brings_into_view_is_fetched(
    seen: Watched, api: httpx.Client, alone: bool
) -> None:
    """The response of a hit of 16,384 samples: of the whole the least and greatest of each stretch,
    of a part all. The drawing alone has its colours.
    """
    _, structure = bar(api)
    campaign = posted(
        api, f"structures/{structure}/campaigns", {"name": "hits", "boundary": "free"}
    )["id"]
    posted(api, f"campaigns/{campaign}/records", long_hit(16_384, 16_384.0))
    page = seen.goto(f"/ui/campaigns/{campaign}")
    drawn(page, HITS)
    inside = f"{X_OF_THE_RESPONSE}.filter((x) => x >= 0.5 && x <= 0.51).length"
    assert page.evaluate(inside) < 40
    page.evaluate(
        f"document.querySelector(\"{HITS}\").addEventListener('in-view', () =>"
        " document.body.dataset.inView = 'yes')"
    )
    with page.expect_response("**/figures/hits?*tmin=*") as fetched:
        page.evaluate(
            f'Plotly.relayout(document.querySelector("{HITS} .js-plotly-plot"),'
            " {'xaxis2.range': [0.5, 0.51]})"
        )
    asked = parse_qs(urlsplit(fetched.value.url).query)
    assert (asked["tmin"], asked["tmax"]) == (["0.5"], ["0.51"])
    page.wait_for_selector("[data-in-view=yes]")
    assert page.evaluate(inside) >= 163
    assert page.evaluate(
        f'document.querySelector("{HITS} .js-plotly-plot").layout.xaxis2.range'
    ) == [0.5, 0.51]
    if alone:
        a_drawing_opened_alone_has_its_colours(page, campaign)


def long_hit(count: int, rate: float) -> dict[str, object]:
    """One hit with a ringing that lasts."""
    force = [100.0 * (160 <= k < 170) for k in range(count)]
    ringing = [((7 * k) % 31 - 15) * 0.1 for k in range(count)]
    mapping = {
        "sample_rate_hz": {"variable": "fs"},
        "channels": [
            {"variable": "force", "quantity": "force", "point": 1},
            {"variable": "a", "quantity": "acceleration", "point": 2},
        ],
    }
    return {"variables": {"fs": rate, "force": force, "a": ringing}, "mapping": mapping}
