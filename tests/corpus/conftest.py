"""What the refused requests of the corpus meet."""

from collections.abc import Iterator
from typing import Any
from uuid import uuid4

import httpx
import pytest

from service.app.supervisor import LocalService
from tests.support.laboratory import BEAM
from tests.support.rest import client_of, finished, ok, posted

Ids = dict[str, str]
SHAPE = {"point": 1, "direction": 3, "real": 1.0, "imag": 0.0}
FRF = {"response_point": 1, "response_direction": 3, "reference_point": 1, "reference_direction": 3}
FRFS = {"quantity": "accelerance", "frequency_hz": [1.0, 2.0, 3.0]}


@pytest.fixture(scope="module")
def room(service: LocalService) -> Iterator[tuple[httpx.Client, Ids]]:
    """A project with two structures, two campaigns of the first and one of the second, and
    something of each kind.
    """
    with client_of(service, f"refused-{uuid4().hex}") as api:
        ids = {"project": posted(api, "projects", {"name": "p"})["id"]}
        ids["structure"], ids["elsewhere"] = (
            posted(api, f"projects/{ids['project']}/structures", {**BEAM, "name": name})["id"]
            for name in ("a", "b")
        )
        apart = posted(api, "projects", {"name": "q"})["id"]
        far = posted(api, f"projects/{apart}/structures", BEAM)["id"]
        ids["far"] = posted(api, f"structures/{far}/campaigns", {"name": "c", "boundary": "free"})[
            "id"
        ]
        bare = posted(api, f"projects/{ids['project']}/structures", {"name": "bare"})["id"]
        for name, structure in (
            ("campaign", "structure"),
            ("other", "structure"),
            ("foreign", "elsewhere"),
        ):
            body = {"name": name, "boundary": "cantilever"}
            body |= {"performed_at": "2026-03-02T09:30:00Z"} if name == "other" else {}
            ids[name] = posted(api, f"structures/{ids[structure]}/campaigns", body)["id"]
        ids["of_bare"] = posted(
            api, f"structures/{bare}/campaigns", {"name": "c", "boundary": "free"}
        )["id"]
        modes = {"name": "m", "modes": [{"frequency_hz": 25.0}]}
        ids["mode_set"] = posted(api, f"campaigns/{ids['other']}/mode-sets", modes)["id"]
        spectrum = {"real": [1.0, 2.0, 3.0], "imag": [0.0, 0.5, 1.0]}
        frfs = posted(
            api, f"campaigns/{ids['campaign']}/frfs", {**FRFS, "frfs": [{**FRF, **spectrum}]}
        )
        ids["frf"] = frfs["items"][0]["id"]
        for name, structure in (("batch", "structure"), ("foreign_batch", "elsewhere")):
            path = f"structures/{ids[structure]}/coupon-batches"
            ids[name] = posted(api, path, {"name": "b", "constants": ["Ex", "Ey"]})["id"]
        coupon = posted(
            api, f"coupon-batches/{ids['batch']}/coupons", {"specimen": "A", "strength_Pa": 3e8}
        )
        ids["coupon"] = coupon["items"][0]["id"]
        since = {"campaigns": 4, "since": "2030-01-01T00:00:00Z"}
        monitor = {"name": "m", "runs_on": "hand", "baseline": since}
        ids["monitor"] = posted(api, f"structures/{ids['structure']}/monitors", monitor)["id"]
        ids["resting"] = posted(api, f"structures/{ids['structure']}/monitors", monitor)["id"]
        ok(
            api.patch(
                f"monitors/{ids['resting']}", json={"active": False}, headers={"If-Match": "*"}
            )
        )
        key = {"name": "short", "expires_at": "2999-01-01T00:00:00Z"}
        ids["key"] = posted(api, "api-keys", key)["id"]
        job = api.post(f"campaigns/{ids['foreign']}/update-jobs", json={})
        ids["job"] = ok(job, 202)["id"]
        finished(api, job.headers["Location"])
        before = stored(api, ids)
        yield api, ids
        assert stored(api, ids) == before


def stored(api: httpx.Client, ids: Ids) -> list[Any]:
    """What a refused request leaves as it was."""
    project, structure = (f"projects/{ids['project']}", f"structures/{ids['structure']}")
    campaign = f"campaigns/{ids['campaign']}"
    lists = [
        *(f"{structure}/{name}" for name in ("campaigns", "coupon-batches", "monitors")),
        *(f"{campaign}/{name}" for name in ("mode-sets", "identifications", "frfs", "records")),
        *(
            f"{project}/structures",
            f"coupon-batches/{ids['batch']}/coupons",
            f"monitors/{ids['monitor']}/runs",
        ),
    ]
    # noted once a minute
    keys = [{**key, "last_used_at": None} for key in ok(api.get("api-keys"))["items"]]
    return [
        ok(api.get(path)) for path in (project, structure, campaign, *lists, "update-jobs")
    ] + keys
