"""The main job as a laboratory does it: over HTTP against a running service, on files of another
finite element code.
"""

import subprocess
import sys

import httpx
import pytest

from service.app.supervisor import LocalService
from tests.golden.inputs import open_campaign, open_file, truth_of
from tests.support.places import SHARED
from tests.support.rest import finished, result_of
from tests.support.waiting import PATIENCE

LAB_SESSION = SHARED / "tools" / "lab-session"

TOLERANCE = {"Ex": 0.005, "Gxy": 0.01, "a0": 0.01, "a1": 0.01}


def test_independent_data_give_their_constants_back(api: httpx.Client) -> None:
    """Identification alone makes a mode set, and an update takes it."""
    truth = truth_of(open_file("cantilever-1pct.uff"))
    config, campaign = truth["config"], open_campaign(api, "cantilever-1pct")
    answer = api.post(
        f"campaigns/{campaign}/identifications", json={"name": "first look"}
    ).raise_for_status()
    assert answer.status_code == 202
    modes = finished(api, answer.headers["Location"])
    assert modes["status"] == "succeeded", modes
    true_hz = [
        mode["f_hz"]
        for mode in truth["modes"]
        if mode["out_of_plane"] and mode["f_hz"] < config["fmax"]
    ]
    assert [mode["frequency_hz"] for mode in modes["result"]["modes"]] == pytest.approx(
        true_hz, rel=1e-3
    )
    assert modes["result"]["stabilisation"]["order"]
    answer = api.post(
        f"campaigns/{campaign}/update-jobs", json={"mode_set": modes["mode_set"]}
    ).raise_for_status()
    assert answer.status_code == 202
    job = finished(api, answer.headers["Location"])
    assert job["status"] == "succeeded", job
    result = result_of(api, answer.headers["Location"])
    found = {row["name"]: row for row in result["parameters"]}
    for parameter, tolerance in TOLERANCE.items():
        assert found[parameter]["estimate"] == pytest.approx(config[parameter], rel=tolerance), (
            parameter
        )
    for parameter in ("Ex", "Ey", "Gxy", "Gxz", "a0", "a1"):
        low, high = found[parameter]["interval_95"]
        assert low <= config[parameter] <= high, parameter
    assert not found["Ey"]["identifiable"]
    assert {name: row["tied_to"] for name, row in found.items() if row["tied_to"]} == {"Gyz": "Gxz"}
    assert "Gyz" not in result["verdict"]["sentence"]  # it is not known by itself
    assert all(abs(mode["error_percent"]) < 0.1 for mode in result["modes"])
    assert min(result["correlation"]["sac"]) > 0.99
    assert len(result["provenance"]["frfs"]) == 33


SETS = ("cantilever-1pct", "cantilever-5pct-sensor-mass", "free-1pct", "paper-like")


@pytest.mark.long
@pytest.mark.parametrize("modes", [[], ["--modes", "typed"]])
@pytest.mark.parametrize("name", SETS)
def test_the_laboratorys_own_script_runs_unchanged(
    service: LocalService, name: str, modes: list[str]
) -> None:
    """UFF in, parameters out, the default recipe; with modes that the service identifies, and with
    typed ones. The test above is the short form: it asks the same requests.
    """
    file = open_file(f"{name}.uff")
    if not LAB_SESSION.exists():
        pytest.skip(f"{LAB_SESSION} is not there")
    command = [
        sys.executable,
        str(LAB_SESSION),
        "--url",
        service.url,
        "--key",
        service.new_key("laboratory"),
    ]
    command += [str(file), "--truth", str(file.with_suffix(".truth.json")), *modes]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr
