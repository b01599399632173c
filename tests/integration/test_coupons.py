"""Coupons over HTTP: results and curves in, statistics out."""

import hashlib
import io
import json
from collections.abc import Callable
from typing import Any

import httpx
import numpy as np
import pytest

from tests.support.rest import ok
from tests.support.tables import parquet_rows

# docs/coupons.md, example 1: strain µε, force N, transverse strain µε
CURVE = [
    (0, 0, 0), (495, 990, -124), (990, 1980, -248), (1510, 3012, -377), (2015, 4012, -503), (2490, 4950, -622),
    (3020, 5990, -754), (5000, 9800, -1240), (8000, 15300, -1960), (10000, 19000, -2440),
]  # fmt: skip
WIDTH, THICKNESS = [25.02, 25.00, 24.98], [2.01, 2.00, 1.99]
SHEAR_GAMMA = [0, 1000, 2000, 3000, 4000, 5000, 6000, 8000, 12000, 16000, 30000, 49000, 60000]
SHEAR_TAU = [0, 5, 10, 15, 19.6, 24, 28, 34, 42, 48, 60, 70, 74]


def machine_file(rows: list[tuple[float, ...]]) -> bytes:
    """As a German machine writes it: cp1252, semicolons, decimal commas, a preamble, a line of
    units, a blank line.
    """
    lines = ["Prüfprotokoll;Nr. 17", "", "Kraft;Längsdehnung;Querdehnung", "kN;%;%"]
    for strain, force, transverse in rows:
        cells = (f"{force / 1000:.6f}", f"{strain / 1e4:.6f}", f"{transverse / 1e4:.6f}")
        lines.append(";".join(cells).replace(".", ","))
    return "\r\n".join([*lines, ""]).encode("cp1252")


COUPON: dict[str, Any] = {
    "specimen": "A1",
    "dimensions": {"unit": "mm", "width": WIDTH, "thickness": THICKNESS},
    "columns": {
        "force": "Kraft",
        "strain": "Längsdehnung",
        "transverse_strain": {"header": "Querdehnung", "unit": "%"},
    },
    "failure_code": "lgm",
}


@pytest.fixture
def batch(api: httpx.Client, structure: str) -> str:
    body = {"name": "0 degrees", "constants": ["Ex", "nu_xy"], "conditions": {"speed": "2 mm/min"}}
    return str(ok(api.post(f"structures/{structure}/coupon-batches", json=body), 201)["id"])


@pytest.fixture
def send(api: httpx.Client, batch: str) -> Callable[..., httpx.Response]:
    def post(data: bytes, to: str = batch, **changes: Any) -> httpx.Response:
        coupon = json.dumps({**COUPON, **changes})
        return api.post(
            f"coupon-batches/{to}/coupons",
            files={"file": ("C:\\tests\\A1.csv", data)},
            data={"coupon": coupon},
        )

    return post


