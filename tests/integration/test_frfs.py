"""FRFs over HTTP: from scripts in, in several formats out, and stored bytes that are checked on the
way.
"""

import csv
import io
import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any
from uuid import UUID

import httpx
import numpy as np
import pytest
import pyuff
from scipy.io import savemat

from fecore.frf import Dof
from modalbase.formats.registry import WRITERS
from service.app.supervisor import LocalService
from service.nouns.frfs.data import load_measured_campaign
from service.platform.db.engine import make_engine, make_sessions
from service.platform.web.downloads import MEMORY_BYTES
from tests.support.lengths import long
from tests.support.reality import refused
from tests.support.rest import ok

NPZ = {"Content-Type": "application/x-npz"}


def arrays(dtype: str = "complex128", count: int = 4, lines: int = 50) -> dict[str, Any]:
    rng = np.random.default_rng(5)
    values = rng.standard_normal((count, lines)) + 1j * rng.standard_normal((count, lines))
    return {
        "frequency_hz": np.arange(1, lines + 1) * 0.5,
        "values": values.astype(dtype),
        "response_point": np.arange(1, count + 1),
        "response_direction": np.full(count, 3),
        "reference_point": np.int64(33),
        "reference_direction": np.int64(-3),
        "quantity": np.array("mobility"),
    }


def npz(**named: Any) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **named)
    return buffer.getvalue()


def post(api: httpx.Client, campaign: str, **named: Any) -> httpx.Response:
    return api.post(f"campaigns/{campaign}/frfs", content=npz(**named), headers=NPZ)


@pytest.mark.parametrize("dtype", ["complex64", "complex128"])
def test_npz_goes_in_and_comes_out_bit_for_bit(
    api: httpx.Client, campaign: str, dtype: str
) -> None:
    sent = arrays(dtype)
    stored = ok(post(api, campaign, **sent), 201)["items"]
    assert [f["response_point"] for f in stored] == [1, 2, 3, 4]
    assert {
        (f["reference_point"], f["reference_direction"], f["quantity"], f["unit"], f["dtype"])
        for f in stored
    } == {(33, -3, "mobility", "m/s/N", dtype)}
    answer = api.get(f"campaigns/{campaign}/frfs/data", headers={"Accept": "application/x-npz"})
    assert answer.headers["content-type"] == "application/x-npz"
    with np.load(io.BytesIO(answer.content)) as got:
        assert got["values"].dtype == np.dtype(dtype)
        np.testing.assert_array_equal(got["values"], sent["values"])
        np.testing.assert_array_equal(got["frequency_hz"], sent["frequency_hz"])
        np.testing.assert_array_equal(got["reference_direction"], [-3] * 4)
        assert str(got["quantity"]) == "mobility"
        assert got["id"].tolist() == [f["id"] for f in stored]
        assert "coherence" not in got
        again = {name: got[name] for name in got.files}
    second = ok(api.post(f"campaigns/{campaign}/frfs", content=npz(**again), headers=NPZ), 201)[
        "items"
    ]
    assert [f["sha256"] for f in second] == [f["sha256"] for f in stored]


def test_json_goes_in_and_comes_out(api: httpx.Client, campaign: str) -> None:
    frf = {
        "response_point": 1,
        "response_direction": 3,
        "reference_point": 2,
        "reference_direction": -3,
        "real": [0.1, 0.2, 0.3],
        "imag": [1e-9, -2.5, 0.0],
        "coherence": [0.9, 0.8, 0.7],
        "averages": 10,
        "label": "tip, µm/N",
    }
    bare = {**frf, "response_point": 2, "coherence": None, "averages": None}
    body = {"quantity": "receptance", "frequency_hz": [1.0, 1.5, 7.25], "frfs": [frf, bare]}
    stored = ok(api.post(f"campaigns/{campaign}/frfs", json=body), 201)["items"]
    assert [(f["step_hz"], f["averages"], f["has_coherence"]) for f in stored] == [
        (None, 10, True),
        (None, None, False),
    ]
    data = ok(api.get(f"campaigns/{campaign}/frfs/data"), 200)
    assert data["frequency_hz"] == [1.0, 1.5, 7.25]
    assert (data["quantity"], data["unit"]) == ("receptance", "m/N")
    assert [{key: got[key] for key in frf} for got in data["frfs"]] == [frf, bare]
    with np.load(
        io.BytesIO(api.get(f"campaigns/{campaign}/frfs/data", params={"format": "npz"}).content)
    ) as got:
        np.testing.assert_array_equal(got["coherence"], [[0.9, 0.8, 0.7], [np.nan] * 3])


