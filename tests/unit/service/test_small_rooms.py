"""Small parts of the service where something is missing, has ended or cannot be: no process, no database."""

import asyncio
import os
import signal
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from markdown_it.token import Token
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException

from fecore.errors import InputError, UpdatingError
from modalbase.client.errors import ClientError, Exit
from modalbase.formats import uff
from service.app import doctor, supervisor
from service.app.cli import people, running
from service.app.supervisor import LocalService, Part, StartError, how_it_ended
from service.compute.reading import _why_unused
from service.db import opening, schema
from service.db.opening import DataFolderError
from service.errors import UnsupportedMediaType
from service.jobs.metrics import _open_metrics
from service.jobs.process import LOST, SERVER_GONE, Child
from service.jobs.worker import _clear_if_dead, run_to_end, run_worker
from service.monitoring.notifications.messages import as_mail
from service.settings import Settings
from service.show.guide.markdown import _lead
from service.show.reports.blocks import Bullets, Heading, PageBreak, Paragraph, Table
from service.show.reports.update_report import MOST_MODES, UpdateFacts, update_report
from service.store.frfs.routes import _uff_axis
from service.store.storage.operations import _require_that_all_fits, book
from service.web import openapi
from service.web.middleware import RequestMiddleware
from service.web.problems import _core_error, _http_exception
from service.web.routing import _require_json


class Clock:
    """Seconds that pass when they are let."""

    now = 1000.0

    def monotonic(self) -> float:
        return self.now


def test_a_part_that_ran_for_long_has_all_its_tries_again(monkeypatch: pytest.MonkeyPatch) -> None:
    clock, ended = Clock(), ["ended with status 1"]
    monkeypatch.setattr(supervisor, "time", clock)
    part = Part("worker", lambda: ended.clear(), lambda: ended[0] if ended else None, (1.0, 2.0))
    said = [part.tend()]
    for seconds, dies in ((1.0, True), (2.0, True), (supervisor.STEADY_SECONDS + 1, False)):
        clock.now += seconds
        said.append(part.tend())
        if dies:
            ended.append("ended with status 1")
            said.append(part.tend()) if seconds < 2 else None
    assert [line and line.split("; ")[-1] for line in said] == [
        "it is started again in 1 s",
        "worker runs again",
        "it is started again in 2 s",
        "worker runs again",
        "it is started again in 1 s",  # it ran for long before it ended
    ]
    assert not part.runs


@pytest.mark.parametrize(
    ("status", "words"),
    [
        (None, None),
        (-signal.SIGKILL, "was killed, perhaps for lack of memory"),
        (-signal.SIGSEGV, "was ended by SIGSEGV"),
        (3, "ended with status 3"),
    ],
)
def test_how_a_process_ended(status: int | None, words: str | None) -> None:
    assert how_it_ended(SimpleNamespace(poll=lambda: status)) == words
    if status is None:
        return
    child = Child.__new__(Child)
    child._killed_for, child._process = None, SimpleNamespace(join=lambda: None, exitcode=status)
    said = {-signal.SIGKILL: "ran out of memory", -signal.SIGSEGV: "crashed with SIGSEGV", 3: "ended with status 3"}
    assert said[status] in child._post_mortem().detail
    child._process.exitcode = SERVER_GONE
    assert child._post_mortem() == LOST
    child._killed_for = LOST
    assert child._post_mortem() is LOST


def test_metrics_keep_what_waits_and_what_runs_apart() -> None:
    rows: Any = [
        SimpleNamespace(kind="update", queue="updates", state=state, jobs=jobs, oldest=oldest)
        for state, jobs, oldest in (("queued", 3, -0.5), ("running", 2, None))
    ]
    found = {family.name: [sample.value for sample in family.samples] for family in _open_metrics(rows)}
    assert found == {
        "modalbase_jobs_queued": [3],
        "modalbase_jobs_oldest_wait_seconds": [0.0],  # a clock that goes back
        "modalbase_jobs_running": [2],
    }


