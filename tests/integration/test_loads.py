"""A recording of shakers and what they move goes over HTTP to FRFs and modes."""

import io
import json
from typing import Any

import httpx
import numpy as np

from fecore.arrays import FloatArray
from tests.support.rest import RAW, finished, ok, posted
from tests.unit.fecore.signal.test_measured_loads import (
    POLES,
    RATE,
    random_loads,
    recorded,
    recorded_sines,
)

STRIP = {
    "name": "strip",
    "geometry": {"length_m": 0.4, "width_m": 0.03, "thickness_m": 0.005},
    "density_kg_m3": 1800.0,
    "material": {"Ex_Pa": 3e10, "Ey_Pa": 6e9, "Gxy_Pa": 5e9, "Gxz_Pa": 5e9, "Gyz_Pa": 5e9}
    | {"nu_xy": 0.3},
}


def sent(api: httpx.Client, campaign: str, body: bytes, mapping: Any, **query: Any) -> Any:
    stated = {"filename": "shakers.npz", "mapping": json.dumps(mapping)} | query
    answer = api.post(f"campaigns/{campaign}/imports", content=body, params=stated, headers=RAW)
    ok(answer, 202)
    return finished(api, answer.headers["Location"])


def campaign_of(api: httpx.Client, name: str) -> str:
    project = posted(api, "projects", {"name": name})["id"]
    structure = posted(api, f"projects/{project}/structures", STRIP)["id"]
    named = {"name": name, "boundary": "free"}
    return str(posted(api, f"structures/{structure}/campaigns", named)["id"])


def file_of(x: FloatArray) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, sample_rate_hz=RATE, **dict(zip("abcde", x, strict=False)))
    return stream.getvalue()


def mapping_of(channels: str, points: list[int]) -> dict[str, Any]:
    """Three velocities, and forces."""
    quantities = [*["velocity"] * 3, "force", "force"]
    rows = [
        {"variable": name, "quantity": quantity, "sensitivity": 1, "point": point, "direction": 3}
        for name, quantity, point in zip(channels, quantities, points, strict=False)
    ]
    return {"sample_rate_hz": RATE, "channels": rows}


def job(api: httpx.Client, path: str, body: Any) -> Any:
    done = finished(api, api.post(path, json=body).headers["Location"])
    assert done["status"] == "succeeded", (done["message"], done.get("error"))
    return done


def test_shakers_become_frfs_and_modes(api: httpx.Client) -> None:
    campaign = campaign_of(api, "two shakers")
    file, mapping = file_of(recorded(random_loads(2))), mapping_of("abcde", [1, 2, 3, 1, 2])
    channels = mapping["channels"]

    # several forces are no hits, and are loads where that is stated
    (fault,) = sent(api, campaign, file, mapping)["error"]["errors"]
    assert "state kind=loads" in fault["detail"]
    one = {**mapping, "channels": channels[:3]}
    (fault,) = sent(api, campaign, file, one, kind="loads")["error"]["errors"]
    assert "have 0 forces" in fault["detail"]
    read = sent(api, campaign, file, mapping, kind="loads")
    assert (read["status"], read["kind"], read["counts"]["recordings"]) == ("succeeded", "loads", 1)

    named = {"references": [{"point": 1, "direction": 3}]}
    refused = ok(api.post(f"campaigns/{campaign}/processings", json=named), 422)
    (fault,) = refused["errors"]
    assert fault["pointer"] == "/references"
    assert "every recording of the campaign has its loads" in fault["detail"]

    done = job(api, f"campaigns/{campaign}/processings", {})["result"]
    assert len(done["frfs"]) == 6
    (frf, *_) = ok(api.get(f"campaigns/{campaign}/frfs"))["items"]
    assert frf["window_rate_per_s"] > 0
    job(api, f"campaigns/{campaign}/identifications", {})
    (modes,) = ok(api.get(f"campaigns/{campaign}/mode-sets"))["items"]
    assert modes["excitation"] == "measured"
    assert not any("half spectra" in text for text in modes["details"]["warnings"])
    assert modes["window_taken_out_per_s"] == frf["window_rate_per_s"]
    true = np.log(POLES) * RATE
    assert len(modes["modes"]) == 2
    for own, pole in zip(modes["modes"], true, strict=True):
        assert abs(own["frequency_hz"] - abs(pole) / 2 / np.pi) < 3 * own["frequency_sd_hz"]
        assert abs(own["damping_ratio"] + pole.real / abs(pole)) < 3 * own["damping_sd"]
        assert own["damping_sd"] < 0.1 * own["damping_ratio"]


def test_steady_sines_of_several_files_are_one_set_of_frfs(api: httpx.Client) -> None:
    campaign, mapping = campaign_of(api, "stepped sine"), mapping_of("abcd", [1, 2, 3, 1])
    steps = np.sort(np.append(np.arange(6.013, 20, 0.8), 7.96 + np.arange(-3, 3) / 12))
    files = [tuple(steps[k::6]) for k in range(6)]
    for number, hz in enumerate([*files, (11.613,)]):
        x = recorded_sines(hz, 3000, 0.1, number)
        x[:3] *= 1.2 if number == 6 else 1.0  # what was measured again is larger
        name = f"step {number}.npz"
        assert sent(api, campaign, file_of(x), mapping, filename=name, kind="loads")["counts"]
    done = job(api, f"campaigns/{campaign}/processings", {})["result"]
    joined, differ = done["warnings"]
    assert f"the loads of 7 recordings repeat: their FRFs are one set of {steps.size}" in joined
    assert "the FRFs of step 1.npz, step 6.npz at 11.61 Hz differ by" in differ
    frfs = ok(api.get(f"campaigns/{campaign}/frfs"))["items"]
    assert [(frf["lines"], frf["window_rate_per_s"]) for frf in frfs] == [(steps.size, 0)] * 3

    job(api, f"campaigns/{campaign}/identifications", {"include_doubtful": True})
    (modes,) = ok(api.get(f"campaigns/{campaign}/mode-sets"))["items"]
    own = min(modes["modes"], key=lambda mode: abs(mode["frequency_hz"] - 7.958))
    pole = np.log(POLES[0]) * RATE
    assert abs(own["frequency_hz"] - abs(pole) / 2 / np.pi) < 3 * own["frequency_sd_hz"] < 0.01
    assert abs(own["damping_ratio"] + pole.real / abs(pole)) < 3 * own["damping_sd"]