def test_csv_has_a_line_a_value(api: httpx.Client, campaign: str) -> None:
    sent = arrays(count=2, lines=3)
    first = ok(post(api, campaign, **sent), 201)["items"][0]
    answer = api.get(f"frfs/{first['id']}/data", headers={"Accept": "text/csv"})
    rows = list(csv.reader(io.StringIO(answer.text)))
    assert rows[0][4:7] == ["frequency_hz", "real", "imag"]
    got = [complex(float(row[5]), float(row[6])) for row in rows[1:]]
    np.testing.assert_array_equal(got, sent["values"][0])
    assert (
        len(api.get(f"campaigns/{campaign}/frfs/data", params={"format": "csv"}).text.splitlines())
        == 1 + 2 * 3
    )


def test_an_analysers_mat_goes_in_by_its_mapping(api: httpx.Client, campaign: str) -> None:
    file, hz, values = io.BytesIO(), np.arange(1.0, 9.0), np.arange(16).reshape(2, 8) * (1 + 2j)
    savemat(file, {"f": hz, "H": values, "coh": np.full((2, 8), 0.9)})
    mapping = {
        "frequency_hz": {"variable": "f"},
        "frf": {"variable": "H"},
        "coherence": {"variable": "coh"},
    }
    whole = {**mapping, "response_point": 33, "reference_point": [4, 5]}
    headers = {"Content-Type": "application/x-matlab-data"}

    def send(**params: str) -> httpx.Response:
        return api.post(
            f"campaigns/{campaign}/frfs", content=file.getvalue(), headers=headers, params=params
        )

    assert "the file suggests" in json.dumps(ok(send(quantity="mobility"), 422))
    ok(send(mapping=json.dumps(whole)), 422)
    ok(send(quantity="mobility", mapping=json.dumps(mapping)), 422)
    items = ok(send(quantity="mobility", mapping=json.dumps(whole)), 201)["items"]
    assert [(f["reference_point"], f["quantity"], f["has_coherence"]) for f in items] == [
        (4, "mobility", True),
        (5, "mobility", True),
    ]


def test_a_band_and_a_stride(api: httpx.Client, campaign: str) -> None:
    sent = arrays()
    first = ok(post(api, campaign, **sent), 201)["items"][0]
    path = f"frfs/{first['id']}/data"
    data = ok(api.get(path, params={"fmin": 2, "fmax": 5, "stride": 3}), 200)
    assert data["frequency_hz"] == [2.0, 3.5, 5.0]
    assert data["frfs"][0]["real"] == sent["values"][0].real[[3, 6, 9]].tolist()
    ok(api.get(path, params={"fmin": 100}), 422)
    ok(api.get(path, params={"stride": 0}), 422)
    ok(api.get(path, params={"fmin": "nan"}), 422)
    ok(api.get(path, params={"format": "xlsx"}), 422)
    ok(api.get(path, headers={"Accept": "image/png"}), 406)
    answer = api.get(path)
    unchanged = api.get(path, headers={"If-None-Match": answer.headers["ETag"]})
    assert (unchanged.status_code, unchanged.content) == (304, b"")
    part = api.get(path, headers={"Range": "bytes=0-9"})
    assert (part.status_code, part.content) == (206, answer.content[:10])