def test_errors_of_core_and_framework_are_problems_in_words() -> None:
    request: Any = SimpleNamespace(url=SimpleNamespace(path="/x"), method="PUT")
    shown = [
        answer.body.decode()
        for answer in (
            _core_error(request, UpdatingError("no modes", {}, ())),
            _core_error(request, InputError("band.0", "is empty")),
            _http_exception(request, HTTPException(404)),
            _http_exception(request, HTTPException(405, headers={"Allow": "GET"})),
            _http_exception(request, HTTPException(413, "too long")),
        )
    ]
    words = (
        "no modes",
        '"pointer":"/band/0"',
        "no such address: /x",
        "PUT is not possible at this address, GET is",
        "too long",
    )
    assert [text in body for text, body in zip(words, shown, strict=True)] == [True] * 5


@pytest.mark.parametrize("begun", [False, True])
def test_an_unexpected_error_is_a_problem_unless_half_an_answer_is_out(begun: bool) -> None:
    sent: list[Any] = []

    async def app(_scope: Any, _receive: Any, send: Any) -> None:
        if begun:
            await send({"type": "http.response.start", "status": 200, "headers": []})
        raise ZeroDivisionError

    async def send(message: Any) -> None:
        sent.append(message)

    async def ask() -> None:
        scope = {"type": "http", "method": "GET", "path": "/", "headers": [], "app": None}
        await RequestMiddleware(app)(scope, None, send)

    if begun:
        with pytest.raises(ZeroDivisionError):
            asyncio.run(ask())
    else:
        asyncio.run(ask())
    assert sent[0]["status"] == (200 if begun else 500)


def test_a_body_has_a_type_and_no_body_needs_none() -> None:
    _require_json(Headers({}))
    _require_json(Headers({"content-length": "0"}))
    _require_json(Headers({"content-type": "application/json", "content-length": "2"}))
    for wrong in ({"content-length": "2"}, {"transfer-encoding": "chunked"}, {"content-type": "text/plain"}):
        with pytest.raises(UnsupportedMediaType):
            _require_json(Headers(wrong))


def test_systems_and_installations_that_cannot_do_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    windows = SimpleNamespace(name="nt")
    with monkeypatch.context() as patch:
        patch.setattr(opening, "os", windows)
        patch.setattr(supervisor, "os", windows)
        with (
            pytest.raises(DataFolderError, match="does not run on Windows; use WSL"),
            opening.open_database(Settings()),
        ):
            raise AssertionError("it was opened")
        with pytest.raises(StartError, match="run it in WSL 2 or on a server"), LocalService(Settings()):
            raise AssertionError("it was started")
    monkeypatch.setattr(openapi, "find_spec", lambda _: None)
    with pytest.raises(RuntimeError, match="fastapi-offline is not installed"):
        openapi._assets()
    monkeypatch.setattr(schema, "_parents", lambda: {"b": "a", "c": "a"})
    with pytest.raises(schema.SchemaError, match="migrations are not whole; install modalbase again"):
        schema.head_revision()
    monkeypatch.setattr(schema, "require_version", lambda _: None)
    monkeypatch.setattr(schema, "_revision", lambda connection: connection)
    assert schema.require_known("b") == "b"
    for found, words in ((None, schema.NO_SCHEMA), ("z", "the schema is at z, which")):
        with pytest.raises(schema.SchemaError) as refused:
            schema.require_known(found)
        assert words in str(refused.value)
    with pytest.raises(ValueError, match=r"settings\.database_url is not set"):
        run_worker(Settings(), ())
    with monkeypatch.context() as patch:
        patch.setattr(os, "access", lambda *_: False)
        assert "is closed to you; run this as" in doctor._folder(tmp_path).words


def test_a_workers_end_does_not_wait_for_what_it_left() -> None:
    left: list[str] = []

    async def stays() -> None:
        try:
            await asyncio.Event().wait()
        finally:
            left.append("cancelled")

    async def work() -> None:
        tasks.append(asyncio.ensure_future(stays()))
        await asyncio.sleep(0)

    tasks: list[Any] = []
    run_to_end(work())
    assert left == ["cancelled"]


