"""What a user did wrong, in the words of the answer: each refusal of a well-formed request by its
place and its sentence.
"""

import json
from collections.abc import Callable
from typing import Any
from uuid import uuid4

import httpx
import pytest

from tests.corpus.conftest import FRF, FRFS, SHAPE, Ids
from tests.support.laboratory import BEAM
from tests.support.rest import ok, pointers

EX = {"name": "Ex"}


def filled(value: Any, ids: Ids) -> Any:
    """The value with `{name}` replaced by that thing's id."""
    text = json.dumps(value)
    for name, key in ids.items():
        text = text.replace(f"{{{name}}}", key)
    return json.loads(text)


# fmt: off
BATCH, CAMPAIGN = {"name": "b", "constants": ["Ex"]}, {"name": "c", "boundary": "free"}
MONITOR = {"name": "m", "recipe": {"parameters": [EX]}, "parameters": [EX]}
MASS = {"specimen": "B", "E_Pa": 1e9}
PLY = {"E1_Pa": 1e9, "E2_Pa": 1e9, "G12_Pa": 1e9, "G13_Pa": 1e9, "G23_Pa": 1e9, "nu_12": 0.3, "thickness_m": 0.00253,
       "angle_deg": 0}  # fmt: skip
UNKNOWN = str(uuid4())


def beam(**change: Any) -> dict[str, Any]:
    """A structure with some of its members changed."""
    return {name: {**part, **change.pop(name, {})} if isinstance(part, dict) else part for name, part in BEAM.items()} | change


def one(**mode: Any) -> dict[str, Any]:
    return {"name": "m", "modes": [mode]}


def joint(*recipes: Any, **more: Any) -> dict[str, Any]:
    """A joint update of the campaign, once for each recipe; None: without one."""
    jobs = [{"campaign_id": "{campaign}", **({} if recipe is None else {"recipe": recipe})} for recipe in recipes]
    return {"joint": True, "jobs": jobs, **more}


TWICE, SOFT = {"window_rate_per_s": 2.0, "window_time_constant_s": 0.5}, {"clamp_compliance_sd": 100}
THREE = {**FRF, "real": [1, 2, 3], "imag": [0, 0, 0]}
OF_OTHER_NAMES = [({"a/b": 1, "~c": 2}, place, "") for place in ("/a~1b", "/~0c")]
"""RFC 6901: whoever follows the pointer comes to the member that is wrong, whatever it is
called.
"""
FOR_EACH: dict[str, list[tuple[Any, str, str]]] = {
    "POST projects/{project}/structures": [
        ({"name": "x", "Ex": 33e9}, "/Ex", "did you mean material/Ex_Pa?"),
        ({"name": "x", "colour": 1}, "/colour", "there is name, geometry, density_kg_m3"),
        ({"name": "x", "density_kg_m3": 1e6}, "/density_kg_m3", "is 1e6 kg/m³, expected at most 50000 kg/m³"),
        (beam(geometry={"width_m": 0}), "/geometry/width_m", "is 0 m, expected more than 0 m"),
        (beam(geometry={"thickness_m": 0.6}), "/geometry/thickness_m", ""),
        (beam(material={"nu_xy": 1.1}), "/material/nu_xy", ""),
        (beam(laminate={"plies": [{**PLY, "thickness_m": 0.01012}]}), "", "a laminate or a material, not both"),
        ({**beam(laminate={"plies": [PLY] * 3}), "material": None}, "", "0.00759"),
        ({"name": "x", "pieces": [{"from_m": 0.1, "to_m": 0.2, "thickness_m": 0.005}]}, "", "pieces belong to a geometry"),
    ],
    "PATCH structures/{structure}": [
        ({}, "", "names nothing to change"),
        ({"geometry": None}, "/geometry", "cannot be null; leave it out to keep it"),
        ({"laminate": {"plies": [PLY] * 4}, "material": BEAM["material"]}, "/material", ""),
        ({"pieces": [{"from_m": 0.1, "to_m": 0.9, "thickness_m": 0.005}]}, "", ""),
    ],
    "POST structures/{structure}/campaigns": [
        ({**CAMPAIGN, "temperature_c": "20"}, "/temperature_c", "Input should be a number"),
        ({**CAMPAIGN, "humidity_percent": True}, "/humidity_percent", "Input should be a number"),
        ({**CAMPAIGN, "instruments": {"sensor_mass_kg": 0.005, "sensor_point": "3"}}, "/instruments/sensor_point", "a number"),
        ({**CAMPAIGN, "frame": {"origin_m": [0.0, 0.0, False]}}, "/frame/origin_m/2", "Input should be a number"),
        ({**CAMPAIGN, "inputs": TWICE}, "/inputs", ""),
        ({**CAMPAIGN, "performed_at": "2026-03-02T09:30:00"}, "/performed_at", ""),
        ({**CAMPAIGN, "performed_at": "2026-03-02"}, "/performed_at", ""),
        ({**CAMPAIGN, "performed_at": "1772443800"}, "/performed_at", ""),
        ({**CAMPAIGN, "instruments": {"hammer": {"note": "a\0b"}}}, "/instruments/hammer/note", ""),
        ({**CAMPAIGN, "frame": {"x_axis": [0, 1, 0]}}, "/frame", ""),
    ],
    "PATCH campaigns/{campaign}": [
        ({}, "", "names nothing to change"),
        ({"name": None}, "/name", "cannot be null; leave it out to keep it"),
        ({"boundary": None}, "/boundary", "cannot be null"),
        ({"frame": {"x_axis": [2, 0, 0]}}, "/frame", "has length 2, expected a unit vector"),
        ({"frame": {"x_axis": [1, 0, 0], "y_axis": [1, 0, 0]}}, "/frame", ""),
        ({"instruments": {"hammer": {"a": 10_000 * "x"}}}, "/instruments/hammer", "as JSON, at most 10000 are kept"),
    ],
    "PATCH projects/{project}": [
        ({}, "", "names nothing to change"),
        ({"archived": None}, "/archived", ""),
    ],
    "POST campaigns/{campaign}/frfs": [
        ({**FRFS, "frequency_hz": [2, 1, 3], "frfs": [THREE]}, "/frequency_hz", ""),
        ({**FRFS, "frequency_hz": [1, 2], "frfs": [THREE]}, "/frfs/0/real", ""),
        ({**FRFS, "frfs": [{**THREE, "coherence": [0.5]}]}, "/frfs/0/coherence", ""),
        *OF_OTHER_NAMES,
        ({**FRFS, "frfs": [{**FRF, "real": [1, 2, 3], "imag": [1]}]}, "/frfs/0", "real has 3 values, imag has 1"),
        ({**FRFS, "frfs": [{**FRF, "real": [1, 2, 3], "imag": [0, 0, 0], "coherence": [0, 1, 2]}]}, "/coherence",
         "lies outside 0 to 1"),
    ],
    "POST campaigns/{campaign}/mode-sets": [
        (one(frequency_hz=1, shape=[{**SHAPE, "direction": 0}]), "/modes/0/shape/0/direction", ""),
        (one(frequency_hz=1, shape=[SHAPE, {**SHAPE, "direction": -3}]), "/modes/0/shape", ""),
        (one(frequency_hz=1, shape=[SHAPE, SHAPE]), "/modes/0/shape", "point 1 has direction 3 twice"),
        (one(frequency_hz=1, shape=[{**SHAPE, "real": 0}]), "/modes/0/shape", "is zero everywhere"),
    ],
    "PUT campaigns/{campaign}/grid-points": [
        ({"items": [{"label": 1, "x_m": 0, "y_m": 0}] * 2}, "/items", ""),
    ],
    "POST campaigns/{campaign}/identifications": [
        ({"band_hz": [3, 1]}, "/band_hz", "is (3, 1), expected low < high"),
        ({"band_hz": [-1, 10]}, "/band_hz/0", "is -1 Hz, expected at least 0 Hz"),
    ],
    "POST campaigns/{campaign}/records": [
        ({"force": [1]}, "", 'is not {"variables": {name: numbers}, "mapping"'),
        ({"variables": {"a": [[1], [1, 2]]}}, "/variables/a", "is not a number or a regular array of numbers"),
        ({"variables": {"a": [1]}}, "mapping", "?dry_run=true proposes one"),
    ],
    "POST campaigns/{campaign}/hit-decisions": [
        ({"point": 1, "hit": 1, "good": good, "why": "x"}, "/good", "a valid boolean") for good in ("no", "off", 0, "true")
    ],
    "POST structures/{structure}/coupon-batches": [
        ({**BATCH, "constants": ["Ex", "Ex"]}, "/constants", "a constant is named twice"),
        ({**BATCH, "published": {"Ey": {"mean": 1}}}, "", "published has Ey, which constants does not name"),
        ({**BATCH, "published": {"Ex": {"mean": -1e9}}}, "", ""),
    ],
    "POST coupon-batches/{batch}/coupons": [
        ({"specimen": "B", "E": 1e9}, "/E", "did you mean E_Pa?"),
        ([{"specimen": "B", "strenth_Pa": 1e9}], "/0/strenth_Pa", "did you mean strength_Pa?"),
        ({"specimen": "B", "E_Pa": 3.3e19}, "/E_Pa", "is 3.3e19 Pa, expected at most 1e13 Pa (10000 GPa)"),
        ([], "", "the list has 0 specimens, expected 1 to 1000"),
        ({"specimen": "B", "E_Pa": 3e10}, "/E_Pa", "record each direction"),
        ([{"specimen": n, "E_Pa": 3e10} for n in "BC"], "/1/E_Pa", "batch gives"),
        ({"specimen": "B", "standard": "D3518", "nu": 0.1}, "", "not E_Pa or nu"),
        ({"specimen": "B", "G_Pa": 4e9}, "", "a shear modulus comes from D3518"),
        ({"specimen": "B", "failure_code": "AXT"}, "/failure_code", "X is no area, expected one of"),
        ({"specimen": "B"}, "", ""),
        ([{"specimen": "C", "nu": 0.1}, {"specimen": "B"}], "/1", ""),
        ({**MASS, "excluded": True}, "", ""),
        ({**MASS, "exclusion_reason": "ugly"}, "", ""),
    ],
    "POST campaigns/{campaign}/update-jobs": [
        ({"inputs": TWICE}, "/inputs", ""),
        ({"inputs": SOFT}, "/inputs/clamp_compliance_sd", ""),
        ({"band": [1, 2]}, "/band", "is no member here; did you mean band_hz?"),
        ({"hold_out": {"pionts": [1]}}, "/hold_out/pionts", "did you mean points?"),
        ({"parameters": [{**EX, "mean": 1}]}, "/parameters/0/mean", "did you mean prior_mean?"),
        ({"mode_set": "{mode_set}"}, "/mode_set", "belongs to another campaign"),
        ({"mode_set": UNKNOWN}, "/mode_set", ""),
        ({"prior_from_coupon_batch": "{foreign_batch}"}, "/prior_from_coupon_batch", "belongs to another structure"),
        ({"prior_from_coupon_batch": UNKNOWN}, "/prior_from_coupon_batch", ""),
        ({"band_hz": [3, 1]}, "/band_hz", "its low end below its high end"),
        ({"band_hz": [8, 9]}, "/band_hz", "8 to 9 Hz holds no line; the campaign's"),
        ({"identification": {"band_hz": [3, 1]}}, "/identification/band_hz", "is (3, 1), expected low < high"),
        ({"damping_models": ["modal", "modal"]}, "/damping_models", "a law twice"),
        ({"hold_out": {"points": [1]}}, "/hold_out/points", "holds out every FRF"),
        ({"hold_out": {"band_hz": [0, 9]}}, "/hold_out/band_hz", "holds out every line"),
        ({"parameters": [{"name": "E1"}]}, "/parameters/0/name", "E1"),
        ({"parameters": [{"name": "root"}]}, "/parameters/0/name", ""),
        ({"springs": [{"name": "root", "stiffness": 1e4, "direction": 5}]}, "/spring", ""),
    ],
    "POST campaigns/{of_bare}/update-jobs": [
        ({}, "/structure", "states no geometry, no density_kg_m3, no laminate or material: an update needs them"),
    ],
    "POST update-jobs": [
        *(({"jobs": [{"campaign_id": UNKNOWN}, {"campaign_id": "{campaign}", "recipe": {"mode_set": UNKNOWN}}]}, place, "")
          for place in ("/jobs/0/campaign_id", "/jobs/1/recipe/mode_set")),
        ({"joint": True, "jobs": [{"campaign_id": "{campaign}", "recipe": {"inputs": SOFT}}, {"campaign_id": "{other}"}]},
         "/jobs/0/recipe/inputs/clamp_compliance_sd", ""),
        ({"jobs": [{"campaign_id": "{structure}"}]}, "/jobs/0/campaign_id", "no campaign"),
        ({"jobs": [{"campaign_id": "{campaign}", "recipe": {"band_hz": [3, 1]}}]}, "/jobs/0/recipe/band_hz", "its low end"),
        ({"jobs": [{"campaign_id": "{campaign}", "angle_deg": 45}]}, "/jobs/0/angle_deg", ""),
        ({"jobs": [{"campaign_id": "{campaign}"}], "scatter": 0.0}, "/scatter", ""),
        (joint(None), "/jobs", ""),
        (joint(None, None), "/jobs", "names a campaign twice"),
        (joint({"parameters": [EX]}), "/jobs/0/recipe/parameters", "state them in the common `recipe`"),
        (joint({"mode_set": "{mode_set}"}), "/jobs/0/recipe/mode_set", "belongs to another campaign"),
        (joint({"posterior": "mcmc"}), "/jobs/0/recipe/posterior", ""),
        (joint(None, recipe={"mode_set": "{mode_set}"}), "/recipe/mode_set", "state it in that job's recipe"),
        (joint(None, recipe={"parameters": [{"name": "density"}]}), "/recipe/parameters/0/name", ""),
        (joint(None, coupon_batches=[UNKNOWN]), "/coupon_batches/0", ""),
        (joint(None, coupon_batches=[UNKNOWN, UNKNOWN]), "/coupon_batches", "names a batch twice"),
        ({"joint": True, "jobs": [{"campaign_id": "{campaign}"}, {"campaign_id": UNKNOWN}]}, "/jobs/1/campaign_id", ""),
        ({"joint": True, "jobs": [{"campaign_id": "{campaign}"}, {"campaign_id": "{far}"}]}, "/jobs",
         "belong to several projects; a joint update takes campaigns of one"),
    ],
    "POST structures/{structure}/plans": [
        ({"made": [{"campaign_id": "{campaign}", "mode_set": "{mode_set}"}]}, "/made/0/mode_set", "another campaign"),
        ({"made": [{"campaign_id": "{campaign}", "mode_set": UNKNOWN}]}, "/made/0/mode_set", ""),
        ({"made": [{"campaign_id": "{campaign}", "mode_set": UNKNOWN}] * 2}, "/made", "names a campaign twice"),
        ({"tests": [{"boundary": "free", "structure_id": UNKNOWN}]}, "/tests/0/structure_id", ""),
        ({"tests": [{"boundary": "free", "highest_hz": 3.0}]}, "/tests/0/highest_hz", "below the first mode"),
        ({"tests": [{"boundary": "free"}, {"boundary": "as_modelled"}]}, "/tests/1/boundary", ""),
    ],
    "POST structures/{structure}/monitors": [
        ({"name": "m", "parameters": [{"name": "Colour"}]}, "/parameters", "Colour is no parameter that a result has"),
        ({"name": "m", "parameters": [{"name": "nu_xy"}]}, "/parameters/0/name",
         "nu_xy is not updated by the recipe, which updates Ex"),
        ({"name": "m", "covariates": ["temperature_c"] * 2}, "", "a covariate is there twice"),
        ({"name": "m", "mail_to": ["a@b.org"]}, "/mail_to", "no SMTP server"),
        ({**MONITOR, "mail_to": ["nobody"]}, "/mail_to", "nobody is no mail address"),
        ({**MONITOR, "recipe": {"mode_set": UNKNOWN}}, "/recipe/mode_set", "a mode set is of one campaign"),
        ({**MONITOR, "recipe": {"prior_from_coupon_batch": UNKNOWN}}, "/recipe/prior_from_coupon_batch", "no coupon batch"),
        ({**MONITOR, "parameters": [EX, EX]}, "/parameters", "Ex is there twice"),
        ({**MONITOR, "parameters": []}, "/parameters", "at least 1"),
        ({**MONITOR, "baseline": {"campaigns": 3}}, "/baseline/campaigns", "is 3, expected at least 4"),
        ({**MONITOR, "baseline": {"campaigns": 4}, "covariates": ["temperature_c"]}, "", "too few campaigns"),
        ({**MONITOR, "horizon": 2, "pending": 3}, "", "horizon"),
        ({**MONITOR, "runs_on": "schedule"}, "", "a schedule belongs to"),
        ({**MONITOR, "runs_on": "schedule", "schedule": "every day"}, "", "five cron fields"),
        ({**MONITOR, "false_alarm_rate": 0}, "/false_alarm_rate", "is 0, expected more than 0"),
        ({**MONITOR, "treshold": 3}, "/treshold", "is no member here; there is name, "),
    ],
    "PATCH monitors/{monitor}": [
        ({}, "", "names nothing to change"),
        ({"mail_to": ["a@b.org"]}, "/mail_to", "has set no SMTP server"),
    ],
    "POST monitors/{monitor}/runs": [
        ({"campaign": "{other}", "rerun": True}, "", ""),
        ({"campaign": "{foreign}"}, "/campaign", "is no campaign of this monitor's structure"),
        ({"campaign": UNKNOWN}, "/campaign", "no campaign of this"),
        ({"campaign": "{campaign}"}, "/campaign", "states no performed_at"),
        ({"campaign": "{other}"}, "/campaign", "before the series begins, 2030-01-01"),
    ],
    "POST api-keys": [({"name": "k", "expires_at": "2020-01-01T00:00:00Z"}, "/expires_at", "is over already")],
    "POST webhooks": [
        ({"project": "{project}", "url": "http://x:port"}, "/url", "is no URL"),
        ({"project": "{project}", "url": "ftp://x"}, "/url", "is no http:// or https:// URL with a host"),
        ({"project": "{project}", "url": "http://a:b@x.org"}, "/url", "holds a user or password"),
        *(({"project": "{project}", "url": f"http://{host}/"}, "/url", "")
          for host in ("10.0.0.1", "[::1]", "192.0.0.192", "[64:ff9b::1.1.1.1]", "no-such-name.invalid")),
    ],
}
OTHERS: list[tuple[str, Any, int, str, str]] = [
    ("GET projects?colour=red", None, 422, "colour", "is no parameter of this query"),
    ("GET projects/{project}/structures?cursor=x", None, 422, "cursor", "is not a cursor of this list"),
    ("DELETE projects/{project}/members/nobody", None, 404, "", "no member nobody"),
    ("GET structures/{structure}/versions/7", None, 404, "", "no version 7"),
    ("GET structures/{structure}/versions/99999999999999999999", None, 404, "", ""),
    ("GET campaigns/{campaign}/frfs/data?fmin=5&fmax=1", None, 422, "fmin", "is 5 Hz and above fmax, 1 Hz"),
    ("GET campaigns/{campaign}/frfs/data?point=9", None, 404, "", "no FRF that matches in this campaign"),
    ("DELETE campaigns/{campaign}", None, 412, "", "it was changed since: its ETag is now"),
    ("DELETE structures/{structure}", None, 412, "", "it was changed since: its ETag is now"),
    ("GET campaigns/{campaign}/figures/hats", None, 404, "", "no figure 'hats'; there are"),
    ("GET coupons/{coupon}/curve", None, 404, "", "no raw curve of coupon {coupon}"),
    ("GET coupons/{coupon}/figures/x", None, 404, "", "no figure 'x'; there are curve"),
    ("GET update-jobs/{job}/result?include=pictures", None, 422, "include", "names pictures; there are"),
    ("GET update-jobs/{job}/result", None, 409, "", "update job"),
    ("GET update-jobs/{job}/frfs/data?model=updated", None, 409, "", "update job"),
    ("GET update-jobs/{job}/frfs/data?model=updated&fmin=5&fmax=1", None, 422, "fmin", "is 5 Hz and above fmax, 1 Hz"),
    ("GET update-jobs/{job}/figures/frf?fmin=5&fmax=1", None, 422, "fmin", "is 5 Hz and above fmax, 1 Hz"),
    ("POST monitors/{resting}/runs", {}, 409, "", "the monitor is at rest; set `active` first"),
    ("POST monitors/{resting}/runs", {"rerun": True}, 409, "", "the monitor is at rest; set `active` first"),
    ("GET monitors/{monitor}/series?series=9", None, 404, "", "no version of this series 9"),
    ("GET monitors/{monitor}/series/figure?parameter=nu_xy", None, 422, "parameter", "'nu_xy' is not watched; Ex, "),
    ("GET alarms/{monitor}", None, 404, "", "no alarm"),
    ("DELETE webhooks/{project}", None, 404, "", "no webhook"),
]
REFUSED = [(asked, body, 422, *said) for asked, rows in FOR_EACH.items() for body, *said in rows] + OTHERS
# fmt: on


