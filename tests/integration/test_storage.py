"""How much a project stores, and what happens beyond what it may."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import httpx
import psycopg
import pytest

from benchmarks.service import RAW
from service.app.demo import paper
from service.app.supervisor import LocalService
from service.db.engine import psycopg_url
from service.settings import Settings
from tests.support.furnished import MODES, frfs, record
from tests.support.laboratory import BEAM
from tests.support.rest import client_of, finished, ok
from tests.support.waiting import until

QUOTA = 800_000


@pytest.fixture(scope="module")
def small(new_database: Callable[[], str]) -> Iterator[LocalService]:
    """A service with room for two of the paper's files, and a worker."""
    settings = Settings(database_url=new_database(), port=0, log_level="error", project_quota_bytes=QUOTA)
    with LocalService(settings) as running:
        yield running


def campaign_in(client: httpx.Client, project: str) -> tuple[str, str]:
    structure = ok(client.post(f"projects/{project}/structures", json=BEAM), 201)["id"]
    campaign = ok(client.post(f"structures/{structure}/campaigns", json=paper.CAMPAIGN), 201)["id"]
    return structure, campaign


def upload(client: httpx.Client, campaign: str, content: bytes, **params: Any) -> httpx.Response:
    return client.post(f"campaigns/{campaign}/imports", content=content, params=params, headers=RAW)


def test_what_is_stored_is_counted_and_beyond_the_quota_refused(small: LocalService) -> None:
    with client_of(small, "ada") as client:
        project = ok(client.post("projects", json={"name": "p"}), 201)["id"]
        structure, campaign = campaign_in(client, project)

        def storage() -> dict[str, Any]:
            found: dict[str, Any] = ok(client.get(f"projects/{project}/storage"), 200)
            assert found["used_bytes"] == sum(found["parts"].values())
            return found

        assert storage() == {"used_bytes": 0, "allowed_bytes": QUOTA, "parts": {}}
        file = paper.uff_file()
        sent = upload(client, campaign, file)
        assert finished(client, sent.headers["Location"])["status"] == "succeeded"
        listed = ok(client.get(f"campaigns/{campaign}/frfs"), 200)["items"]
        spectra = sum(frf["lines"] * int(frf["dtype"].removeprefix("complex")) // 8 for frf in listed)
        assert storage()["parts"] == {"files": len(file), "frfs": spectra}

        stored = ok(client.post(f"campaigns/{campaign}/records", json=record()), 201)["items"]
        samples = sum(row["samples"] * 8 for row in stored)
        assert storage()["parts"]["records"] == samples
        ok(client.delete(f"records/{stored[0]['id']}"), 204)
        assert storage()["parts"]["records"] == samples - 512
        ok(client.post(f"campaigns/{campaign}/mode-sets", json={"name": "m", "modes": MODES}), 201)
        before = storage()
        assert before["parts"]["modes"] > 50

        assert upload(client, campaign, file).status_code == 200  # the same bytes need no room
        _, second = campaign_in(client, project)
        refused = ok(upload(client, second, file + b" " * 200_000), 413)
        assert f"stores {before['used_bytes']} of the {QUOTA} bytes" in refused["detail"]
        assert "MODALBASE_PROJECT_QUOTA_BYTES" in refused["detail"]
        assert ok(client.get(f"campaigns/{second}/imports"), 200)["items"] == []
        assert storage() == before

        room = QUOTA - before["used_bytes"]
        ok(upload(client, second, b" " * room), 202)  # exactly full
        for path, body in (
            (f"campaigns/{campaign}/update-jobs", {}),
            (f"campaigns/{campaign}/identifications", {}),
            (f"campaigns/{campaign}/processings", {}),
            (f"campaigns/{campaign}/frfs", frfs(7)),
            (f"campaigns/{campaign}/records", record(hit=9)),
            (f"campaigns/{campaign}/mode-sets", {"name": "m", "modes": MODES}),
        ):
            assert "purge what nobody needs" in ok(client.post(path, json=body), 413)["detail"], path

        ok(client.delete(f"structures/{structure}"), 204)
        assert storage()["used_bytes"] == QUOTA  # hidden, not gone
        ok(client.post(f"structures/{structure}/purge"), 204)
        assert storage()["parts"] == {"files": room}
        ok(client.post(f"campaigns/{second}/records", json=record()), 201)


def test_an_import_whose_frfs_have_no_room_ends_with_the_reason(small: LocalService) -> None:
    """The file has room, what is in it has not: nothing of it stays, and the job is refused, not broken."""
    with client_of(small, "ben") as client:
        project = ok(client.post("projects", json={"name": "p"}), 201)["id"]
        _, campaign = campaign_in(client, project)
        filler = upload(client, campaign, b" " * (QUOTA - len(paper.uff_file())), dry_run=True)
        sent = upload(client, campaign, paper.uff_file())
        ended = finished(client, sent.headers["Location"])
        assert (filler.status_code, ended["status"], ended["error"]["reason"]) == (202, "failed", "refused")
        assert "MODALBASE_PROJECT_QUOTA_BYTES" in ended["message"]
        assert ok(client.get(f"campaigns/{campaign}/frfs"), 200)["items"] == []


def test_uploads_at_the_same_moment_do_not_pass_the_quota_together(small: LocalService) -> None:
    """Four files of which two have room, all found to have room before any is committed."""
    with client_of(small, "eve") as client, ThreadPoolExecutor(4) as pool:
        project = ok(client.post("projects", json={"name": "p"}), 201)["id"]
        campaigns = [campaign_in(client, project)[1] for _ in range(4)]  # uploads into one follow each other
        with psycopg.connect(psycopg_url(small.settings.database_url or "")) as held:
            held.execute("SELECT pg_advisory_xact_lock(hashtextextended(%s, 0))", [f"storage {project}"])
            sent = [
                pool.submit(upload, client, campaign, b"%d" % number * 300_000, dry_run=True)
                for number, campaign in enumerate(campaigns)
            ]
            waiting = "SELECT count(*) = 4 FROM pg_locks WHERE locktype = 'advisory' AND NOT granted"
            until(lambda: _asked(small, waiting), "the four uploads wait to be committed")
            held.rollback()
        statuses = [answer.result().status_code for answer in sent]
        assert sorted(statuses) == [202, 202, 413, 413]
        assert ok(client.get(f"projects/{project}/storage"), 200)["used_bytes"] == 600_000
        stored = [len(ok(client.get(f"campaigns/{campaign}/imports"), 200)["items"]) for campaign in campaigns]
        assert sorted(stored) == [0, 0, 1, 1]


def _asked(service: LocalService, question: str) -> bool:
    with psycopg.connect(psycopg_url(service.settings.database_url or "")) as connection:
        return connection.execute(question.encode()).fetchone() == (True,)