def test_only_real_folders_of_ones_own_are_cleared(tmp_path: Path) -> None:
    real, link = tmp_path / "real", tmp_path / "link"
    real.mkdir()
    link.symlink_to(real)
    _clear_if_dead(link)
    assert real.is_dir()
    _clear_if_dead(real)
    assert not real.exists()


def test_the_password_of_a_file_goes_into_the_url() -> None:
    url = "postgresql://ada@host/lab"
    found = [
        Settings(database_url=given, database_password=password).database_url
        for given, password in ((url, None), (url, "a/b"), (None, "x"), ("no url", "x"))
    ]
    assert found == [url, "postgresql://ada:a%2Fb@host/lab", None, "no url"]


def test_nothing_is_booked_for_nothing_and_no_quota_is_no_limit() -> None:
    session: Any = SimpleNamespace(info={})  # whatever else is asked of it fails
    book(session, None, "records", 0)
    _require_that_all_fits(session)
    assert session.info == {}


def test_links_of_the_guide() -> None:
    def lead(href: str) -> tuple[str, dict[str, Any]]:
        token = Token("link_open", "a", 1, attrs={"href": href})
        _lead(token, "docs/a.md", {"docs/b.md", "docs/c.svg"})
        return token.tag, token.attrs

    assert lead("b.md#x") == ("a", {"href": "b.html#x"})
    assert lead("c.svg") == ("a", {"href": "c.svg"})
    assert lead("d.md") == ("span", {"class": "source"})
    assert lead("https://e.f") == ("a", {"href": "https://e.f"})


def test_drawings_stay_in_the_original_file() -> None:
    trace, element = uff.TraceLine.__new__(uff.TraceLine), uff.Element.__new__(uff.Element)
    assert _why_unused(trace) == "is a trace line of the drawing; it stays in the original file"
    assert _why_unused(element) == "holds elements of the drawing; they stay in the original file"
    assert _why_unused(uff.GridPoint.__new__(uff.GridPoint)) is None


class Answers:
    """A connection that answers from a list."""

    def __init__(self, **lists: Any) -> None:
        self.lists, self.sent = lists, []

    def pages(self, path: str) -> Iterator[Any]:
        found = self.lists[path.replace("-", "_").rpartition("/")[2]]
        if isinstance(found, Exception):
            raise found
        yield from found

    def post(self, path: str, body: Any) -> Any:
        self.sent.append((path, body))
        return {"key": "mb_1_2"}


def test_keys_by_rest() -> None:
    service: Any = Answers()
    assert people.new_key_at(service, "n", None, None) == "mb_1_2"
    people.new_key_at(service, "n", ["read"], datetime(2030, 1, 1, tzinfo=UTC))
    assert service.sent == [
        ("api-keys", {"name": "n"}),
        ("api-keys", {"name": "n", "scopes": ["read"], "expires_at": "2030-01-01T00:00:00+00:00"}),
    ]
    key, user = {"id": 1}, {"id": 2}
    assert list(people.keys_at(Answers(users=[user], api_keys=[key]))) == [(key, user)]
    for status, outcome in ((people.FORBIDDEN, [(key, None)]), (500, None)):
        refused: Any = Answers(users=ClientError("no", Exit.REFUSED, status=status), api_keys=[key])
        if outcome is None:
            with pytest.raises(ClientError):
                list(people.keys_at(refused))
        else:
            assert list(people.keys_at(refused)) == outcome