@pytest.mark.parametrize(
    ("asked", "body", "status", "place", "says"),
    REFUSED,
    ids=[f"{number}-{row[0]}-{row[3]}-{row[4]}"[:90] for number, row in enumerate(REFUSED)],
)
def test_a_refusal_says_where_and_what(
    room: tuple[httpx.Client, Ids], asked: str, body: Any, status: int, place: str, says: str
) -> None:
    api, ids = room
    method, path = asked.split(" ", 1)
    headers = {"PATCH": {"If-Match": "*"}, "DELETE": {"If-Match": '"old"'}}.get(method, {})
    content = {} if body is None else {"json": filled(body, ids)}
    answer = api.request(method, filled(path, ids), headers=headers, **content)
    problem, wanted = ok(answer, status), filled(says, ids)
    assert answer.headers["content-type"] == "application/problem+json"
    if status == 422:
        assert place in pointers(problem), problem
        assert "confirmable" not in problem
        assert any(
            wanted in fault["detail"] for fault in problem["errors"] if fault["pointer"] == place
        ), problem
    assert wanted in problem["detail"]


def test_a_webhook_that_is_deleted_gets_nothing_any_more(
    room: tuple[httpx.Client, Ids], rows: Callable[..., list[dict[str, Any]]]
) -> None:
    """What waits for it is given up, and nothing that it got is sent again."""
    api, ids = room
    made = (
        "WITH hook AS (INSERT INTO webhooks (project_id, url, secret, events) "
        "VALUES (%s, 'http://x.invalid', 's', '[]') RETURNING *) "
        "INSERT INTO deliveries (project_id, channel, webhook_id, message_id, event, body, due_at) "
        "SELECT project_id, 'webhook', id, 'm', 'test', '{}', '2999-01-01' FROM hook RETURNING id, webhook_id"
    )
    (waiting,) = rows(made, ids["project"])
    hook, delivery = f"webhooks/{waiting['webhook_id']}", f"deliveries/{waiting['id']}"
    assert [
        item["id"] for item in ok(api.get("webhooks", params={"project": ids["project"]}))["items"]
    ] == [hook[9:]]
    assert "it is sent again at" in ok(api.post(f"{delivery}/replay"), 409)["detail"]
    ok(api.delete(hook), 204)
    assert ok(api.post(f"{delivery}/replay"), 409)["detail"] == "the webhook was deleted"
    (given_up,) = rows("SELECT state, last_error FROM deliveries WHERE id = %s", waiting["id"])
    assert given_up == {"state": "failed", "last_error": "the webhook was deleted"}
