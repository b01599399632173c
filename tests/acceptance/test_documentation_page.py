"""The service as a stranger uses it, who has the documentation page alone."""

import re
from typing import Any

import httpx
import pytest

from service.app.demo import paper
from service.app.supervisor import LocalService
from service.store.updating.result_schemas import ResultOut
from tests.support.rest import finished


class Stranger:
    """Sends what the OpenAPI document proposes, with the ids that came back."""

    def __init__(self, api: httpx.Client, document: dict[str, Any]) -> None:
        self.api, self.document, self.ids = api, document, dict[str, str]()

    def proposed(self, path: str, method: str) -> dict[str, Any]:
        reference = self.document["paths"][f"/api/v1{path}"][method]["requestBody"]["content"][
            "application/json"
        ]["schema"]
        schema = self.document["components"]["schemas"][reference["$ref"].rsplit("/", 1)[1]]
        return schema["examples"][0]

    def send(self, method: str, path: str, **how: Any) -> dict[str, Any]:
        answer = self.api.request(method, path.format(**self.ids).lstrip("/"), **how)
        assert answer.is_success, f"{method} {path}: {answer.status_code} {answer.text}"
        return answer.json()

    def make(self, path: str, **ids: str) -> None:
        """Post the proposal and keep the id of what was made."""
        made = self.send("POST", path, json=self.proposed(path, "post"))
        self.ids |= {name: made[field] for name, field in ids.items()}

    def wait(self, path: str) -> None:
        state = finished(self.api, path.format(**self.ids).lstrip("/"))
        assert state["status"] == "succeeded", state


@pytest.fixture
def stranger(service: LocalService, api: httpx.Client) -> Stranger:
    return Stranger(
        api, httpx.get(f"{service.url}/openapi.json", trust_env=False, timeout=60).json()
    )


def test_a_stranger_runs_the_main_job_from_the_documentation_page(stranger: Stranger) -> None:
    steps = re.findall(r"`(POST|GET) (/[^`]+)`", stranger.document["info"]["description"])
    assert all(  # the description names addresses that exist, with {id} for each kind of id
        any(
            re.fullmatch(re.sub(r"\{\w+\}", r"[^/]+", there), f"/api/v1{path}")
            for there in stranger.document["paths"]
        )
        for _, path in steps
    )
    stranger.make("/projects", project_id="id")
    stranger.make("/projects/{project_id}/structures", structure_id="id")
    stranger.make("/structures/{structure_id}/campaigns", campaign_id="id")
    sent = stranger.send(
        "POST", "/campaigns/{campaign_id}/imports", files={"file": ("beam.uff", paper.uff_file())}
    )
    stranger.ids["import_id"] = sent["id"]
    stranger.wait("/imports/{import_id}")
    stranger.make("/campaigns/{campaign_id}/update-jobs", job_id="id")
    stranger.wait("/update-jobs/{job_id}")
    result = stranger.send("GET", "/update-jobs/{job_id}/result")
    assert ResultOut.model_validate(result).parameters  # it is what the page says that it is
    assert list(result)[:2] == ["verdict", "warnings"]
    assert "convergence" not in result
    assert "stabilisation" not in result["identification"]
    whole = stranger.send("GET", "/update-jobs/{job_id}/result?include=stabilisation,convergence")
    assert ResultOut.model_validate(whole).convergence
    assert whole["identification"]["stabilisation"]["order"]
    wrong = stranger.api.get(f"update-jobs/{stranger.ids['job_id']}/result?include=all")
    assert wrong.status_code == 422


def test_every_other_proposal_works_too(stranger: Stranger) -> None:
    stranger.make("/projects", project_id="id")
    stranger.make("/projects/{project_id}/structures", structure_id="id")
    stranger.make("/structures/{structure_id}/campaigns", campaign_id="id")
    stranger.make("/campaigns/{campaign_id}/mode-sets")
    stranger.make("/structures/{structure_id}/coupon-batches", batch_id="id")
    coupons = "/coupon-batches/{batch_id}/coupons"
    content = stranger.document["paths"][f"/api/v1{coupons}"]["post"]["requestBody"]["content"]
    coupon = content["application/json"]["schema"]["anyOf"][0]["examples"][0]
    stranger.ids["coupon_id"] = stranger.send("POST", coupons, json=coupon)["items"][0]["id"]
    stranger.make("/projects/{project_id}/instruments", instrument_id="id")
    stranger.make("/structures/{structure_id}/monitors", monitor_id="id")
    stranger.make("/monitors/{monitor_id}/runs")
    for path, operations in stranger.document["paths"].items():
        # an administrator's, who ends keys earlier and never later
        if "patch" in operations and "/users/" not in path:
            stated = {parameter["name"] for parameter in operations["patch"]["parameters"]}
            assert "If-Match" in stated, path
            route = path.removeprefix("/api/v1")
            stranger.send(
                "PATCH", route, json=stranger.proposed(route, "patch"), headers={"If-Match": "*"}
            )
