"""Numbers in another unit than the contract's are refused with what was probably meant; who means
them confirms them.
"""

from typing import Any

import httpx
import pytest

import modalbase
from service.app.supervisor import LocalService
from tests.support.laboratory import BEAM, MATERIAL
from tests.support.rest import ok

CORE = {"E1_Pa": 1e6, "E2_Pa": 1e6, "G12_Pa": 1e6, "G13_Pa": 2e6, "G23_Pa": 1e6, "nu_12": 0.3}
FACE = {
    "E1_Pa": 40e9,
    "E2_Pa": 9e9,
    "G12_Pa": 4e9,
    "G13_Pa": 4e9,
    "G23_Pa": 3e9,
    "nu_12": 0.3,
    "angle_deg": 0,
}
SIZE = {"length_m": 0.5, "width_m": 0.04, "thickness_m": 0.01}
RUBBER = {name: value if name == "nu_xy" else 2e6 for name, value in MATERIAL.items()}
CURVE = "Load (kN),Strain (%)\n" + "".join(f"{0.4 * i:.3f},{0.02 * i:.4f}\n" for i in range(51))


def of_plies(ply: dict[str, Any]) -> dict[str, Any]:
    return {"material": None, "geometry": None, "laminate": {"plies": [{**FACE, **ply}]}}


def only_fault(answer: httpx.Response) -> tuple[str, str]:
    problem = ok(answer, 422)
    assert problem["confirmable"] is True
    ((pointer, detail),) = (fault.values() for fault in problem["errors"])
    return pointer, detail


STRUCTURES: list[tuple[dict[str, Any], str, str]] = [
    (
        {"geometry": {**SIZE, "length_m": 500}},
        "/geometry/length_m",
        "is 500 m, usual is 0.02 m (20 mm) to 100 m",
    ),
    ({"geometry": {**SIZE, "length_m": 500}}, "/geometry/length_m", "did you mean 0.5 m (500 mm)?"),
    ({"geometry": {**SIZE, "width_m": 40}}, "/geometry/width_m", "did you mean 0.04 m (40 mm)?"),
    (
        {"geometry": {**SIZE, "length_m": 20, "thickness_m": 10}},
        "/geometry/thickness_m",
        "did you mean 0.01 m (10 mm)?",
    ),
    (
        {"material": {**MATERIAL, "Ex_Pa": 33, "nu_xy": 0}},
        "/material/Ex_Pa",
        "is 33 Pa, usual is 1e6 Pa to 1.2e12 Pa (1200 GPa)",
    ),
    (
        {"material": {**MATERIAL, "Ex_Pa": 33, "nu_xy": 0}},
        "/material/Ex_Pa",
        "did you mean 3.3e10 Pa (33 GPa)?",
    ),
    (
        {"material": {**MATERIAL, "Gxy_Pa": 5730}},
        "/material/Gxy_Pa",
        "did you mean 5.73e9 Pa (5.73 GPa)?",
    ),
    ({"density_kg_m3": 2.012}, "/density_kg_m3", "did you mean 2012 kg/m³?"),
    ({"density_kg_m3": 2.012e-9}, "/density_kg_m3", "did you mean 2012 kg/m³?"),
    (
        of_plies({"thickness_m": 10}),
        "/laminate/plies/0/thickness_m",
        "did you mean 0.01 m (10 mm)?",
    ),
    (
        of_plies({"thickness_m": 0.01, "G13_Pa": 4}),
        "/laminate/plies/0/G13_Pa",
        "did you mean 4e9 Pa (4 GPa)?",
    ),
    (
        {"inputs": {"thickness_sd_m": 0.1}},
        "/inputs/thickness_sd_m",
        "did you mean 0.0001 m (0.1 mm)?",
    ),
    (
        {"pieces": [{"from_m": 0.1, "to_m": 0.2, "thickness_m": 12}]},
        "/pieces/0/thickness_m",
        "did you mean 0.012 m (12 mm)?",
    ),
]


@pytest.mark.parametrize(("changes", "pointer", "said"), STRUCTURES)
def test_a_structure_in_other_units(
    api: httpx.Client, project: str, changes: dict[str, Any], pointer: str, said: str
) -> None:
    path, body = f"projects/{project}/structures", {**BEAM, **changes}
    found, detail = only_fault(api.post(path, json=body))
    assert found == pointer
    assert said in detail
    assert "confirm=true" in detail
    assert ok(api.get(path))["items"] == []
    assert ok(api.post(path, params={"confirm": True}, json=body), 201)["name"] == BEAM["name"]


