"""What the tests of the measurement database start from: a project, a beam, a campaign; waiting for an import."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import psycopg
import pytest
from psycopg.rows import dict_row

from service.db.engine import psycopg_url
from service.supervisor import LocalService

MATERIAL = {"Ex_Pa": 33.05e9, "Ey_Pa": 31.8e9, "Gxy_Pa": 5.73e9, "Gxz_Pa": 4.5e9, "Gyz_Pa": 4.5e9, "nu_xy": 0.15}
BEAM: dict[str, Any] = {
    "name": "FRP beam",
    "geometry": {"length_m": 0.5, "width_m": 0.04, "thickness_m": 0.01012},
    "density_kg_m3": 2012.0,
    "material": MATERIAL,
}


def json_of(answer: httpx.Response, status: int) -> Any:
    """The body of an answer that must have this status."""
    assert answer.status_code == status, f"{answer.status_code}: {answer.text}"
    return answer.json() if answer.content else None


@pytest.fixture
def checked() -> Callable[[httpx.Response, int], Any]:
    return json_of


@pytest.fixture
def beam() -> dict[str, Any]:
    """The body of a structure."""
    return {**BEAM, "geometry": dict(BEAM["geometry"]), "material": dict(MATERIAL)}


@pytest.fixture
def project(api: httpx.Client) -> str:
    return str(json_of(api.post("projects", json={"name": "tests"}), 201)["id"])


@pytest.fixture
def structure(api: httpx.Client, project: str) -> str:
    return str(json_of(api.post(f"projects/{project}/structures", json=BEAM), 201)["id"])


@pytest.fixture
def new_campaign(api: httpx.Client, structure: str) -> Callable[..., str]:
    def make(**fields: Any) -> str:
        body = {"name": "first", "boundary": "cantilever", **fields}
        return str(json_of(api.post(f"structures/{structure}/campaigns", json=body), 201)["id"])

    return make


@pytest.fixture
def campaign(new_campaign: Callable[..., str]) -> str:
    return new_campaign()


@pytest.fixture
def finished(api: httpx.Client) -> Callable[[str], dict[str, Any]]:
    """Waits for an import or another job at an address and gives its last state."""

    def wait(location: str, timeout: float = 60) -> dict[str, Any]:
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            state: dict[str, Any] = json_of(api.get(api.base_url.join(location)), 200)
            if state["status"] in ("succeeded", "failed", "cancelled"):
                return state
            time.sleep(0.05)
        raise AssertionError(f"{location} is {state['status']} ({state['stage']}) after {timeout} s")

    return wait


@pytest.fixture
def imported(api: httpx.Client, finished: Callable[[str], dict[str, Any]]) -> Callable[..., dict[str, Any]]:
    """Uploads bytes to a campaign and waits for the import's end."""

    def run(campaign: str, content: bytes, **params: Any) -> dict[str, Any]:
        answer = api.post(f"campaigns/{campaign}/imports", params=params, content=content)
        json_of(answer, 202)
        return finished(answer.headers["Location"])

    return run


@pytest.fixture
def rows(service: LocalService) -> Callable[..., list[dict[str, Any]]]:
    """Asks the running service's database directly."""

    def ask(query: str, *parameters: Any) -> list[dict[str, Any]]:
        assert service.settings.database_url is not None
        with psycopg.connect(psycopg_url(service.settings.database_url), row_factory=dict_row) as connection:
            return connection.execute(query, parameters).fetchall()  # type: ignore[arg-type]

    return ask


def _folder(variable: str, default: str) -> Path:
    folder = Path(os.environ.get(variable, Path(__file__).parents[2] / default))
    if not folder.is_dir():
        pytest.skip(f"no {folder}; set {variable}")
    return folder


@pytest.fixture
def blind_open() -> Path:
    return _folder("BLIND_OPEN", "../shared/blind-open")


@pytest.fixture
def uff_corpus() -> Path:
    return _folder("UFF_CORPUS", "../shared/uff-corpus")
