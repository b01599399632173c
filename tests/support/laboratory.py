"""What the tests of the measurement database start from: a project, a beam, a campaign; waiting for
an import; a result to look at.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any
from uuid import uuid4

import httpx
import psycopg
import pytest
from psycopg.rows import dict_row

from service.app.demo.run import Laboratory
from service.app.supervisor import LocalService
from service.platform.db.engine import psycopg_url
from tests.support import rest
from tests.support.rest import ok

MATERIAL = {
    "Ex_Pa": 33.05e9,
    "Ey_Pa": 31.8e9,
    "Gxy_Pa": 5.73e9,
    "Gxz_Pa": 4.5e9,
    "Gyz_Pa": 4.5e9,
    "nu_xy": 0.15,
}
BEAM: dict[str, Any] = {
    "name": "FRP beam",
    "geometry": {"length_m": 0.5, "width_m": 0.04, "thickness_m": 0.01012},
    "density_kg_m3": 2012.0,
    "material": MATERIAL,
}


@dataclass(frozen=True)
class Done:
    """A job that has a result."""

    api: httpx.Client
    result: dict[str, Any]

    @property
    def job(self) -> str:
        return str(self.result["provenance"]["update_job"])

    @property
    def path(self) -> str:
        return f"update-jobs/{self.job}"

    def address(self, item: dict[str, Any]) -> httpx.URL:
        """Of a figure in a list, from the service's root."""
        return self.api.base_url.join(item["href"])

    def figure(self, name: str, **query: Any) -> dict[str, Any]:
        return ok(self.api.get(f"{self.path}/figures/{name}", params=query), 200)


@pytest.fixture(scope="session")
def demo(service: LocalService) -> Iterator[Done]:
    """The demonstration's update, for all who leave it as it is."""
    key = service.new_key(f"demo {uuid4()}")
    headers = {"Authorization": f"Bearer {key}"}
    with (
        httpx.Client(base_url=service.url, headers=headers, timeout=60, trust_env=False) as client,
        rest.client_at(service.url, key) as api,
    ):
        yield Done(api, Laboratory(client).update_beam())


@pytest.fixture
def beam() -> dict[str, Any]:
    """The body of a structure."""
    return {**BEAM, "geometry": dict(BEAM["geometry"]), "material": dict(MATERIAL)}


@pytest.fixture
def project(api: httpx.Client) -> str:
    return str(ok(api.post("projects", json={"name": "tests"}), 201)["id"])


@pytest.fixture
def structure(api: httpx.Client, project: str) -> str:
    return str(ok(api.post(f"projects/{project}/structures", json=BEAM), 201)["id"])


@pytest.fixture
def new_campaign(api: httpx.Client, structure: str) -> Callable[..., str]:
    def make(**fields: Any) -> str:
        body = {"name": "first", "boundary": "cantilever", **fields}
        return str(ok(api.post(f"structures/{structure}/campaigns", json=body), 201)["id"])

    return make


@pytest.fixture
def campaign(new_campaign: Callable[..., str]) -> str:
    return new_campaign()


@pytest.fixture
def finished(api: httpx.Client) -> Callable[[str], dict[str, Any]]:
    """Waits for an import or another job at an address and gives its last state."""

    return lambda location: rest.finished(api, location)


@pytest.fixture
def imported(
    api: httpx.Client, finished: Callable[[str], dict[str, Any]]
) -> Callable[..., dict[str, Any]]:
    """Uploads bytes to a campaign and waits for the import's end."""

    def run(campaign: str, content: bytes, **params: Any) -> dict[str, Any]:
        answer = api.post(f"campaigns/{campaign}/imports", params=params, content=content)
        ok(answer, 202)
        return finished(answer.headers["Location"])

    return run


@pytest.fixture
def damaged(service: LocalService) -> Iterator[Callable[[str, str, str], None]]:
    """Turns a byte of the data of a row (table, column, value) until the test ends: others use the
    database after it, and some look for damage.
    """
    turned: list[tuple[str, str, str]] = []

    def turn(table: str, column: str, value: str) -> None:
        turning = f"UPDATE {table} SET data = set_byte(data, 5, 255 - get_byte(data, 5))"
        with psycopg.connect(psycopg_url(service.settings.database_url)) as connection:
            done = connection.execute(f"{turning} WHERE {column} = %s", [value])
            assert done.rowcount == 1

    def damage(*row: str) -> None:
        turn(*row)
        turned.append(row)

    yield damage
    for row in turned:
        turn(*row)


@pytest.fixture
def rows(service: LocalService) -> Callable[..., list[dict[str, Any]]]:
    """Asks the running service's database directly."""

    def ask(query: str, *parameters: Any) -> list[dict[str, Any]]:
        with psycopg.connect(
            psycopg_url(service.settings.database_url), row_factory=dict_row
        ) as connection:
            return connection.execute(query, parameters).fetchall()

    return ask
