"""The comparer of golden documents sees what a person would, and no round-off."""

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.support import contract, golden, golden_text
from tests.support.golden_parts import freeze

FRFS = np.linspace(1, 30, 2000).reshape(2, 1000)
DOCUMENT: dict[str, Any] = {
    "job": {"id": "6a1c2f4e-0000-4000-8000-000000000000", "status": "succeeded"},
    "result": {
        "findings": [
            {
                "kind": "law_inadequate",
                "level": "with_care",
                "text": "the law misses mode 2 by 3.1 %",
            }
        ],
        "verdict": {"level": "with_care", "sentence": "Use the result with care: Ex to 4 %."},
        "parameters": [
            {
                "name": "Ex",
                "estimate": 31705668229.01,
                "standard_deviation": 1355320395.171,
                "interval_95": [29944161436.6, 34478337653.07],
                "budget": [{"source": "thickness", "standard_deviation": 1.1e9, "share": 0.61}],
            },
            {
                "name": "Gxy",
                "estimate": 6384375426.438,
                "standard_deviation": 3085212.252,
                "interval_95": [6378328410.4, 6390422442.5],
                "budget": [],
            },
        ],
        "modes": [
            {
                "measured_hz": 25.61250777972,
                "updated_hz": 25.6591061068,
                "mac": 0.99123,
                "mode": 1.0,
            }
        ],
        "correlation": {"frac": [0.9585, 0.94], "mac_matrix": [[0.991, 0.034], [0.033, 0.982]]},
        "stated": None,
    },
    "frfs": {"values": FRFS + 1j * FRFS[::-1], "first": FRFS[0].tolist()},
}
Change = Callable[[dict[str, Any]], Any]


def scaled(*path: Any, by: float = 0.0, to: Any = None) -> Change:
    """A change of one member: by a difference, or to a value."""

    def change(document: dict[str, Any]) -> None:
        value: Any = document
        for each in path[:-1]:
            value = value[each]
        value[path[-1]] = value[path[-1]] + by if to is None else to

    return change


FIRST, SECOND = ("result", "parameters", 0), ("result", "parameters", 1)
CHANGES: dict[str, tuple[Change, str]] = {
    "an estimate by 0.3 of its deviation": (
        scaled(*FIRST, "estimate", by=0.3 * 1355320395.171),
        "estimate/0",
    ),
    "a well known estimate by as much": (
        scaled(*SECOND, "estimate", by=0.3 * 3085212.252),
        "estimate/1",
    ),
    "a deviation by 5 %": (
        scaled(*FIRST, "standard_deviation", by=0.05 * 1355320395.171),
        "standard_deviation/0",
    ),
    "an end of an interval": (
        scaled(*FIRST, "interval_95", 1, by=0.3 * 1355320395.171),
        "interval_95/0/1",
    ),
    "a share of a budget": (scaled(*FIRST, "budget", 0, "share", by=0.01), "share/0/0"),
    "the id of a finding": (scaled("result", "findings", 0, "kind", to="length_moves"), "kind/0"),
    "words of a sentence": (
        scaled("result", "verdict", "sentence", to="Use it with care: Ey to 4 %."),
        "sentence",
    ),
    "a MAC by 0.01": (scaled("result", "modes", 0, "mac", by=-0.01), "mac/0"),
    "a MAC of a matrix": (
        scaled("result", "correlation", "mac_matrix", 0, 1, by=0.02),
        "mac_matrix/0/1",
    ),
    "a FRAC by 0.01": (scaled("result", "correlation", "frac", 0, by=-0.01), "frac/0"),
    "a frequency by a thousandth": (
        scaled("result", "modes", 0, "updated_hz", by=0.0257),
        "updated_hz/0",
    ),
    "an array of FRFs by 1 %": (
        scaled("frfs", "values", to=1.01 * DOCUMENT["frfs"]["values"]),
        "values/values/rms",
    ),
    "a list of numbers by 1 %": (
        scaled("frfs", "first", to=(1.01 * FRFS[0]).tolist()),
        "first/rms",
    ),
    "a value that was none": (scaled("result", "stated", to=3.0), "stated: is new"),
    "a member": (lambda document: document["result"].update(fdac=[0.9]), "result/fdac: is new"),
    "an entry that is gone": (
        lambda document: document["result"]["parameters"].pop(),
        "had 2 entries, has 1",
    ),
    "a value that is gone": (
        lambda document: document["result"].pop("verdict"),
        "verdict: is gone",
    ),
}


