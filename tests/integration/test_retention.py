"""The retention rule of a structure: what it deletes, what stays, and what rests."""

import io
import json
from typing import Any

import httpx
import numpy as np
from scipy.io import wavfile
from sqlalchemy import NullPool, create_engine, text

from service.app.backup.verification import deleted_by_rules, find_damage
from service.app.supervisor import LocalService
from tests.integration.test_recordings import CHANNELS, ORDER, TIMES
from tests.support.rest import RAW, finished, ok, posted, session_client
from tests.support.waiting import until
from tests.support.wind import WIND, wind
from tests.unit.fecore.signal.test_recording import RATE, recording

SENTENCE = "original deleted by the retention rule on 20"


class Laboratory:
    """A structure with a rule, and campaigns of it."""

    def __init__(self, api: httpx.Client, url: str, days: int | None = 30) -> None:
        self.api, self.engine = api, create_engine(url, poolclass=NullPool)
        self.project = posted(api, "projects", {"name": "bridge"})["id"]
        body = {"name": "deck", "retention_days": days}
        self.structure = posted(api, f"projects/{self.project}/structures", body)["id"]

    def recording(self, seed: int, *, processed: bool = True) -> dict[str, Any]:
        """An import that is a campaign of its own."""
        campaign = {"name": f"{seed}", "boundary": "free", "performed_at": "2026-03-02T09:30:00Z"}
        query = {"campaign": json.dumps(campaign), "mapping": json.dumps(WIND)}
        path = f"structures/{self.structure}/imports"
        sent = ok(self.api.post(path, content=wind(seed), params=query, headers=RAW), 202)
        done = finished(self.api, f"imports/{sent['id']}")
        assert done["status"] == "succeeded", done
        if processed:
            self.process(done["campaign_id"])
        return done

    def hits(self, campaign: str) -> dict[str, Any]:
        """An import of six hits at two points."""
        whole = recording(TIMES, [1.0, 0.5, 2.0, 1.0, 0.7, 1.5], 19.0)
        file = io.BytesIO()
        wavfile.write(file, int(RATE), np.round(whole.T * 0.24 * 2**31).astype(np.int32))
        mapping = json.dumps({"channels": CHANNELS, "recording": {"order": ORDER}})
        query = {"mapping": mapping, "filename": "long.wav"}
        path = f"campaigns/{campaign}/imports"
        sent = ok(self.api.post(path, content=file.getvalue(), params=query, headers=RAW), 202)
        done = finished(self.api, f"imports/{sent['id']}")
        assert done["counts"]["records"] == 12, done
        return done

    def process(self, campaign: str) -> None:
        made = self.api.post(f"campaigns/{campaign}/processings", json={})
        assert finished(self.api, made.headers["Location"])["status"] == "succeeded"

    def pass_days(self, days: int) -> None:
        """Let all that was imported have been so many days ago."""
        campaigns = f"SELECT id FROM campaigns WHERE structure_id = '{self.structure}'"
        with self.engine.begin() as connection:
            for table, column, own in (
                ("jobs", "finished_at", f"project_id = '{self.project}'"),
                ("records", "created_at", f"campaign_id IN ({campaigns})"),
            ):
                moved = f"UPDATE {table} SET {column} = {column} - interval '{days} days'"
                connection.execute(text(f"{moved} WHERE {own}"))

    def deleted(self, item: dict[str, Any]) -> Any:
        return ok(self.api.get(f"imports/{item['id']}"))["bytes_deleted_at"]

    def status(self, item: dict[str, Any]) -> int:
        return self.api.get(f"imports/{item['id']}/original").status_code


