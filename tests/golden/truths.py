"""What is known of the golden inputs beside their results: true constants and laws, hits that were
bad, what must be said.
"""

from dataclasses import replace
from typing import Any

import httpx
import numpy as np
import pytest

from fecore.body.specimen import Specimen
from fecore.body.supports import PointMass
from fecore.updating.measurement import Measurement
from tests.golden.inputs import new_campaign, open_file, put_frfs, put_points, truth_of
from tests.support.cantilever import COUPONS
from tests.support.laboratory import MATERIAL
from tests.support.moved_sensor import LAW, MASS, TRUE, measured
from tests.support.rest import ok, posted

Result = dict[str, Any]
WITHIN = {"Ex": 0.01, "Gxy": 0.02, "a0": 0.02, "a1": 0.03}


def rows_of(result: Result) -> dict[str, Any]:
    return {row["name"]: row for row in result["parameters"]}


def is_no_rayleigh_body(api: httpx.Client, result: Result) -> None:
    """The open set `paper-like`."""
    laws = {law["name"]: law for law in result["damping_models"]}
    assert laws["modal"]["preferred"]
    assert laws["rayleigh"]["bic"] > laws["modal"]["bic"] + 100
    (sentence,) = [
        warning for warning in result["warnings"] if "rayleigh law is inadequate" in warning
    ]
    # docs/theory.md, section 5: the best Rayleigh law misses mode 3 by a third
    assert "mode 3" in sentence
    modes = truth_of(open_file("paper-like.uff"))["modes"]
    ratios = [mode["zeta"] for mode in modes if mode["out_of_plane"]][:5]
    assert list(laws["modal"]["coefficients"].values()) == pytest.approx(ratios, rel=0.02)
    # The modes that the job found are a mode set of the campaign now, and the result names it.
    kept = ok(api.get(f"mode-sets/{result['provenance']['mode_set']}"), 200)
    assert kept["origin"] == "identified"
    assert [mode["frequency_hz"] for mode in kept["modes"]] == [
        mode["measured_hz"] for mode in result["modes"]
    ]
    held = result["correlation"]["held_out"]["frfs"]
    assert len(held["sac"]) == 4
    assert 0.88 <= held["coverage_95"] <= 1.0


def agree(sampled: Result, gaussian: Result) -> None:
    """The posteriors of the same update, of whose frequencies all is nearly linear."""
    assert min(sampled["posterior"]["effective_samples"]) >= 5000
    expected = rows_of(gaussian)
    for name, one in rows_of(sampled).items():
        assert one["estimate"] == expected[name]["estimate"]
        # 5,000 independent samples know a standard deviation to 1 %; the frequencies are not quite
        # linear in the logarithms.
        assert one["standard_deviation"] == pytest.approx(
            expected[name]["standard_deviation"], rel=0.05
        ), name
    # Excursions reach to one side and the law's tails are long, so of a correlation the samples
    # know 0.02 to 0.05.
    np.testing.assert_allclose(
        sampled["posterior"]["correlation"], gaussian["posterior"]["correlation"], atol=0.1
    )


def has_no_spring(result: Result) -> None:
    """A soft spring under the tip's edge, which is not there: the estimate is next to nothing, and
    not identifiable.
    """
    found = rows_of(result)
    assert found["tip"]["unit"] == "N/m²"
    assert found["tip"]["estimate"] < 1000.0
    # a logarithm has no zero to end at: the data set an upper limit alone
    assert not found["tip"]["identifiable"]
    assert found["Ex"]["estimate"] == pytest.approx(31.7e9, rel=0.02)


def comes_from_hits(api: httpx.Client, campaign: str, result: Result, judged: list[Any]) -> None:
    """The open set of a free beam whose blocks were multiplied with an exponential window, which
    damps like the body.
    """
    truth, found = truth_of(open_file("hits-free-window/hits.npz")), rows_of(result)
    for parameter, share in WITHIN.items():
        true = truth["config"][parameter]
        low, high = found[parameter]["interval_95"]
        assert abs(found[parameter]["estimate"] / true - 1) < share, parameter
        assert low <= true <= high, parameter
    frfs = ok(api.get(f"campaigns/{campaign}/frfs"))["items"]
    assert {f["id"] for f in frfs} == {f["id"] for f in result["provenance"]["frfs"]}
    assert {f["window_rate_per_s"] for f in frfs} == {truth["instruments"]["window_rate_per_s"]}
    assert len(judged) == len(truth["records"])
    faults = np.array([record["fault"] is not None for record in truth["records"]])
    accepted = np.array([hit["accepted"] for hit in judged])
    assert np.mean(accepted[~faults]) > 0.95


# --- a sensor of some mass, which moved from point to point or stood still
# ----------------------------------------------

BODY = Specimen(0.5, 0.04, 0.010, replace(COUPONS, **TRUE))


def campaign_with(api: httpx.Client, name: str, taken: Measurement) -> str:
    """A campaign whose sensor has a mass and no stated point."""
    geometry = {"length_m": BODY.length, "width_m": BODY.width, "thickness_m": BODY.thickness}
    beam = {
        "name": "beam",
        "density_kg_m3": BODY.material.density,
        "geometry": geometry,
        "material": MATERIAL,
    }
    project = posted(api, "projects", {"name": f"sensor {name}"})["id"]
    campaign = new_campaign(api, beam, project, instruments={"sensor_mass_kg": MASS})
    put_points(api, campaign, taken.points)
    put_frfs(api, campaign, taken.frfs)
    return campaign


def moved() -> Measurement:
    """Four of the points: each is a body of its own to solve, and the core's test has all."""
    tour = measured(BODY, MASS)
    return replace(tour, frfs=tour.frfs.select(list(range(5, 33, 9))))


def standing() -> Measurement:
    """The same tour the other way round: the hammer goes about and the sensor stands at point
    33.
    """
    still = measured(replace(BODY, masses=(PointMass(0.5, 0.02, MASS),)), 0.0)
    return replace(
        still,
        frfs=replace(still.frfs, responses=still.frfs.references, references=still.frfs.responses),
    )


def has_its_sensors_mass(result: Result, *, roves: bool) -> None:
    rows = rows_of(result)
    for parameter, value in {**TRUE, "a0": LAW[0], "a1": LAW[1]}.items():
        low, high = rows[parameter]["interval_95"]
        assert low < value < high, parameter
    # massless sensors would leave it 2 % low
    assert rows["Ex"]["estimate"] == pytest.approx(TRUE["Ex"], rel=2e-3)
    assert (
        any("4.8 g moved with the response" in warning for warning in result["warnings"]) == roves
    )
