"""What is stated beside a file is used or refused by name; where file and request contradict, both
values are named.
"""

import json
import re
from collections.abc import Callable
from typing import Any

import httpx
import numpy as np
import pytest

from modalbase.formats.registry import FORMATS, JSON
from tests.support.furnished import frfs, record
from tests.support.laboratory import Done
from tests.support.member_lab import (
    FRFS_CSV,
    FRFS_MAT,
    FRFS_NPZ,
    HITS_CSV,
    MAPPING,
    OF_CSV,
    OF_MAT,
)
from tests.support.rest import RAW, finished, ok, pointers

NPZ = {"Content-Type": "application/x-npz"}
CSV = {"Content-Type": "text/csv"}


@pytest.fixture
def send(api: httpx.Client, campaign: str) -> Callable[..., httpx.Response]:
    def post(content: bytes, **query: Any) -> httpx.Response:
        return api.post(f"campaigns/{campaign}/imports", content=content, params=query, headers=RAW)

    return post


@pytest.fixture
def uff(api: httpx.Client, new_campaign: Callable[..., str]) -> Callable[..., bytes]:
    """A UFF file of an accelerance, with what it says of its ordinate changed."""

    def made(data_type: str = "12", unit: str = "m/s2") -> bytes:
        campaign = new_campaign(name="written")
        ok(api.post(f"campaigns/{campaign}/frfs", json=frfs()), 201)
        text = api.get(f"campaigns/{campaign}/frfs/data", params={"format": "uff-ascii"}).text
        lines = text.splitlines()
        (place,) = (
            i for i, line in enumerate(lines) if line.split()[:1] == ["12"] and "ration" in line
        )
        lines[place] = lines[place].replace("12", data_type.rjust(2), 1)
        (at,) = (i for i in (place,) if lines[i])
        words = lines[at].split()
        lines[at] = lines[at].replace(words[-1], unit)
        return "\n".join([*lines, ""]).encode()

    return made


def failed(api: httpx.Client, answer: httpx.Response) -> dict[str, Any]:
    ok(answer, 202)
    state = finished(api, answer.headers["Location"])
    assert state["status"] == "failed", state
    return dict(state["error"])


def test_a_uff_that_says_its_quantity_and_another_one_beside_it(
    api: httpx.Client, send: Callable[..., httpx.Response], uff: Callable[..., bytes]
) -> None:
    stated, silent = uff(), uff("0", "NONE")
    error = failed(api, send(stated, quantity="mobility"))
    assert error["errors"][0]["pointer"] == "quantity"
    assert "is mobility" in error["detail"]
    assert "says that it is accelerance" in error["detail"]
    assert "leave quantity out" in error["detail"]
    assert (
        finished(api, send(stated, quantity="accelerance").headers["Location"])["status"]
        == "succeeded"
    )
    assert "says whether it is" in failed(api, send(silent))["detail"]
    read = finished(api, send(silent, quantity="receptance").headers["Location"])
    assert ok(api.get(f"campaigns/{read['campaign_id']}/frfs", params={"import_id": read["id"]}))["items"][0][
        "quantity"
    ] == "receptance"  # fmt: skip


@pytest.mark.parametrize(
    ("query", "pointer", "says"),
    [
        ({"kind": "frfs"}, "kind", "a UFF says of each dataset what it is"),
        ({"mapping": '{"frf": {"variable": "H"}}'}, "mapping", "only a recording has one"),
    ],
)
def test_a_uff_takes_neither_kind_nor_a_mapping_of_arrays(
    api: httpx.Client,
    send: Callable[..., httpx.Response],
    uff: Callable[..., bytes],
    query: Any,
    pointer: str,
    says: str,
) -> None:
    error = failed(api, send(uff(), **query))
    assert error["errors"][0]["pointer"] == pointer
    assert says in error["detail"]


def test_an_npz_is_what_it_says_or_what_the_request_says(api: httpx.Client, campaign: str) -> None:
    address = f"campaigns/{campaign}/frfs"
    problem = ok(api.post(address, content=FRFS_NPZ, headers=NPZ), 422)
    assert pointers(problem) == {"quantity"}
    (frf,) = ok(
        api.post(address, content=FRFS_NPZ, headers=NPZ, params={"quantity": "mobility"}), 201
    )["items"]
    assert frf["quantity"] == "mobility"
    # which says what it is
    own = api.get(f"frfs/{frf['id']}/data", params={"format": "npz"}).content
    problem = ok(
        api.post(address, content=own, headers=NPZ, params={"quantity": "receptance"}), 422
    )
    assert "is mobility in the file and receptance beside it" in problem["detail"]
    ok(api.post(address, content=own, headers=NPZ, params={"quantity": "mobility"}), 201)


