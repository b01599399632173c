"""The service as a stranger uses it, who has the documentation page alone."""

import json
import os
import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest

from service.app.supervisor import LocalService
from service.nouns.updates.result_schemas import ResultOut
from service.pages.example import paper
from service.platform.web.bodies import SOME_ID
from tests.support.laboratory import Done
from tests.support.lengths import long
from tests.support.rest import finished, ok


class Stranger:
    """Sends what the OpenAPI document proposes, with the ids that came back."""

    def __init__(self, api: httpx.Client, document: dict[str, Any]) -> None:
        self.api, self.document, self.ids = api, document, dict[str, str]()
        self.proposals = {
            (method, path.removeprefix("/api/v1"))
            for path, operations in document["paths"].items()
            for method, operation in operations.items()
            if "application/json" in operation.get("requestBody", {}).get("content", {})
        }

    def proposed(self, path: str, method: str) -> dict[str, Any]:
        content = self.document["paths"][f"/api/v1{path}"][method]["requestBody"]["content"]
        schema = content["application/json"]["schema"]
        reference = schema.get("anyOf", [schema])[0]["$ref"]
        body = self.document["components"]["schemas"][reference.rsplit("/", 1)[1]]["examples"][0]
        self.proposals.discard((method, path))
        return self.with_ids(body)

    def with_ids(self, body: Any) -> Any:
        """A body with ids that there are in the place of those that stand for one's own."""
        if isinstance(body, list):
            return [self.with_ids(one) for one in body]
        if not isinstance(body, dict):
            return body
        return {
            name: self.ids.get(f"{name.removesuffix('_id')}_id", value)
            if value == SOME_ID
            else self.with_ids(value)
            for name, value in body.items()
        }

    def send(self, method: str, path: str, **how: Any) -> dict[str, Any]:
        answer = self.api.request(method, path.format(**self.ids).lstrip("/"), **how)
        assert answer.is_success, f"{method} {path}: {answer.status_code} {answer.text}"
        return answer.json()

    def make(self, path: str, **ids: str) -> None:
        """Post the proposal and keep the id of what was made."""
        made = self.send("POST", path, json=self.proposed(path, "post"))
        self.ids |= {name: made[field] for name, field in ids.items()}

    def put(self, path: str) -> None:
        """Put the proposal."""
        self.send("PUT", path, json=self.proposed(path, "put"), headers={"If-Match": "*"})

    def wait(self, path: str) -> None:
        state = finished(self.api, path.format(**self.ids).lstrip("/"))
        assert state["status"] == "succeeded", state


@pytest.fixture
def stranger(service: LocalService, api: httpx.Client) -> Stranger:
    return Stranger(
        api, httpx.get(f"{service.url}/openapi.json", trust_env=False, timeout=60).json()
    )


@pytest.mark.parametrize("own", [False, long(True)])
def test_a_stranger_runs_the_main_job_by_the_curl_of_its_steps(
    stranger: Stranger, service: LocalService, demo: Done, tmp_path: Path, own: bool
) -> None:
    """Each step sends the document's proposal; the result is what the document says: that of the
    step's own job, or the demonstration's without a report, of which the tutorial has one.
    """
    api = stranger.api = demo.api
    (tmp_path / "beam.uff").write_bytes(paper.uff_file())
    key = api.headers["authorization"].removeprefix("Bearer ")
    variables = {"URL": service.url, "KEY": key, "PATH": os.environ["PATH"]}
    kinds = ("project", "structure", "campaign", "import", "", "", "job", "", "", "")
    steps = re.findall(r"`(POST|GET|PUT) (/[^`]+)`", stranger.document["info"]["description"])
    for (method, step), kind in zip(steps, kinds, strict=True):
        (description,) = (
            operations[method.lower()]["description"]
            for path, operations in stranger.document["paths"].items()
            if re.sub(r"\{\w+\}", "{id}", path) == f"/api/v1{step}" and method.lower() in operations
        )
        if step.endswith("/report") and not own:
            continue
        command = description.partition("```sh\n")[2].partition("\n```")[0]
        said = subprocess.run(
            ["bash", "-c", command], env=variables, cwd=tmp_path, capture_output=True, check=True
        )
        if step.endswith("/report"):
            assert (tmp_path / "report.pdf").read_bytes().startswith(b"%PDF")
            continue
        answer = json.loads(said.stdout)
        if kind:
            variables[f"{kind.upper()}_ID"] = answer["id"]
        if kind == "job" and not own:
            ok(api.post(f"update-jobs/{answer['id']}/cancel"))
            variables["JOB_ID"] = stranger.ids["job_id"] = demo.job
        elif kind in ("import", "job"):
            stranger.ids[f"{kind}_id"] = answer["id"]
            stranger.wait({"import": "/imports/{import_id}", "job": "/update-jobs/{job_id}"}[kind])
    assert ResultOut.model_validate(answer).parameters
    assert list(answer)[:2] == ["verdict", "warnings"]
    assert "convergence" not in answer
    whole = stranger.send("GET", "/update-jobs/{job_id}/result?include=stabilisation,convergence")
    assert ResultOut.model_validate(whole).convergence
    if own:
        assert "stabilisation" not in answer["identification"]
        assert whole["identification"]["stabilisation"]["order"]
    stranger.put("/update-jobs/{job_id}/labels")
    wrong = api.get(f"update-jobs/{stranger.ids['job_id']}/result?include=all")
    assert wrong.status_code == 422