def test_a_curve_becomes_results_and_stays_with_them(
    api: httpx.Client, batch: str, send: Callable[..., httpx.Response]
) -> None:
    data = machine_file(CURVE)
    (coupon,) = ok(send(data), 201)["items"]
    # by hand in docs/coupons.md: E 39.5074 GPa, nu 0.2493, F 380.0 MPa, ultimate strain 10000 µε
    assert coupon["E_Pa"] == pytest.approx(39.5074e9, rel=2e-6)
    assert coupon["nu"] == pytest.approx(0.2493, abs=5e-5)
    assert coupon["strength_Pa"] == pytest.approx(380.0e6, rel=1e-9)
    assert coupon["ultimate_strain"] == pytest.approx(0.01, rel=1e-9)
    assert (coupon["failure_code"], coupon["has_curve"], coupon["warnings"]) == ("LGM", True, [])
    address = f"coupons/{coupon['id']}/figures/curve"
    figure = ok(api.get(address), 200)
    drawn = {trace["name"]: trace for trace in figure["data"]}
    area = np.mean(WIDTH) * np.mean(THICKNESS)
    np.testing.assert_allclose(
        drawn["measured"]["y"], [force / area for _, force, _ in CURVE], rtol=1e-6
    )
    chord, nu = drawn["chord, modulus E = 39.51 GPa"], drawn["Poisson's ratio ν = 0.249"]
    # MPa per %
    assert np.diff(chord["y"]) / np.diff(chord["x"]) == pytest.approx(395.074, rel=1e-5)
    assert np.diff(nu["y"]) / np.diff(nu["x"]) == pytest.approx(-0.2493, abs=5e-5)
    assert drawn["bounds, 990 and 3020 µε"]["x"] == pytest.approx([0.099, 0.302])
    etag = api.get(address).headers["etag"]
    assert api.get(address, headers={"If-None-Match": etag}).status_code == 304
    assert api.get(address, params={"format": "svg"}).content.startswith(b"<?xml")
    curve = ok(api.get(f"coupons/{coupon['id']}/curve"), 200)
    file = curve["file"]
    assert (file["filename"], file["encoding"], file["delimiter"], file["decimal"]) == (
        "A1.csv",
        "cp1252",
        ";",
        ",",
    )
    assert file["units"] == {"force": "kN", "strain": "%", "transverse_strain": "%"}
    assert file["sha256"] == hashlib.sha256(data).hexdigest()
    assert curve["reduction"]["area_m2"] == pytest.approx(50e-6, rel=1e-12)
    assert curve["reduction"]["chord_range"] == pytest.approx([990e-6, 3020e-6], rel=1e-9)
    assert curve["request"]["dimensions"]["width"] == WIDTH
    assert (
        ok(api.get(f"coupon-batches/{batch}/summary"), 200)["constants"]["Ex"]["mean"]
        == coupon["E_Pa"]
    )


def test_a_strain_that_was_not_tared_is_zeroed_where_that_is_stated(
    send: Callable[..., httpx.Response],
) -> None:
    tared = ok(send(machine_file(CURVE)), 201)["items"][0]
    shifted = machine_file([(row[0] + 228_000, *row[1:]) for row in CURVE])
    refused = ok(send(shifted, specimen="A2"), 422)
    assert '"zero": {"strain": "first"}' in str(refused["errors"])
    for zero, specimen in (("first", "A3"), (22.8, "A4")):  # in per cent, the unit of the column
        coupon = ok(
            send(shifted + specimen.encode(), specimen=specimen, zero={"strain": zero}), 201
        )["items"][0]
        assert coupon["E_Pa"] == pytest.approx(tared["E_Pa"], rel=1e-6)
        assert coupon["ultimate_strain"] == pytest.approx(tared["ultimate_strain"], rel=1e-6)
    ok(send(shifted, specimen="A5", zero={"strain_back": "first"}), 422)


def test_the_curve_and_its_file_go_out(
    api: httpx.Client, send: Callable[..., httpx.Response]
) -> None:
    data = machine_file(CURVE)
    path = f"coupons/{ok(send(data), 201)['items'][0]['id']}/curve"
    original = api.get(f"{path}/original")
    assert original.content == data
    assert "A1.csv" in original.headers["content-disposition"]
    force = [row[1] for row in CURVE]
    with np.load(io.BytesIO(api.get(f"{path}/data", params={"format": "npz"}).content)) as arrays:
        assert set(arrays) == {"force", "strain", "transverse_strain"}
        assert arrays["force"] == pytest.approx(force, rel=1e-12)
    sent = ok(api.get(f"{path}/data"), 200)
    assert sent["units"] == {"force": "N", "strain": "m/m", "transverse_strain": "m/m"}
    assert sent["series"]["strain"] == pytest.approx([row[0] * 1e-6 for row in CURVE], rel=1e-12)
    lines = api.get(f"{path}/data", params={"format": "csv"}).text.splitlines()
    assert lines[0] == "force (N),strain (m/m),transverse_strain (m/m)"
    assert len(lines) == 1 + len(CURVE)


