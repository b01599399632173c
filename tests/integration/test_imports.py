"""Imports over HTTP: a laboratory's file in, its parts in the tables, and nothing of a file that is
broken.
"""

import contextlib
import hashlib
import http.client
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import psycopg
import pytest

from service.app.supervisor import LocalService
from service.platform.db.engine import psycopg_url
from tests.support.rest import ok
from tests.support.uff import set_58
from tests.support.waiting import PATIENCE

Imported = Callable[..., dict[str, Any]]
Rows = Callable[..., list[dict[str, Any]]]

HEADER = """    -1
   164
         1  SI: Meter (newton)         1
   1.0000000000000000D+00   1.0000000000000000D+00   1.0000000000000000D+00
   2.7314999999999998D+02
    -1
"""


def points(*labels_x: tuple[int, float]) -> str:
    """Set 2411 with points on the x axis."""
    lines = [
        f"{label:10d}         0         0         1\n{x:25.16e}{0:25.16e}{0:25.16e}\n"
        for label, x in labels_x
    ]
    return "    -1\n  2411\n" + "".join(lines) + "    -1\n"


def function(response: int, reference: int, values: list[complex], kind: int = 4) -> str:
    """Set 58: an accelerance (type 4) or a coherence (type 6) on lines 1, 2, 3 … Hz."""
    is_complex = kind == 4
    numbers = [x for v in values for x in ((v.real, v.imag) if is_complex else (v.real,))]
    rows = [numbers[i : i + 4] for i in range(0, len(numbers), 4)]
    ordinate = (
        "        12    0    0    0 Acceleration         m/s^2               \n"
        if is_complex
        else ("         0    0    0    0 Coherence            NONE                \n")
    )
    denominator = (
        "        13    0    0    0 Force                N                   \n"
        if is_complex
        else ("         0    0    0    0 NONE                 NONE                \n")
    )
    return (
        "    -1\n    58\nFRF"
        f" {response}Z/{reference}Z\nNONE\nNONE\nNONE\nNONE\n{kind:5d}{response:10d}{1:5d}{0:10d}"
        f" {'NONE':10s}{response:10d}{3:4d}"
        f" {'NONE':10s}{reference:10d}{3:4d}\n"
        f"{6 if is_complex else 4:10d}{len(values):10d}{1:10d}{1.0:13.5e}{1.0:13.5e}{0.0:13.5e}\n"
        "        18    0    0    0 Frequency            Hz                  \n"
        + ordinate
        + denominator
        + "         0    0    0    0 NONE                 NONE                \n"
        + "".join("".join(f"{x:20.12e}" for x in row) + "\n" for row in rows)
        + "    -1\n"
    )


def small_file() -> bytes:
    text = HEADER + points((1, 0.1), (2, 0.2)) + function(1, 2, [1 + 2j, 3 + 4j, 5 - 6j])
    return (text + function(1, 2, [0.5, 0.75, 1.0], kind=6)).encode()


@pytest.fixture
def stored(rows: Rows) -> Callable[[str], dict[str, int]]:
    """How many rows of each table belong to a campaign."""

    def count(campaign: str) -> dict[str, int]:
        tables = ("frfs", "grid_points", "mode_sets")
        return {
            t: rows(f"SELECT count(*) AS n FROM {t} WHERE campaign_id = %s", campaign)[0]["n"]
            for t in tables
        }

    return count


NOTHING = {"frfs": 0, "grid_points": 0, "mode_sets": 0}


