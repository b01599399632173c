"""Rows of results, figures, searches, monitors and webhooks."""

from typing import Any

from service.nouns.search.nouns import SEARCHED
from tests.support.member_lab import (
    JOINT_RECIPE,
    RECIPE,
)
from tests.support.member_rows_of_files import DATA
from tests.support.member_rows_of_things import (
    LABELS,
    MONITOR,
    NEW,
    cancelled,
    cancelled_together,
    unless_named,
)
from tests.support.member_rows_within import PLANNED
from tests.support.members import Body, Refused, To, held


def _search(noun: str) -> dict[str, Any]:
    files = {"?format": "csv"}
    return {
        "filter": "project.id = '{second_project_id}'",
        "q": "nowhere",
        "sort": "-frequency_hz" if noun == "modes" else "-id",
        "fields": "project.id",
        "facets": ("project.id", Refused("project.id", files)),
        "limit": (Refused(1, files), Refused(1, {"?format": "arrow"})),
        "cursor": Refused("x", files),
    }


_LATER = {"campaign_id": "{later_id}", "recipe": {"mode_set": "{later_set_id}"}}
_TWO_SPECIMENS = [
    {"campaign_id": f"{{{name}}}", "specimen": name}
    for name in ("campaign_id", "second_campaign_id")
]
_LONG_HITS = {"campaign_id": "long_id", "name": "hits"}
_OF_RESULT = {
    "campaign": "{second_campaign_id}",
    "structure": "{second_structure_id}",
    "project": "{second_project_id}",
}


def _filters(more: Any) -> dict[str, Any]:
    """Rows of what narrows an answer that then has nothing."""
    return {"filter": To("campaign.name = 'nothing'", **more), "q": To("nowhere", **more)}


def _of(*rows: tuple[Any, Any]) -> Any:
    """Rows of a parameter of figures: the value where a figure uses it; another figure refuses
    it.
    """
    (figure, value), (other, _) = rows
    return To(value, ids={"name": figure}), Refused(value, ids={"name": other})


