"""What the golden documents are made of: structures, campaigns, measurements and jobs, over
REST.
"""

import io
import json
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from fecore.frf import FrfSet
from tests.support.golden import numeric
from tests.support.laboratory import BEAM, MATERIAL
from tests.support.places import shared_file
from tests.support.rest import finished, ok, posted

OCTETS = {"Content-Type": "application/octet-stream"}


def open_file(name: str) -> Path:
    """A file of the open sets; the test is skipped where it is not there."""
    return shared_file("BLIND_OPEN", "blind-open", name)


def truth_of(file: Path) -> dict[str, Any]:
    """The answers beside an open set: what the laboratory knows is taken from there."""
    beside = (
        file.parent / "truth.json"
        if file.name.startswith("hits.")
        else file.with_suffix(".truth.json")
    )
    return json.loads(beside.read_text())


def new_campaign(
    api: httpx.Client, body: dict[str, Any] = BEAM, project: str | None = None, **fields: Any
) -> str:
    """A campaign of a structure of its own, unless it is named in a project of its own."""
    project = project or posted(api, "projects", {"name": "golden"})["id"]
    structure = posted(api, f"projects/{project}/structures", body)["id"]
    campaign = {"name": "tour", "boundary": "cantilever", **fields}
    return str(posted(api, f"structures/{structure}/campaigns", campaign)["id"])


def beam(config: dict[str, Any]) -> dict[str, Any]:
    """The structure of an open set, as the laboratory states it."""
    return {
        "name": "beam",
        "density_kg_m3": config["rho"],
        "geometry": {"length_m": config["L"], "width_m": config["b"], "thickness_m": config["t"]},
        "material": {**MATERIAL, "nu_xy": config["nuxy"]},
    }


def imported(api: httpx.Client, campaign: str, file: Path) -> dict[str, Any]:
    """The end of the import of a file."""
    answer = api.post(
        f"campaigns/{campaign}/imports", params={"filename": file.name}, content=file.read_bytes()
    )
    ok(answer, 202)
    return finished(api, answer.headers["Location"])


def open_campaign(api: httpx.Client, name: str, project: str | None = None) -> str:
    """A campaign with the FRFs of an open set of beams."""
    file = open_file(f"{name}.uff")
    config = truth_of(file)["config"]
    sensor = (
        {"sensor_mass_kg": config["acc_mass"], "sensor_point": config["acc"]}
        if config["acc_mass"]
        else {}
    )
    campaign = new_campaign(api, beam(config), project, boundary=config["bc"], instruments=sensor)
    assert imported(api, campaign, file)["status"] == "succeeded"
    return campaign


def hits_campaign(api: httpx.Client, name: str) -> str:
    """A campaign with the grid and the time blocks of an open set of hits."""
    file = open_file(f"{name}/hits.npz")
    truth = truth_of(file)
    known = truth["instruments"]
    campaign = new_campaign(api, beam(truth["config"]), boundary=truth["config"]["bc"])
    put_points(
        api,
        campaign,
        {number: (x, y, 0.0) for number, (x, y) in enumerate(truth["points"], start=1)},
    )
    window = {"window_rate_per_s": known["window_rate_per_s"]}
    force = {"variable": "force", "quantity": "force", "point": {"variable": "point"}}
    response = {
        "variable": "acceleration",
        "quantity": "acceleration",
        "point": known["sensor_point"],
    }
    mapping = {
        "sample_rate_hz": known["fs_hz"],
        "hit": {"variable": "hit"},
        "channels": [
            {**force, "sensitivity": known["force_V_per_N"], **window},
            {**response, "sensitivity": known["acceleration_V_per_m_s2"], **window},
        ],
    }
    params = {"filename": file.name, "mapping": json.dumps(mapping)}
    ok(
        api.post(
            f"campaigns/{campaign}/records",
            content=file.read_bytes(),
            params=params,
            headers=OCTETS,
        ),
        201,
    )
    return campaign


def put_points(
    api: httpx.Client, campaign: str, points: dict[int, tuple[float, float, float]]
) -> None:
    """The grid of a campaign."""
    items = [{"label": label, "x_m": x, "y_m": y, "z_m": z} for label, (x, y, z) in points.items()]
    ok(api.put(f"campaigns/{campaign}/grid-points", json={"items": items}))


def put_frfs(api: httpx.Client, campaign: str, frfs: FrfSet) -> None:
    """FRFs of a script."""
    buffer = io.BytesIO()
    np.savez(
        buffer,
        frequency_hz=frfs.frequency_hz,
        values=frfs.values,
        response_point=np.array([dof.point for dof in frfs.responses]),
        response_direction=np.array([dof.direction for dof in frfs.responses]),
        reference_point=np.array([dof.point for dof in frfs.references]),
        reference_direction=np.array([dof.direction for dof in frfs.references]),
        quantity=np.array(frfs.quantity),
    )
    npz = {"Content-Type": "application/x-npz"}
    ok(api.post(f"campaigns/{campaign}/frfs", content=buffer.getvalue(), headers=npz), 201)


def job(api: httpx.Client, path: str, body: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """A job that was begun there: its address, and its state at its end."""
    answer = api.post(path, json=body)
    ok(answer, 202)
    address = str(api.base_url.join(answer.headers["Location"]))
    return address, finished(api, address)


def updated(api: httpx.Client, campaign: str, recipe: dict[str, Any]) -> dict[str, Any]:
    """The state and, where it succeeded, the whole result of an update and its deck for another
    solver.
    """
    address, state = job(api, f"campaigns/{campaign}/update-jobs", recipe)
    if state["status"] != "succeeded":
        return {"job": state}
    whole = {"include": ["convergence", "stabilisation"]}
    deck = api.get(f"{address}/cards", params={"format": "abaqus"})
    shown = numeric(deck.content) if deck.is_success else deck.json()
    return {
        "job": state,
        "result": ok(api.get(f"{address}/result", params=whole), 200),
        "deck": shown,
    }


def modes_of(api: httpx.Client, campaign: str, modes: Any) -> str:
    """A mode set that is typed in."""
    return str(
        posted(api, f"campaigns/{campaign}/mode-sets", {"name": "typed", "modes": list(modes)})[
            "id"
        ]
    )