def test_a_lost_gauge_is_empty_cells_and_null(
    api: httpx.Client, send: Callable[..., httpx.Response]
) -> None:
    text = machine_file(CURVE).decode("cp1252").splitlines()
    force, _, transverse = text[-1].split(";")
    text[-1] = f"{force};;{transverse}"
    (coupon,) = ok(send("\r\n".join(text).encode("cp1252")), 201)["items"]
    assert coupon["ultimate_strain"] is None
    assert any("strain ends" in warning for warning in coupon["warnings"])
    sent = ok(api.get(f"coupons/{coupon['id']}/curve/data"), 200)
    assert sent["series"]["strain"][-1] is None
    last = api.get(
        f"coupons/{coupon['id']}/curve/data", params={"format": "csv"}
    ).text.splitlines()[-1]
    assert last.split(",")[1] == ""
    accepted = {"Accept": "application/vnd.apache.parquet"}
    rows = parquet_rows(api.get(f"coupons/{coupon['id']}/curve/data", headers=accepted).content)
    assert np.isnan(rows[-1]["strain"])
    assert [row["force"] for row in rows] == sent["series"]["force"]


def test_of_a_restarted_machine_one_run_is_chosen(send: Callable[..., httpx.Response]) -> None:
    first = machine_file(CURVE[:6])
    data = first + machine_file(CURVE).split(b"\r\n", 2)[2]  # the header comes again
    problem = ok(send(data), 422)
    assert problem["errors"][0]["pointer"] == "/run"
    assert "restarted" in problem["errors"][0]["detail"]
    (coupon,) = ok(send(data, run=2), 201)["items"]
    assert coupon["E_Pa"] == pytest.approx(39.5074e9, rel=2e-6)


def test_what_cannot_be_reduced_is_refused_with_its_pointer(
    api: httpx.Client, batch: str, send: Callable[..., httpx.Response]
) -> None:
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"columns": {"force": "Kraft"}}, ""),
        ({"columns": {"force": "Last", "strain": "Längsdehnung"}}, "/columns"),
        (
            {"columns": {"force": {"header": "Kraft", "unit": "N"}, "strain": "Längsdehnung"}},
            "/columns/force/unit",
        ),
        (
            {"columns": {"force": "Kraft", "strain": "Längsdehnung", "shear": 3}},
            "/columns/shear/[key]",
        ),
        (
            {"dimensions": {"unit": "mm", "width": [25.0, 2.5], "thickness": [2.0]}},
            "/dimensions/width",
        ),
        ({"dimensions": {"unit": "yard", "width": [25.0], "thickness": [2.0]}}, "/dimensions/unit"),
        ({"chord_range": [0.003, 0.001]}, "/chord_range"),
        ({"chord_range": [0.02, 0.03]}, "/strain"),
        ({"chord_start": 0.002}, ""),
        ({"standard": "D3518", "chord_range": [0.001, 0.003]}, ""),
        ({"excluded": True}, ""),
        ({"failure_code": "QQQ"}, "/failure_code"),
        ({"run": 2}, "/run"),
    ]
    for changes, pointer in wrong:
        problem = ok(send(machine_file(CURVE), **changes), 422)
        assert {error["pointer"] for error in problem["errors"]} == {pointer}, changes
    for data in (b"", b"\0\1\2", b"-1", b"Kraft;L\xe4ngsdehnung;Querdehnung\n"):
        assert ok(send(data), 422)["errors"], data
    assert ok(api.get(f"coupon-batches/{batch}/coupons"), 200)["items"] == []


def test_a_body_that_is_neither_is_refused(api: httpx.Client, batch: str) -> None:
    path = f"coupon-batches/{batch}/coupons"
    ok(api.post(path, content=b"a,b", headers={"Content-Type": "text/csv"}), 415)
    no_file = ok(api.post(path, data={"coupon": "{}"}, files={"other": b"x"}), 422)
    assert no_file["errors"][0]["pointer"] == "/file"
    no_coupon = ok(api.post(path, files={"file": b"x"}), 422)
    assert no_coupon["errors"][0]["pointer"] == "/coupon"
    broken = {"Content-Type": "multipart/form-data; boundary=x"}
    ok(api.post(path, content=b"--y nonsense", headers=broken), 422)
    assert ok(api.post(path, content=b"[]", headers={"Content-Type": "application/json"}), 422)[
        "errors"
    ]


