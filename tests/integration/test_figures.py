"""Figures of an update: what they draw is what the result says, in every format; where there is nothing to draw they say why.

One job, the demonstration's, is shared by all.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import cycle
from typing import Any
from uuid import uuid4

import httpx
import numpy as np
import pytest

from service.demo.laboratory import Laboratory
from service.supervisor import LocalService
from tests.support.rest import client_at, ok

BEGINNINGS = {"plotly": b'{"data":', "svg": b"<?xml", "png": b"\x89PNG", "pdf": b"%PDF"}


@dataclass(frozen=True)
class Done:
    """A job that has a result."""

    api: httpx.Client
    result: dict[str, Any]

    @property
    def path(self) -> str:
        return f"update-jobs/{self.result['provenance']['update_job']}"

    def address(self, item: dict[str, Any]) -> httpx.URL:
        """Of a figure in a list, from the service's root."""
        return self.api.base_url.join(item["href"])

    def figure(self, name: str, **query: Any) -> dict[str, Any]:
        found: dict[str, Any] = ok(self.api.get(f"{self.path}/figures/{name}", params=query), 200)
        return found


@pytest.fixture(scope="module")
def demo(service: LocalService) -> Iterator[Done]:
    key = service.new_key(f"figures {uuid4()}")
    headers = {"Authorization": f"Bearer {key}"}
    with (
        httpx.Client(base_url=service.url, headers=headers, timeout=60, trust_env=False) as client,
        client_at(service.url, key) as api,
    ):
        yield Done(api, Laboratory(client).update_beam(lambda *_: None))


def traces(figure: dict[str, Any], name: str) -> list[dict[str, Any]]:
    return [trace for trace in figure["data"] if trace["name"] == name]


def test_every_figure_is_listed_and_drawn_as_json_in_print_and_in_both_themes(demo: Done) -> None:
    items = ok(demo.api.get(f"{demo.path}/figures"))["items"]
    assert {"frf", "mac", "parameters"} <= {item["name"] for item in items}
    prints = cycle(["svg", "png", "pdf"])  # each figure in one of them: they are drawn alike
    for item in items:
        if not item["available"]:
            refused = demo.api.get(demo.address(item))
            assert (refused.status_code, refused.json()["detail"]) == (409, item["reason"])
            continue
        assert item["reason"] is None
        for file_format in ("plotly", next(prints)):
            answer = demo.api.get(demo.address(item), params={"format": file_format})
            assert answer.is_success, (item["name"], answer.text)
            assert answer.content.startswith(BEGINNINGS[file_format])
            if file_format != "plotly":
                assert answer.headers["content-disposition"] == f'inline; filename="{item["name"]}.{file_format}"'
        again = demo.api.get(
            demo.address(item), headers={"If-None-Match": demo.api.get(demo.address(item)).headers["etag"]}
        )
        assert again.status_code == 304
        light, dark = (ok(demo.api.get(demo.address(item), params={"theme": theme})) for theme in ("light", "dark"))
        assert light["layout"]["paper_bgcolor"] != dark["layout"]["paper_bgcolor"]
        assert [trace.get("y") for trace in light["data"]] == [trace.get("y") for trace in dark["data"]]


def test_the_frf_figure_draws_the_measured_and_the_predicted_values(demo: Done) -> None:
    point = demo.figure("frf")["layout"]["meta"]["points"][7]
    figure = demo.figure("frf", point=point)
    meta = figure["layout"]["meta"]
    chosen = {"point": meta["response"], "reference": meta["reference"], "format": "npz"}
    assert point in (meta["response"], meta["reference"])
    with np.load(io.BytesIO(demo.api.get(f"{demo.path}/frfs/data", params=chosen).content)) as predicted:
        updated, frequency = predicted["values"][0], predicted["frequency_hz"]
    stored = demo.api.get(f"campaigns/{demo.result['provenance']['campaign']}/frfs/data", params=chosen)
    with np.load(io.BytesIO(stored.content)) as found:
        measured = found["values"][0]
    for name, values in (("measured", measured), ("updated", updated)):
        magnitude, phase = traces(figure, name)
        np.testing.assert_allclose(magnitude["x"], frequency, rtol=1e-6)
        np.testing.assert_allclose(magnitude["y"], np.abs(values), rtol=1e-4)  # printed to five digits
        drawn = np.array([np.nan if y is None else y for y in phase["y"]])
        np.testing.assert_allclose(drawn[~np.isnan(drawn)], np.degrees(np.angle(values)), atol=0.06)
    low, high = demo.result["band_hz"]
    (cut,) = traces(demo.figure("frf", point=point, fmin=100, fmax=200), "measured")[:1]
    assert (cut["x"][0], cut["x"][-1]) == (100, 200)
    edges = {shape["x0"] for shape in figure["layout"]["shapes"]} | {
        shape["x1"] for shape in figure["layout"]["shapes"]
    }
    assert edges <= {low, high, frequency[0], frequency[-1]}


def test_matrix_and_parameters_are_the_results(demo: Done) -> None:
    (mac,) = demo.figure("mac")["data"]
    np.testing.assert_allclose(mac["z"], demo.result["correlation"]["mac_matrix"], rtol=1e-4)
    figure = demo.figure("parameters")
    drawn = {
        name: (place, low, high)
        for trace in traces(figure, "updated, 95 %") + traces(figure, "updated, not identifiable")
        for name, place, low, high in zip(
            trace["customdata"], trace["x"], trace["error_x"]["arrayminus"], trace["error_x"]["array"], strict=True
        )
    }
    assert set(drawn) == {row["name"] for row in demo.result["parameters"]}
    for row in demo.result["parameters"]:
        place, low, high = drawn[row["name"]]
        share = 100 / (row["initial"] or row["estimate"])
        expected = [row["estimate"] * share, row["interval_95"][0] * share, row["interval_95"][1] * share]
        np.testing.assert_allclose([place, place - low, place + high], expected, rtol=1e-5)


@pytest.mark.parametrize(
    ("name", "query", "status", "said"),
    [
        ("nonsense", {}, 404, "there are frf"),
        ("frf", {"point": 999}, 404, "there are points 1, 2"),
        ("frf", {"point": "x"}, 422, "point"),
        ("frf", {"fmin": 5000}, 422, "no line"),
        ("frf", {"fmin": 50, "fmax": 20}, 422, "above fmax"),
        ("mac", {"format": "gif"}, 422, "format"),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_words(
    demo: Done, name: str, query: dict[str, Any], status: int, said: str
) -> None:
    answer = demo.api.get(f"{demo.path}/figures/{name}", params=query)
    assert answer.status_code == status, answer.text
    assert said in answer.text
