"""Clients that generators make of the OpenAPI document: without a warning, and good for the main job."""

import importlib
import io
import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from uuid import UUID

import httpx
import pytest

from service.app.supervisor import LocalService
from service.pages.example import paper
from tests.support.laboratory import Done
from tests.support.rest import finished
from tools.reference import document

BINARY = (
    *("application/x-npz", "application/x-npy", "application/x-hdf5", "application/x-matlab-data"),
    *("application/vnd.apache.parquet", "application/zip", "text/csv"),
)
"""Media types of files, which this generator reads as bytes with a setting."""


@pytest.fixture(scope="module")
def schema(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("openapi") / "openapi.json"
    file.write_text(json.dumps({**document(), "info": {"title": "generated lab", "version": "1"}}))
    return file


@pytest.fixture(scope="module")
def generated(schema: Path) -> Iterator[str]:
    """Name of the package that openapi-python-client makes; whatever it warns of is an error."""
    config = schema.with_name("config.json")
    as_bytes = dict.fromkeys(BINARY, "application/octet-stream")
    config.write_text(json.dumps({"content_type_overrides": as_bytes, "post_hooks": []}))
    made = subprocess.run(
        [
            *(sys.executable, "-m", "openapi_python_client", "generate", "--meta", "none"),
            *("--path", str(schema), "--config", str(config), "--fail-on-warning"),
            *("--output-path", str(schema.parent / "generated_lab")),
        ],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert made.returncode == 0, made.stdout + made.stderr
    assert "WARNING" not in made.stdout + made.stderr
    sys.path.insert(0, str(schema.parent))
    yield "generated_lab"
    sys.path.remove(str(schema.parent))
    for name in [name for name in sys.modules if name.split(".")[0] == "generated_lab"]:
        del sys.modules[name]


class Calls:
    """The functions of a generated package by their operation's id, with its client."""

    def __init__(self, package: str, url: str, key: str) -> None:
        self.package, self.models = package, importlib.import_module(f"{package}.models")
        client = importlib.import_module(f"{package}.client")
        self.client = client.AuthenticatedClient(
            base_url=url, token=key, httpx_args={"trust_env": False}, timeout=httpx.Timeout(60)
        )

    def __call__(self, tag: str, operation: str, *words: Any, **more: Any) -> Any:
        module = importlib.import_module(f"{self.package}.api.{tag}.{operation}")
        answer = module.sync_detailed(*words, client=self.client, **more)
        assert answer.status_code < 300, answer.content
        return answer.parsed


def test_operations_are_called_as_their_functions() -> None:
    operations = [one for path in document()["paths"].values() for one in path.values()]
    ids = [one["operationId"] for one in operations]
    assert len(ids) == len(set(ids))
    assert {"create_project", "start_update", "get_result"} <= set(ids)


def test_every_body_is_a_named_schema_with_an_example() -> None:
    schemas = document()["components"]["schemas"]
    for path, operations in document()["paths"].items():
        for method, operation in operations.items():
            content = operation.get("requestBody", {"content": {}})["content"]
            if (stated := content.get("application/json")) is None:
                continue
            for each in stated["schema"].get("anyOf", [stated["schema"]]):
                named = each.get("items", each)
                name = named["$ref"].rpartition("/")[2]
                assert schemas[name].get("examples"), f"{method} {path}: {name} has no example"


@pytest.mark.long
def test_a_generated_client_runs_the_main_job(
    generated: str, service: LocalService, demo: Done
) -> None:
    """From a project to its file; the update has no FRFs, and the demonstration's result is read.
    The tests above are the short form: what a generator needs is in the document.
    """
    call = Calls(generated, service.url, demo.api.headers["Authorization"].split()[1])
    with call.client:
        main_job(generated, call, demo.api)
        result = call("update_jobs", "get_result", UUID(demo.job))
    estimates = {one.name: one.estimate for one in result.parameters}
    assert estimates == {one["name"]: one["estimate"] for one in demo.result["parameters"]}
    assert result.verdict.level == demo.result["verdict"]["level"]


def main_job(generated: str, call: Calls, api: httpx.Client) -> None:
    """A project, a structure, a campaign, an update, the file."""
    models, types = call.models, importlib.import_module(f"{generated}.types")
    project = call("projects", "create_project", body=models.ProjectIn(name="generated"))
    structure = call(
        "structures",
        "create_structure",
        project.id,
        body=models.StructureIn.from_dict(paper.STRUCTURE),
    )
    campaign = call(
        "campaigns",
        "create_campaign",
        structure.id,
        body=models.CampaignIn.from_dict(paper.CAMPAIGN),
    )
    job = call("update_jobs", "start_update", campaign.id, body=models.RecipeIn())
    assert isinstance(job.id, UUID)
    assert finished(api, f"update-jobs/{job.id}")["status"] == "failed"
    sent = call(
        "imports", "start_import", campaign.id,
        body=models.MappedForm(file=types.File(io.BytesIO(paper.uff_file()), "beam.uff")),
    )  # fmt: skip
    assert finished(api, f"imports/{sent.id}")["status"] == "succeeded"


@pytest.mark.skipif(
    shutil.which("openapi-typescript") is None, reason="openapi-typescript is not installed"
)
def test_openapi_typescript_takes_the_document(schema: Path) -> None:
    target = schema.with_suffix(".ts")
    subprocess.run(["openapi-typescript", str(schema), "-o", str(target)], check=True)
    assert "create_project: {" in target.read_text()
