"""Recordings of responses go over HTTP to half spectra, modes and an update: nobody measured a force."""

import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import httpx
import numpy as np
import pytest
import pyuff

from fecore.correlation import mac
from tests.support.places import shared_file
from tests.support.rest import RAW, finished, ok, posted
from tests.support.tables import parquet_rows

FEW = {"parameters": [{"name": "Ex"}, {"name": "Gxy"}], "damping_models": ["rayleigh"], "seed": 1}
Sent = Callable[..., dict[str, Any]]


def truth_of(name: str) -> tuple[Path, dict[str, Any]]:
    file = shared_file("BLIND_OPEN", "blind-open", f"ambient/{name}/truth.json")
    return file.parent, json.loads(file.read_text())


def campaign_of(api: httpx.Client, folder: Path, truth: dict[str, Any]) -> str:
    """A campaign of the set's beam, with its grid points."""
    config = truth["config"]
    body = {
        "name": "deck",
        "geometry": {"length_m": config["L"], "width_m": config["b"], "thickness_m": config["t"]},
        "density_kg_m3": config["rho"],
        "material": {
            "Ex_Pa": 0.9 * config["Ex"],
            "Ey_Pa": config["Ey"],
            "Gxy_Pa": 1.15 * config["Gxy"],
            "Gxz_Pa": config["Gxz"],
            "Gyz_Pa": config["Gyz"],
            "nu_xy": config["nuxy"],
        },
    }
    project = posted(api, "projects", {"name": "bridge"})["id"]
    structure = posted(api, f"projects/{project}/structures", body)["id"]
    campaign = posted(
        api, f"structures/{structure}/campaigns", {"name": "wind", "boundary": "cantilever"}
    )["id"]
    points = np.loadtxt(folder / "points.csv", delimiter=",", skiprows=1)
    items = [dict(zip(("label", "x_m", "y_m", "z_m"), row, strict=True)) for row in points]
    items = [{**item, "label": int(item["label"])} for item in items]
    ok(api.put(f"campaigns/{campaign}/grid-points", json={"items": items}))
    return str(campaign)


@pytest.fixture
def sent(api: httpx.Client) -> Sent:
    def send(campaign: str, file: Path, mapping: Any = None, **query: Any) -> dict[str, Any]:
        query |= {"filename": file.name} | ({"mapping": json.dumps(mapping)} if mapping else {})
        path = f"campaigns/{campaign}/imports"
        answer = api.post(path, content=file.read_bytes(), params=query, headers=RAW)
        ok(answer, 202)
        return finished(api, answer.headers["Location"])

    return send


def completed(mapping: dict[str, Any]) -> dict[str, Any]:
    """A proposal with what the file does not say: each channel is a_POINT along z, in SI."""
    channels = [
        {**c, "quantity": "acceleration", "sensitivity": 1, "point": int(c["variable"][2:])}
        | {"direction": 3}
        for c in mapping["channels"]
    ]
    return {**mapping, "channels": channels}


def job(api: httpx.Client, path: str, body: Any) -> dict[str, Any]:
    done = finished(api, api.post(path, json=body).headers["Location"])
    assert done["status"] == "succeeded", done
    return done


def require_modes(found: dict[str, Any], truth: dict[str, Any]) -> None:
    """All modes of the set and no other, within three of their standard deviations."""
    modes, true = found["modes"], truth["modes"]
    assert len(modes) == len(true)
    for own, each in zip(modes, true, strict=True):
        assert abs(own["frequency_hz"] - each["f_hz"]) < 3 * own["frequency_sd_hz"]
        assert abs(own["damping_ratio"] - each["zeta"]) < 3 * own["damping_sd"]
        assert own["frequency_sd_hz"] < 4e-3 * each["f_hz"]
        points = [value["point"] - 1 for value in own["shape"]]
        shape = np.array([[value["real"] + 1j * value["imag"] for value in own["shape"]]])
        assert mac(shape, np.array([each["shape"]])[:, points])[0, 0] > 0.99


