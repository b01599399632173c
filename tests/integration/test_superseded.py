"""What is made anew replaces what was made before of the same records, wherever it is listed or
computed with.
"""

import io
import json
from collections.abc import Callable
from typing import Any
from uuid import UUID
from zipfile import ZipFile

import httpx
import numpy as np
import psycopg
import pytest
from sqlalchemy import Engine, text

from service.app.supervisor import LocalService
from service.nouns.updates.document import VERSION
from service.pages.example import paper
from service.platform.db.engine import psycopg_url
from service.platform.db.schema import upgrade
from tests.integration.test_db import fill
from tests.integration.test_records import npz, post, processed
from tests.support.backups import RECIPE, small_file
from tests.support.furnished import frfs
from tests.support.hammer import Simulated
from tests.support.hammer import campaign as simulated_campaign
from tests.support.rest import finished, ok, posted, session_client


@pytest.fixture(scope="module")
def hits() -> list[Simulated]:
    return simulated_campaign(np.random.default_rng(12), "free", 3, 4, 0.3, 0.0)[2]


LOW = {"band_hz": [5, 250]}
"""What makes an identification short."""


def ids(items: list[dict[str, Any]]) -> list[str]:
    return [one["id"] for one in items]


def identified(api: httpx.Client, campaign: str, **options: Any) -> dict[str, Any]:
    started = api.post(f"campaigns/{campaign}/identifications", json=options)
    done = finished(api, started.headers["Location"])
    assert done["status"] == "succeeded", done
    return done


def test_frfs_of_a_second_processing_take_the_place_of_the_first(
    api: httpx.Client, campaign: str, hits: list[Simulated]
) -> None:
    ok(post(api, campaign, npz(hits)), 201)
    first = ids(processed(api, campaign, {})["result"]["frfs"])
    good = next(s for s in hits if s.fault is None)
    overrule = {"point": good.hit.force.dof.point, "hit": good.hit.number, "use": False}
    second = processed(api, campaign, {"overrules": [overrule]})
    present = ids(second["result"]["frfs"])
    assert len(present) == len(first)
    assert ids(ok(api.get(f"campaigns/{campaign}/frfs"), 200)["items"]) == present
    both = ok(api.get(f"campaigns/{campaign}/frfs", params={"superseded": True}), 200)["items"]
    assert ids(both) == first + present
    assert [one["superseded_by"] for one in both] == len(first) * [second["id"]] + len(present) * [
        None
    ]
    assert ok(api.get(f"frfs/{first[0]}"), 200)["superseded_by"] == second["id"]
    assert api.get(f"frfs/{first[0]}/data").status_code == 200

    # All that is computed, drawn, exported and found sees the same set.
    query = {"filter": f"campaign.id = '{campaign}'"}
    assert sorted(
        row["id"] for row in ok(api.get("search/frfs", params=query), 200)["items"]
    ) == sorted(present)
    with np.load(
        io.BytesIO(api.get(f"campaigns/{campaign}/frfs/data", params={"format": "npz"}).content)
    ) as file:
        assert len(file["response_point"]) == len(present)
    assert (
        api.get("search/campaigns", params={"filter": f"frf.id = '{first[0]}'"}).json()["items"]
        == []
    )
    assert (
        len(
            api.get("search/campaigns", params={"filter": f"frf.id = '{present[0]}'"}).json()[
                "items"
            ]
        )
        == 1
    )
    with ZipFile(io.BytesIO(api.get(f"campaigns/{campaign}/archive").content)) as archive:
        rows = archive.read(f"campaigns/{campaign}/frfs.csv").decode().splitlines()
    assert len(rows) == 1 + len(present)

    # One none of whose hits is good any more leaves too.
    point = second["result"]["frfs"][0]["reference_point"]
    bad = [
        {"point": point, "hit": s.hit.number, "use": False}
        for s in hits
        if s.hit.force.dof.point == point
    ]
    third = ids(processed(api, campaign, {"overrules": bad})["result"]["frfs"])
    assert len(third) == len(present) - 1
    assert ids(ok(api.get(f"campaigns/{campaign}/frfs"), 200)["items"]) == third


def test_an_frf_whose_blocks_are_gone_stays(
    api: httpx.Client, campaign: str, hits: list[Simulated]
) -> None:
    stored = ok(post(api, campaign, npz(hits)), 201)["items"]
    first = processed(api, campaign, {})["result"]["frfs"]
    point = first[0]["reference_point"]
    for block in stored:
        if block["force_point"] == point:
            ok(api.delete(f"records/{block['id']}"), 204)
    second = processed(api, campaign, {})["result"]["frfs"]
    assert ids(ok(api.get(f"campaigns/{campaign}/frfs"), 200)["items"]) == [
        first[0]["id"],
        *ids(second),
    ]


