"""Results that earlier versions stored, as today's service shows them: REST, report, figures and
pages.

`files/result-0.1.0.zip` and `result-0.2.0.zip` have the document and the arrays that these versions
stored of the same file.
"""

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import httpx
import psycopg
import pytest
from psycopg.types.json import Json

from service.app.demo import paper
from service.app.supervisor import LocalService
from service.db.engine import psycopg_url
from service.store.updating.document import MARKS, VERSION, up_to_date
from service.store.updating.result_schemas import ResultOut
from tests.support.backups import RECIPE, small_file
from tests.support.rest import finished, ok, session_client

OLD = ("0.1.0", "0.2.0")


def stored_by(version: str) -> tuple[dict[str, Any], bytes]:
    """The document and the arrays of a result."""
    with ZipFile(Path(__file__).parent / "files" / f"result-{version}.zip") as archive:
        return json.loads(archive.read("document.json")), archive.read("prediction.npz")


@pytest.fixture
def old_job(
    api: httpx.Client, campaign: str, imported: Callable[..., dict[str, Any]], service: LocalService
) -> Callable[[str], str]:
    """An update job of the same file, whose result is replaced by an old one: its id."""
    assert imported(campaign, small_file())["status"] == "succeeded"
    modes = ok(
        api.post(
            f"campaigns/{campaign}/mode-sets", json={"name": "published", "modes": paper.MODES}
        ),
        201,
    )["id"]
    begun = api.post(f"campaigns/{campaign}/update-jobs", json={**RECIPE, "mode_set": modes})
    assert finished(api, begun.headers["Location"])["status"] == "succeeded"
    job = str(ok(begun)["id"])
    now = ok(api.get(f"update-jobs/{job}/result"))["provenance"]

    def replace(version: str) -> str:
        document, prediction = stored_by(version)
        document["provenance"] |= {
            name: now[name] for name in ("update_job", "campaign", "frfs", "mode_set")
        }
        with psycopg.connect(psycopg_url(service.settings.database_url)) as connection:
            change = "UPDATE update_results SET document = %s, prediction = %s WHERE id = %s"
            assert connection.execute(change, (Json(document), prediction, job)).rowcount == 1
        return job

    return replace


def test_results_of_earlier_versions_are_shown_everywhere(
    api: httpx.Client, campaign: str, service: LocalService, old_job: Callable[[str], str]
) -> None:
    for version in OLD:
        job, (stored, _) = old_job(version), stored_by(version)
        is_shown(api, service, campaign, job, stored)


def is_shown(
    api: httpx.Client, service: LocalService, campaign: str, job: str, stored: dict[str, Any]
) -> None:
    shown = ok(api.get(f"update-jobs/{job}/result?include=convergence,stabilisation"))
    ResultOut.model_validate(shown)
    assert shown["version"] == VERSION
    for row, kept in zip(shown["parameters"], stored["parameters"], strict=True):
        assert {name: row[name] for name in kept} == kept
    assert shown["warnings"][-len(stored["warnings"]) :] == stored["warnings"]
    figures = {row["name"]: row for row in ok(api.get(f"update-jobs/{job}/figures"))["items"]}
    for name, row in figures.items():
        status = api.get(f"update-jobs/{job}/figures/{name}").status_code  # the report prints each
        assert status == (200 if row["available"] else 409), name
    drawn = {name for name, row in figures.items() if row["available"]}
    assert drawn >= {"frf", "parameters", "mac", "convergence", "stabilisation"}
    sentence = shown["verdict"]["sentence"]
    assert sentence in api.get(f"update-jobs/{job}/report").raise_for_status().text
    assert (
        api.get(f"update-jobs/{job}/report?format=pdf")
        .raise_for_status()
        .content.startswith(b"%PDF")
    )
    with session_client(api, base=service.url) as browser:
        for path in (f"update-jobs/{job}", f"campaigns/{campaign}", f"compare?job={job}"):
            page = browser.get(f"/ui/{path}")
            assert page.status_code == 200, f"{path}: {page.text}"
            assert sentence in page.text or not path.startswith("update-jobs")
            assert "data-over-time" not in page.text  # one result makes no time axis
    for path in ("cards", "frfs/data"):
        api.get(f"update-jobs/{job}/{path}").raise_for_status()


@pytest.mark.parametrize("version", OLD)
def test_a_document_is_brought_up_to_date_once_and_stays_as_it_is(version: str) -> None:
    stored, _ = stored_by(version)
    before = copy.deepcopy(stored)
    shown = up_to_date(stored)
    assert stored == before
    assert up_to_date(shown) == shown
    assert shown.keys() >= ResultOut.model_fields.keys() - {"version"}
    assert "do not" not in shown["verdict"]["sentence"]
    part = up_to_date(
        {name: stored.get(name) for name in (*MARKS, "parameters", "provenance", "warnings")}
    )
    assert part["parameters"] == shown["parameters"]


def test_a_result_of_0_1_0_says_what_it_lacks() -> None:
    shown = up_to_date(stored_by("0.1.0")[0])
    assert shown["verdict"]["level"] == "with_care"
    assert (
        "modalbase 0.1.0, which computed this result, judged none" in shown["verdict"]["sentence"]
    )
    assert shown["warnings"][0] in shown["verdict"]["sentence"]
    assert [row["budget"] for row in shown["parameters"]] == [[]] * len(shown["parameters"])