@pytest.mark.parametrize("name", ["cantilever-1pct", "free-1pct"])
def test_a_laboratorys_file_comes_in_whole(
    api: httpx.Client, campaign: str, imported: Imported, blind_open: Path, rows: Rows, name: str
) -> None:
    content = (blind_open / f"{name}.uff").read_bytes()
    done = imported(campaign, content, filename=f"{name}.uff")
    assert done["status"] == "succeeded", done
    assert done["counts"] == {
        "frfs": 33,
        "grid_points": 33,
        "modes": 0,
        "records": 0,
        "recordings": 0,
    }
    assert (done["filename"], done["size"], done["error"]) == (f"{name}.uff", len(content), None)
    assert done["sha256"] == hashlib.sha256(content).hexdigest()
    assert [d["number"] for d in done["datasets"]] == list(range(1, len(done["datasets"]) + 1))
    assert {d["outcome"] for d in done["datasets"]} == {"read"}
    assert all(content[d["offset"] :].lstrip().startswith(b"-1") for d in done["datasets"])
    frfs = ok(api.get(f"campaigns/{campaign}/frfs"), 200)["items"]
    assert {f["response_point"] for f in frfs} | {f["reference_point"] for f in frfs} == set(
        range(1, 34)
    )
    assert {(f["quantity"], f["start_hz"], f["step_hz"]) for f in frfs} == {
        ("accelerance", 1.0, 1.0)
    }
    assert len(ok(api.get(f"campaigns/{campaign}/grid-points"), 200)["items"]) == 33
    kept = rows(
        "SELECT data FROM original_chunks WHERE sha256 = %s ORDER BY number",
        bytes.fromhex(done["sha256"]),
    )
    assert b"".join(bytes(row["data"]) for row in kept) == content


def test_a_coherence_goes_to_an_frf_whose_line_at_0_hz_is_left_out(
    api: httpx.Client, campaign: str, imported: Imported
) -> None:
    """Integration leaves 0/0 there in the FRF alone."""
    gap = set_58(f"{'NaN':>13}{'NaN':>13}{1.0:13.5e}{2.0:13.5e}", kind=5, points=2)
    done = imported(
        campaign, gap + set_58(f"{0.25:13.5e}{0.75:13.5e}", kind=2, points=2, function=6)
    )
    assert [d["outcome"] for d in done["datasets"]] == ["read", "read"], done["datasets"]
    (frf,) = ok(api.get(f"campaigns/{campaign}/frfs"))["items"]
    got = ok(api.get(f"frfs/{frf['id']}/data"))
    assert (got["frequency_hz"], got["frfs"][0]["coherence"]) == ([1.0], [0.75])


def test_a_coherence_goes_to_its_frf(api: httpx.Client, campaign: str, imported: Imported) -> None:
    done = imported(campaign, small_file())
    assert done["status"] == "succeeded", done
    (frf,) = ok(api.get(f"campaigns/{campaign}/frfs"), 200)["items"]
    assert frf["has_coherence"]
    data = ok(api.get(f"frfs/{frf['id']}/data"), 200)
    assert data["frequency_hz"] == [1.0, 2.0, 3.0]
    assert data["frfs"][0]["real"] == [1.0, 3.0, 5.0]
    assert data["frfs"][0]["imag"] == [2.0, 4.0, -6.0]
    assert data["frfs"][0]["coherence"] == [0.5, 0.75, 1.0]


def test_frfs_without_points_are_noted_and_no_computation_says_that_there_are_none(
    api: httpx.Client, campaign: str, imported: Imported, finished: Callable[[str], dict[str, Any]]
) -> None:
    done = imported(campaign, set_58(f"{1.0:13.5e}{2.0:13.5e}", kind=5, points=1, response=(0, 0)))
    assert "its response has no point and no direction" in done["datasets"][0]["notes"][0]
    queued = api.post(f"campaigns/{campaign}/identifications", json={})
    ended = finished(queued.headers["Location"])
    assert "has 1 FRF, and none states point and direction" in str(ended["error"])


def test_a_coherence_without_its_frf_is_reported(campaign: str, imported: Imported) -> None:
    text = HEADER + function(1, 2, [1 + 2j, 3 + 4j]) + function(5, 2, [0.5, 0.75], kind=6)
    done = imported(campaign, text.encode())
    assert [d["outcome"] for d in done["datasets"]] == ["read", "read", "ignored"]
    assert "no FRF" in done["datasets"][2]["reason"]
    assert "1, 2" in done["warnings"][0]  # points without coordinates


