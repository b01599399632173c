"""Files beside what is stored: of each noun, shown or only saved, counted, searched, and gone with
what they are beside; and whose reports their photographs are in.
"""

import io
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from zipfile import ZipFile

import httpx
import numpy as np
import psycopg
import pytest
from PIL import Image

import modalbase
from modalbase.client.errors import ClientError
from service.app.supervisor import LocalService
from service.platform.db.engine import psycopg_url
from tests.support.furnished import MONITOR
from tests.support.rest import RAW, client_of, ok, session_client

PNG = b"\x89PNG\r\n\x1a\n"
SCRIPT = b"<svg xmlns='http://www.w3.org/2000/svg' onload='alert(1)'/>"


def photo() -> bytes:
    Image.new("RGB", (64, 48), "red").save(written := io.BytesIO(), "jpeg")
    return written.getvalue()


@pytest.fixture
def lab(api: httpx.Client, service: LocalService) -> Iterator[modalbase.Laboratory]:
    key = api.headers["Authorization"].removeprefix("Bearer ")
    with modalbase.connect(service.url, key) as connected:
        yield connected


def test_every_noun_has_attachments(
    lab: modalbase.Laboratory, campaign: str, api: httpx.Client, tmp_path: Path
) -> None:
    """One mechanism: a noun that lacked a part of it would be found here."""
    test = lab.campaign(campaign)
    structure = lab.structure(test.structure_id)
    project = lab.project(structure.project_id)
    monitor = structure.new_monitor(**MONITOR)
    update = lab.job(ok(api.post(f"campaigns/{campaign}/update-jobs", json={}), 202)["id"])
    (tmp_path / "clamp_side.jpg").write_bytes(photo())
    for thing, column in (
        (project, None),
        (structure, "structure_id"),
        (test, "campaign_id"),
        (monitor, "monitor_id"),
        (update, "update_job_id"),
    ):
        made = thing.attach(tmp_path / "clamp_side.jpg", caption="from the left")
        columns = ("structure_id", "campaign_id", "monitor_id", "update_job_id")
        assert [name for name in columns if made.fields[name]] == ([column] if column else [])
        assert thing.attachments() == [made]
        assert made.save(tmp_path / "again.jpg").read_bytes() == photo()
    found = lab.find("attachments", "media_type = 'image/jpeg'")
    assert len(list(found)) == 5
    words = {"q": "CLAMP left"}
    assert len(ok(api.get("search/attachments", params=words))["items"]) == 5
    storage = f"projects/{project.id}/storage"
    assert ok(api.get(storage))["parts"]["attachments"] == 5 * len(photo())
    assert made.change(caption="from behind").fields["caption"] == "from behind"
    made.delete()
    assert update.attachments() == []
    assert ok(api.get(storage))["parts"]["attachments"] == 4 * len(photo())
    other = {"name": "second", "boundary": test.fields["boundary"]}
    second = ok(api.post(f"structures/{structure.id}/campaigns", json=other), 201)["id"]
    jobs = [{"campaign_id": one} for one in (campaign, second)]
    joint = ok(api.post("update-jobs", json={"joint": True, "jobs": jobs}), 202)["joint"]["id"]
    beside = f"joint-updates/{joint}/attachments"
    note = ok(api.post(beside, params={"filename": "n.txt"}, content=b"n", headers=RAW), 201)
    assert note["update_job_id"] == joint
    assert ok(api.get(beside))["items"] == [note]
    ok(api.get(f"update-jobs/{joint}/attachments"), 404)
    ok(api.get(f"joint-updates/{update.id}/attachments"), 404)
    assert ok(api.get(storage))["parts"]["attachments"] == 4 * len(photo()) + 1
    assert "attachments.json" in ZipFile(project.archive(tmp_path / "a.zip")).namelist()
    ok(api.delete(f"attachments/{note['id']}"), 204)
    monitor.delete()
    assert len(ok(api.get("search/attachments", params=words))["items"]) == 3
    test.delete()
    assert len(ok(api.get("search/attachments", params=words))["items"]) == 2
    ok(api.get(f"campaigns/{campaign}/attachments"), 404)
    ok(api.post(f"campaigns/{campaign}/purge"), 204)
    assert ok(api.get(storage))["parts"]["attachments"] == 3 * len(photo())
    assert project.attachments()[0].save(tmp_path / "kept.jpg").read_bytes() == photo()


