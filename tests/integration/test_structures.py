"""Structures over HTTP: what goes in, what is refused, that versions never change; how much a
project stores.
"""

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import httpx
import psycopg
import pytest
from sqlalchemy import delete

from service.app.supervisor import LocalService
from service.nouns.structures.operations import Structure, structure_for
from service.pages.example import paper
from service.platform.access import Member, Project, User
from service.platform.db.engine import Sessions, psycopg_url
from service.platform.errors import NotFound
from tests.support.furnished import MODES, frfs, record
from tests.support.laboratory import BEAM
from tests.support.rest import RAW, every_page, finished, ok
from tests.support.waiting import until

PLY = {
    "E1_Pa": 38e9,
    "E2_Pa": 9e9,
    "G12_Pa": 3.6e9,
    "G13_Pa": 3.6e9,
    "G23_Pa": 3.0e9,
    "nu_12": 0.3,
    "thickness_m": 0.00253,
    "angle_deg": 0.0,
}


def test_a_structure_is_stored_as_it_was_sent(
    api: httpx.Client, project: str, beam: dict[str, Any]
) -> None:
    created = api.post(f"projects/{project}/structures", json=beam)
    body = ok(created, 201)
    assert {key: body[key] for key in beam} == beam
    assert (body["version"], body["laminate"]) == (1, None)
    read = api.get(api.base_url.join(created.headers["Location"]))
    assert ok(read, 200) == body
    assert read.headers["ETag"] == created.headers["ETag"]


def test_a_laminate_is_stored_as_it_was_sent(
    api: httpx.Client, project: str, beam: dict[str, Any]
) -> None:
    del beam["material"]
    plies = [{**PLY, "angle_deg": angle} for angle in (0.0, 45.0, -45.0, 90.0)]
    beam["laminate"] = {"plies": plies}
    body = ok(api.post(f"projects/{project}/structures", json=beam), 201)
    assert body["laminate"]["plies"] == [{**ply, "density_kg_m3": None} for ply in plies]
    assert body["material"] is None


def test_any_body_can_be_a_structure_and_an_update_names_what_it_lacks(
    api: httpx.Client, project: str
) -> None:
    bridge = ok(api.post(f"projects/{project}/structures", json={"name": "bridge"}), 201)
    assert (bridge["geometry"], bridge["density_kg_m3"], bridge["material"]) == (None, None, None)
    sent = {"name": "tour", "boundary": "free"}
    campaign = ok(api.post(f"structures/{bridge['id']}/campaigns", json=sent), 201)
    problem = ok(api.post(f"campaigns/{campaign['id']}/update-jobs", json={}), 422)
    for lacking in ("geometry", "density_kg_m3", "laminate or material"):
        assert lacking in str(problem)
    seen = api.get(f"structures/{bridge['id']}")
    edit = {"If-Match": seen.headers["ETag"]}
    changed = ok(
        api.patch(f"structures/{bridge['id']}", json={"density_kg_m3": 2500}, headers=edit), 200
    )
    assert (changed["version"], changed["geometry"], changed["density_kg_m3"]) == (2, None, 2500)


def patch(api: httpx.Client, structure: str, body: dict[str, Any]) -> httpx.Response:
    etag = api.get(f"structures/{structure}").headers["ETag"]
    return api.patch(f"structures/{structure}", json=body, headers={"If-Match": etag})


def test_a_physical_change_makes_a_version_and_the_old_one_stays(
    api: httpx.Client, structure: str, beam: dict[str, Any]
) -> None:
    thicker = {**beam["geometry"], "thickness_m": 0.0102}
    assert ok(patch(api, structure, {"geometry": thicker}), 200)["version"] == 2
    assert ok(patch(api, structure, {"name": "renamed"}), 200)["version"] == 2
    plies = {"plies": [{**PLY, "thickness_m": 0.0102}]}
    body = ok(patch(api, structure, {"laminate": plies}), 200)
    assert (body["version"], body["material"], body["name"]) == (3, None, "renamed")
    body = ok(patch(api, structure, {"material": beam["material"]}), 200)
    assert (body["version"], body["laminate"]) == (4, None)
    first = ok(api.get(f"structures/{structure}/versions/1"), 200)
    assert first["geometry"] == beam["geometry"]
    assert first["material"] == beam["material"]
    ok(api.get(f"structures/{structure}/versions/5"), 404)
    ok(api.get(f"structures/{structure}/versions/99999999999999999999"), 404)