def test_a_specimen_is_excluded_later_with_a_reason(
    api: httpx.Client, batch: str, send: Callable[..., httpx.Response]
) -> None:
    (coupon,) = ok(send(machine_file(CURVE)), 201)["items"]
    path = f"coupons/{coupon['id']}"
    out = {"excluded": True, "exclusion_reason": "slipped in the grip"}
    ok(api.patch(path, json=out), 428)
    tag = api.get(path).headers["etag"]
    ok(api.patch(path, json={"excluded": True}, headers={"If-Match": tag}), 422)
    changed = ok(api.patch(path, json=out, headers={"If-Match": tag}), 200)
    assert (changed["excluded"], changed["exclusion_reason"]) == (True, "slipped in the grip")
    ok(api.patch(path, json=out, headers={"If-Match": tag}), 412)
    summary = ok(api.get(f"coupon-batches/{batch}/summary"), 200)
    assert summary["excluded"] == [{"specimen": "A1", "reason": "slipped in the grip"}]
    assert summary["constants"] == {}
    ok(api.patch(path, json={"excluded": False}, headers={"If-Match": "*"}), 200)
    assert "Ex" in ok(api.get(f"coupon-batches/{batch}/summary"), 200)["constants"]


def test_results_without_a_curve_have_none(api: httpx.Client, batch: str) -> None:
    (coupon,) = ok(
        api.post(f"coupon-batches/{batch}/coupons", json={"specimen": "B", "E_Pa": 33e9}), 201
    )["items"]
    assert (coupon["has_curve"], coupon["warnings"]) == (False, [])
    ok(api.get(f"coupons/{coupon['id']}/curve"), 404)


def test_a_damaged_curve_is_not_handed_out(
    api: httpx.Client,
    send: Callable[..., httpx.Response],
    damaged: Callable[[str, str, str], None],
) -> None:
    (coupon,) = ok(send(machine_file(CURVE)), 201)["items"]
    damaged("coupon_curves", "coupon_id", coupon["id"])
    problem = ok(api.get(f"coupons/{coupon['id']}/curve/data"), 500)
    assert "checksum" in problem["detail"]


def test_the_same_file_is_not_counted_twice(send: Callable[..., httpx.Response]) -> None:
    first = ok(send(machine_file(CURVE)), 201)
    assert ok(send(machine_file(CURVE)), 201) == first  # a script that is run again
    assert "as specimen A1" in ok(send(machine_file(CURVE), failure_code="AGM"), 409)["detail"]
    problem = ok(send(machine_file(CURVE), specimen="A2"), 409)
    assert "run 1 of this file already, as specimen A1" in problem["detail"]


def test_a_thickness_ten_times_anothers_is_said_at_once(
    send: Callable[..., httpx.Response],
) -> None:
    ok(send(machine_file(CURVE)), 201)
    other = [(strain, 1.01 * force, transverse) for strain, force, transverse in CURVE]
    thick = {"unit": "mm", "width": WIDTH, "thickness": [20.1, 20.0, 19.9]}
    (coupon,) = ok(send(machine_file(other), specimen="A2", dimensions=thick), 201)["items"]
    (warning,) = coupon["warnings"]
    assert "thickness is 20 mm, 10 times that of the batch's other specimens (2 mm)" in warning