@pytest.mark.parametrize(
    "changes",
    [
        {"material": RUBBER, "density_kg_m3": 1100},
        {"density_kg_m3": 100},  # balsa
        {"density_kg_m3": 19_300},  # tungsten
        {"geometry": {"length_m": 30, "width_m": 4, "thickness_m": 0.25}},  # a bridge deck
        {"geometry": {"length_m": 0.05, "width_m": 0.01, "thickness_m": 2e-4}},  # a film
        {"inputs": {"thickness_sd_m": 0, "length_sd_m": 0.0005, "density_sd_kg_m3": 10}},
        {"material": None, "geometry": {**SIZE, "thickness_m": 0.0528}, "laminate": {"plies": [
            {**FACE, "thickness_m": 1.4e-3}, {**CORE, "angle_deg": 0, "density_kg_m3": 30, "thickness_m": 0.05},
            {**FACE, "thickness_m": 1.4e-3}]}},  # a soft foam
    ],
)  # fmt: skip
def test_what_is_rare_and_real_needs_no_confirmation(
    api: httpx.Client, project: str, changes: dict[str, Any]
) -> None:
    ok(api.post(f"projects/{project}/structures", json={**BEAM, **changes}), 201)


def test_a_change_is_looked_at_and_what_was_confirmed_stays(
    api: httpx.Client, project: str
) -> None:
    body = {**BEAM, "material": {**MATERIAL, "Gyz_Pa": 4.5}}
    made = ok(api.post(f"projects/{project}/structures", params={"confirm": True}, json=body), 201)
    path, match = f"structures/{made['id']}", {"If-Match": "*"}
    assert (
        only_fault(api.patch(path, json={"density_kg_m3": 2.0}, headers=match))[0]
        == "/density_kg_m3"
    )
    changed = ok(api.patch(path, json={"density_kg_m3": 2000}, headers=match))
    assert (changed["density_kg_m3"], changed["material"]["Gyz_Pa"]) == (2000, 4.5)


def test_a_sensor_in_grams(api: httpx.Client, structure: str) -> None:
    body = {
        "name": "March",
        "boundary": "free",
        "instruments": {"sensor_mass_kg": 5.8, "sensor_point": 1},
    }
    pointer, detail = only_fault(api.post(f"structures/{structure}/campaigns", json=body))
    assert pointer == "/instruments/sensor_mass_kg"
    assert "did you mean 0.0058 kg (5.8 g)?" in detail


@pytest.mark.parametrize(
    ("parameter", "member", "said"),
    [
        ({"name": "Ex", "prior_mean": 33}, "prior_mean", "did you mean 3.3e10 Pa (33 GPa)?"),
        (
            {"name": "Ex", "prior_mean": 33e9, "prior_sd": 3},
            "prior_sd",
            "did you mean 3e9 Pa (3 GPa)?",
        ),
        ({"name": "density", "prior_mean": 2.0}, "prior_mean", "did you mean 2000 kg/m³?"),
        ({"name": "thickness", "prior_sd": 0.05}, "prior_sd", "did you mean 5e-5 m (0.05 mm)?"),
    ],
)
def test_priors_of_recipes(
    api: httpx.Client,
    structure: str,
    campaign: str,
    parameter: dict[str, Any],
    member: str,
    said: str,
) -> None:
    recipe = {"parameters": [{"name": "Gxy"}, parameter]}
    several = {"jobs": [{"campaign_id": campaign, "recipe": recipe}]}
    watch = {"name": "ageing", "recipe": recipe}
    for path, body, at in (
        (f"campaigns/{campaign}/update-jobs", recipe, ""),
        ("update-jobs", several, "/jobs/0/recipe"),
        (f"structures/{structure}/monitors", watch, "/recipe"),
    ):
        pointer, detail = only_fault(api.post(path, json=body))
        assert pointer == f"{at}/parameters/1/{member}"
        assert said in detail
    assert ok(api.get("update-jobs"))["items"] == []
    confirmed = api.post(f"campaigns/{campaign}/update-jobs", params={"confirm": True}, json=recipe)
    assert "confirmable" not in confirmed.json()


def test_coupons(api: httpx.Client, service: LocalService, structure: str, tmp_path: Any) -> None:
    path, published = (
        f"structures/{structure}/coupon-batches",
        {"Ex": {"mean": 33.1, "standard_deviation": 0.5e9}},
    )
    body = {"name": "0", "constants": ["Ex"], "published": published}
    assert only_fault(api.post(path, json=body))[0] == "/published/Ex/mean"
    batch = ok(api.post(path, json={"name": "0", "constants": ["Ex"]}), 201)["id"]
    several = [
        {"specimen": "A1", "E_Pa": 33e9},
        {"specimen": "A2", "E_Pa": 33e9, "strength_Pa": 510},
    ]
    pointer, detail = only_fault(api.post(f"coupon-batches/{batch}/coupons", json=several))
    assert pointer == "/1/strength_Pa"
    assert "did you mean 5.1e8 Pa (0.51 GPa)?" in detail
    strain = {"specimen": "A3", "E_Pa": 33e9, "ultimate_strain": 1.9}
    assert (
        "did you mean 0.019 m/m?"
        in only_fault(api.post(f"coupon-batches/{batch}/coupons", json=strain))[1]
    )
    curve, columns = tmp_path / "A1.csv", {"force": "Load", "strain": "Strain"}
    curve.write_text(CURVE)
    with modalbase.connect(service.url, api.headers["authorization"].split()[1]) as lab:
        coupons = lab.structure(structure).coupon_batch("0")
        wrong = {"unit": "m", "width": [25.0], "thickness": [0.002]}
        with pytest.raises(
            modalbase.ClientError,
            match=r"/dimensions/width/0: is 25 m.*did you mean 0\.025 m \(25 mm\)\?",
        ):
            coupons.add_curve(curve, dimensions=wrong, columns=columns)
        right = {"unit": "mm", "width": [25.0], "thickness": [2.0]}
        # MN
        curve.write_text(
            "Load (N),Strain (%)\n" + "".join(f"{4e-4 * i:.4f},{0.02 * i:.4f}\n" for i in range(51))
        )
        with pytest.raises(
            modalbase.ClientError, match=r"/E_Pa: is 40000 Pa.*did you mean 4e10 Pa \(40 GPa\)\?"
        ):
            coupons.add_curve(curve, dimensions=right, columns=columns)
        assert len(coupons.coupons()) == 0


