"""What a user did wrong, in the words of the answer: each refusal of a well-formed request by its place and its sentence."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from typing import Any
from uuid import uuid4

import httpx
import pytest

from service.app.supervisor import LocalService
from tests.support.laboratory import BEAM
from tests.support.rest import client_of, finished, ok, pointers, posted

Ids = dict[str, str]
SHAPE = {"point": 1, "direction": 3, "real": 1.0, "imag": 0.0}
FRF = {"response_point": 1, "response_direction": 3, "reference_point": 1, "reference_direction": 3}
FRFS = {"quantity": "accelerance", "frequency_hz": [1.0, 2.0, 3.0]}
EX = {"name": "Ex"}


@pytest.fixture(scope="module")
def room(service: LocalService) -> Iterator[tuple[httpx.Client, Ids]]:
    """A project with two structures, two campaigns of the first and one of the second, and something of each kind."""
    with client_of(service, f"refused-{uuid4().hex}") as api:
        ids = {"project": posted(api, "projects", {"name": "p"})["id"]}
        ids["structure"], ids["elsewhere"] = (
            posted(api, f"projects/{ids['project']}/structures", {**BEAM, "name": name})["id"] for name in ("a", "b")
        )
        apart = posted(api, "projects", {"name": "q"})["id"]
        far = posted(api, f"projects/{apart}/structures", BEAM)["id"]
        ids["far"] = posted(api, f"structures/{far}/campaigns", {"name": "c", "boundary": "free"})["id"]
        bare = posted(api, f"projects/{ids['project']}/structures", {"name": "bare"})["id"]
        for name, structure in (("campaign", "structure"), ("other", "structure"), ("foreign", "elsewhere")):
            body = {"name": name, "boundary": "cantilever"}
            body |= {"performed_at": "2026-03-02T09:30:00Z"} if name == "other" else {}
            ids[name] = posted(api, f"structures/{ids[structure]}/campaigns", body)["id"]
        ids["of_bare"] = posted(api, f"structures/{bare}/campaigns", {"name": "c", "boundary": "free"})["id"]
        modes = {"name": "m", "modes": [{"frequency_hz": 25.0}]}
        ids["mode_set"] = posted(api, f"campaigns/{ids['other']}/mode-sets", modes)["id"]
        spectrum = {"real": [1.0, 2.0, 3.0], "imag": [0.0, 0.5, 1.0]}
        frfs = posted(api, f"campaigns/{ids['campaign']}/frfs", {**FRFS, "frfs": [{**FRF, **spectrum}]})
        ids["frf"] = frfs["items"][0]["id"]
        for name, structure in (("batch", "structure"), ("foreign_batch", "elsewhere")):
            path = f"structures/{ids[structure]}/coupon-batches"
            ids[name] = posted(api, path, {"name": "b", "constants": ["Ex", "Ey"]})["id"]
        coupon = posted(api, f"coupon-batches/{ids['batch']}/coupons", {"specimen": "A", "strength_Pa": 3e8})
        ids["coupon"] = coupon["items"][0]["id"]
        since = {"campaigns": 4, "since": "2030-01-01T00:00:00Z"}
        monitor = {"name": "m", "runs_on": "hand", "baseline": since}
        ids["monitor"] = posted(api, f"structures/{ids['structure']}/monitors", monitor)["id"]
        ids["resting"] = posted(api, f"structures/{ids['structure']}/monitors", monitor)["id"]
        ok(api.patch(f"monitors/{ids['resting']}", json={"active": False}, headers={"If-Match": "*"}))
        key = {"name": "short", "expires_at": "2999-01-01T00:00:00Z"}
        ids["key"] = posted(api, "api-keys", key)["id"]
        job = api.post(f"campaigns/{ids['foreign']}/update-jobs", json={})
        ids["job"] = ok(job, 202)["id"]
        finished(api, job.headers["Location"])
        yield api, ids


def filled(value: Any, ids: Ids) -> Any:
    """The value with `{name}` replaced by that thing's id."""
    text = json.dumps(value)
    for name, key in ids.items():
        text = text.replace(f"{{{name}}}", key)
    return json.loads(text)