def test_a_mode_set_of_the_same_settings_takes_the_place_of_the_first(
    api: httpx.Client, campaign: str, hits: list[Simulated]
) -> None:
    ok(post(api, campaign, npz(hits)), 201)
    processed(api, campaign, {})
    first, other, second = (
        identified(api, campaign, **options)
        for options in (LOW, {**LOW, "highest_order": 20}, {**LOW, "most_modes": 100})
    )
    present = [other["mode_set"], second["mode_set"]]
    path = f"campaigns/{campaign}/mode-sets"
    assert ids(ok(api.get(path), 200)["items"]) == present
    listed = ok(api.get(path, params={"superseded": True}), 200)["items"]
    assert ids(listed) == [first["mode_set"], *present]
    assert [one["superseded_by"] for one in listed] == [second["mode_set"], None, None]
    rows = ok(api.get("search/modes", params={"filter": f"campaign.id = '{campaign}'"}), 200)[
        "items"
    ]
    assert {row["mode_set.id"] for row in rows} <= set(present)
    # Who names it has it.
    assert ok(api.get(f"mode-sets/{first['mode_set']}"), 200)["superseded_by"] == second["mode_set"]
    job = ok(
        api.post(f"campaigns/{campaign}/update-jobs", json={"mode_set": first["mode_set"]}), 202
    )
    assert job["recipe"]["mode_set"] == first["mode_set"]
    posted(api, f"update-jobs/{job['id']}/cancel")
    edit = {"name": "by hand", "decisions": [{**_of(listed[0]), "keep": True, "reason": "seen"}]}
    edited = ok(api.post(f"mode-sets/{first['mode_set']}/edits", json=edit), 201)
    assert ids(ok(api.get(path), 200)["items"]) == [*present, edited["id"]]
    pole = {"frequency_hz": 206.0, "damping_ratio": 0.01, "reason": "seen in the imaginary part"}
    refit = identified(api, campaign, **LOW, poles=[pole])
    [hz] = refit["result"]["stated"]
    fitted = ok(api.get(f"mode-sets/{refit['mode_set']}"), 200)
    assert fitted["details"]["decisions"] == [
        {"frequency_hz": hz, "keep": True, "reason": pole["reason"]}
    ]
    [mode] = [mode for mode in fitted["modes"] if mode["frequency_hz"] == hz]
    assert mode["shape"]
    assert mode["frequency_sd_hz"]
    assert any("was stated, and is a mode for that" in w for w in fitted["details"]["warnings"])
    listed = ids(ok(api.get(path), 200)["items"])
    assert listed == [*present, edited["id"], fitted["id"]]
    outside = api.post(
        f"campaigns/{campaign}/identifications",
        json=LOW | {"poles": [pole | {"frequency_hz": 900}]},
    )
    failed = finished(api, outside.headers["Location"])
    assert "is 900, outside the lines, 6.25 to 250 Hz" in str(failed["error"])


def _of(mode_set: dict[str, Any]) -> dict[str, Any]:
    return {"frequency_hz": mode_set["modes"][0]["frequency_hz"]}


def test_a_result_says_what_changed_since(
    api: httpx.Client,
    structure: str,
    campaign: str,
    imported: Callable[..., dict[str, Any]],
    service: LocalService,
) -> None:
    assert imported(campaign, small_file())["status"] == "succeeded"
    modes = ok(
        api.post(
            f"campaigns/{campaign}/mode-sets", json={"name": "published", "modes": paper.MODES}
        ),
        201,
    )["id"]
    begun = api.post(f"campaigns/{campaign}/update-jobs", json={**RECIPE, "mode_set": modes})
    assert finished(api, begun.headers["Location"])["status"] == "succeeded"
    job = ok(begun)["id"]

    def outdated() -> dict[str, Any] | None:
        state: dict[str, Any] | None = ok(api.get(f"update-jobs/{job}/result"), 200)["outdated"]
        return state

    def page() -> str:
        with session_client(api, base=service.url) as browser:
            return str(browser.get(f"/ui/update-jobs/{job}").raise_for_status().text)

    assert outdated() is None
    assert "Compute again" not in page()
    points = ok(api.get(f"campaigns/{campaign}/grid-points"), 200)["items"]
    ok(api.put(f"campaigns/{campaign}/grid-points", json={"items": points}), 200)
    assert outdated() is None  # they are the same
    points[0]["x_m"] += 0.001
    tag = api.get(f"campaigns/{campaign}/grid-points").headers["etag"]
    ok(
        api.put(
            f"campaigns/{campaign}/grid-points", json={"items": points}, headers={"If-Match": tag}
        ),
        200,
    )
    state = outdated()
    assert state is not None
    assert state["what"] == ["points"]
    ok(api.post(f"campaigns/{campaign}/frfs", json=frfs(1)), 201)
    tag = api.get(f"structures/{structure}").headers["etag"]
    ok(
        api.patch(
            f"structures/{structure}", json={"density_kg_m3": 1999.0}, headers={"If-Match": tag}
        ),
        200,
    )
    for changes in ({"notes": "nothing that an update reads"}, {"boundary": "free"}):
        tag = api.get(f"campaigns/{campaign}").headers["etag"]
        ok(api.patch(f"campaigns/{campaign}", json=changes, headers={"If-Match": tag}), 200)
        after = outdated()
        what = ["structure", *(["campaign"] if "boundary" in changes else []), "points", "frfs"]
        assert after == {"since": state["since"], "what": what}
    text = page()
    assert "structure, campaign, points, FRFs of this result changed" in text
    assert f"ui/campaigns/{campaign}/update?like={job}" in text