def test_files_go_and_what_was_made_of_them_stays(api: httpx.Client, service: LocalService) -> None:
    lab = Laboratory(api, service.settings.database_url)
    other = Laboratory(api, service.settings.database_url, None)
    old, unread, trashed = (lab.recording(n, processed=n != 22) for n in (21, 22, 23))
    kept = other.recording(21)  # the same bytes where no rule is
    campaign = {"name": "hits", "boundary": "free"}
    hits = posted(api, f"structures/{lab.structure}/campaigns", campaign)["id"]
    hit = lab.hits(hits)
    (*_, block) = (one["id"] for one in ok(api.get(f"campaigns/{hits}/records"))["items"])
    lab.process(hits)
    files = ok(api.get(f"projects/{lab.project}/storage"))["parts"]
    api.delete(f"campaigns/{trashed['campaign_id']}", headers={"If-Match": "*"})
    lab.pass_days(31)
    until(lambda: lab.deleted(old), "the end of the file")
    until(lambda: ok(api.get(f"records/{block}"))["bytes_deleted_at"], "the end of the samples")

    gone = api.get(f"imports/{old['id']}/original")
    assert (gone.status_code, gone.json()["detail"][: len(SENTENCE)]) == (410, SENTENCE)
    emptied = api.get(f"records/{block}/data")
    assert emptied.status_code == 410
    assert "time block deleted by the retention rule" in emptied.json()["detail"]
    (recording,) = ok(api.get(f"campaigns/{old['campaign_id']}/recordings"))["items"]
    assert recording["bytes_deleted_at"] is not None
    assert recording["file_sha256"] == old["sha256"]
    spectra = api.get(f"recordings/{recording['id']}/spectra", params={"format": "npz"})
    assert spectra.status_code == 200
    made = api.post(f"campaigns/{old['campaign_id']}/identifications", json={})
    assert finished(api, made.headers["Location"])["status"] == "succeeded"
    for key, words in ((old["campaign_id"], SENTENCE), (hits, "time blocks deleted by")):
        refused = api.post(f"campaigns/{key}/processings", json={})
        assert (refused.status_code, words in refused.json()["detail"]) == (409, True)
        assert api.get(f"campaigns/{key}/archive").status_code == 200
    assert ok(api.get(f"imports/{hit['id']}/records"))["hits"] == []

    figure = api.get(f"campaigns/{hits}/figures/hits", params={"format": "plotly"})
    assert figure.status_code == 410

    # what nothing was made of, what is in the trash, and what another structure has, stays
    assert lab.deleted(unread) is None
    assert (lab.status(unread), other.status(kept)) == (200, 200)
    left = ok(api.get(f"projects/{lab.project}/storage"))["parts"]
    assert left["files"] == files["files"] - old["size"] - hit["size"]
    assert left["records"] == 0 < files["records"]
    assert left["spectra"] == files["spectra"]
    events = ok(api.get("audit-events", params={"project": lab.project}))["items"]
    noted = [one["detail"] for one in events if one["action"] == "campaign.retention"]
    assert {"upload": old["sha256"]} in [one["files"] for one in noted]
    assert sum(one["time_blocks"] for one in noted) == 12
    with session_client(api, base=service.url) as browser:
        for place, words in (
            (f"campaigns/{old['campaign_id']}", SENTENCE),
            (f"imports/{old['id']}", SENTENCE),
            (f"campaigns/{hits}", "samples deleted by the retention rule on 20"),
            (f"structures/{lab.structure}", "30 days after their import"),
        ):
            assert words in " ".join(browser.get(f"/ui/{place}").text.split()), place
    ok(api.post(f"campaigns/{trashed['campaign_id']}/restore"))
    until(lambda: lab.deleted(trashed), "the end of what was restored")
    lab.process(unread["campaign_id"])
    until(lambda: lab.deleted(unread), "the end of what was processed since")

    with lab.engine.connect() as connection:
        assert find_damage(connection) == []
        words = "3 files and 12 time blocks were deleted by retention rules"
        assert deleted_by_rules(connection) == words
    # the same bytes are known, and are stored anew where they are sent to another structure
    again = api.post(
        f"structures/{lab.structure}/imports",
        content=wind(23),
        params={"campaign": json.dumps({**campaign, "performed_at": "2026-03-02T09:30:00Z"})},
        headers=RAW,
    )
    assert ok(again, 200)["id"] == trashed["id"]
    anew = other.recording(23, processed=False)
    assert (other.status(anew), lab.status(trashed)) == (200, 410)
    answer = api.delete(f"imports/{old['id']}")
    assert answer.status_code in (204, 409)


def test_a_rule_is_changed_and_ended(api: httpx.Client, service: LocalService) -> None:
    lab = Laboratory(api, service.settings.database_url)
    address = f"structures/{lab.structure}"
    for value, status in ((0, 422), (10.5, 422), (365, 200), (None, 200)):
        tag = api.get(address).headers["ETag"]
        answer = api.patch(address, json={"retention_days": value}, headers={"If-Match": tag})
        assert answer.status_code == status, answer.text
    assert ok(api.get(address))["retention_days"] is None
    assert ok(api.get(address))["version"] == 1
