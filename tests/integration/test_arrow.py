"""FRFs as an Arrow stream: the columns of the CSV, whole and exact."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Any

import httpx
import nanoarrow as na
import numpy as np
import pytest


@pytest.fixture
def stored(api: httpx.Client, campaign: str) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Two FRFs on 40 lines, the second with a coherence."""
    rng = np.random.default_rng(5)
    values = rng.standard_normal((2, 40)) + 1j * rng.standard_normal((2, 40))
    coherence = np.vstack([np.full(40, np.nan), rng.uniform(0.5, 1, 40)])
    buffer = io.BytesIO()
    np.savez(
        buffer,
        frequency_hz=np.arange(40) * 0.25,
        values=values,
        response_point=np.array([7, 8]),
        response_direction=np.array([3, -3]),
        reference_point=np.int64(1),
        reference_direction=np.int64(3),
        coherence=coherence,
    )
    path = f"campaigns/{campaign}/frfs"
    answer = api.post(path, content=buffer.getvalue(), headers={"Content-Type": "application/x-npz"})
    assert answer.status_code == 201, answer.text
    return values, coherence


def read(content: bytes) -> list[dict[str, Any]]:
    return list(na.ArrayStream.from_readable(content).read_all().to_pylist())


def test_an_arrow_stream_holds_every_value(
    api: httpx.Client, campaign: str, stored: tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]
) -> None:
    values, coherence = stored
    answer = api.get(
        f"campaigns/{campaign}/frfs/data", headers={"Accept": "application/vnd.apache.arrow.stream"}
    ).raise_for_status()
    assert answer.headers["content-type"] == "application/vnd.apache.arrow.stream"
    rows = read(answer.content)
    assert len(rows) == 80
    assert np.array_equal([complex(r["real"], r["imag"]) for r in rows], values.ravel())
    assert np.array_equal([r["frequency_hz"] for r in rows[:40]], np.arange(40) * 0.25)
    assert {(r["response_point"], r["response_direction"]) for r in rows} == {(7, 3), (8, -3)}
    assert [r["coherence"] for r in rows[:40]] == [None] * 40
    assert np.array_equal([r["coherence"] for r in rows[40:]], coherence[1])


def test_an_arrow_stream_of_a_band(
    api: httpx.Client, campaign: str, stored: tuple[object, object], checked: Callable[[httpx.Response, int], Any]
) -> None:
    assert stored
    query = {"format": "arrow", "fmin": 1, "fmax": 5, "stride": 2, "point": 8}
    rows = read(api.get(f"campaigns/{campaign}/frfs/data", params=query).raise_for_status().content)
    assert [r["frequency_hz"] for r in rows] == [1, 1.5, 2, 2.5, 3, 3.5, 4, 4.5, 5]
    checked(api.get(f"campaigns/{campaign}/frfs/data", params={**query, "fmin": 90, "fmax": 99}), 404)
