"""A wav with many hits goes over HTTP to FRFs."""

import io
import json
import re
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from scipy.io import wavfile

from tests.support.rest import ok
from tests.unit.fecore.signal.test_recording import RATE, recording

Finished = Callable[[str], dict[str, Any]]

TIMES = [1.0, 4.0, 7.0, 10.0, 13.0, 16.0]
CHANNELS = [
    {"variable": "channel_1", "quantity": "force", "sensitivity": 0.25},
    {"variable": "channel_2", "quantity": "acceleration", "point": 33, "sensitivity": 0.25},
]
ORDER = [{"point": 4, "hits": 3}, {"point": 5, "hits": 3}]


@pytest.fixture
def sent(api: httpx.Client, campaign: str, finished: Finished) -> Callable[..., dict[str, Any]]:
    def send(
        settings: Any, filename: str = "long.wav", channels: Any = CHANNELS, **query: Any
    ) -> dict[str, Any]:
        whole = recording(TIMES, [1.0, 0.5, 2.0, 1.0, 0.7, 1.5], 19.0)
        file = io.BytesIO()
        wavfile.write(file, int(RATE), np.round(whole.T * 0.25 * 2**31).astype(np.int32))
        query |= {
            "mapping": json.dumps({"channels": channels, "recording": settings}),
            "filename": filename,
        }
        raw = {"Content-Type": "application/octet-stream"}
        answer = api.post(
            f"campaigns/{campaign}/imports", content=file.getvalue(), params=query, headers=raw
        )
        ok(answer, 202)
        return finished(answer.headers["Location"])

    return send


def test_a_recording_becomes_hits_of_its_points_and_frfs(
    api: httpx.Client, campaign: str, finished: Finished, sent: Callable[..., dict[str, Any]]
) -> None:
    read = sent({"order": ORDER})
    assert (read["status"], read["counts"]["records"], read["warnings"]) == ("succeeded", 12, []), (
        read
    )
    items = ok(api.get(f"imports/{read['id']}/records"), 200)["items"]
    assert [(r["force_point"], r["hit"]) for r in items[::2]] == [
        (4, 1),
        (4, 2),
        (4, 3),
        (5, 1),
        (5, 2),
        (5, 3),
    ]
    begins = [r["start_sample"] for r in items[::2]]
    assert begins == [r["start_sample"] for r in items[1::2]]
    np.testing.assert_allclose(begins, np.array(TIMES) * RATE - 256, atol=1)
    made = api.post(f"campaigns/{campaign}/processings", json={})
    assert finished(made.headers["Location"])["status"] == "succeeded"
    frfs = ok(api.get(f"campaigns/{campaign}/frfs"), 200)["items"]
    assert {(f["response_point"], f["reference_point"]) for f in frfs} == {(33, 4), (33, 5)}
    data = ok(api.get(f"frfs/{frfs[0]['id']}/data"), 200)
    size = np.hypot(data["frfs"][0]["real"], data["frfs"][0]["imag"])
    lines = np.linspace(frfs[0]["start_hz"], frfs[0]["end_hz"], len(size))
    assert abs(lines[np.argmax(size)] - 251 / (2 * np.pi)) < 1.0


def test_the_name_of_a_file_is_its_point(
    api: httpx.Client, sent: Callable[..., dict[str, Any]]
) -> None:
    read = sent({"order": "filename"}, "beam_2_point_7.wav")
    items = ok(api.get(f"imports/{read['id']}/records"), 200)["items"]
    assert {r["force_point"] for r in items} == {7}


@pytest.mark.parametrize(
    ("said", "pointer", "says"),
    [
        (
            {"order": [{"point": 4, "hits": 5}]},
            "/mapping/recording/order",
            r"has 5 hits, and 6 were found, at 1\.00 s",
        ),
        ({"order": [{"point": 4}]}, "/mapping/recording/order/0", r"is not \{point, hits\}"),
        ({"order": ORDER, "least_force": 9}, "", "has no hit"),
        ({"level": 1}, "/mapping/recording/level", "is unknown"),
        ({}, "/mapping/channels/0/point", "is missing"),
    ],
)
def test_what_does_not_fit_is_named(
    sent: Callable[..., dict[str, Any]], said: Any, pointer: str, says: str
) -> None:
    error = sent(said)["error"]
    (fault,) = error["errors"]
    assert fault["pointer"] == pointer
    assert re.search(says, fault["detail"])


def test_values_that_no_sensor_gives_are_refused_by_the_channel(
    sent: Callable[..., dict[str, Any]],
) -> None:
    error = sent({"order": ORDER}, channels=[CHANNELS[0], {**CHANNELS[1], "sensitivity": 1e-20}])[
        "error"
    ]
    (fault,) = error["errors"]
    assert fault["pointer"] == "/channel_2"
    assert "more than any sensor gives" in fault["detail"]


def tdms(both: dict[str, np.ndarray]) -> bytes:
    nptdms = pytest.importorskip(
        "nptdms", reason="npTDMS is not installed: pip install 'modalbase[tdms]'"
    )
    file, properties = io.BytesIO(), {"wf_increment": 1 / RATE}
    with nptdms.TdmsWriter(file) as written:
        written.write_segment(
            [nptdms.ChannelObject("daq", name, values, properties) for name, values in both.items()]
        )
    return file.getvalue()


def mdf(both: dict[str, np.ndarray]) -> bytes:
    asammdf = pytest.importorskip(
        "asammdf", reason="asammdf is not installed: pip install 'modalbase[mdf]'"
    )
    with asammdf.MDF() as file, tempfile.TemporaryDirectory() as folder:
        file.append(
            [
                asammdf.Signal(values.astype(np.float32), np.arange(values.size) / RATE, name=name)
                for name, values in both.items()
            ],
            acq_name="daq",
        )
        return Path(file.save(Path(folder, "a.mf4"))).read_bytes()


@pytest.mark.parametrize("write", [tdms, mdf])
def test_a_file_of_channels_lists_them_and_gives_its_hits(
    api: httpx.Client,
    campaign: str,
    finished: Finished,
    write: Callable[[dict[str, np.ndarray]], bytes],
) -> None:
    force, response = recording(TIMES, [1.0, 0.5, 2.0, 1.0, 0.7, 1.5], 19.0)
    content = write({"force": force, "acc": response})

    def send(**query: str) -> dict[str, Any]:
        raw = {"Content-Type": "application/octet-stream"}
        answer = api.post(
            f"campaigns/{campaign}/imports", content=content, params=query, headers=raw
        )
        ok(answer, 202)
        return finished(answer.headers["Location"])

    seen = send(dry_run="true")
    assert (seen["format"], seen["kind"]) == (write.__name__, "hits"), seen
    assert seen["found"]["variables"] == {
        f"daq/{name}": f"float32 [{force.size}], {values.min():.3g} to {values.max():.3g}"
        for name, values in (("force", force), ("acc", response))
    }
    channels = [{**CHANNELS[0], "variable": "daq/force"}, {**CHANNELS[1], "variable": "daq/acc"}]
    read = send(mapping=json.dumps({"recording": {"order": ORDER}, "channels": channels}))
    assert (read["status"], read["counts"]["records"], read["warnings"]) == ("succeeded", 12, []), (
        read
    )
