"""Mode sets over HTTP."""

from collections.abc import Callable
from typing import Any
from uuid import UUID

import httpx
import numpy as np
import pytest

from fecore.frf import Dof
from service.app.supervisor import LocalService
from service.db.engine import make_engine, make_sessions
from service.store.modes.operations import load_modes

Checked = Callable[[httpx.Response, int], Any]

SHAPE = [
    {"point": 1, "direction": 3, "real": 1.0, "imag": 0.5},
    {"point": 2, "direction": -3, "real": -0.25, "imag": 0.0},
]


def test_modes_are_stored_by_frequency(api: httpx.Client, campaign: str, checked: Checked) -> None:
    modes = [
        {"frequency_hz": 160.06, "damping_ratio": 0.0284, "shape": SHAPE},
        {"frequency_hz": 25.63},
    ]
    created = api.post(f"campaigns/{campaign}/mode-sets", json={"name": "paper", "modes": modes})
    body = checked(created, 201)
    assert body["origin"] == "typed"
    assert [(m["number"], m["frequency_hz"], m["damping_ratio"]) for m in body["modes"]] == [
        (1, 25.63, None),
        (2, 160.06, 0.0284),
    ]
    assert [m["shape"] for m in body["modes"]] == [None, SHAPE]
    assert checked(api.get(api.base_url.join(created.headers["Location"])), 200) == body
    assert checked(api.get(f"campaigns/{campaign}/mode-sets"), 200)["items"] == [body]


def test_the_core_gets_modes_with_shared_dofs_and_covariance(
    api: httpx.Client, service: LocalService, campaign: str, checked: Checked
) -> None:
    sd = {"frequency_sd_hz": 0.1, "damping_sd": 0.002}
    zero_x = {"point": 1, "direction": 1, "real": 0.0, "imag": 0.0}
    third = {"point": 3, "direction": 3, "real": 1.0, "imag": 0.0}
    modes = [
        {"frequency_hz": 160.0, "damping_ratio": 0.03, **sd, "shape": [*SHAPE, zero_x]},
        {"frequency_hz": 25.0, "damping_ratio": 0.1, **sd, "shape": [*SHAPE[::-1], zero_x, third]},
    ]
    made = checked(api.post(f"campaigns/{campaign}/mode-sets", json={"name": "x", "modes": modes}), 201)
    assert service.settings.database_url is not None
    engine = make_engine(service.settings.database_url)
    with make_sessions(engine)() as session:
        measured = load_modes(session, UUID(made["id"]))
    engine.dispose()
    np.testing.assert_array_equal(measured.frequency_hz, [25.0, 160.0])
    assert measured.dofs == (Dof(1, 3), Dof(2, 3))
    assert measured.shapes is not None
    np.testing.assert_array_equal(measured.shapes, [[1 + 0.5j, 0.25], [1 + 0.5j, 0.25]])
    assert measured.covariance is not None
    np.testing.assert_allclose(np.diag(measured.covariance), [0.01, 0.01, 4e-6, 4e-6], rtol=1e-14)


def test_a_mode_set_goes_out_as_set_55_and_comes_back(
    api: httpx.Client, new_campaign: Callable[..., str], imported: Callable[..., dict[str, Any]], checked: Checked
) -> None:
    points = {"items": [{"label": n, "x_m": 0.1 * n, "y_m": 0, "z_m": 0} for n in (1, 2)]}
    shapes = [[(1, 3, 1.0, 0.0), (2, -3, 0.25, 0.0)], [(1, 3, 0.5, -0.125), (2, 3, -1.0, 0.0)]]
    modes = [
        {
            "frequency_hz": f,
            "damping_ratio": z,
            "shape": [dict(zip(("point", "direction", "real", "imag"), v, strict=True)) for v in shape],
        }
        for f, z, shape in zip((12.5, 80.0), (0.015625, 0.03125), shapes, strict=True)
    ]
    first, second = new_campaign(), new_campaign()
    checked(api.put(f"campaigns/{first}/grid-points", json=points), 200)
    made = checked(api.post(f"campaigns/{first}/mode-sets", json={"name": "hand", "modes": modes}), 201)
    file = api.get(f"mode-sets/{made['id']}", params={"format": "uff"}).raise_for_status()
    assert file.headers["content-type"].startswith("text/x-uff")
    assert imported(second, file.content)["counts"] == {"frfs": 0, "grid_points": 2, "modes": 2, "records": 0}
    (back,) = checked(api.get(f"campaigns/{second}/mode-sets"), 200)["items"]
    for sent, got in zip(modes, back["modes"], strict=True):
        # a complex mode travels as its eigenvalue, in columns of 12 characters
        assert got["frequency_hz"] == pytest.approx(sent["frequency_hz"], rel=1e-6)
        assert got["damping_ratio"] == pytest.approx(sent["damping_ratio"], rel=1e-5)
        there = {(v["point"], v["direction"]): complex(v["real"], v["imag"]) for v in got["shape"]}
        for v in sent["shape"]:
            sign = 1 if v["direction"] > 0 else -1
            assert there[v["point"], 3] == sign * complex(v["real"], v["imag"])


def test_modes_without_shapes_cannot_be_a_set_55(api: httpx.Client, campaign: str, checked: Checked) -> None:
    body = {"name": "x", "modes": [{"frequency_hz": 10}]}
    made = checked(api.post(f"campaigns/{campaign}/mode-sets", json=body), 201)
    problem = checked(api.get(f"mode-sets/{made['id']}", params={"format": "uff"}), 409)
    assert "mode 1 has no shape" in problem["detail"]
    checked(api.get(f"mode-sets/{made['id']}", params={"format": "npz"}), 422)


def test_poles_kept_and_dropped_by_hand_are_a_new_set_that_says_who_and_why(
    api: httpx.Client, campaign: str, checked: Checked
) -> None:
    modes = [{"frequency_hz": hz, "damping_ratio": 0.01, "shape": SHAPE} for hz in (25.63, 50.0, 160.06)]
    first = checked(api.post(f"campaigns/{campaign}/mode-sets", json={"name": "typed", "modes": modes}), 201)
    decisions = [{"frequency_hz": 50.0, "keep": False, "reason": "hum of the mains"}]
    edit = {"name": "checked", "decisions": decisions}
    created = api.post(f"mode-sets/{first['id']}/edits", json=edit)
    edited = checked(created, 201)
    assert edited["origin"] == "edited"
    assert [(mode["number"], mode["frequency_hz"]) for mode in edited["modes"]] == [(1, 25.63), (2, 160.06)]
    assert edited["modes"][1]["shape"] == SHAPE
    assert edited["details"]["edited_from"] == first["id"]
    [decision] = edited["details"]["decisions"]
    assert (decision["frequency_hz"], decision["keep"], decision["reason"]) == (50.0, False, "hum of the mains")
    assert decision["by"]
    assert decision["at"]
    assert checked(api.get(f"mode-sets/{first['id']}"), 200) == first
    nowhere = {"name": "x", "decisions": [{"frequency_hz": 99.0, "keep": False, "reason": "none"}]}
    refused = checked(api.post(f"mode-sets/{first['id']}/edits", json=nowhere), 422)
    assert "no pole of the set is there; it has 25.63, 50, 160.06 Hz" in str(refused)
    none = [{"frequency_hz": hz, "keep": False, "reason": "noise"} for hz in (25.63, 50.0, 160.06)]
    assert "keep at least one" in str(
        checked(api.post(f"mode-sets/{first['id']}/edits", json=edit | {"decisions": none}), 422)
    )
