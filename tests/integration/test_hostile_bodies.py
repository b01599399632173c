"""Bodies that are made to cost: without a key, or with one."""

import io
import json
import urllib.error
import urllib.request
import zipfile
from typing import Any

import httpx
import numpy as np
import psutil
import pytest

from service.app.supervisor import LocalService
from tests.support.rest import campaigns_of, plain_client

MIB = 1024 * 1024


def memory(service: LocalService) -> int:
    return int(psutil.Process(service.processes["api"].pid).memory_info().rss)


@pytest.mark.parametrize("unit", [b"0,", b"[],", b'{"a":0},'])
@pytest.mark.parametrize("header", [{}, {"Authorization": "Bearer mb_000000000000_x"}])
def test_without_a_key_a_body_is_not_read(
    service: LocalService, unit: bytes, header: dict[str, str]
) -> None:
    """Nothing of it is parsed, so that it takes neither memory nor time: 16 MB of it once took 1.1
    GB and 98 s.
    """
    body = b"[" + unit * (15 * MIB // len(unit)) + b"0]"
    before = memory(service)
    with plain_client(f"{service.url}/api/v1/") as client:
        for _ in range(2):
            headers = {"Content-Type": "application/json", **header}
            assert client.post("projects", content=body, headers=headers).status_code == 401
    assert memory(service) - before < 50 * MIB


@pytest.mark.parametrize("unit", [b"0,", b"[],", b'{"a":0},'])
def test_with_a_key_a_body_beyond_its_limits_is_not_parsed(
    service: LocalService, unit: bytes
) -> None:
    body = b"[" + unit * (15 * MIB // len(unit)) + b"0]"
    before = memory(service)
    headers = {
        "Authorization": f"Bearer {service.new_key('k')}",
        "Content-Type": "application/json",
    }
    answer = httpx.post(
        f"{service.url}/api/v1/projects", content=body, headers=headers, trust_env=False, timeout=60
    )
    assert answer.status_code == 413
    assert memory(service) - before < 100 * MIB


def npz(**members: bytes) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(f"{name}.npy", data)
    return packed.getvalue()


def stored(array: Any) -> bytes:
    target = io.BytesIO()
    np.save(target, array)
    return target.getvalue()


def frfs(count: int, lines: int) -> bytes:
    one = stored(np.int64(1))
    return npz(
        frequency_hz=stored(np.arange(1.0, lines + 1)),
        values=stored(np.zeros((count, lines), np.complex64)),
        response_point=one,
        response_direction=one,
        reference_point=one,
        reference_direction=one,
        quantity=stored(np.array("accelerance")),
    )


@pytest.mark.parametrize(
    ("size", "says"),
    [
        pytest.param((30_000, 100), "at most 10000 are taken at a time", id="count"),
        pytest.param((1000, 10_000), "unpacks to more than", id="ratio"),
    ],
)
def test_an_npz_that_unpacks_to_too_much_is_refused(
    api: httpx.Client, campaign: str, service: LocalService, size: tuple[int, int], says: str
) -> None:
    """0.5 MB of npz once became 30,000 FRFs, in 157 s and 800 MB of the API."""
    body = frfs(*size)
    assert len(body) < MIB
    before = memory(service)
    answer = api.post(
        f"campaigns/{campaign}/frfs", content=body, headers={"Content-Type": "application/x-npz"}
    )
    assert answer.status_code == 422, answer.text
    assert says in answer.json()["detail"]
    assert memory(service) - before < 50 * MIB
    assert api.get(f"campaigns/{campaign}/frfs").json()["items"] == []


def test_an_array_that_claims_to_be_huge_is_refused(api: httpx.Client, campaign: str) -> None:
    answer = api.post(
        f"campaigns/{campaign}/frfs",
        content=npz(
            frequency_hz=(
                b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape':"
                b" (99999999999,), }"
            )
        ),
        headers={"Content-Type": "application/x-npz"},
    )
    assert answer.status_code == 422
    assert api.get("projects").status_code == 200


def test_many_frfs_in_one_body_are_stored(api: httpx.Client, campaign: str) -> None:
    body = {"content": frfs(2000, 10), "headers": {"Content-Type": "application/x-npz"}}
    answer = api.post(f"campaigns/{campaign}/frfs", **body)
    assert answer.status_code == 201, answer.text
    ids = [item["id"] for item in answer.json()["items"]]
    assert len(ids) == 2000
    assert ids == sorted(ids)
    page = api.get(f"campaigns/{campaign}/frfs", params={"limit": 1000}).json()
    assert [item["id"] for item in page["items"]] == ids[:1000]


POINT, VALUE = b'{"label":1,"x_m":0,"y_m":0}', b'{"point":1,"direction":3,"real":1}'
MEASURED = {
    "grid-points": (
        "put",
        b'{"items":[%b]}',
        POINT,
        b'{"items":[{"label":1,"x_m":%b,"y_m":0}]}',
        "/items/0/x_m",
    ),
    "mode-sets": (
        "post",
        b'{"name":"m","modes":[{"frequency_hz":1,"shape":[%b]}]}',
        VALUE,
        b'{"name":%b,"modes":[{"frequency_hz":1}]}',
        "/name",
    ),
}
"""Measured values in JSON: how they are sent, a list of many, one of it, and a place for something
else.
"""


@pytest.mark.parametrize("kind", MEASURED)
def test_measured_values_in_json_are_held_to_elements_depth_and_text(
    service: LocalService, kind: str
) -> None:
    """Elements are counted before anything is made of them; depth and text stop at what a body may
    have.
    """
    method, many, one, place, pointer = MEASURED[kind]
    with plain_client(f"{service.url}/api/v1/") as client:
        client.headers = {
            "Authorization": f"Bearer {service.new_key('k')}",
            "Content-Type": "application/json",
        }
        (campaign,) = campaigns_of(client, "p")

        def faults(body: bytes) -> list[dict[str, str]]:
            answer = client.request(method, f"campaigns/{campaign}/{kind}", content=body)
            assert answer.status_code == 422, answer.text[:500]
            return answer.json()["errors"]

        client.get(f"campaigns/{campaign}")
        before = memory(service)
        assert "more than 2000000 values" in faults(many % (b"[]," * 2_000_001 + one))[0]["detail"]
        assert memory(service) - before < 50 * MIB
        (fault,) = faults(place % (b"[" * 80 + b"]" * 80))
        assert "nested more than 64 deep" in fault["detail"]
        (fault,) = faults(place % (b'"' + b"y" * 100_001 + b'"'))
        assert (fault["pointer"], "at most 100000 are read" in fault["detail"]) == (pointer, True)
        # 20,000 faults once were 2 MB of answer
        (fault,) = faults(many % b",".join([b"0"] * 20_000))
        assert len(str(fault)) < 300


@pytest.mark.parametrize("kind", ["frfs", "records"])
def test_a_body_over_its_limit_is_refused_in_words_that_its_sender_can_read(
    api: httpx.Client, service: LocalService, campaign: str, kind: str
) -> None:
    """The standard library sends all of a body before it listens: it once met a broken pipe."""
    body = b"[" + b"1.25," * (18 * MIB // 5) + b"0]"
    headers = {"Authorization": api.headers["Authorization"], "Content-Type": "application/json"}
    address = f"{service.url}/api/v1/campaigns/{campaign}/{kind}"
    request = urllib.request.Request(address, data=body, headers=headers)
    with pytest.raises(urllib.error.HTTPError) as refused:
        urllib.request.build_opener(urllib.request.ProxyHandler({})).open(request, timeout=60)
    detail = json.load(refused.value)["detail"]
    assert (refused.value.code, str(16 * MIB) in detail, "such as npz" in detail) == (
        413,
        True,
        True,
    )