def test_the_library(api: httpx.Client, service: LocalService) -> None:
    with modalbase.connect(service.url, api.headers["authorization"].split()[1]) as lab:
        deck = lab.project("deck", create=True)
        with pytest.raises(
            modalbase.ClientError,
            match=r"/geometry/length_m: is 500 m.*did you mean 0\.5 m \(500 mm\)\?",
        ):
            deck.new_structure("beam", **{**SIZE, "length_m": 500})
        with pytest.raises(
            modalbase.ClientError, match=r"/material/Ex_Pa.*did you mean 3\.3e10 Pa \(33 GPa\)\?"
        ):
            deck.structure("beam", create=True, **SIZE, **{**MATERIAL, "Ex_Pa": 33, "nu_xy": 0})
        with pytest.raises(
            modalbase.ClientError,
            match="/length: is no member here; did you mean geometry/length_m",
        ):
            deck.new_structure("beam", length=0.5)
        assert deck.structures() == []
        beam = deck.structure("beam", create=True, confirm=True, **{**SIZE, "length_m": 500})
        assert deck.structure("beam", create=True, **{**SIZE, "length_m": 500}) == beam
        assert beam.change(density_kg_m3=5, confirm=True).density_kg_m3 == 5
        campaign = beam.new_campaign("March", "free", sensor_mass_kg=5, confirm=True)
        recipe = {"parameters": [{"name": "Ex", "prior_mean": 33}]}
        with pytest.raises(
            modalbase.ClientError, match=r"/parameters/0/prior_mean.*did you mean 3\.3e10 Pa"
        ):
            campaign.update(recipe)
        with pytest.raises(modalbase.ClientError, match="states no laminate or material"):
            campaign.update(recipe, confirm=True)


@pytest.mark.parametrize("number", [1e-320, 1e-200, 1e-31])
@pytest.mark.parametrize(
    ("changes", "pointer"),
    [
        ({"geometry": {**SIZE, "thickness_m": None}}, "/geometry/thickness_m"),
        ({"density_kg_m3": None}, "/density_kg_m3"),
        ({"material": {**MATERIAL, "Ex_Pa": None, "nu_xy": 0}}, "/material/Ex_Pa"),
        ({"inputs": {"density_sd_kg_m3": None}}, "/inputs/density_sd_kg_m3"),
        (of_plies({"thickness_m": 0.01, "G13_Pa": None}), "/laminate/plies/0/G13_Pa"),
    ],
)
def test_what_nobody_can_compute_with_is_refused_though_it_is_confirmed(
    api: httpx.Client, project: str, changes: dict[str, Any], pointer: str, number: float
) -> None:
    def filled(value: Any, at: str = "") -> Any:
        if isinstance(value, dict):
            return {name: filled(inner, f"{at}/{name}") for name, inner in value.items()}
        if isinstance(value, list):
            return [filled(inner, f"{at}/{place}") for place, inner in enumerate(value)]
        return number if at == pointer else value

    answer = api.post(
        f"projects/{project}/structures?confirm=true", json=filled({**BEAM, **changes})
    )
    problem = ok(answer, 422)
    assert [one["pointer"] for one in problem["errors"]] == [pointer]
    assert "confirmable" not in problem


def test_numbers_of_a_recipe_and_of_a_campaign_too(
    api: httpx.Client, campaign: str, structure: str
) -> None:
    for body, pointer in (
        ({"parameters": [{"name": "Ex", "prior_mean": 1e300}]}, "/parameters/0/prior_mean"),
        ({"parameters": [{"name": "Ex", "prior_sd": 1e-320}]}, "/parameters/0/prior_sd"),
    ):
        answer = ok(api.post(f"campaigns/{campaign}/update-jobs?confirm=true", json=body), 422)
        assert [one["pointer"] for one in answer["errors"]] == [pointer]
    masses = {"added_masses": [{"x_m": 0.1, "y_m": 0.0, "mass_kg": 1e-320}]}
    body = {"name": "c", "boundary": "free", "instruments": masses, "meta": {"free": 1e-320}}
    answer = ok(api.post(f"structures/{structure}/campaigns?confirm=true", json=body), 422)
    assert [one["pointer"] for one in answer["errors"]] == ["/instruments/added_masses/0/mass_kg"]
