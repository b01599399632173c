"""Results that an earlier version stored in a form that is read no more: each place says to run the
update again, or leaves them out; nothing of them is lost.
"""

import io
import json
from collections.abc import Callable
from typing import Any
from zipfile import ZipFile

import httpx
import psycopg
import pytest

from service.app.supervisor import LocalService
from service.nouns.updates.document import VERSION, require_current
from service.pages.example import paper
from service.platform.db.engine import psycopg_url
from service.platform.errors import Conflict
from tests.support.backups import RECIPE, small_file
from tests.support.rest import finished, ok, session_client

REMEDY = "run the update again"


@pytest.fixture
def job(api: httpx.Client, campaign: str, imported: Callable[..., dict[str, Any]]) -> str:
    """An update job that has succeeded: its id."""
    assert imported(campaign, small_file())["status"] == "succeeded"
    modes = ok(
        api.post(
            f"campaigns/{campaign}/mode-sets", json={"name": "published", "modes": paper.MODES}
        ),
        201,
    )["id"]
    begun = api.post(f"campaigns/{campaign}/update-jobs", json={**RECIPE, "mode_set": modes})
    assert finished(api, begun.headers["Location"])["status"] == "succeeded"
    return str(ok(begun)["id"])


def stored_as(service: LocalService, job: str, version: int | None) -> dict[str, Any]:
    """Make the stored result of a job one of this version; None for one that states none, as the
    first did.
    """
    with psycopg.connect(psycopg_url(service.settings.database_url)) as connection:
        query = "SELECT document FROM update_results WHERE id = %s"
        (document,) = connection.execute(query, (job,)).fetchone() or ({},)
        document.pop("version", None)
        document |= {} if version is None else {"version": version}
        change = "UPDATE update_results SET document = %s WHERE id = %s"
        assert connection.execute(change, (json.dumps(document), job)).rowcount == 1
    return dict(document)


def test_a_result_of_an_earlier_form_is_refused_by_what_to_do(
    api: httpx.Client, campaign: str, service: LocalService, job: str
) -> None:
    assert ok(api.get(f"update-jobs/{job}/result"))["version"] == VERSION
    for version in (VERSION - 1, None):
        stored = stored_as(service, job, version)
        for path in ("result", "report", "figures/parameters", "frfs/data", "cards"):
            answer = api.get(f"update-jobs/{job}/{path}")
            assert answer.status_code == 409, path
            assert REMEDY in answer.json()["detail"], path
        listed = ok(api.get("update-jobs", params={"campaign": campaign}))["items"]
        assert [row["id"] for row in listed] == [job]
        with session_client(api, base=service.url) as browser:
            page = browser.get(f"/ui/update-jobs/{job}")
            assert page.status_code == 409
            assert REMEDY in page.text
            for path in (f"campaigns/{campaign}", f"compare?job={job}"):
                assert browser.get(f"/ui/{path}").status_code == 200, path
        archived = api.get(f"campaigns/{campaign}/archive").raise_for_status().content
        with ZipFile(io.BytesIO(archived)) as archive:
            kept = json.loads(archive.read(f"campaigns/{campaign}/results/{job}.json"))
        assert {name: kept[name] for name in stored} == stored


@pytest.mark.parametrize("document", [{"version": 2}, {}, {"version": VERSION + 1}])
def test_only_todays_form_is_read(document: dict[str, Any]) -> None:
    with pytest.raises(Conflict, match=REMEDY):
        require_current(document)
    assert require_current({"version": VERSION}) == {"version": VERSION}