REFUSED: list[tuple[str, str, Any, int, str, str]] = [
    # Projects, keys
    ("PATCH", "projects/{project}", {}, 422, "", "names nothing to change"),
    ("POST", "api-keys", {"name": "k", "expires_at": "2020-01-01T00:00:00Z"}, 422, "/expires_at", "is over already"),
    ("GET", "projects?colour=red", None, 422, "colour", "is no parameter of this query"),
    ("GET", "projects/{project}/structures?cursor=x", None, 422, "cursor", "is not a cursor of this list"),
    ("DELETE", "projects/{project}/members/nobody", None, 404, "", "no member nobody"),
    # Structures
    ("PATCH", "structures/{structure}", {}, 422, "", "names nothing to change"),
    ("PATCH", "structures/{structure}", {"geometry": None}, 422, "/geometry", "cannot be null; leave it out to keep it"),
    ("GET", "structures/{structure}/versions/7", None, 404, "", "no version 7"),
    # Campaigns, FRFs, modes
    ("PATCH", "campaigns/{campaign}", {}, 422, "", "names nothing to change"),
    ("PATCH", "campaigns/{campaign}", {"name": None}, 422, "/name", "cannot be null; leave it out to keep it"),
    ("PATCH", "campaigns/{campaign}", {"frame": {"x_axis": [2, 0, 0]}}, 422, "/frame",
     "has length 2, expected a unit vector"),
    ("PATCH", "campaigns/{campaign}", {"instruments": {"hammer": {"a": 10_000 * "x"}}}, 422, "/instruments/hammer",
     "as JSON, at most 10000 are kept"),
    ("POST", "campaigns/{campaign}/frfs", {**FRFS, "frfs": [{**FRF, "real": [1, 2, 3], "imag": [1]}]}, 422, "/frfs/0",
     "real has 3 values, imag has 1"),
    ("POST", "campaigns/{campaign}/frfs",
     {**FRFS, "frfs": [{**FRF, "real": [1, 2, 3], "imag": [0, 0, 0], "coherence": [0, 1, 2]}]}, 422, "/coherence",
     "lies outside 0 to 1"),
    ("GET", "campaigns/{campaign}/frfs/data?fmin=5&fmax=1", None, 422, "fmin", "is 5 Hz and above fmax, 1 Hz"),
    ("GET", "campaigns/{campaign}/frfs/data?point=9", None, 404, "", "no FRF that matches in this campaign"),
    ("POST", "campaigns/{campaign}/mode-sets", {"name": "m", "modes": [{"frequency_hz": 1, "shape": [SHAPE, SHAPE]}]}, 422,
     "/modes/0/shape", "point 1 has direction 3 twice"),
    ("POST", "campaigns/{campaign}/mode-sets", {"name": "m", "modes": [{"frequency_hz": 1, "shape": [{**SHAPE, "real": 0}]}]},
     422, "/modes/0/shape", "is zero everywhere"),
    ("POST", "campaigns/{campaign}/identifications", {"band_hz": [3, 1]}, 422, "/band_hz", "is (3, 1), expected low < high"),
    ("DELETE", "campaigns/{campaign}", None, 412, "", "it was changed since: its ETag is now"),
    ("DELETE", "structures/{structure}", None, 412, "", "it was changed since: its ETag is now"),
    # Time blocks
    ("POST", "campaigns/{campaign}/records", {"force": [1]}, 422, "", 'is not {"variables": {name: numbers}, "mapping"'),
    ("POST", "campaigns/{campaign}/records", {"variables": {"a": [[1], [1, 2]]}}, 422, "/variables/a",
     "is not a number or a regular array of numbers"),
    ("POST", "campaigns/{campaign}/records", {"variables": {"a": [1]}}, 422, "mapping", "?dry_run=true proposes one"),
    ("GET", "campaigns/{campaign}/figures/hats", None, 404, "", "no figure 'hats'; there are"),
    # Coupons
    ("POST", "structures/{structure}/coupon-batches", {"name": "b", "constants": ["Ex", "Ex"]}, 422, "/constants",
     "a constant is named twice"),
    ("POST", "structures/{structure}/coupon-batches", {"name": "b", "constants": ["Ex"], "published": {"Ey": {"mean": 1}}},
     422, "", "published has Ey, which constants does not name"),
    ("POST", "coupon-batches/{batch}/coupons", [], 422, "", "the list has 0 specimens, expected 1 to 1000"),
    ("POST", "coupon-batches/{batch}/coupons", {"specimen": "B", "E_Pa": 3e10}, 422, "/E_Pa", "record each direction"),
    ("POST", "coupon-batches/{batch}/coupons", [{"specimen": n, "E_Pa": 3e10} for n in "BC"], 422, "/1/E_Pa", "batch gives"),
    ("POST", "coupon-batches/{batch}/coupons", {"specimen": "B", "standard": "D3518", "nu": 0.1}, 422, "", "not E_Pa or nu"),
    ("POST", "coupon-batches/{batch}/coupons", {"specimen": "B", "G_Pa": 4e9}, 422, "", "a shear modulus comes from D3518"),
    ("POST", "coupon-batches/{batch}/coupons", {"specimen": "B", "failure_code": "AXT"}, 422, "/failure_code",
     "X is no area, expected one of"),
    ("GET", "coupons/{coupon}/curve", None, 404, "", "no raw curve of coupon {coupon}"),
    ("GET", "coupons/{coupon}/figures/x", None, 404, "", "no figure 'x'; there are curve"),
    # Recipes
    ("POST", "campaigns/{campaign}/update-jobs", {"mode_set": "{mode_set}"}, 422, "/mode_set", "belongs to another campaign"),
    ("POST", "campaigns/{campaign}/update-jobs", {"prior_from_coupon_batch": "{foreign_batch}"}, 422,
     "/prior_from_coupon_batch", "belongs to another structure"),
    ("POST", "campaigns/{campaign}/update-jobs", {"band_hz": [3, 1]}, 422, "/band_hz", "its low end below its high end"),
    ("POST", "campaigns/{campaign}/update-jobs", {"identification": {"band_hz": [3, 1]}}, 422, "/identification/band_hz",
     "its low end below its high end"),
    ("POST", "campaigns/{campaign}/update-jobs", {"damping_models": ["modal", "modal"]}, 422, "/damping_models",
     "a law twice"),
    ("POST", "campaigns/{campaign}/update-jobs", {"band_hz": [8, 9]}, 422, "/band_hz",
     "8 to 9 Hz holds no line; the campaign's"),
    ("POST", "campaigns/{campaign}/update-jobs", {"parameters": [{"name": "E1"}]}, 422, "/parameters/0/name", "E1"),
    ("POST", "campaigns/{campaign}/update-jobs", {"parameters": [EX, EX]}, 422, "/parameters/1/name", "is named twice"),
    ("POST", "campaigns/{of_bare}/update-jobs", {}, 422, "/structure",
     "states no geometry, no density_kg_m3, no laminate or material: an update needs them"),
    ("POST", "update-jobs", {"jobs": [{"campaign_id": "{structure}"}]}, 422, "/jobs/0/campaign_id", "no campaign"),
    ("POST", "update-jobs", {"jobs": [{"campaign_id": "{campaign}", "recipe": {"band_hz": [3, 1]}}]}, 422,
     "/jobs/0/recipe/band_hz", "its low end"),
    ("POST", "update-jobs", {"joint": True, "jobs": [{"campaign_id": "{campaign}"}] * 2}, 422, "/jobs",
     "names a campaign twice"),
    ("POST", "update-jobs", {"joint": True, "jobs": [{"campaign_id": "{campaign}", "recipe": {"parameters": [EX]}}]}, 422,
     "/jobs/0/recipe/parameters", "state them in the common `recipe`"),
    ("POST", "update-jobs", {"joint": True, "jobs": [{"campaign_id": "{campaign}",
     "recipe": {"mode_set": "{mode_set}"}}]}, 422,
     "/jobs/0/recipe/mode_set", "belongs to another campaign"),
    ("POST", "update-jobs", {"joint": True, "recipe": {"mode_set": "{mode_set}"}, "jobs": [{"campaign_id": "{campaign}"}]}, 422,
     "/recipe/mode_set", "state it in that job's recipe"),
    ("POST", "update-jobs", {"joint": True, "jobs": [{"campaign_id": "{campaign}"}, {"campaign_id": "{far}"}]}, 422, "/jobs",
     "belong to several projects; a joint update takes campaigns of one"),
    ("POST", "structures/{structure}/plans", {"made": [{"campaign_id": "{campaign}", "mode_set": "{mode_set}"}]}, 422,
     "/made/0/mode_set", "belongs to another campaign"),
    # Results
    ("GET", "update-jobs/{job}/result?include=pictures", None, 422, "include", "names pictures; there are"),
    ("GET", "update-jobs/{job}/result", None, 409, "", "update job"),
    ("GET", "update-jobs/{job}/frfs/data?model=updated", None, 409, "", "update job"),
    ("GET", "update-jobs/{job}/frfs/data?model=updated&fmin=5&fmax=1", None, 422, "fmin", "is 5 Hz and above fmax, 1 Hz"),
    ("GET", "update-jobs/{job}/figures/frf?fmin=5&fmax=1", None, 422, "fmin", "is 5 Hz and above fmax, 1 Hz"),
    # Monitors
    ("PATCH", "monitors/{monitor}", {}, 422, "", "names nothing to change"),
    ("POST", "structures/{structure}/monitors", {"name": "m", "parameters": [{"name": "Colour"}]}, 422, "/parameters",
     "Colour is no parameter that a result has"),
    ("POST", "structures/{structure}/monitors", {"name": "m", "covariates": ["temperature_c"] * 2}, 422, "",
     "a covariate is there twice"),
    ("POST", "structures/{structure}/monitors", {"name": "m", "parameters": [{"name": "nu_xy"}]}, 422, "/parameters/0/name",
     "nu_xy is not updated by the recipe, which updates Ex"),
    ("POST", "structures/{structure}/monitors", {"name": "m", "mail_to": ["a@b.org"]}, 422, "/mail_to", "no SMTP server"),
    ("PATCH", "monitors/{monitor}", {"mail_to": ["a@b.org"]}, 422, "/mail_to", "has set no SMTP server"),
    ("POST", "monitors/{resting}/runs", {}, 409, "", "the monitor is at rest; set `active` first"),
    ("POST", "monitors/{resting}/runs", {"rerun": True}, 409, "", "the monitor is at rest; set `active` first"),
    ("POST", "monitors/{monitor}/runs", {"campaign": "{foreign}"}, 422, "/campaign",
     "is no campaign of this monitor's structure"),
    ("POST", "monitors/{monitor}/runs", {"campaign": "{campaign}"}, 422, "/campaign", "states no performed_at"),
    ("POST", "monitors/{monitor}/runs", {"campaign": "{other}"}, 422, "/campaign", "before the series begins, 2030-01-01"),
    ("GET", "monitors/{monitor}/series?series=9", None, 404, "", "no version of this series 9"),
    ("GET", "monitors/{monitor}/series/figure?parameter=nu_xy", None, 422, "parameter", "'nu_xy' is not watched; Ex, "),
    ("GET", "alarms/{monitor}", None, 404, "", "no alarm"),
    # Webhooks
    ("POST", "webhooks", {"project": "{project}", "url": "http://x:port"}, 422, "/url", "is no URL"),
    ("POST", "webhooks", {"project": "{project}", "url": "ftp://x"}, 422, "/url",
     "is no http:// or https:// URL with a host"),
    ("POST", "webhooks", {"project": "{project}", "url": "http://a:b@x.org"}, 422, "/url", "holds a user or password"),
    ("DELETE", "webhooks/{project}", None, 404, "", "no webhook"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("method", "path", "body", "status", "place", "says"), REFUSED, ids=[f"{row[1]}-{row[5]}"[:90] for row in REFUSED]
)
def test_a_refusal_says_where_and_what(
    room: tuple[httpx.Client, Ids], method: str, path: str, body: Any, status: int, place: str, says: str
) -> None:
    api, ids = room
    headers = {"PATCH": {"If-Match": "*"}, "DELETE": {"If-Match": '"old"'}}.get(method, {})
    content = {} if body is None else {"json": filled(body, ids)}
    problem = ok(api.request(method, filled(path, ids), headers=headers, **content), status)
    wanted = filled(says, ids)
    if status == 422:
        assert place in pointers(problem), problem
        assert any(wanted in fault["detail"] for fault in problem["errors"] if fault["pointer"] == place), problem
    assert wanted in problem["detail"]


def test_a_webhook_that_is_deleted_gets_nothing_any_more(
    room: tuple[httpx.Client, Ids], rows: Callable[..., list[dict[str, Any]]]
) -> None:
    """What waits for it is given up, and nothing that it got is sent again."""
    api, ids = room
    made = (
        "WITH hook AS (INSERT INTO webhooks (project_id, url, secret, events) "
        "VALUES (%s, 'http://x.invalid', 's', '[]') RETURNING *) "
        "INSERT INTO deliveries (project_id, webhook_id, message_id, event, body, due_at) "
        "SELECT project_id, id, 'm', 'test', '{}', '2999-01-01' FROM hook RETURNING id, webhook_id"
    )
    ((waiting),) = rows(made, ids["project"])
    hook, delivery = f"webhooks/{waiting['webhook_id']}", f"deliveries/{waiting['id']}"
    assert [item["id"] for item in ok(api.get("webhooks", params={"project": ids["project"]}))["items"]] == [hook[9:]]
    assert "it is sent again at" in ok(api.post(f"{delivery}/replay"), 409)["detail"]
    ok(api.delete(hook), 204)
    assert ok(api.post(f"{delivery}/replay"), 409)["detail"] == "the webhook was deleted"
    (given_up,) = rows("SELECT state, last_error FROM deliveries WHERE id = %s", waiting["id"])
    assert given_up == {"state": "failed", "last_error": "the webhook was deleted"}