def test_a_version_cannot_be_changed_even_in_the_database(
    service: LocalService, structure: str
) -> None:
    with (
        psycopg.connect(psycopg_url(service.settings.database_url)) as connection,
        pytest.raises(psycopg.errors.RaiseException, match="never change"),
    ):
        connection.execute(
            "UPDATE structure_versions SET length_m = 1 WHERE structure_id = %s", [structure]
        )


def test_an_edit_needs_the_version_that_it_edits(api: httpx.Client, structure: str) -> None:
    ok(api.patch(f"structures/{structure}", json={"name": "x"}), 428)
    old = api.get(f"structures/{structure}").headers["ETag"]
    ok(patch(api, structure, {"name": "mine"}), 200)
    ok(api.patch(f"structures/{structure}", json={"name": "yours"}, headers={"If-Match": old}), 412)
    assert api.get(f"structures/{structure}").json()["name"] == "mine"


def test_structures_are_listed_in_pages(
    api: httpx.Client, project: str, beam: dict[str, Any]
) -> None:
    made = [
        ok(api.post(f"projects/{project}/structures", json={**beam, "name": n}), 201)
        for n in "abcde"
    ]
    assert every_page(api, f"projects/{project}/structures", {"limit": 2}) == made


def test_what_was_removed_since_it_was_found_is_not_found(sessions: Sessions) -> None:
    """A purge between the look and the lock of another request, which once would have been an error
    of the service.
    """
    with sessions.begin() as session:
        user, project = User(name="ada"), Project(name="p")
        session.add_all([user, project])
        session.flush()
        structure = Structure(project_id=project.id, name="s")
        session.add_all([Member(project_id=project.id, user_id=user.id, role="owner"), structure])
    with sessions() as session:
        assert structure_for(session, user, structure.id, "editor", lock=True).name == "s"
        session.rollback()
        session.get_one(Structure, structure.id)
        with sessions.begin() as other:
            other.execute(delete(Structure))
        with pytest.raises(NotFound):
            structure_for(session, user, structure.id, "editor", lock=True)


# --- how much a project stores, and what happens beyond what it may
# -----------------------------------------------------

ROOM = 800_000


@pytest.fixture
def narrow(api: httpx.Client, service: LocalService, project: str) -> dict[str, Any]:
    """The account of a project that has room for two of the paper's files left."""
    account: dict[str, Any] = ok(api.get(f"projects/{project}/storage"), 200)
    assert account == {"used_bytes": 0, "allowed_bytes": 102400 * 2**20, "parts": {}}
    filled = "INSERT INTO stored_bytes (project_id, kind, size) VALUES (%s, 'curves', %s)"
    with psycopg.connect(psycopg_url(service.settings.database_url)) as connection:
        connection.execute(filled, [project, account["allowed_bytes"] - ROOM])
    return ok(api.get(f"projects/{project}/storage"), 200)


def campaign_in(client: httpx.Client, project: str) -> tuple[str, str]:
    structure = ok(client.post(f"projects/{project}/structures", json=BEAM), 201)["id"]
    campaign = ok(client.post(f"structures/{structure}/campaigns", json=paper.CAMPAIGN), 201)["id"]
    return structure, campaign


def upload(client: httpx.Client, campaign: str, content: bytes, **params: Any) -> httpx.Response:
    return client.post(f"campaigns/{campaign}/imports", content=content, params=params, headers=RAW)