@pytest.mark.parametrize(
    ("name", "content", "kind"),
    [
        ("a.png", PNG, "image/png"),
        ("a.webp", b"RIFF\0\0\0\0WEBPVP8 ", "image/webp"),
        ("a.txt", b"%PDF-1.7", "application/pdf"),
        ("a.png", SCRIPT, None),
        ("a.svg", SCRIPT, None),
        ("a.html", b"<!doctype html><script>alert(1)</script>", None),
        ('né"\r\nX-Evil: 1 中.bin', b"", None),
    ],
)
def test_a_browser_is_shown_pictures_and_pdf_and_nothing_else(
    api: httpx.Client, campaign: str, name: str, content: bytes, kind: str | None
) -> None:
    """By what is in the file: its name, or what a client says of it, shows no page of a stranger."""
    sent = api.post(
        f"campaigns/{campaign}/attachments",
        params={"filename": name, "caption": "<b>"},
        content=content,
        headers={"Content-Type": "text/html"},
    )
    made = ok(sent, 201)
    assert (made["name"], made["caption"], made["size"]) == (name, "<b>", len(content))
    assert made["media_type"] == (kind or "application/octet-stream")
    answer = api.get(f"attachments/{made['id']}/file")
    assert answer.content == content
    assert answer.headers["content-type"] == made["media_type"]
    how = answer.headers["content-disposition"].partition(";")[0]
    assert how == ("inline" if kind else "attachment")
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert answer.headers["content-security-policy"].startswith("default-src 'none'")
    assert "x-evil" not in answer.headers
    tag = {"If-None-Match": answer.headers["etag"]}
    assert api.get(f"attachments/{made['id']}/file", headers=tag).status_code == 304
    assert api.get(api.base_url.join(sent.headers["Location"])).json() == made


def test_what_is_beside_a_project_is_its_members_alone(
    api: httpx.Client, service: LocalService, campaign: str
) -> None:
    form = {"files": {"file": ("notes.txt", b"n")}, "data": {"caption": "c" * 501}}
    refused = api.post(f"campaigns/{campaign}/attachments", **form)  # type: ignore[arg-type]
    assert "501 characters, 500 at most" in refused.text
    form["data"] = {"caption": "c"}
    made = ok(api.post(f"campaigns/{campaign}/attachments", **form), 201)  # type: ignore[arg-type]
    assert made["caption"] == "c"
    with client_of(service, "stranger") as stranger:
        for method, path in (
            ("GET", f"attachments/{made['id']}"),
            ("GET", f"attachments/{made['id']}/file"),
            ("DELETE", f"attachments/{made['id']}"),
            ("GET", f"campaigns/{campaign}/attachments"),
        ):
            assert stranger.request(method, path).status_code == 404, path
        assert ok(stranger.get("search/attachments"))["items"] == []


def test_an_archive_takes_attachments_along(
    lab: modalbase.Laboratory, campaign: str, tmp_path: Path
) -> None:
    """Those of a project, a structure and a campaign come back, with their names and captions; a
    recording of the campaign too, which is kept as a file as they are.
    """
    test = lab.campaign(campaign)
    structure = lab.structure(test.structure_id)
    project = lab.project(structure.project_id)
    file = tmp_path / "../clamp.jpg"
    file.write_bytes(photo())
    for thing in (project, structure, test):
        thing.attach(file, caption=thing.noun.word)
    np.savez(tmp_path / "deck.npz", a=np.random.default_rng(1).standard_normal(4096))
    channel = {"variable": "a", "quantity": "acceleration", "sensitivity": 1, "point": 1}
    recorded = {"recording": {}, "sample_rate_hz": 256.0, "channels": [{**channel, "direction": 3}]}
    test.import_file(tmp_path / "deck.npz", mapping=recorded)
    other = lab.new_project("other")
    archive = project.archive(tmp_path / "all.zip")
    done = other.import_archive(archive)
    (brought,) = other.structures()
    things = (other, brought, lab.campaign(done.ids[campaign]))
    for thing in things:
        (one,) = thing.attachments()
        assert (one.name, one.caption) == ("clamp.jpg", thing.noun.word)
        assert one.save(tmp_path / "back.jpg").read_bytes() == photo()
    (recording,) = lab.campaign(done.ids[campaign]).recordings()
    assert recording.fields["samples"] == 4096
    with pytest.raises(ClientError, match="has what is in this archive"):
        other.import_archive(archive)


def test_administrators_state_whose_reports_they_are(
    new_api: Callable[..., AbstractContextManager[LocalService]],
) -> None:
    """Until then the operator's settings do; the logo is a picture, and of a size that reports
    can have.
    """
    with (
        new_api(laboratory="Lab", laboratory_address="Street; Town") as running,
        client_of(running, "ada") as ada,
    ):
        before = {"name": "Lab", "address": "Street\nTown", "logo": False}
        assert ok(ada.get("laboratory")) == before
        ok(ada.get("laboratory/logo"), 404)
        body = {"name": "Institute", "address": "Hall 3"}
        assert "for administrators" in ok(ada.put("laboratory", json=body), 403)["detail"]
        assert ok(ada.get("laboratory")) == before
        with psycopg.connect(psycopg_url(running.settings.database_url or "")) as database:
            database.execute("UPDATE users SET administrator = true")
        for content, status in ((b"GIF89a", 422), (PNG + bytes(1024 * 1024), 413)):
            ok(ada.put("laboratory/logo", content=content, headers=RAW), status)
        ok(ada.put("laboratory/logo", content=PNG, headers=RAW))
        assert ok(ada.get("laboratory")) == {**before, "logo": True}
        assert ok(ada.put("laboratory", json=body)) == {**body, "logo": True}
        logo = ada.get("laboratory/logo")
        assert (logo.content, logo.headers["content-type"]) == (PNG, "image/png")
        with session_client(ada, base=running.url) as browser:
            page = browser.get("/ui/laboratory").text
        assert 'value="Institute"' in page
        ok(ada.delete("laboratory/logo"), 204)
        assert ok(ada.get("laboratory"))["logo"] is False
