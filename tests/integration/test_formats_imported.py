"""One way in for files: every format by `POST …/imports`, read by a job; `POST …/records` and
`…/frfs` wait for it.
"""

import io
import json
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import Any
from uuid import uuid4

import h5py
import httpx
import numpy as np
import pytest
from scipy.io import savemat, wavfile

from service.app.supervisor import LocalService
from tests.support.bombs import ALIASES, MOST_GROWTH, throw
from tests.support.lengths import long
from tests.support.reality import refused
from tests.support.rest import RAW, campaigns_of, client_of, ok
from tests.support.waiting import until

Finished = Callable[[str], dict[str, Any]]

RATE, SAMPLES = 2048.0, 512


def hits() -> dict[str, np.ndarray]:
    noise = np.random.default_rng(3).normal(0, 1e-4, (2, 3, SAMPLES))
    time = np.arange(SAMPLES) / RATE
    force = np.exp(-(((time - 0.02) / 5e-4) ** 2)) + noise[0]
    response = (
        np.where(time > 0.02, np.exp(-20 * (time - 0.02)) * np.sin(600 * time), 0.0) + noise[1]
    )
    return {"force": force / 2, "acc": response / 2}


MAPPING: dict[str, Any] = {
    "sample_rate_hz": RATE,
    "channels": [
        {"variable": "force", "quantity": "force", "point": 4},
        {"variable": "acc", "quantity": "acceleration", "point": 33},
    ],
}
WAV = {
    **MAPPING,
    "channels": [{**c, "variable": f"channel_{i}"} for i, c in enumerate(MAPPING["channels"], 1)],
}
FRF_MAPPING = {
    "frequency_hz": {"variable": "f"},
    "frf": {"variable": "H"},
    "response_point": 33,
    "reference_point": 4,
}
FREQUENCY = np.arange(1.0, 9.0)
VALUES = FREQUENCY * (1 + 2j)


def table(names: list[str], columns: list[np.ndarray]) -> bytes:
    rows = (",".join(map(repr, row)) for row in zip(*(c.tolist() for c in columns), strict=True))
    return "\n".join([",".join(names), *rows]).encode()


def written(form: str, arrays: dict[str, Any]) -> bytes:
    file = io.BytesIO()
    if form == "npz":
        np.savez(file, **arrays)
    elif form == "hdf5":
        with h5py.File(file, "w") as made:
            for name, array in arrays.items():
                made[name] = array
    elif form == "mat":
        savemat(file, arrays, do_compression=True)
    elif form == "csv":
        return table(list(arrays), [np.atleast_2d(a)[0] for a in arrays.values()])
    else:
        wavfile.write(
            file, int(RATE), np.column_stack([a[0] for a in arrays.values()]).astype(np.float32)
        )
    return file.getvalue()


def frfs(form: str) -> bytes:
    if form == "mat":
        return written(form, {"f": FREQUENCY, "H": VALUES})
    dofs = {
        "response_point": 33,
        "response_direction": 3,
        "reference_point": 4,
        "reference_direction": -3,
    }
    if form in ("npz", "hdf5"):
        return written(form, {"frequency_hz": FREQUENCY, "values": VALUES[np.newaxis], **dofs})
    same = [np.full(FREQUENCY.size, value) for value in dofs.values()]
    return table(
        [*dofs, "frequency_hz", "real", "imag"], [*same, FREQUENCY, VALUES.real, VALUES.imag]
    )


@pytest.fixture
def sent(api: httpx.Client, campaign: str, finished: Finished) -> Callable[..., dict[str, Any]]:
    """Sends bytes through an import, without a name that says what they are, and waits for the
    import's end.
    """

    def send(content: bytes, mapping: Any = None, **query: Any) -> dict[str, Any]:
        if mapping is not None:
            query["mapping"] = json.dumps(mapping)
        answer = api.post(
            f"campaigns/{campaign}/imports", content=content, params=query, headers=RAW
        )
        ok(answer, 202)
        return finished(answer.headers["Location"])

    return send