@pytest.mark.long
def test_every_other_proposal_works_too(
    stranger: Stranger, new_client: Callable[[], httpx.Client]
) -> None:
    stranger.make("/projects", project_id="id")
    stranger.make("/api-keys")
    other = new_client()
    theirs = other.post("projects", json={"name": "theirs"}).raise_for_status().json()["id"]
    (owner,) = other.get(f"projects/{theirs}/members").raise_for_status().json()["items"]
    stranger.ids["member"] = owner["user_id"]
    stranger.put("/projects/{project_id}/members/{member}")
    stranger.make("/projects/{project_id}/structures", structure_id="id")
    stranger.make("/structures/{structure_id}/campaigns", campaign_id="id")
    hits = "/campaigns/{campaign_id}"
    stranger.put(f"{hits}/grid-points")
    stranger.make(f"{hits}/alignment")
    stranger.make(f"{hits}/records")
    stranger.make(f"{hits}/hit-decisions")
    stranger.make(f"{hits}/processings")
    stranger.make(f"{hits}/frfs")
    stranger.put(f"{hits}/frfs/labels")
    stranger.make(f"{hits}/mode-sets", mode_set_id="id")
    stranger.make("/mode-sets/{mode_set_id}/edits")
    stranger.make(f"{hits}/identifications")
    stranger.make(f"{hits}/update-jobs", job_id="id")
    stranger.make("/update-jobs")
    stranger.make("/structures/{structure_id}/coupon-batches", batch_id="id")
    coupons = "/coupon-batches/{batch_id}/coupons"
    made = stranger.send("POST", coupons, json=stranger.proposed(coupons, "post"))
    stranger.ids["coupon_id"] = made["items"][0]["id"]
    stranger.make("/projects/{project_id}/instruments", instrument_id="id")
    for what in ("forecasts", "plans"):
        stranger.make(f"/structures/{{structure_id}}/{what}")
    stranger.make("/searches")
    hook = {**stranger.proposed("/webhooks", "post"), "url": "http://127.0.0.1:9/ones-own"}
    stranger.send("POST", "/webhooks", json=hook)
    stranger.make("/structures/{structure_id}/monitors", monitor_id="id")
    stranger.make("/monitors/{monitor_id}/runs")
    for path, operations in stranger.document["paths"].items():
        # an administrator's, who ends keys earlier and never later; a caption, which is all of its edit
        if "patch" in operations and not {"users", "attachments"} & set(path.split("/")):
            stated = {parameter["name"] for parameter in operations["patch"]["parameters"]}
            assert "If-Match" in stated, path
            route = path.removeprefix("/api/v1")
            stranger.send(
                "PATCH", route, json=stranger.proposed(route, "patch"), headers={"If-Match": "*"}
            )
    # the first needs a result and is sent in the main job, the others a file, an alarm and
    # administrators
    assert stranger.proposals == {
        ("put", "/update-jobs/{job_id}/labels"),
        ("patch", "/attachments/{attachment_id}"),
        ("put", "/laboratory"),
        ("post", "/alarms/{alarm_id}/acknowledge"),
        ("patch", "/users/{user_id}/api-keys/{key_id}"),
    }