@pytest.fixture
def data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the document as it is kept."""
    monkeypatch.setattr(golden, "DATA", tmp_path)
    monkeypatch.setattr(golden, "MEMBERS", tmp_path / "members.txt")
    monkeypatch.setattr(golden, "SENTENCES", tmp_path / "sentences.txt")
    monkeypatch.setenv(golden.WRITE, "write")
    golden.check("update-some", DOCUMENT)
    monkeypatch.delenv(golden.WRITE)
    return tmp_path


@pytest.mark.parametrize("name", CHANGES)
def test_a_change_is_seen_and_writes_its_lines_alone(
    data: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    change, place = CHANGES[name]
    change(document := copy.deepcopy(DOCUMENT))
    with pytest.raises(AssertionError, match=place.replace("[", r"\[")):
        golden.check("update-some", document)
    before = (data / "update-some.txt").read_text().splitlines()
    monkeypatch.setenv(golden.WRITE, "write")
    golden.check("update-some", document)
    after = (data / "update-some.txt").read_text().splitlines()
    assert len(set(after) ^ set(before)) <= (14 if "gone" in name else 4)
    monkeypatch.delenv(golden.WRITE)
    golden.check("update-some", document)


@pytest.mark.usefixtures("data")
def test_round_off_and_what_is_masked_is_none() -> None:
    def other(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: other(each) for name, each in value.items()}
        if isinstance(value, list):
            return [other(each) for each in value]
        return value * (1 - 3e-10) if isinstance(value, (float, np.ndarray)) else value

    document = other(DOCUMENT)
    document["job"]["id"] = "6a1c2f4e-1111-4111-8111-111111111111"
    golden.check("update-some", document)


def test_a_member_that_each_entry_has_is_one_line(data: Path) -> None:
    text = (data / "update-some.txt").read_text()
    assert "  estimate [" in text
    assert text.count("estimate") == 1
    assert "6a1c2f4e" not in text
    assert "  stated\n" in (data / "members.txt").read_text()


def test_text_is_read_as_it_was_written() -> None:
    frozen = golden_text.columns(freeze(DOCUMENT))
    settled = golden.settled({}, frozen, "some")
    once = "\n".join(golden_text.written(settled))
    assert "\n".join(golden_text.written(golden_text.read(once))) == once
    assert list(golden.different(golden_text.read(once), frozen, "some")) == []


def api(**changes: Any) -> dict[str, Any]:
    """An OpenAPI document of one operation."""
    sent = {
        "type": "object",
        "required": ["name"],
        "properties": {"name": {"type": "string"}, "n": {"type": "integer"}},
    }
    row = {
        "type": "object",
        "required": ["id"],
        "properties": {"id": {"type": "string"}, "kind": {"enum": ["a", "b"]}},
    }
    limit = {"in": "query", "name": "limit", "schema": {"type": "integer", "default": 100}}
    parts = {
        "sent": sent,
        "row": row,
        "parameters": [limit],
        "name": "Row",
        "status": "201",
        **changes,
    }
    listed = {"type": "array", "items": {"$ref": f"#/components/schemas/{parts['name']}"}}
    operation = {
        "parameters": parts["parameters"],
        "requestBody": {
            "required": True,
            "content": {contract.JSON: {"schema": {"$ref": "#/components/schemas/In"}}},
        },
        "responses": {parts["status"]: {"content": {contract.JSON: {"schema": listed}}}},
    }
    schemas = {"In": parts["sent"], parts["name"]: parts["row"]}
    return {"paths": {"/rows": {"post": operation}}, "components": {"schemas": schemas}}


def with_(schema: str, **properties: Any) -> dict[str, Any]:
    """One of its schemas with other members; those that are None are taken away."""
    document = api()["components"]["schemas"][schema]
    members = {**document["properties"], **properties}
    kept = {name: each for name, each in members.items() if each is not None}
    return {
        **document,
        "properties": kept,
        "required": [name for name in document["required"] if name in kept],
    }


IN, ROW = with_("In"), with_("Row")
REQUIRED = {"in": "query", "name": "of", "required": True, "schema": {"type": "string"}}
BROKEN: dict[str, tuple[dict[str, Any], str]] = {
    "status": ({"status": "200"}, "POST /rows: status 201 is gone"),
    "parameter": ({"parameters": []}, "POST /rows: parameter `query limit` is gone"),
    "new parameter": (
        {"parameters": [*api()["paths"]["/rows"]["post"]["parameters"], REQUIRED]},
        "new parameter `query of` is",
    ),
    "member sent": ({"sent": with_("In", n=None)}, "member `n` is gone"),
    "required": ({"sent": {**IN, "required": ["name", "n"]}}, "member `n` is required now"),
    "new required": (
        {"sent": {**with_("In", of={"type": "string"}), "required": ["name", "of"]}},
        "new member `of` is required",
    ),
    "type sent": (
        {"sent": with_("In", n={"type": "string"})},
        "member `n` no longer accepts integer",
    ),
    "member answered": ({"row": with_("Row", kind=None)}, "member `kind` is gone"),
    "type answered": (
        {"row": with_("Row", id={"type": "integer"})},
        "member `id` now answers integer",
    ),
    "null answered": (
        {"row": with_("Row", id={"anyOf": [{"type": "string"}, {"type": "null"}]})},
        "`id` now answers null",
    ),
    "may be absent": ({"row": {**ROW, "required": []}}, "member `id` may be absent now"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_contract_is_named(name: str) -> None:
    changes, sentence = BROKEN[name]
    (broken,) = contract.breaks(contract.Contract(api()), contract.Contract(api(**changes)))
    assert sentence in broken


def test_an_operation_that_is_gone_is_named() -> None:
    old, new = contract.Contract(api()), contract.Contract({"paths": {}})
    assert list(contract.breaks(old, new)) == ["POST /rows is gone"]


ADDED: dict[str, dict[str, Any]] = {
    "member": {"row": with_("Row", more={"type": "number"})},
    "constant": {"row": with_("Row", kind={"enum": ["a", "b", "c"]})},
    "optional": {"sent": with_("In", more={"type": "number"})},
    "wider": {"sent": with_("In", n={"type": "number"})},
    "name": {"name": "RowOut"},
}


@pytest.mark.parametrize("name", ADDED)
def test_additions_break_nothing_but_are_to_be_written(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old, new = contract.Contract(api()), contract.Contract(api(**ADDED[name]))
    assert list(contract.breaks(old, new)) == []
    monkeypatch.setattr(contract, "FILE", tmp_path / "contract.txt")
    monkeypatch.setenv(golden.WRITE, "write")
    contract.check(old)
    monkeypatch.delenv(golden.WRITE)
    contract.check(old)
    with pytest.raises(AssertionError, match=r"nothing\nIs new or another:\n"):
        contract.check(new)


def test_a_contract_is_read_as_it_was_written() -> None:
    made = contract.Contract(json.loads(json.dumps(api())))
    again = contract.read(contract.text(made))
    assert (again.operations, again.schemas) == (made.operations, made.schemas)
