"""Structures over HTTP: what goes in, what is refused, and that versions never change."""

from collections.abc import Callable
from typing import Any

import httpx
import psycopg
import pytest
from sqlalchemy import delete

from service.access import Member, Project, User
from service.app.supervisor import LocalService
from service.db.engine import Sessions, psycopg_url
from service.errors import NotFound
from service.store.structures.operations import Structure, structure_for
from tests.support.rest import pointers

Checked = Callable[[httpx.Response, int], Any]

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
    api: httpx.Client, project: str, beam: dict[str, Any], checked: Checked
) -> None:
    created = api.post(f"projects/{project}/structures", json=beam)
    body = checked(created, 201)
    assert {key: body[key] for key in beam} == beam
    assert (body["version"], body["laminate"]) == (1, None)
    read = api.get(api.base_url.join(created.headers["Location"]))
    assert checked(read, 200) == body
    assert read.headers["ETag"] == created.headers["ETag"]


def test_a_laminate_is_stored_as_it_was_sent(
    api: httpx.Client, project: str, beam: dict[str, Any], checked: Checked
) -> None:
    del beam["material"]
    plies = [{**PLY, "angle_deg": angle} for angle in (0.0, 45.0, -45.0, 90.0)]
    beam["laminate"] = {"plies": plies}
    body = checked(api.post(f"projects/{project}/structures", json=beam), 201)
    assert body["laminate"]["plies"] == [{**ply, "density_kg_m3": None} for ply in plies]
    assert body["material"] is None


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_a_number_that_is_not_finite_is_refused(api: httpx.Client, project: str, checked: Checked, number: str) -> None:
    body = '{"name": "x", "geometry": {"length_m": NUMBER, "width_m": 1}}'.replace("NUMBER", number)
    answer = api.post(f"projects/{project}/structures", content=body, headers={"Content-Type": "application/json"})
    assert "/geometry/length_m" in pointers(checked(answer, 422))


def test_any_body_can_be_a_structure_and_an_update_names_what_it_lacks(
    api: httpx.Client, project: str, checked: Checked
) -> None:
    bridge = checked(api.post(f"projects/{project}/structures", json={"name": "bridge"}), 201)
    assert (bridge["geometry"], bridge["density_kg_m3"], bridge["material"]) == (None, None, None)
    sent = {"name": "tour", "boundary": "free"}
    campaign = checked(api.post(f"structures/{bridge['id']}/campaigns", json=sent), 201)
    problem = checked(api.post(f"campaigns/{campaign['id']}/update-jobs", json={}), 422)
    for lacking in ("geometry", "density_kg_m3", "laminate or material"):
        assert lacking in str(problem)
    seen = api.get(f"structures/{bridge['id']}")
    edit = {"If-Match": seen.headers["ETag"]}
    changed = checked(api.patch(f"structures/{bridge['id']}", json={"density_kg_m3": 2500}, headers=edit), 200)
    assert (changed["version"], changed["geometry"], changed["density_kg_m3"]) == (2, None, 2500)


def patch(api: httpx.Client, structure: str, body: dict[str, Any]) -> httpx.Response:
    etag = api.get(f"structures/{structure}").headers["ETag"]
    return api.patch(f"structures/{structure}", json=body, headers={"If-Match": etag})


def test_a_physical_change_makes_a_version_and_the_old_one_stays(
    api: httpx.Client, structure: str, beam: dict[str, Any], checked: Checked
) -> None:
    thicker = {**beam["geometry"], "thickness_m": 0.0102}
    assert checked(patch(api, structure, {"geometry": thicker}), 200)["version"] == 2
    assert checked(patch(api, structure, {"name": "renamed"}), 200)["version"] == 2
    plies = {"plies": [{**PLY, "thickness_m": 0.0102}]}
    body = checked(patch(api, structure, {"laminate": plies}), 200)
    assert (body["version"], body["material"], body["name"]) == (3, None, "renamed")
    body = checked(patch(api, structure, {"material": beam["material"]}), 200)
    assert (body["version"], body["laminate"]) == (4, None)
    first = checked(api.get(f"structures/{structure}/versions/1"), 200)
    assert first["geometry"] == beam["geometry"]
    assert first["material"] == beam["material"]
    checked(api.get(f"structures/{structure}/versions/5"), 404)
    checked(api.get(f"structures/{structure}/versions/99999999999999999999"), 404)


def test_a_version_cannot_be_changed_even_in_the_database(service: LocalService, structure: str) -> None:
    assert service.settings.database_url is not None
    with (
        psycopg.connect(psycopg_url(service.settings.database_url)) as connection,
        pytest.raises(psycopg.errors.RaiseException, match="never change"),
    ):
        connection.execute("UPDATE structure_versions SET length_m = 1 WHERE structure_id = %s", [structure])


def test_an_edit_needs_the_version_that_it_edits(api: httpx.Client, structure: str, checked: Checked) -> None:
    checked(api.patch(f"structures/{structure}", json={"name": "x"}), 428)
    old = api.get(f"structures/{structure}").headers["ETag"]
    checked(patch(api, structure, {"name": "mine"}), 200)
    checked(api.patch(f"structures/{structure}", json={"name": "yours"}, headers={"If-Match": old}), 412)
    assert api.get(f"structures/{structure}").json()["name"] == "mine"


def test_structures_are_listed_in_pages(
    api: httpx.Client, project: str, beam: dict[str, Any], checked: Checked
) -> None:
    made = [checked(api.post(f"projects/{project}/structures", json={**beam, "name": n}), 201) for n in "abcde"]
    seen: list[Any] = []
    cursor = None
    while True:
        page = checked(
            api.get(f"projects/{project}/structures", params={"limit": 2, **({"cursor": cursor} if cursor else {})}),
            200,
        )
        seen += page["items"]
        cursor = page["next_cursor"]
        if cursor is None:
            break
    assert seen == made


def test_what_was_removed_since_it_was_found_is_not_found(sessions: Sessions) -> None:
    """A purge between the look and the lock of another request, which once would have been an error of the service."""
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