@pytest.mark.parametrize("more", [True, False])
def test_the_welcome_names_what_there_is(more: bool, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    service: Any = SimpleNamespace(
        settings=Settings(pages=more, docs=more),
        url="http://x",
        has_keys=lambda: False,
        new_key=lambda *_, **__: "mb_1_2",
    )
    running._welcome(service, tmp_path if more else None)
    said = capsys.readouterr().out
    assert [f"{name} " in said for name in ("pages", "guide", "documentation", "API")] == [more, more, more, True]
    assert "API key: mb_1_2  (shown this once" in said
    assert [file.read_text() for file in tmp_path.iterdir()] == ["mb_1_2\n"] * more


def test_mail_of_what_is_no_alarm_names_structure_monitor_and_state() -> None:
    body = (
        '{"timestamp": "2026-03-02T12:00:00+00:00", "data": {"structure": {"name": "s", "id": "1"},'
        ' "monitor": {"name": "m", "id": "2", "state": "normal"}}}'
    )
    delivery: Any = SimpleNamespace(body=body, recipient="a@b.de", event="ping", message_id="msg_1")
    mail = as_mail(delivery, "lab@b.de")
    assert mail.get_content().splitlines() == ["structure   s (1)", "monitor     m (2)", "state       normal"]


def test_an_axis_of_a_file_keeps_its_lines() -> None:
    one, even, odd = (
        _uff_axis(SimpleNamespace(frequency_hz=np.array(hz))) for hz in ([5.0], [1.0, 2.0, 3.0], [1.0, 2.0, 4.0])
    )
    assert (one.values, even.values, odd.values.tolist()) == ([5.0], None, [1.0, 2.0, 4.0])
    assert even.step == 1.0


def a_mode(number: int) -> dict[str, Any]:
    return {"number": number, "kind": "bending"} | dict.fromkeys(
        ("measured_hz", "initial_hz", "updated_hz", "error_percent", "mac", "measured_damping", "predicted_damping")
    )


def a_report(modes: int, structure: dict[str, Any], **document: Any) -> list[Any]:
    found = {
        "parameters": [], "modes": [a_mode(number) for number in range(modes)], "outcomes": [], "warnings": [],
        "band_hz": None, "correlation": {"initial": None, "sac": []},
        "provenance": {
            "software": {"modalbase": "1"}, "update_job": "u", "computed_at": "2026-03-02T12:00:00", "recipe": {}, "frfs": [],
            "durations_s": {}, "campaign": "c", "structure_version": "v", "mode_set": None, "host": "h",
        },
    }  # fmt: skip
    body = {
        "name": "s", "geometry": {"length_m": 1, "width_m": 0.1, "thickness_m": 0.01}, "density_kg_m3": 2000, "laminate": None,
        "shape": None, "model": None,
    }  # fmt: skip
    campaign = {
        "name": "c", "boundary": "free", "performed_at": None, "temperature_c": None, "humidity_percent": None,
        "instruments": {"sensor_mass_kg": 0.002},
    }  # fmt: skip
    facts = UpdateFacts(found | document, "p", body | structure, campaign, 0)
    return list(update_report(facts, lambda _: ()).blocks)


def texts(blocks: list[Any], kind: Callable[..., Any]) -> list[str]:
    return [block.text for block in blocks if isinstance(block, kind)]


def test_a_report_of_little_and_of_much() -> None:
    little = a_report(1, {}, verdict={"sentence": "Fair.", "level": "with_care", "reasons": []})
    assert texts(little, Heading)[:3] == ["Updated model: s", "Specimen and test", "Parameters"]
    assert "Warnings" not in texts(little, Heading)
    assert "No FRF is predicted, as the damping was not fitted." in texts(little, Paragraph)
    rows = {row[0]: row[1] for block in little if isinstance(block, Table) for row in block.rows if len(row) == 2}
    assert rows["section"] == "equivalent orthotropic plate"
    assert rows["instruments"] == "sensor of 2 g"
    verdict = {"sentence": "Good.", "level": "usable", "reasons": ["It fits."]}
    plies = {"plies": [{"angle_deg": 45}] * 17}
    much = a_report(
        MOST_MODES + 2,
        {"laminate": plies},
        verdict=verdict,
        warnings=["Look."],
        outcomes=[{"stage": "damping", "message": "too short"}],
    )
    assert f"The annex lists all {MOST_MODES + 2} modes." in texts(much, Paragraph)
    assert {"Warnings", "All modes"} <= set(texts(much, Heading))
    assert "No FRF is predicted, as the damping was not fitted: too short." in texts(much, Paragraph)
    assert [list(block.items) for block in much if isinstance(block, Bullets)] == [["It fits."], ["Look."]]
    assert sum(isinstance(block, PageBreak) for block in much) == 2
    rows = {row[0]: row[1] for block in much if isinstance(block, Table) for row in block.rows if len(row) == 2}
    assert rows["section"].startswith("laminate of 17 plies [45/45/")
    assert rows["section"].endswith("/…]")