def test_filters_and_pages(api: httpx.Client, campaign: str) -> None:
    ok(post(api, campaign, **arrays()), 201)
    ok(post(api, campaign, **{**arrays(count=2), "quantity": np.array("accelerance")}), 201)
    path = f"campaigns/{campaign}/frfs"

    def count(**params: Any) -> int:
        return len(ok(api.get(path, params=params), 200)["items"])

    assert [count(), count(point=1), count(point=9), count(direction=3), count(direction=-3)] == [
        6,
        2,
        0,
        6,
        0,
    ]
    assert [count(reference=33), count(quantity="mobility"), count(fmin=30), count(fmax=0.1)] == [
        6,
        4,
        0,
        0,
    ]
    assert count(point=1, quantity="accelerance") == 1
    page = ok(api.get(path, params={"limit": 4}), 200)
    rest = ok(api.get(path, params={"limit": 4, "cursor": page["next_cursor"]}), 200)
    assert (len(page["items"]), len(rest["items"]), rest["next_cursor"]) == (4, 2, None)
    for params in (
        {"point": 1e30},
        {"quantity": "loudness"},
        {"fmin": 5, "fmax": 1},
        {"cursor": "?"},
    ):
        ok(api.get(path, params=params), 422)
    mistyped = ok(api.get(path, params={"point": 1, "referense": 33, "foo": 1}), 422)["errors"]
    assert [fault["pointer"] for fault in mistyped] == ["foo", "referense"]
    assert (
        "expected one of cursor, direction, fmax, fmin, import_id, limit, point, quantity,"
        " reference" in mistyped[0]["detail"]
    )
    assert "this address takes none" in ok(api.get("projects/x?y=1"), 422)["detail"]
    ok(api.get(f"campaigns/{campaign}/grid-points?limit=100"), 200)  # which come whole
    mixed = ok(api.get(f"{path}/data"), 409)
    assert "quantity" in mixed["detail"]
    assert len(ok(api.get(f"{path}/data", params={"quantity": "mobility"}), 200)["frfs"]) == 4
    ok(api.get(f"{path}/data", params={"point": 9}), 404)


def test_different_axes_are_named(api: httpx.Client, campaign: str) -> None:
    ok(post(api, campaign, **arrays(lines=50)), 201)
    ok(post(api, campaign, **arrays(lines=40)), 201)
    problem = ok(api.get(f"campaigns/{campaign}/frfs/data"), 409)
    assert "50 lines" in problem["detail"]
    assert "40 lines" in problem["detail"]


@pytest.mark.parametrize(
    ("change", "pointer"),
    [
        ({"values": np.ones((4, 50))}, "/values"),
        ({"values": np.ones((4, 49), complex)}, "/values"),
        ({"values": np.full((4, 50), complex(np.nan, 0))}, "/values"),
        ({"values": np.full((4, 50), complex(1e300, 0))}, "/values"),
        ({"values": np.full((4, 50), complex(0, 1e-300))}, "/values"),
        ({"frequency_hz": np.arange(50)[::-1]}, "/frequency_hz"),
        ({"frequency_hz": np.full(50, np.inf)}, "/frequency_hz"),
        ({"frequency_hz": np.arange(50).astype(str)}, "/frequency_hz"),
        ({"response_point": np.arange(3)}, "/response_point"),
        ({"response_point": np.array([1, 2, 3, 0])}, "/response_point"),
        ({"response_point": np.array([1.5, 2, 3, 4])}, "/response_point"),
        ({"response_direction": np.full(4, 7)}, "/direction"),
        ({"quantity": np.array("loudness")}, "/quantity"),
        ({"quantity": np.array(3)}, "/quantity"),
        ({"coherence": np.full((4, 50), 1.5)}, "/coherence"),
        ({"coherence": np.ones((4, 49))}, "/coherence"),
        ({"label": np.array(["a\0b", "b", "c", "d"])}, "/label"),
        ({"temperature": np.array(20.0)}, "/temperature.npy"),
    ],
)
def test_senseless_arrays_are_refused_by_name(
    tmp_path: Path, change: dict[str, Any], pointer: str
) -> None:
    faults = refused(npz(**{**arrays(), **change}), tmp_path / "a.npz", form="npz", kind="frfs")
    assert {fault.pointer for fault in faults} == {pointer}