RESULTS: dict[str, Body] = {
    "POST /update-jobs": Body(
        {
            "recipe": held({**JOINT_RECIPE, "parameters": [{"name": "Ex"}]}, "estimate"),
            "jobs": held([{"campaign_id": "{campaign_id}"}, _LATER], "campaigns"),
            "joint": To(False, "items", waits="never"),
            "scatter": (held(0.2, "standard_deviation", {"jobs": _TWO_SPECIMENS}), Refused(0.2)),
            "coupon_batches": held(["{batch_id}"], "standard_deviation"),
            "priority": To(3, "priority", waits="never"),
            "confirm": To(
                True,
                without=422,
                beside={"recipe": {"inputs": {"thickness_sd_m": 0.5}}},
                waits="never",
            ),
        },
        {
            "recipe": JOINT_RECIPE,
            "joint": True,
            "jobs": [{"campaign_id": "{campaign_id}"}, {"campaign_id": "{second_campaign_id}"}],
        },
        then="joint-updates/{id}/result",
    ),
    "GET /update-jobs": Body({**_OF_RESULT, "status": "failed"}),
    "GET /update-jobs/{job_id}/events": Body({"last-event-id": To("{update_event}", status=204)}),
    "GET /joint-updates/{joint_id}/events": Body(
        {"last-event-id": To("{joint_event}", status=204)}
    ),
    "GET /update-jobs/{job_id}/result": Body({"include": "convergence"}),
    "POST /update-jobs/{job_id}/cancel": Body(),
    "POST /update-jobs/{job_id}/retry": Body(fresh=cancelled),
    "POST /joint-updates/{joint_id}/cancel": Body(),
    "POST /joint-updates/{joint_id}/retry": Body(fresh=cancelled_together),
    "POST /forecasts/{forecast_id}/cancel": Body(),
    "POST /identifications/{identification_id}/cancel": Body(),
    "PUT /update-jobs/{job_id}/labels": Body(LABELS, {}),
    "GET /projects/{project_id}/joint-updates": Body(),
    "POST /structures/{structure_id}/plans": Body(
        {
            "tests": To([PLANNED], "items"),
            "made": To(
                [{"campaign_id": "{campaign_id}", "mode_set": "{identified_id}"}], "known_sd"
            ),
            "points_to_hit": To(2, "points_m"),
            "coupons": To([{"constants": ["Ex"], "pieces": 10, "scatter": 0.1}], "items"),
            "about": To("Gxy", "information_nats"),
        },
        {"tests": [{"boundary": "free", "highest_hz": 300}]},
        short=("made", "coupons.sets"),
    ),
    **{
        f"GET /search/{noun}": Body(
            _search(noun), short=None if noun == "results" else ("filter", "q", "sort")
        )
        for noun in SEARCHED
    },
    "GET /search/results/trend": Body(
        {**_filters({}), "value": "Gxy", "covariates": "humidity_percent"}
    ),
    "GET /search/modes/trend": Body(
        {**_filters({}), "value": "damping_ratio", "covariates": "humidity_percent"}
    ),
    "GET /search/results/trend/figure": Body(
        {**_filters({}), "value": "Gxy", "covariates": "humidity_percent"}
    ),
    "GET /search/modes/trend/figure": Body(
        {**_filters({}), "value": "damping_ratio", "covariates": "humidity_percent"}
    ),
    "GET /search/results/figure": Body({**_filters({}), "sort": "-id"}),
    "GET /search/frfs/data": Body(
        {"filter": "campaign.id = '{second_campaign_id}'", "q": To("nowhere", status=404), **DATA},
        query={"filter": "campaign.id = '{campaign_id}'"},
    ),
    "GET /search/campaigns/archive": Body(
        {
            "filter": To("campaign.name = 'nothing'", status=404, beside={"?q": "wind"}),
            "q": To("nowhere", status=404, beside={"?filter": "campaign.name = 'small_id'"}),
        }
    ),
    "POST /searches": Body(
        {
            "project": To("{second_project_id}", "project_id"),
            "name": NEW,
            "noun": "campaigns",
            "filter": "quantity = 'mobility'",
            "q": "word",
            "sort": "-id",
            "fields": "id",
        },
        {"project": "{project_id}", "name": "s {n}", "noun": "frfs"},
    ),
    "GET /searches": Body(),
    "GET /update-jobs/{job_id}/frfs/data": Body(
        {
            "model": "initial",
            "point": To(1, status=404),
            "direction": To(2, status=404),
            "reference": 2,
            **DATA,
        }
    ),
    "GET /update-jobs/{job_id}/cards": Body({"element": "shell"}),
    "GET /update-jobs/{job_id}/figures/{name}": Body(
        {
            "point": _of(("frf", 2), ("mac", 2)),
            "reference": _of(("frf", 3), ("shapes", 3)),
            "fmin": _of(("csac", 50), ("parameters", 50)),
            "fmax": _of(("frf", 300), ("mac", 300)),
            "measured": _of(("shapes", 1), ("frf", 1)),
            "model": _of(("shapes", 1), ("csf", 1)),
        },
        ids={"name": "frf"},
    ),
    "GET /update-jobs/{job_id}/mesh": Body(
        {"at": (To("points", beside={"?format": "vtu"}), Refused("points"))}
    ),
    "GET /update-jobs/{job_id}/mesh/shapes": Body(
        {"measured": To(1, without=422), "model": To(1, without=422)}
    ),
    # test_updates.py has one on paper
    "GET /update-jobs/{job_id}/report": Body(ids={"job_id": "later_job_id"}, short=()),
    "GET /joint-updates/{joint_id}/figures/{name}": Body(ids={"name": "parameters"}),
    "GET /forecasts/{forecast_id}/frfs/data": Body(),
    "GET /forecasts/{forecast_id}/mesh": Body(
        {"at": (To("points", beside={"?format": "vtu"}), Refused("points"))}
    ),
    "GET /forecasts/{forecast_id}/mesh/shapes": Body({"model": 2}),
    "GET /campaigns/{campaign_id}/figures/{name}": Body(
        {
            "point": To(1, status=404),
            "direction": To(2, status=404),
            "response": (
                Refused(1),
                To(9, status=404, ids={"campaign_id": "hits_id", "name": "hits"}),
            ),
            "reference": (2, Refused(2, ids={"campaign_id": "hits_id", "name": "hits"})),
            "fmin": (100, To(300, ids=_LONG_HITS)),
            "fmax": (100, To(100, ids=_LONG_HITS)),
            "tmin": (To(5, ids=_LONG_HITS), Refused(5)),
            "tmax": (To(1, ids=_LONG_HITS), Refused(1)),
        },
        ids={"name": "frf"},
    ),
    "GET /identifications/{identification_id}/figures/{name}": Body(ids={"name": "stabilisation"}),
    "GET /mode-sets/{mode_set_id}/figures/{name}": Body(
        {"mode_set": (To("{other_identified_id}", ids={"name": "mac"}), Refused("{mode_set_id}"))},
        ids={"mode_set_id": "identified_id", "name": "shapes"},
    ),
    "GET /coupons/{coupon_id}/figures/{name}": Body(ids={"coupon_id": "curve_id", "name": "curve"}),
    "GET /monitors/{monitor_id}/series/figure": Body(
        {
            "parameter": "a0",
            "over": "temperature_c",
            "series": To(99, status=404),
            "from": Refused("2025-01-01T00:00:00"),
            "to": Refused("2025-01-01T00:00:00"),
        }
    ),
    "GET /monitors/{monitor_id}/series/rows": Body(
        {
            "parameter": To(["flange.E1"], status=422),
            "series": To(99, status=404),
            "from": Refused("2025-01-01T00:00:00"),
            "to": Refused("2025-01-01T00:00:00"),
        }
    ),
    "POST /structures/{structure_id}/monitors": Body(
        {
            "name": NEW,
            "watch": "modes",
            "recipe": {**RECIPE, "seed": 3},
            "modes": "given",
            "priors": "last",
            "boundary": "free",
            "parameters": [{"name": "Gxy"}],
            "baseline": {"campaigns": 7},
            "covariates": ["temperature_c"],
            "false_alarm_rate": 0.02,
            "horizon": 12,
            "pending": 2,
            "chart": {"kind": "cusum"},
            "expected_interval_days": 31,
            "runs_on": "hand",
            "schedule": To("0 3 * * 1", without=422, beside={"runs_on": "schedule"}),
            "mail_to": Refused(["a@example.org"]),
            "active": False,
            "unless_named": unless_named("monitor_id", structure_id="structure_id"),
            "confirm": To(
                True, without=422, beside={"recipe": {"inputs": {"thickness_sd_m": 0.5}}}
            ),
        },
        {"name": "m {n}"},
        ids={"structure_id": "second_structure_id"},
        short=("recipe", "mail_to", "schedule", "unless_named", "confirm", "chart.weight"),
    ),
    "GET /structures/{structure_id}/monitors": Body(),
    "GET /monitors": Body({"state": "alarm"}),
    "PATCH /monitors/{monitor_id}": Body(
        {
            "name": NEW,
            "active": False,
            "expected_interval_days": 31,
            "mail_to": Refused(["a@example.org"]),
        },
        {},
        fresh=MONITOR,
    ),
    "DELETE /monitors/{monitor_id}": Body(),
    "POST /monitors/{monitor_id}/runs": Body(
        {
            "campaign": To(
                "{second_campaign_id}",
                "campaign_id",
                {"*": {"campaign": "{campaign_id}"}},
                ids={"monitor_id": "second_monitor_id"},
            ),
            "rerun": To(True, "series"),
            "reason": To("why", "", {"rerun": True}),
        },
        {},
    ),
    "GET /monitors/{monitor_id}/runs": Body({"series": To(99)}),
    "GET /monitors/{monitor_id}/series": Body(
        {
            "series": To(99, status=404),
            "from": To("2100-01-01T00:00:00Z", "campaigns"),
            "to": To("1900-01-01T00:00:00Z", "campaigns"),
            "stride": To(7, "stride"),
        }
    ),
    "GET /alarms": Body(
        {"state": "cleared", "monitor": "{second_monitor_id}", "project": "{second_project_id}"}
    ),
    "POST /alarms/{alarm_id}/acknowledge": Body(
        {"note": To("n {n}", "note"), "together": True},
        {"note": "first"},
        fresh=lambda lab: {"alarm_id": lab.alarm()},
    ),
    "GET /monitors/{monitor_id}/deliveries": Body(),
    "POST /deliveries/{delivery_id}/replay": Body(),
    "POST /webhooks/{webhook_id}/test": Body(),
    "POST /webhooks": Body(
        {
            "project": To("{second_project_id}", "project_id"),
            "url": "{hook}?other",
            "events": ["alarm.raised"],
        },
        {"project": "{project_id}", "url": "{hook}"},
    ),
    "GET /webhooks": Body({"project": "{second_project_id}"}),
    "GET /webhooks/{webhook_id}/deliveries": Body(),
}