def test_the_same_bytes_as_something_else_are_a_conflict_until_the_import_is_deleted(
    api: httpx.Client, campaign: str, send: Callable[..., httpx.Response]
) -> None:
    first = finished(api, send(FRFS_CSV, filename="f.csv", quantity="mobility").headers["Location"])
    assert ok(send(FRFS_CSV, filename="f.csv", quantity="mobility"), 200)["already_imported"]
    assert ok(send(FRFS_CSV, filename="f.csv"), 200)["already_imported"]
    problem = ok(send(FRFS_CSV, filename="f.csv", quantity="receptance"), 409)
    assert "quantity is receptance" in problem["detail"]
    assert "as mobility" in problem["detail"]
    assert f"DELETE /imports/{first['id']}" in problem["detail"]
    problem = ok(send(FRFS_CSV, filename="f.csv", kind="hits"), 409)
    assert "kind is hits" in problem["detail"]
    assert "as frfs" in problem["detail"]
    ok(
        api.post(
            f"campaigns/{campaign}/frfs",
            content=FRFS_CSV,
            headers=CSV,
            params={"quantity": "receptance"},
        ),
        409,
    )
    ok(api.delete(f"imports/{first['id']}"), 204)
    ok(api.get(f"imports/{first['id']}"), 404)
    assert ok(api.get(f"campaigns/{campaign}/frfs"))["items"] == []
    again = finished(
        api, send(FRFS_CSV, filename="f.csv", quantity="receptance").headers["Location"]
    )
    assert again["counts"]["frfs"] == 1
    (frf,) = ok(api.get(f"campaigns/{campaign}/frfs"))["items"]
    assert frf["quantity"] == "receptance"


def test_a_deleted_import_takes_its_hits_and_its_bytes_with_it(
    api: httpx.Client, project: str, campaign: str, send: Callable[..., httpx.Response]
) -> None:
    read = finished(api, send(HITS_CSV, mapping=json.dumps(MAPPING)).headers["Location"])
    assert read["counts"]["records"] == 2
    assert ok(api.get(f"projects/{project}/storage"))["used_bytes"] > 0
    ok(api.delete(f"imports/{read['id']}"), 204)
    assert ok(api.get(f"campaigns/{campaign}/records"))["items"] == []
    assert ok(api.get(f"projects/{project}/storage"))["used_bytes"] == 0


def test_an_import_that_an_update_rests_on_stays(demo: Done) -> None:
    campaign = demo.result["provenance"]["campaign"]
    (read,) = ok(demo.api.get(f"campaigns/{campaign}/imports"))["items"]
    problem = ok(demo.api.delete(f"imports/{read['id']}"), 409)
    assert re.search(
        r"update \S+ of the campaign may rest on what the import brought", problem["detail"]
    )
    assert ok(demo.api.get(f"campaigns/{campaign}/frfs"))["items"]


@pytest.mark.parametrize("text", ['"x"', "[1]", "null", "3", "{"])
def test_a_mapping_is_an_object(send: Callable[..., httpx.Response], text: str) -> None:
    assert pointers(ok(send(HITS_CSV, mapping=text), 422)) == {"mapping"}


def test_a_form_has_the_fields_that_are_read(api: httpx.Client, campaign: str) -> None:
    address, file = f"campaigns/{campaign}/imports", {"file": ("f.csv", FRFS_CSV)}
    problem = ok(api.post(address, files=file, data={"quantity": "mobility"}), 422)
    assert pointers(problem) == {"/quantity"}
    assert "parameters stand in the address" in problem["detail"]
    both = api.post(address, files=file, data={"mapping": "{}"}, params={"mapping": "{}"})
    assert "is stated twice" in ok(both, 422)["detail"]


def test_json_states_all_of_itself(api: httpx.Client, campaign: str) -> None:
    stated = {"quantity": "mobility", "mapping": "{}"}
    problem = ok(api.post(f"campaigns/{campaign}/frfs", json=frfs(), params=stated), 422)
    assert pointers(problem) == {"quantity", "mapping"}
    assert "it is a member of the body itself" in problem["detail"]
    problem = ok(
        api.post(f"campaigns/{campaign}/records", json=record(), params={"mapping": "{}"}), 422
    )
    assert pointers(problem) == {"mapping"}


def test_what_a_conflict_advises_exists(api: httpx.Client, campaign: str) -> None:
    for quantity in ("mobility", "accelerance"):
        ok(api.post(f"campaigns/{campaign}/frfs", json={**frfs(), "quantity": quantity}), 201)
    own = {"filter": f"campaign.id = '{campaign}'"}
    problem = ok(api.get("search/frfs/data", params=own), 409)
    assert "?filter=, such as quantity = 'accelerance'" in problem["detail"]
    own["filter"] += " AND quantity = 'accelerance'"
    assert ok(api.get("search/frfs/data", params=own), 200)["quantity"] == "accelerance"
    problem = ok(api.get(f"campaigns/{campaign}/frfs/data"), 409)
    assert "?quantity=" in problem["detail"]
    assert (
        ok(api.get(f"campaigns/{campaign}/frfs/data", params={"quantity": "mobility"}), 200)[
            "quantity"
        ]
        == "mobility"
    )


def test_every_format_says_what_it_takes() -> None:
    assert [name for name, form in FORMATS.items() if form.name != name] == []
    assert all(form.kinds for form in (*FORMATS.values(), JSON))
    assert np.all(["quantity" not in form.takes.get("hits", ()) for form in FORMATS.values()])


@pytest.mark.parametrize(
    ("content", "kind", "mapping"),
    [(FRFS_MAT, "application/x-matlab-data", OF_MAT), (FRFS_CSV, "text/csv", OF_CSV)],
)
def test_a_unit_in_the_mapping_says_the_quantity(
    api: httpx.Client, campaign: str, content: bytes, kind: str, mapping: dict[str, Any]
) -> None:
    query = {"mapping": json.dumps({**mapping, "unit": "m/N"})}
    sent = api.post(
        f"campaigns/{campaign}/frfs", content=content, params=query, headers={"Content-Type": kind}
    )
    assert [frf["quantity"] for frf in ok(sent, 201)["items"]] == ["receptance"]