@pytest.mark.parametrize("form", ["npz", "mat", "hdf5", "csv", "wav"])
def test_hits_of_each_format_are_imported(
    api: httpx.Client, campaign: str, sent: Callable[..., dict[str, Any]], form: str
) -> None:
    content, mapping = written(form, hits()), WAV if form == "wav" else MAPPING
    count = 1 if form in ("csv", "wav") else 3
    looked = sent(content, dry_run=True)
    assert (looked["status"], looked["format"], looked["kind"]) == ("succeeded", form, "hits")
    assert {c["variable"] for c in mapping["channels"]} <= looked["found"]["variables"].keys()
    assert looked["found"]["mapping"].keys() >= {"channels"}
    if form == "npz":
        tried = sent(content, mapping, dry_run=True)
        assert (tried["found"]["blocks"], tried["counts"]["records"]) == (2 * count, 2 * count)
    assert api.get(f"campaigns/{campaign}/records").json()["items"] == []
    read = sent(content, mapping)
    assert (read["status"], read["format"], read["counts"]["records"]) == (
        "succeeded",
        form,
        2 * count,
    ), read
    state = ok(api.get(f"imports/{read['id']}/records"), 200)
    assert [r["quantity"] for r in state["items"]] == ["force", "acceleration"] * count
    assert [h["hit"] for h in state["hits"]] == list(range(1, count + 1))
    force = ok(api.get(f"records/{state['items'][0]['id']}/data"), 200)["samples"]
    np.testing.assert_allclose(force, hits()["force"][0], atol=1e-7 if form == "wav" else 0)


@pytest.mark.parametrize("form", ["npz", "hdf5", "mat", "csv"])
def test_frfs_of_each_format_are_imported(
    api: httpx.Client, campaign: str, sent: Callable[..., dict[str, Any]], form: str
) -> None:
    mapping = FRF_MAPPING if form == "mat" else None
    read = sent(frfs(form), mapping, quantity="mobility")
    assert (read["status"], read["format"], read["kind"]) == ("succeeded", form, "frfs"), read
    assert read["counts"] == {
        "frfs": 1,
        "grid_points": 0,
        "modes": 0,
        "records": 0,
        "recordings": 0,
    }
    (frf,) = ok(api.get(f"campaigns/{campaign}/frfs", params={"import_id": read["id"]}), 200)[
        "items"
    ]
    assert (frf["response_point"], frf["reference_point"]) == (33, 4)
    assert frf["quantity"] == "mobility"
    data = ok(api.get(f"frfs/{frf['id']}/data"), 200)
    np.testing.assert_array_equal(data["frfs"][0]["imag"], VALUES.imag)


@pytest.mark.parametrize(
    ("content", "query", "pointer", "says"),
    [
        (
            written("npz", hits()),
            {},
            "mapping",
            '?dry_run=true proposes one; the file suggests {"channels"',
        ),
        (written("npz", hits()), {"kind": "frfs"}, "/force.npy", "is no array that is read here"),
        (frfs("npz"), {"kind": "hits"}, "mapping", "is missing"),
        (frfs("csv"), {}, "quantity", "a csv does not say what it holds"),
        (frfs("mat"), {"quantity": "mobility"}, "/mapping", "the file suggests"),
        (b"PK\x03\x04 and no zip", {}, "", "cannot be read as .npz"),
        (b"RIFF" + b"\xff" * 30, {}, "", "cannot be read as .wav"),
        (b"a;b\n" + b"1;2\n" * 70 + b"1;x\n1;2\n", {}, "/line 72, b", "is no number"),
        (b"for\0ce;b\n1;2\n", {"filename": "a.csv"}, "/file", "NUL"),
    ],
)
def test_a_file_that_cannot_be_read_is_said_with_its_place(
    tmp_path: Path, content: bytes, query: dict[str, Any], pointer: str, says: str
) -> None:
    first, *_ = refused(content, tmp_path / "a file", **query)
    assert (first.pointer, says in first.detail) == (pointer, True), first