def test_a_result_of_hits_says_that_a_hit_was_judged_since(
    api: httpx.Client, campaign: str, hits: list[Simulated], service: LocalService
) -> None:
    """The update itself is beside the point: its result is put in place."""
    stored = ok(post(api, campaign, npz(hits)), 201)["items"]
    made = processed(api, campaign, {})["result"]["frfs"]
    begun = api.post(f"campaigns/{campaign}/update-jobs", json=RECIPE)
    job = finished(api, begun.headers["Location"])["id"]
    document = {
        "provenance": {"frfs": [{"id": one["id"]} for one in made]},
        "parameters": [],
        "version": VERSION,
    }
    row = (
        "INSERT INTO update_results (id, campaign_id, document, prediction) VALUES (%s, %s, %s, '')"
    )
    with psycopg.connect(psycopg_url(service.settings.database_url)) as connection:
        connection.execute("DELETE FROM update_results WHERE id = %s", [job])
        connection.execute(row, [job, campaign, json.dumps(document)])

    def what() -> list[str]:
        found = ok(api.get(f"update-jobs/{job}/result"), 200)["outdated"]
        return [] if found is None else list(found["what"])

    assert what() == []
    good = next(s for s in hits if s.fault is None)
    named = {"point": good.hit.force.dof.point, "hit": good.hit.number}
    ok(
        api.post(
            f"campaigns/{campaign}/hit-decisions", json={**named, "good": False, "why": "a cable"}
        ),
        201,
    )
    assert what() == ["hits"]
    ok(
        api.post(
            f"campaigns/{campaign}/hit-decisions", json={**named, "good": None, "why": "not it"}
        ),
        201,
    )
    ok(api.delete(f"records/{stored[0]['id']}"), 204)
    processed(api, campaign, {})
    assert what() == ["hits", "frfs"]


def test_what_was_made_anew_before_there_was_a_mark_is_marked(empty: Engine) -> None:
    upgrade(empty, "0056_idempotency_keys")
    with empty.begin() as connection:
        (frf,) = fill(connection)["frfs"]

        def again(table: str, key: UUID, **changed: Any) -> UUID:
            """A row like another, with a newer key."""
            new: UUID = connection.scalar(text("SELECT uuidv7()"))
            values = json.dumps({"id": str(new), **changed})
            copied = (
                f"SELECT (jsonb_populate_record(t, CAST(:values AS jsonb))).* FROM {table} t WHERE"
                " id = :key"
            )
            connection.execute(
                text(f"INSERT INTO {table} {copied}"), {"values": values, "key": key}
            )
            return new

        of_processing = frf["processing_id"]
        again_made = again("jobs", of_processing, ticket=None)
        connection.execute(
            text(
                "INSERT INTO processings (id, campaign_id, options) VALUES (:id, :campaign, '{}')"
            ),
            {"id": again_made, "campaign": frf["campaign_id"]},
        )
        newer = again(
            "frfs", frf["id"], processing_id=str(again_made), import_id=None, dataset=None
        )
        elsewhere = again("frfs", frf["id"], response_point=77, import_id=None, dataset=None)
    upgrade(empty, "head")
    with empty.connect() as connection:
        marks = dict(connection.execute(text("SELECT id, superseded_by FROM frfs")).all())
    assert marks == {frf["id"]: again_made, newer: None, elsewhere: None}
