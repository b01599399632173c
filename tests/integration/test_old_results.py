"""Results that an earlier version stored in a form that is read no more: each place says to run the
update again, or leaves them out; nothing of them is lost.
"""

import io
import json
from collections.abc import Callable, Iterator
from typing import Any
from zipfile import ZipFile

import psycopg
import pytest

from service.app.supervisor import LocalService
from service.nouns.updates.document import VERSION, require_current
from service.platform.db.engine import psycopg_url
from service.platform.errors import Conflict
from tests.support.laboratory import Done
from tests.support.rest import ok, session_client

REMEDY = "run the update again"


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


@pytest.fixture
def old(demo: Done, service: LocalService) -> Iterator[Callable[[int | None], dict[str, Any]]]:
    """Makes the stored result one of a version, until the test ends."""
    yield lambda version: stored_as(service, demo.job, version)
    stored_as(service, demo.job, VERSION)


def test_a_result_of_an_earlier_form_is_refused_by_what_to_do(
    demo: Done, service: LocalService, old: Callable[[int | None], dict[str, Any]]
) -> None:
    api, job, campaign = demo.api, demo.job, demo.result["provenance"]["campaign"]
    assert ok(api.get(f"update-jobs/{job}/result"))["version"] == VERSION
    for version in (VERSION - 1, None):
        stored = old(version)
        for path in ("result", "report", "figures/parameters", "frfs/data", "cards"):
            answer = api.get(f"update-jobs/{job}/{path}")
            assert answer.status_code == 409, path
            assert REMEDY in answer.json()["detail"], path
        listed = ok(api.get("update-jobs", params={"campaign": campaign}))["items"]
        assert job in [row["id"] for row in listed]
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