def test_a_recording_becomes_modes_and_an_update(
    api: httpx.Client, sent: Sent, tmp_path: Path
) -> None:
    folder, truth = truth_of("ambient-1")
    campaign = campaign_of(api, folder, truth)
    file = folder / "setup_1.npz"
    looked_at = sent(campaign, file, dry_run="true")
    proposed = looked_at["found"]["mapping"]
    form = api.get(api.base_url.join(f"/ui/imports/{looked_at['id']}")).text
    assert 'data-kind="responses"' in form
    assert proposed["recording"] == {}
    assert proposed["sample_rate_hz"] == {"variable": "time_s"}
    assert {c["quantity"] for c in proposed["channels"]} == {None}
    mapping = completed(proposed)

    # a file without a force is a recording where that is stated, and half a hit where it is not
    bare = {name: value for name, value in mapping.items() if name != "recording"}
    (fault,) = sent(campaign, file, bare)["error"]["errors"]
    assert "lack a force" in fault["detail"]
    assert "kind=responses" in fault["detail"]
    (fault,) = sent(campaign, file, {**mapping, "recording": {"least_force": 3}})["error"]["errors"]
    assert fault["pointer"] == "/mapping/recording/least_force"

    read = sent(campaign, file, mapping)
    assert (read["status"], read["kind"], read["counts"]["recordings"]) == (
        "succeeded",
        "responses",
        1,
    )
    assert "loads that nobody measured moved the 8 sensors" in read["warnings"][0]
    (recording,) = ok(api.get(f"campaigns/{campaign}/recordings"))["items"]
    assert (recording["samples"], recording["length_s"]) == (153_600, 600)
    assert recording["spectra"] is None

    refused = api.post(f"campaigns/{campaign}/processings", json={"estimator": "H2"})
    assert "is of hits, and the campaign has none" in refused.text
    missing = api.post(f"campaigns/{campaign}/identifications", json={}).headers["Location"]
    assert "process them first" in finished(api, missing)["message"]

    (made,) = job(api, f"campaigns/{campaign}/processings", {})["result"]["spectra"]
    assert made["recording"] == recording["id"]
    found = job(api, f"campaigns/{campaign}/identifications", {})
    modes = ok(api.get(f"mode-sets/{found['mode_set']}"))
    assert modes["excitation"] == found["result"]["excitation"] == "unmeasured"
    assert modes["details"]["harmonics_hz"] == []
    require_modes(modes, truth)

    # such a set is edited and compared as others are
    drop = {
        "frequency_hz": modes["modes"][-1]["frequency_hz"],
        "keep": False,
        "reason": "at the end",
    }
    edited = posted(api, f"mode-sets/{modes['id']}/edits", {"name": "e", "decisions": [drop]})
    assert (edited["excitation"], len(edited["modes"])) == ("unmeasured", 5)
    form = api.get(api.base_url.join(f"/ui/campaigns/{campaign}/update")).text
    assert f'"mode_set": "{edited["id"]}"' in form
    ok(api.get(f"mode-sets/{edited['id']}/figures/mac", params={"mode_set": modes["id"]}))
    band = {"name": "low", "band_hz": [5, 60], "threshold": 0.5}
    low = job(api, f"campaigns/{campaign}/identifications", band)["result"]["modes"]
    assert [round(each["frequency_hz"]) for each in low] == [10, 28, 36, 54]

    # spectra go out as arrays and as UFF, and are drawn with the modes
    address = f"recordings/{recording['id']}/spectra"
    with np.load(io.BytesIO(api.get(address, params={"format": "npz"}).content)) as arrays:
        auto, lines = arrays["auto"], arrays["frequency_hz"]
    content = api.get(address, params={"format": "hdf5"}).content
    with h5py.File(io.BytesIO(content)) as made:
        np.testing.assert_array_equal(made["auto"], auto)
    rows = parquet_rows(api.get(address, params={"format": "parquet"}).content)[: lines.size]
    assert (rows[0]["response_point"], rows[0]["reference_direction"]) == (33, 3)
    assert [row["real"] for row in rows] == auto[0].tolist()
    tmp_path.joinpath("s.uff").write_bytes(api.get(address, params={"format": "uff"}).content)
    sets = [s for s in pyuff.UFF(str(tmp_path / "s.uff")).read_sets() if s["type"] == 58]
    first = sets[0]
    assert (first["func_type"], first["rsp_node"], first["rsp_dir"]) == (2, 33, 3)
    np.testing.assert_allclose(np.real(first["data"]), auto[0], rtol=1e-12)
    np.testing.assert_allclose(first["x"], lines)
    assert {s["func_type"] for s in sets[1:]} == {2, 3}
    # responses for each unit of the first reference, which are no FRFs
    address = f"recordings/{recording['id']}/transmissibility"
    made = ok(api.get(address))
    own = made["responses"].index(made["references"][0])
    assert set(made["real"][own][0]) == {1.0}
    assert set(made["coherence"][own]) == {1.0}
    (fault,) = ok(api.get(address, params={"references": "99:3"}), 422)["errors"]
    assert "99:3 is no reference of the spectra, which have " in fault["detail"]
    rows = parquet_rows(api.get(address, params={"format": "parquet"}).content)
    assert [row["imag"] for row in rows[: len(made["frequency_hz"])]] == made["imag"][0][0]
    content = api.get(address, params={"format": "uff"}).content
    tmp_path.joinpath("t.uff").write_bytes(content)
    sets = [s for s in pyuff.UFF(str(tmp_path / "t.uff")).read_sets() if s["type"] == 58]
    assert [s["func_type"] for s in sets] == [5, 6] * (len(made["responses"]) - 1)
    sent_back = sent(campaign, tmp_path / "t.uff")
    assert {d["reason"] for d in sent_back["datasets"] if "transmissibility" in str(d["reason"])}
    assert sent_back["counts"]["frfs"] == 0
    at = {"frequency_hz": truth["modes"][0]["f_hz"]}
    deflection = ok(api.get(f"recordings/{recording['id']}/deflection", params=at))
    ods = np.array([[value["real"] + 1j * value["imag"] for value in deflection["shape"]]])
    points = [value["point"] - 1 for value in deflection["shape"]]
    assert mac(ods, np.array([truth["modes"][0]["shape"]])[:, points])[0, 0] > 0.99
    drawn = ok(api.get(f"campaigns/{campaign}/figures/spectra"))
    upright = [shape["x0"] for shape in drawn["layout"]["shapes"]]
    np.testing.assert_allclose(upright, [each["frequency_hz"] for each in low])

    page = api.get(api.base_url.join(f"/ui/campaigns/{campaign}")).text
    assert f"campaigns/{campaign}/figures/spectra" in page
    assert "Identify modes" in page

    # an update takes frequencies, shapes and damping ratios, and says that no FRF was fitted
    started = api.post(f"campaigns/{campaign}/update-jobs", json=FEW)
    updated = finished(api, started.headers["Location"])
    assert updated["status"] == "succeeded", updated
    result = ok(api.get(f"update-jobs/{updated['id']}/result"))
    assert any("loads that nobody measured" in text for text in result["warnings"])
    estimates = {row["name"]: row for row in result["parameters"]}
    for name in ("Ex", "Gxy"):
        row = estimates[name]
        assert abs(row["estimate"] - truth["config"][name]) < 3 * row["standard_deviation"]
        assert row["standard_deviation"] < 0.1 * row["estimate"]
    assert "a0" in estimates  # a law of damping, by the ratios
    none = api.get(f"update-jobs/{updated['id']}/frfs/data")
    assert none.status_code == 409, none.text
    kept = ok(api.get(f"mode-sets/{result['provenance']['mode_set']}"))
    assert kept["excitation"] == "unmeasured"