def test_what_is_stored_is_counted_and_beyond_the_quota_refused(
    api: httpx.Client, project: str, narrow: dict[str, Any]
) -> None:
    structure, campaign = campaign_in(api, project)

    def storage() -> dict[str, Any]:
        used: dict[str, Any] = ok(api.get(f"projects/{project}/storage"), 200)
        assert used["used_bytes"] == sum(used["parts"].values())
        return used

    assert storage() == narrow
    file = paper.uff_file()
    sent = upload(api, campaign, file)
    assert finished(api, sent.headers["Location"])["status"] == "succeeded"
    listed = ok(api.get(f"campaigns/{campaign}/frfs"), 200)["items"]
    spectra = sum(frf["lines"] * int(frf["dtype"].removeprefix("complex")) // 8 for frf in listed)
    assert storage()["parts"] == narrow["parts"] | {"files": len(file), "frfs": spectra}

    stored = ok(api.post(f"campaigns/{campaign}/records", json=record()), 201)["items"]
    samples = sum(row["samples"] * 8 for row in stored)
    assert storage()["parts"]["records"] == samples
    ok(api.delete(f"records/{stored[0]['id']}"), 204)
    assert storage()["parts"]["records"] == samples - 512
    ok(api.post(f"campaigns/{campaign}/mode-sets", json={"name": "m", "modes": MODES}), 201)
    before = storage()
    assert before["parts"]["modes"] > 50

    assert upload(api, campaign, file).status_code == 200  # the same bytes need no room
    _, second = campaign_in(api, project)
    refused = ok(upload(api, second, file + b" " * 200_000), 413)
    allowed = before["allowed_bytes"]
    assert f"stores {before['used_bytes']} of the {allowed} bytes" in refused["detail"]
    assert "MODALBASE_PROJECT_QUOTA_BYTES" in refused["detail"]
    assert ok(api.get(f"campaigns/{second}/imports"), 200)["items"] == []
    assert storage() == before

    room = allowed - before["used_bytes"]
    ok(upload(api, second, b" " * room), 202)  # exactly full
    for path, body in (
        (f"campaigns/{campaign}/update-jobs", {}),
        (f"campaigns/{campaign}/identifications", {}),
        (f"campaigns/{campaign}/processings", {}),
        (f"campaigns/{campaign}/frfs", frfs(7)),
        (f"campaigns/{campaign}/records", record(hit=9)),
        (f"campaigns/{campaign}/mode-sets", {"name": "m", "modes": MODES}),
    ):
        assert "purge what nobody needs" in ok(api.post(path, json=body), 413)["detail"], path

    ok(api.delete(f"structures/{structure}"), 204)
    assert storage()["used_bytes"] == allowed  # hidden, not gone
    ok(api.post(f"structures/{structure}/purge"), 204)
    assert storage()["parts"] == narrow["parts"] | {"files": room}
    ok(api.post(f"campaigns/{second}/records", json=record()), 201)


@pytest.mark.usefixtures("narrow")
def test_an_import_whose_frfs_have_no_room_ends_with_the_reason(
    api: httpx.Client, project: str
) -> None:
    """The file has room, what is in it has not: nothing of it stays, and the job is refused, not
    broken.
    """
    _, campaign = campaign_in(api, project)
    filler = upload(api, campaign, b" " * (ROOM - len(paper.uff_file())), dry_run=True)
    sent = upload(api, campaign, paper.uff_file())
    ended = finished(api, sent.headers["Location"])
    assert (filler.status_code, ended["status"], ended["error"]["reason"]) == (
        202,
        "failed",
        "refused",
    )
    assert "MODALBASE_PROJECT_QUOTA_BYTES" in ended["message"]
    assert ok(api.get(f"campaigns/{campaign}/frfs"), 200)["items"] == []


def test_uploads_at_the_same_moment_do_not_pass_the_quota_together(
    api: httpx.Client, project: str, service: LocalService, narrow: dict[str, Any]
) -> None:
    """Four files of which two have room, all found to have room before any is committed."""
    # uploads into one follow each other
    campaigns = [campaign_in(api, project)[1] for _ in range(4)]
    with (
        ThreadPoolExecutor(4) as pool,
        psycopg.connect(psycopg_url(service.settings.database_url or "")) as held,
    ):
        held.execute(
            "SELECT pg_advisory_xact_lock(hashtextextended(%s, 0))", [f"storage {project}"]
        )
        sent = [
            pool.submit(upload, api, campaign, b"%d" % number * 300_000, dry_run=True)
            for number, campaign in enumerate(campaigns)
        ]
        waiting = "SELECT count(*) = 4 FROM pg_locks WHERE locktype = 'advisory' AND NOT granted"
        until(lambda: _answers(service, waiting), "the four uploads wait to be committed")
        held.rollback()
        statuses = [answer.result().status_code for answer in sent]
    assert sorted(statuses) == [202, 202, 413, 413]
    used = ok(api.get(f"projects/{project}/storage"), 200)["used_bytes"]
    assert used - narrow["used_bytes"] == 600_000
    stored = [
        len(ok(api.get(f"campaigns/{campaign}/imports"), 200)["items"]) for campaign in campaigns
    ]
    assert sorted(stored) == [0, 0, 1, 1]


def _answers(service: LocalService, question: str) -> bool:
    with psycopg.connect(psycopg_url(service.settings.database_url)) as connection:
        return connection.execute(question.encode()).fetchone() == (True,)