def test_broken_archives_are_refused(api: httpx.Client, campaign: str, tmp_path: Path) -> None:
    whole = npz(**arrays())
    claims = io.BytesIO()
    with zipfile.ZipFile(claims, "w", zipfile.ZIP_DEFLATED) as archive:
        header = io.BytesIO()
        np.lib.format.write_array_header_1_0(
            header, {"descr": "<c16", "fortran_order": False, "shape": (10**6, 10**6)}
        )
        archive.writestr("values.npy", header.getvalue())
    pickled = io.BytesIO()
    np.savez(pickled, values=np.array([{"a": 1}], dtype=object))
    for content in (
        b"",
        b"PK",
        whole[:-40],
        whole[: len(whole) // 2],
        claims.getvalue(),
        pickled.getvalue(),
        npz(),
    ):
        assert refused(content, tmp_path / "a.npz", form="npz", kind="frfs")
    flipped = bytearray(whole)
    flipped[len(whole) // 3] ^= 0xFF
    ok(api.post(f"campaigns/{campaign}/frfs", content=bytes(flipped), headers=NPZ), 422)
    senseless = ok(post(api, campaign, **{**arrays(), "values": np.ones((4, 50))}), 422)
    assert [error["pointer"] for error in senseless["errors"]] == ["/values"]
    ok(
        api.post(
            f"campaigns/{campaign}/frfs", content=whole, headers={"Content-Type": "text/plain"}
        ),
        415,
    )
    assert ok(api.get(f"campaigns/{campaign}/frfs"), 200)["items"] == []


def test_a_spectrum_that_was_damaged_in_the_database_is_not_handed_out(
    api: httpx.Client, damaged: Callable[[str, str, str], None], campaign: str
) -> None:
    damaged("frfs", "id", ok(post(api, campaign, **arrays()), 201)["items"][0]["id"])
    path = f"campaigns/{campaign}/frfs/data"
    for format_ in WRITERS:  # the damaged one is the first of several, so its reading is broken off
        answer = api.get(path, params={"format": format_})
        assert answer.status_code == 500
        assert "checksum" in answer.text
    ok(api.get("projects"), 200)


def test_small_and_large_answers_are_the_same_to_a_client(api: httpx.Client, campaign: str) -> None:
    """A small answer comes from memory; a large one, and a part, from disk."""
    small = ok(post(api, campaign, **arrays()), 201)["items"][0]["id"]
    ok(post(api, campaign, **arrays(count=5, lines=MEMORY_BYTES // 16 // 4)), 201)
    named = ("Content-Type", "Content-Disposition", "Accept-Ranges", "Vary")
    answers = []
    for path in (f"frfs/{small}/data", f"campaigns/{campaign}/frfs/data"):
        path, params = f"{path}?format=uff", {"Range": "bytes=10-99"}
        whole, part, head = api.get(path), api.get(path, headers=params), api.head(path)
        assert (whole.status_code, part.status_code, head.status_code) == (200, 206, 200)
        assert part.content == whole.content[10:100]
        assert int(head.headers["Content-Length"]) == len(whole.content)
        assert head.content == b""
        assert part.headers["ETag"] == whole.headers["ETag"] == head.headers["ETag"]
        answers.append([[answer.headers[name] for name in named] for answer in (whole, head)])
    assert len(whole.content) > MEMORY_BYTES
    assert answers[0] == answers[1]


def test_the_core_gets_the_campaign_in_the_specimens_frame(
    api: httpx.Client, service: LocalService, new_campaign: Callable[..., str]
) -> None:
    """The file's x is the specimen's y, its y the specimen's -x; z stays."""
    campaign = new_campaign(
        frame={"origin_m": [1.0, 2.0, 0.0], "x_axis": [0.0, -1.0, 0.0], "y_axis": [1.0, 0.0, 0.0]},
        instruments={"sensor_mass_kg": 0.0048, "sensor_point": 2},
    )
    items = [
        {"label": 1, "x_m": 1.0, "y_m": 1.9, "z_m": 0.005},
        {"label": 2, "x_m": 1.02, "y_m": 1.5, "z_m": 0.005},
    ]
    ok(api.put(f"campaigns/{campaign}/grid-points", json={"items": items}), 200)
    sent = {**arrays(), "response_direction": np.array([3, 2, 1, -1])}
    sent["coherence"], sent["averages"] = np.full((4, 50), 0.9), np.int64(9)
    # as analysers write it where nothing came, and where rounding hid the noise
    sent["coherence"][0, :2] = (0.0, 1.0)
    sent["values"][0, 2] = 0
    ok(post(api, campaign, **sent), 201)
    ok(post(api, campaign, **arrays("complex64", lines=10)), 201)
    engine = make_engine(service.settings.database_url)
    with make_sessions(engine)() as session:
        measured = load_measured_campaign(session, UUID(campaign))
    engine.dispose()
    np.testing.assert_allclose(measured.points[1], (0.1, 0.0, 0.005), atol=1e-15)
    np.testing.assert_allclose(measured.points[2], (0.5, 0.02, 0.005), atol=1e-15)
    assert (measured.boundary, measured.sensor_mass_kg, measured.sensor_point) == (
        "cantilever",
        0.0048,
        2,
    )
    assert (measured.structure_version, measured.structure.density_kg_m3) == (1, 2012.0)
    large, small = measured.frf_sets
    assert large.frfs.responses == (Dof(1, 3), Dof(2, -1), Dof(3, 2), Dof(4, -2))
    np.testing.assert_array_equal(large.frfs.values, sent["values"])
    expected = np.abs(sent["values"]) ** 2 * 0.1 / (0.9 * 9)
    expected[0, :3] = np.nan
    np.testing.assert_allclose(large.frfs.variance, expected, rtol=1e-12)
    assert (small.frfs.values.shape, small.frfs.values.dtype, small.frfs.variance) == (
        (4, 10),
        np.complex128,
        None,
    )


def test_csv_comes_back_in(api: httpx.Client, campaign: str, tmp_path: Path) -> None:
    sent = {**arrays(), "coherence": np.full((4, 50), 0.75)}
    stored = ok(post(api, campaign, **sent), 201)["items"]
    text = api.get(f"campaigns/{campaign}/frfs/data", params={"format": "csv"}).content
    csv_type = {"Content-Type": "text/csv"}
    path = f"campaigns/{campaign}/frfs"
    again = ok(
        api.post(path, content=text, headers=csv_type, params={"quantity": "mobility"}), 201
    )["items"]
    assert [f["sha256"] for f in again] == [f["sha256"] for f in stored]
    assert all(f["has_coherence"] for f in again)
    for content, says in (
        (b"\n", "it is empty"),
        (text.splitlines()[0], "line 2"),
        (text.replace(b"0.5,", b"1/2,", 1), "line 2, frequency_hz"),
        (b"\n".join(text.splitlines()[:52]), "frequency_hz"),
        (text.replace(b"1,3,33,-3,0.5", b"1,3,33,-3", 1), "line 2"),
        (b"\xff" + text, "mapping"),
    ):
        faults = refused(content, tmp_path / "a.csv", "mobility", form="csv", kind="frfs")
        assert says in str(faults)
    assert "quantity" in str(ok(api.post(path, content=text, headers=csv_type), 422)["errors"])
    assert len(ok(api.get(path), 200)["items"]) == 8


@pytest.mark.parametrize("dtype", ["complex64", long("complex128")])
def test_uff_goes_out_and_comes_back_in_bit_for_bit(
    api: httpx.Client,
    campaign: str,
    new_campaign: Callable[..., str],
    imported: Callable[..., dict[str, Any]],
    tmp_path: Path,
    dtype: str,
) -> None:
    points = [{"label": n, "x_m": 0.1 * n, "y_m": -0.02, "z_m": 1 / 3} for n in (1, 2, 3, 4, 33)]
    ok(api.put(f"campaigns/{campaign}/grid-points", json={"items": points}), 200)
    sent = arrays(dtype)
    sent["coherence"] = np.linspace(0.1, 0.9, 200).reshape(4, 50)
    ok(post(api, campaign, **sent), 201)
    ok(
        post(
            api,
            campaign,
            **{**arrays(dtype, lines=7), "frequency_hz": np.array([1, 1.5, 3, 3.25, 4, 8, 9])},
        ),
        201,
    )
    answer = api.get(f"campaigns/{campaign}/frfs/data", headers={"Accept": "application/x-uff"})
    assert answer.headers["content-type"] == "application/x-uff"
    other = new_campaign(name="copy")
    done = imported(other, answer.content)
    assert (done["status"], done["counts"]) == (
        "succeeded",
        {"frfs": 8, "grid_points": 5, "modes": 0, "records": 0, "recordings": 0},
    ), done
    assert ok(api.get(f"campaigns/{other}/grid-points"), 200) == {"items": points}
    was, now = (ok(api.get(f"campaigns/{c}/frfs"), 200)["items"] for c in (campaign, other))
    same = (
        "response_point",
        "response_direction",
        "reference_point",
        "reference_direction",
        "quantity",
        "sha256",
    )
    assert [[f[key] for key in (*same, "dtype", "lines", "has_coherence")] for f in was] == [
        [f[key] for key in (*same, "dtype", "lines", "has_coherence")] for f in now
    ]
    for a, b in zip(was, now, strict=True):
        old, new = (ok(api.get(f"frfs/{f['id']}/data"), 200) for f in (a, b))
        assert old["frequency_hz"] == new["frequency_hz"]
        assert old["frfs"][0]["coherence"] == new["frfs"][0]["coherence"]
    (tmp_path / "out.uff").write_bytes(answer.content)
    sets = pyuff.UFF(str(tmp_path / "out.uff"))
    frfs = [s for s in sets.read_sets() if s["type"] == 58 and s["func_type"] == 4]
    assert len(frfs) == 8
    for mine, theirs in zip(sent["values"], frfs[:4], strict=True):
        np.testing.assert_array_equal(theirs["data"], mine)


def test_uff_as_text_keeps_thirteen_digits(
    api: httpx.Client,
    campaign: str,
    new_campaign: Callable[..., str],
    imported: Callable[..., dict[str, Any]],
) -> None:
    sent = arrays()
    ok(post(api, campaign, **sent), 201)
    text = api.get(
        f"campaigns/{campaign}/frfs/data", params={"format": "uff-ascii", "fmin": 2, "stride": 2}
    ).content
    assert text.isascii()
    other = new_campaign(name="copy")
    assert imported(other, text)["counts"]["frfs"] == 4
    data = ok(api.get(f"campaigns/{other}/frfs/data"), 200)
    np.testing.assert_allclose(data["frequency_hz"], sent["frequency_hz"][3::2], rtol=1e-12)
    got = np.array([np.array(f["real"]) + 1j * np.array(f["imag"]) for f in data["frfs"]])
    np.testing.assert_allclose(got, sent["values"][:, 3::2], rtol=1e-12)


def test_head_tells_without_sending(api: httpx.Client, campaign: str) -> None:
    frf = ok(post(api, campaign, **arrays()), 201)["items"][0]["id"]
    for path in (f"frfs/{frf}/data", f"campaigns/{campaign}/frfs/data"):
        head, whole = api.head(path), api.get(path)
        assert (head.status_code, head.content) == (200, b"")
        assert head.headers["Content-Length"] == str(len(whole.content))
        assert head.headers["ETag"] == whole.headers["ETag"]


def test_an_analysers_table_of_text_comes_in_by_a_mapping(api: httpx.Client, campaign: str) -> None:
    rows = "".join(
        f"{f / 2:.1f};{0.1 * f:.4f};{10 * f % 180},0\n".replace(".", ",") for f in range(1, 60)
    )
    content = f"Analyser;A\n\nFrequency;Magnitude;Phase\nHz;g/N;deg\n{rows}".encode()
    mapping = {
        "frequency_hz": {"variable": "Frequency"},
        "frf": {"magnitude": "Magnitude", "phase": "Phase"},
        "response_point": 2,
        "response_direction": 3,
        "reference_point": 1,
        "reference_direction": -3,
    }
    path, sent = f"campaigns/{campaign}/frfs", {"Content-Type": "text/csv"}
    (frf,) = ok(
        api.post(path, content=content, headers=sent, params={"mapping": json.dumps(mapping)}), 201
    )["items"]
    assert (frf["quantity"], frf["response_point"], frf["reference_direction"]) == (
        "accelerance",
        2,
        -3,
    )
    (data,) = ok(api.get(f"campaigns/{campaign}/frfs/data", params={"format": "json"}), 200)["frfs"]
    assert abs(complex(data["real"][0], data["imag"][0])) == pytest.approx(0.1 * 9.80665)
    params = {"mapping": json.dumps(mapping), "quantity": "mobility"}
    assert "is that of accelerance" in str(
        ok(api.post(path, content=content + b"\n", headers=sent, params=params), 422)["errors"]
    )