def test_points_off_the_specimen_are_told_as_a_file_comes_in(
    api: httpx.Client, campaign: str, imported: Imported
) -> None:
    """The specimen is 0.5 m long. Point 2 lies 8 mm beyond its end, which counts as on the edge; 3
    and 4 lie further out.
    """
    structure = ok(api.get(f"campaigns/{campaign}"), 200)["structure_id"]
    assert ok(api.get(f"structures/{structure}"), 200)["geometry"]["length_m"] == 0.5
    frfs = "".join(function(response, 1, [1 + 2j, 3 + 4j]) for response in (2, 3, 4))
    text = HEADER + points((1, 0.1), (2, 0.508), (3, 0.512), (4, -0.1), (5, 7.0)) + frfs
    (warning,) = imported(campaign, text.encode())["warnings"]
    assert warning.startswith(
        "FRFs name grid points off the specimen: 3, 4; an update will refuse them: check"
    )
    moved = {"frame": {"origin_m": [0, 3.0, 0]}}
    ok(api.patch(f"campaigns/{campaign}", json=moved, headers={"If-Match": "*"}), 200)
    (warning,) = imported(campaign, (HEADER + function(2, 1, [5 + 6j, 7 + 8j])).encode())[
        "warnings"
    ]
    assert "off the specimen: 1, 2;" in warning


def test_a_multipart_form_does_as_well(
    api: httpx.Client, campaign: str, finished: Callable[[str], dict[str, Any]]
) -> None:
    files = {"file": ("C:\\data\\beam.uff", small_file(), "application/octet-stream")}
    answer = api.post(f"campaigns/{campaign}/imports", files=files)
    assert ok(answer, 202)["filename"] == "beam.uff"
    assert finished(answer.headers["Location"])["counts"] == {
        "frfs": 1,
        "grid_points": 2,
        "modes": 0,
        "records": 0,
        "recordings": 0,
    }


def test_a_form_without_a_file_is_refused(api: httpx.Client, campaign: str) -> None:
    problem = ok(api.post(f"campaigns/{campaign}/imports", files={"other": ("a.uff", b"x")}), 422)
    assert problem["errors"][0]["pointer"] == "/file"
    broken = {"Content-Type": "multipart/form-data; boundary=x"}
    ok(api.post(f"campaigns/{campaign}/imports", content=b"no boundary here", headers=broken), 422)
    ok(
        api.post(
            f"campaigns/{campaign}/imports",
            content=b"x",
            headers={"Content-Type": "multipart/form-data"},
        ),
        422,
    )


def test_the_same_bytes_are_not_imported_twice(
    api: httpx.Client,
    campaign: str,
    new_campaign: Callable[..., str],
    imported: Imported,
    stored: Callable[[str], dict[str, int]],
    rows: Rows,
) -> None:
    first = imported(campaign, small_file())
    again = api.post(f"campaigns/{campaign}/imports", content=small_file())
    assert ok(again, 200)["already_imported"]
    assert again.headers["Location"] == f"/api/v1/imports/{first['id']}"
    assert stored(campaign)["frfs"] == 1
    other = new_campaign(name="other")
    assert imported(other, small_file())["status"] == "succeeded"
    assert stored(other)["frfs"] == 1
    sha256 = bytes.fromhex(first["sha256"])
    assert len(rows("SELECT size FROM originals WHERE sha256 = %s", sha256)) == 1


def test_a_dry_run_only_reports(
    api: httpx.Client, campaign: str, imported: Imported, stored: Callable[[str], dict[str, int]]
) -> None:
    done = imported(campaign, small_file(), dry_run="true")
    assert (done["status"], done["dry_run"]) == ("succeeded", True)
    assert done["counts"] == {
        "frfs": 1,
        "grid_points": 2,
        "modes": 0,
        "records": 0,
        "recordings": 0,
    }
    assert stored(campaign) == NOTHING
    assert imported(campaign, small_file())["counts"] == done["counts"]
    assert stored(campaign)["frfs"] == 1
    listed = ok(api.get(f"campaigns/{campaign}/imports"), 200)["items"]
    assert [i["dry_run"] for i in listed] == [False]