def test_setups_are_joined_by_what_stays(api: httpx.Client, sent: Sent) -> None:
    """Four setups of eight sensors, of which two stay; one is a UFF, which says itself what its
    channels are. Stated references are used, and a longest lag.
    """
    folder, truth = truth_of("ambient-2")
    campaign = campaign_of(api, folder, truth)
    unstated = sent(campaign, folder / "setup_1.uff", dry_run="true")
    assert (unstated["kind"], unstated["counts"]["recordings"]) == ("responses", 0)
    assert any("kind=responses" in (d["reason"] or "") for d in unstated["datasets"])
    assert sent(campaign, folder / "setup_1.uff", kind="responses")["counts"]["recordings"] == 1
    for number in (2, 3, 4):
        file = folder / f"setup_{number}.npz"
        with np.load(file) as arrays:
            names = [{"variable": name} for name in arrays if name.startswith("a_")]
        mapping = {"recording": {}, "sample_rate_hz": {"variable": "time_s"}, "channels": names}
        assert sent(campaign, file, completed(mapping))["counts"]["recordings"] == 1
    done = job(api, f"campaigns/{campaign}/processings", {})
    references = [[s["point"] for s in made["references"]] for made in done["result"]["spectra"]]
    assert references == [truth["references"]] * 4
    found = job(api, f"campaigns/{campaign}/identifications", {})
    require_modes(ok(api.get(f"mode-sets/{found['mode_set']}")), truth)
    stated = {"references": [{"point": 14, "direction": 3}], "lag_s": 6.0}
    done = job(api, f"campaigns/{campaign}/processings", stated)
    for made in done["result"]["spectra"]:
        assert (made["references"], made["lag_s"]) == (stated["references"], 6.0)