def test_an_elongation_becomes_a_strain_by_the_gauge_length(
    send: Callable[..., httpx.Response],
) -> None:
    lines = [
        "Load (N);Elongation (mm)",
        *(f"{force};{strain * 50e-6}" for strain, force, _ in CURVE),
    ]
    columns = {"force": "Load", "strain": "Elongation"}
    data = "\n".join(lines).encode()
    problem = ok(send(data, columns=columns), 422)
    assert "state the gauge length" in problem["detail"]
    gauged = {"unit": "mm", "width": WIDTH, "thickness": THICKNESS, "gauge_length": 50.0}
    (coupon,) = ok(send(data, columns=columns, dimensions=gauged), 201)["items"]
    # as with strains, by hand in docs/coupons.md
    assert coupon["E_Pa"] == pytest.approx(39.5074e9, rel=2e-6)
    assert coupon["ultimate_strain"] == pytest.approx(0.01, rel=1e-9)


# --- coupon batches over HTTP
# -------------------------------------------------------------------------------------------

MODULI = [32.1e9, 33.4e9, 33.0e9, 34.2e9, 32.8e9]


def test_a_batch_of_specimens_in_numbers(api: httpx.Client, structure: str, batch: str) -> None:
    specimens = [
        {"specimen": f"A{i}", "E_Pa": e, "nu": 0.15, "failure_code": "lgm"}
        for i, e in enumerate(MODULI)
    ]
    slipped = {
        "specimen": "A9",
        "E_Pa": 20e9,
        "excluded": True,
        "exclusion_reason": "slipped in the grip",
    }
    stored = ok(api.post(f"coupon-batches/{batch}/coupons", json=[*specimens, slipped]), 201)[
        "items"
    ]
    assert [c["failure_code"] for c in stored] == ["LGM"] * 5 + [None]
    summary = ok(api.get(f"coupon-batches/{batch}/summary"), 200)
    # by hand: mean 33.1; deviations -1, .3, -.1, 1.1, -.3; squares sum 2.40; s = sqrt(2.40/4) =
    # .774597
    modulus = summary["constants"]["Ex"]
    assert modulus == summary["properties"]["E_Pa"]
    assert (modulus["n"], modulus["unit"], modulus["source"]) == (5, "Pa", "specimens")
    assert modulus["mean"] == pytest.approx(33.1e9, rel=1e-12)
    assert modulus["standard_deviation"] == pytest.approx(0.6**0.5 * 1e9, rel=1e-9)
    assert modulus["cv_percent"] == pytest.approx(100 * 0.6**0.5 / 33.1, rel=1e-9)
    assert summary["constants"]["nu_xy"]["standard_deviation"] == 0
    assert summary["excluded"] == [{"specimen": "A9", "reason": "slipped in the grip"}]
    assert summary["warnings"] == [
        "nu_xy: no prior: standard_deviation: is 0; specimens that agree to the last digit were not"
        " measured"
    ]
    # the next piece of the same material: t with 4 degrees of freedom, s √(1 + 1/5), as in
    # docs/coupons.md
    assert summary["priors"]["Ex"]["standard_deviation"] == pytest.approx(
        0.6**0.5 * 1e9 * 1.55179, rel=1e-5
    )
    (listed,) = ok(api.get(f"structures/{structure}/coupon-batches"), 200)["items"]
    assert (listed["coupons"], listed["conditions"]) == (6, {"speed": "2 mm/min"})
    assert ok(api.get(f"coupon-batches/{batch}/coupons"), 200)["items"] == stored


def test_the_key_is_checked_before_the_body(api: httpx.Client, batch: str) -> None:
    path = f"coupon-batches/{batch}/coupons"
    for body in ({"specimen": "A"}, "nonsense"):
        ok(api.post(path, json=body, headers={"Authorization": ""}), 401)
    ok(api.post(path, files={"file": b""}, headers={"Authorization": "Bearer wrong"}), 401)


def test_a_specimen_is_recorded_once(api: httpx.Client, batch: str) -> None:
    coupon = {"specimen": "A1", "E_Pa": 33e9}
    ok(api.post(f"coupon-batches/{batch}/coupons", json=coupon), 201)
    ok(
        api.post(f"coupon-batches/{batch}/coupons", json=[{"specimen": "A2", "nu": 0.1}, coupon]),
        409,
    )
    assert len(ok(api.get(f"coupon-batches/{batch}/coupons"), 200)["items"]) == 1