def test_a_damaged_file_fails_with_the_reason_and_leaves_nothing(
    campaign: str, imported: Imported, blind_open: Path, stored: Callable[[str], dict[str, int]]
) -> None:
    whole = (blind_open / "cantilever-1pct.uff").read_bytes()
    for content, says in (
        (whole[: len(whole) * 2 // 3], "byte"),
        (bytes(range(256)) * 40, "of a format that is not read"),
    ):
        done = imported(campaign, content)
        assert (done["status"], says in str(done["error"])) == ("failed", True), done
        assert (done["counts"], done["datasets"]) == (None, [])
    assert stored(campaign) == NOTHING


def test_an_empty_body_is_refused_at_once(api: httpx.Client, campaign: str, rows: Rows) -> None:
    answer = api.post(f"campaigns/{campaign}/imports", content=b"")
    assert answer.headers["content-type"].startswith("application/problem+json")
    assert "empty" in str(ok(answer, 422))
    ok(api.post(f"campaigns/{campaign}/imports", files={"file": ("a.uff", b"")}), 422)
    assert rows("SELECT 1 FROM imports WHERE campaign_id = %s", campaign) == []


def test_a_failed_import_may_be_tried_again(
    api: httpx.Client, campaign: str, imported: Imported
) -> None:
    assert imported(campaign, b"nonsense")["status"] == "failed"
    ok(api.post(f"campaigns/{campaign}/imports", content=b"nonsense"), 202)


def test_a_point_that_lies_elsewhere_stops_the_import(
    campaign: str, imported: Imported, stored: Callable[[str], dict[str, int]]
) -> None:
    assert (
        imported(campaign, (HEADER + points((1, 0.1), (2, 0.2))).encode())["status"] == "succeeded"
    )
    moved = HEADER + points((3, 0.3), (2, 0.25)) + function(1, 2, [1 + 0j, 2 + 0j])
    done = imported(campaign, moved.encode())
    assert done["status"] == "failed"
    assert "grid point 2 lies at (0.25, 0, 0) m in the file and at (0.2, 0, 0) m" in str(
        done["error"]
    )
    assert stored(campaign) == {"frfs": 0, "grid_points": 2, "mode_sets": 0}
    same = HEADER + points((2, 0.2 + 1e-8), (3, 0.3))
    assert imported(campaign, same.encode())["counts"]["grid_points"] == 2
    assert stored(campaign)["grid_points"] == 3


def test_values_that_no_structure_has_are_refused_with_their_size(
    campaign: str, imported: Imported
) -> None:
    wild = [function(2, 1, [1e300 + 0j] * 3), function(3, 1, [1j * 1e-300] * 3)]
    done = imported(campaign, (HEADER + function(1, 1, [1 + 1j] * 3) + "".join(wild)).encode())
    assert (done["status"], done["counts"]["frfs"]) == ("succeeded", 1)
    assert [(each["outcome"], each["reason"]) for each in done["datasets"][-2:]] == [
        (
            "refused",
            f"reaches {size}, expected its largest between 1e-70 and 1e+70; check unit and scale",
        )
        for size in ("1e+300", "1e-300")
    ]


def test_a_file_with_nothing_to_store_says_why(
    campaign: str, imported: Imported, uff_corpus: Path, stored: Callable[[str], dict[str, int]]
) -> None:
    done = imported(campaign, (uff_corpus / "pyuff" / "sample_dataset58_psd.uff").read_bytes())
    assert done["status"] == "failed"
    assert "dataset 1" in str(done["error"])
    assert stored(campaign) == NOTHING


def test_modes_of_a_file_become_a_mode_set(
    api: httpx.Client, campaign: str, imported: Imported, uff_corpus: Path
) -> None:
    done = imported(
        campaign,
        (uff_corpus / "pyuff" / "uff55_translation.uff").read_bytes(),
        filename="shapes.uff",
    )
    assert done["status"] == "succeeded", done
    (mode_set,) = ok(api.get(f"campaigns/{campaign}/mode-sets"), 200)["items"]
    assert (mode_set["origin"], mode_set["name"], mode_set["import_id"]) == (
        "file",
        "shapes.uff",
        done["id"],
    )
    assert len(mode_set["modes"]) == done["counts"]["modes"] > 0
    frequencies = [mode["frequency_hz"] for mode in mode_set["modes"]]
    assert frequencies == sorted(frequencies)
    assert all(mode["shape"] for mode in mode_set["modes"])


def test_a_real_file_of_three_frfs(
    api: httpx.Client, campaign: str, imported: Imported, uff_corpus: Path
) -> None:
    done = imported(
        campaign, (uff_corpus / "pyuff" / "measurement_v1.uff").read_bytes(), quantity="accelerance"
    )
    assert done["counts"]["frfs"] == 3, done
    frfs = ok(api.get(f"campaigns/{campaign}/frfs"), 200)["items"]
    assert [f["lines"] for f in frfs] == [1001] * 3


def test_the_original_can_be_fetched_again(
    api: httpx.Client, new_client: Callable[[], httpx.Client], campaign: str, imported: Imported
) -> None:
    content = small_file() + b" " * 3_000_000 + b"\n"
    done = imported(campaign, b"nonsense" + content, filename="beam.uff")
    path = f"imports/{done['id']}/original"
    answer = api.get(path)
    assert answer.content == b"nonsense" + content
    assert answer.headers["ETag"] == f'"{done["sha256"]}"'
    assert 'filename="beam.uff"' in answer.headers["Content-Disposition"]
    assert api.get(path, headers={"Range": "bytes=2-5"}).content == b"nsen"
    assert api.get(path, headers={"If-None-Match": answer.headers["ETag"]}).status_code == 304
    ok(new_client().get(path), 404)


def test_without_a_key_no_byte_is_read(api: httpx.Client, campaign: str) -> None:
    anonymous = httpx.Client(base_url=api.base_url, trust_env=False, timeout=60)
    with anonymous:
        ok(anonymous.post(f"campaigns/{campaign}/imports", content=b"x"), 401)


@pytest.mark.parametrize(
    "params", [{"filename": "a\0b"}, {"quantity": "loudness"}, {"dry_run": "perhaps"}]
)
def test_a_senseless_parameter_is_refused(
    api: httpx.Client, campaign: str, params: dict[str, str]
) -> None:
    ok(api.post(f"campaigns/{campaign}/imports", params=params, content=small_file()), 422)


def test_a_body_beyond_the_limit_is_refused_before_it_is_sent(
    api: httpx.Client, service: LocalService, campaign: str
) -> None:
    connection = http.client.HTTPConnection(api.base_url.host, api.base_url.port, timeout=PATIENCE)
    with contextlib.closing(connection):
        connection.putrequest("POST", f"/api/v1/campaigns/{campaign}/imports")
        connection.putheader("Authorization", api.headers["Authorization"])
        connection.putheader("Content-Length", str(service.settings.upload_limit_bytes + 1))
        connection.endheaders()
        answer = connection.getresponse()
        assert answer.status == 413
        assert b"larger than" in answer.read()


def test_an_edit_does_not_wait_for_an_import_that_is_being_stored(
    api: httpx.Client, service: LocalService, campaign: str
) -> None:
    with psycopg.connect(psycopg_url(service.settings.database_url)) as storing:
        storing.execute(
            "INSERT INTO mode_sets (campaign_id, name, origin) VALUES (%s, 'in flight', 'typed')",
            [campaign],
        )
        ok(api.patch(f"campaigns/{campaign}", json={"name": "x"}, headers={"If-Match": "*"}), 200)
        ok(api.post(f"campaigns/{campaign}/imports", content=small_file()), 202)
        storing.rollback()