def test_the_same_bytes_are_read_again_by_another_mapping_or_for_a_script(
    api: httpx.Client, campaign: str, sent: Callable[..., dict[str, Any]]
) -> None:
    content = written("npz", hits())
    error = sent(content)["error"]
    assert (error["reason"], error["errors"][0]["pointer"]) == ("refused", "mapping"), error
    first = sent(content, MAPPING)
    query = {"mapping": json.dumps(MAPPING)}
    known = api.post(f"campaigns/{campaign}/imports", content=content, params=query, headers=RAW)
    assert (ok(known, 200)["already_imported"], known.json()["id"]) == (True, first["id"])
    elsewhere = {
        **MAPPING,
        "channels": [{**MAPPING["channels"][0], "point": 5}, MAPPING["channels"][1]],
    }
    assert sent(content, elsewhere)["id"] != first["id"]
    again = api.post(
        f"campaigns/{campaign}/records",
        content=content,
        params=query | {"filename": "a.npz"},
        headers=RAW,
    )
    assert {item["hit"] for item in ok(again, 201)["items"]} == {4, 5, 6}
    numbered = {**MAPPING, "hit": 2}
    twice = api.post(
        f"campaigns/{campaign}/records",
        content=written("npz", {name: array[:1] for name, array in hits().items()}),
        params={"mapping": json.dumps(numbered), "filename": "a.npz"},
        headers=RAW,
    )
    assert "hit 2 of point 4 is in the campaign already" in ok(twice, 409)["detail"]


def test_what_nobody_reads_in_time_is_answered_with_its_import(idle: LocalService) -> None:
    with client_of(idle, f"k {uuid4()}") as client:
        campaign = f"campaigns/{campaigns_of(client, 'p')[0]}"
        frf = client.post(
            f"{campaign}/frfs", content=frfs("npz"), headers={"Content-Type": "application/x-npz"}
        )
        query = {"mapping": json.dumps(MAPPING), "filename": "hits.npz"}
        record = client.post(
            f"{campaign}/records", content=written("npz", hits()), params=query, headers=RAW
        )
        for answer, kind in ((frf, "frfs"), (record, "hits")):
            state = ok(answer, 202)
            assert answer.headers["Location"] == f"/api/v1/imports/{state['id']}"
            assert (state["status"], state["kind"], state["format"]) == ("queued", kind, "npz")
            assert ok(client.get(f"imports/{state['id']}"), 200) == state


def test_who_waits_for_a_file_keeps_nobody_else_waiting(
    new_api: Callable[..., AbstractContextManager[LocalService]],
) -> None:
    """With one slot and one connection, another request is answered while files are waited for. A
    wait counts as a stream of events, of which a key may have half: the import of one more file is
    said at once.
    """
    headers = {"Content-Type": "application/x-npz"}
    with ThreadPoolExecutor(3) as threads, ExitStack() as stack:
        narrow = new_api(database_pool=1, event_streams=6, import_wait_seconds=600)
        with narrow as service:
            client = stack.enter_context(client_of(service, "k"))
            campaign = f"campaigns/{campaigns_of(client, 'p')[0]}"

            def send() -> httpx.Response:
                return client.post(f"{campaign}/frfs", content=frfs("npz"), headers=headers)

            def sent() -> list[Any]:
                return list(ok(client.get(f"{campaign}/imports"), 200)["items"])

            waits = [threads.submit(send) for _ in range(3)]
            until(lambda: len(sent()) == 3, "three imports")
            assert ok(client.get("projects"), 200)["items"]
            assert [send().status_code for _ in range(2)] == [202, 202]
            assert not any(one.done() for one in waits)
        # their addresses are said before it ends
        assert {one.result().status_code for one in waits} == {202}


@pytest.mark.parametrize("aliased", [["csv"], long(list(ALIASES))])
def test_bombs_of_every_format_are_refused_in_words_and_the_api_holds_none(
    service: LocalService, aliased: list[str]
) -> None:
    outcome = throw(service, 1, 72, aliased)
    assert not outcome.faults
    assert outcome.growth < MOST_GROWTH
