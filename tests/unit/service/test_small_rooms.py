"""Small parts of the service where something is missing, has ended or cannot be: no process, no
database.
"""

import asyncio
import io
from collections.abc import Iterator
from contextlib import nullcontext
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from pydantic import ValidationError
from pypdf import PdfReader
from starlette.datastructures import Headers

from fecore.errors import InputError, UpdatingError
from modalbase.client.errors import ClientError, Exit
from modalbase.formats.records import TimeBlock
from modalbase.objects.people import People
from service.figures.marks import words
from service.figures.typeset import Document, typeset
from service.nouns.campaigns.schemas import CampaignInputs
from service.nouns.frfs.data import MeasuredFrfs
from service.nouns.monitors.schemas import WatchedIn
from service.nouns.records.operations import RecordIntake
from service.nouns.updates.schemas import InputsIn
from service.pages.report import FOLDER
from service.pages.report_content import MOST_MODES, content_of
from service.platform.errors import Invalid, NotFound, UnsupportedMediaType
from service.platform.queue.worker import _clear_if_dead, run_to_end
from service.platform.settings import Settings
from service.platform.web.middleware import RequestMiddleware
from service.platform.web.routing import _require_json
from service.tasks.update.batches import _placed
from tests.support.waiting import completed


def test_faults_of_a_batch_are_placed_in_its_job() -> None:
    errors: list[tuple[Any, str, str]] = [
        (NotFound("campaign", "x"), "/jobs/2/campaign_id", "no campaign x"),
        (Invalid("/hold_out", "is too much"), "/jobs/2/recipe/hold_out", "is too much"),
        (
            InputError("identification.band_hz", "is empty"),
            "/jobs/2/recipe/identification/band_hz",
            "is empty",
        ),
        (UpdatingError("no modes", {}, ()), "/jobs/2", "no modes"),
    ]
    for error, pointer, detail in errors:
        (fault,) = _placed(error, 2)
        assert (fault.pointer, fault.detail) == (pointer, detail)


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ([("acceleration", 0, 0)], {0: "is a time block without a point and direction"}),
        ([("acceleration", 2, 0)], {0: "names no force and comes before any force block"}),
        ([("force", 1, 0)], {0: "is the force of hit 1 at point 1, of which the file has no response"}),
        ([("acceleration", 2, 1)], {0: "is a response to hit 1 at point 1, of which the file has no force block"}),
        ([("force", 1, 0), ("acceleration", 2, 0, 5)],
         {1: "has 5 samples at 100 Hz, the force of its hit 4 at 100 Hz", 0: "is the force of hit 1 at point 1"}),
        ([("force", 1, 0), ("acceleration", 2, 0)], {}),
    ],
)  # fmt: skip
def test_time_blocks_of_a_file_that_make_no_whole_hit(
    given: list[tuple[Any, ...]], why: dict[int, str]
) -> None:
    with RecordIntake() as intake:
        refused: dict[int, str] = {}
        for number, (quantity, point, force, *samples) in enumerate(given):
            block = TimeBlock(
                quantity=quantity, samples=np.zeros(*(samples or (4,))), sample_rate_hz=100.0, point=point,
                direction=3 if point else 0, force_point=force, force_direction=3 if force else 0, hit=0,
            )  # fmt: skip
            if (reason := intake.take(number, block)) is not None:
                refused[number] = reason
        refused |= intake.finish()
    assert refused.keys() == why.keys()
    assert all(words in refused[number] for number, words in why.items())


def test_windows_are_remarked_upon_where_there_are_any() -> None:
    def frfs(*rates: float | None) -> MeasuredFrfs:
        return MeasuredFrfs(None, (), (), frozenset((rate, None) for rate in rates))

    assert (frfs(None).window_remark, frfs(None).window) == ([], (None, None))
    assert "an exponential window of 2, 3 per second" in frfs(3.0, 2.0, None).window_remark[0]
    assert (frfs(3.0).window, frfs(3.0, 2.0).window) == ((3.0, None), (None, None))


def test_a_window_that_a_campaign_states_stands_in_place_of_the_one_that_was_seen() -> None:
    seen = (0.7, 0.02)
    taken = InputsIn().or_as_stated(None, CampaignInputs(), seen)
    assert (taken.window_rate_per_s, taken.window_rate_sd_per_s) == seen
    stated = InputsIn().or_as_stated(None, CampaignInputs(window_time_constant_s=0.5), seen)
    assert (
        stated.window_rate_per_s,
        stated.window_time_constant_s,
        stated.window_rate_sd_per_s,
    ) == (None, 0.5, None)


@pytest.mark.parametrize(
    ("name", "direction"),
    [
        ("Ex", "fall"),
        ("frequency_2", "fall"),
        ("density", "both"),
        ("damping_ratio_1", "rise"),
        ("a0", "rise"),
    ],
)
def test_a_parameter_is_watched_where_it_is_worse(name: str, direction: str) -> None:
    assert WatchedIn(name=name).watched_direction == direction
    assert WatchedIn(name=name, direction="both").watched_direction == "both"
    with pytest.raises(ValidationError):
        WatchedIn(name=name, direction="up")


@pytest.mark.parametrize("begun", [False, True])
def test_an_unexpected_error_is_a_problem_unless_half_an_answer_is_out(begun: bool) -> None:
    sent: list[Any] = []

    async def app(_scope: Any, _receive: Any, send: Any) -> None:
        if begun:
            await send({"type": "http.response.start", "status": 200, "headers": []})
        raise ZeroDivisionError

    async def send(message: Any) -> None:
        sent.append(message)

    scope = {"type": "http", "method": "GET", "path": "/", "headers": [], "app": None}
    with pytest.raises(ZeroDivisionError) if begun else nullcontext():
        completed(RequestMiddleware(app)(scope, None, send))
    assert sent[0]["status"] == (200 if begun else 500)


def test_a_body_has_a_type_and_no_body_needs_none() -> None:
    _require_json(Headers({}))
    _require_json(Headers({"content-length": "0"}))
    _require_json(Headers({"content-type": "application/json", "content-length": "2"}))
    for wrong in (
        {"content-length": "2"},
        {"transfer-encoding": "chunked"},
        {"content-type": "text/plain"},
    ):
        with pytest.raises(UnsupportedMediaType):
            _require_json(Headers(wrong))


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
    completed(work(), run_to_end)
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
    urls = [
        Settings(database_url=given, database_password=password).database_url
        for given, password in ((url, None), (url, "a/b"), (None, "x"), ("no url", "x"))
    ]
    assert urls == [url, "postgresql://ada:a%2Fb@host/lab", None, "no url"]


@pytest.mark.parametrize("status", [403, 500])
def test_who_may_not_list_users_lists_keys_alone(status: int) -> None:
    class Answers:
        def pages(self, path: str) -> Iterator[Any]:
            if path == "users":
                raise ClientError("no", Exit.REFUSED, status=status)
            yield {"id": 1}

    service: Any = Answers()
    with pytest.raises(ClientError) if status == 500 else nullcontext():
        assert list(People(service).api_keys()) == [({"id": 1}, None)]


def a_mode(number: int) -> dict[str, Any]:
    return {"number": number, "kind": "bending"} | dict.fromkeys(
        (
            "measured_hz",
            "initial_hz",
            "updated_hz",
            "error_percent",
            "mac",
            "measured_damping",
            "predicted_damping",
        )
    )


def a_report(modes: int, structure: dict[str, Any], **document: Any) -> dict[str, Any]:
    result = {
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
    return content_of(result | document, body | structure, campaign, "p", {})


def test_a_report_of_little_and_of_much() -> None:
    little = a_report(1, {}, verdict={"sentence": "Fair.", "level": "with_care", "reasons": []})
    assert (little["title"], little["notes"], little["more_modes"]) == ("s", [], "")
    assert little["without_frf"] == "No FRF is predicted, as the damping was not fitted."
    facts = dict(little["facts"]["rows"])
    assert facts["Section"] == "equivalent orthotropic plate"
    assert facts["Instruments"] == "sensor of 2 g"
    verdict = {"sentence": "Good.", "level": "usable", "reasons": ["It fits."]}
    plies = {"plies": [{"angle_deg": 45}] * 17}
    more = {"warnings": ["Look."], "outcomes": [{"stage": "damping", "message": "too short"}]}
    much = a_report(MOST_MODES + 2, {"laminate": plies}, verdict=verdict, **more)
    assert much["more_modes"] == f"The annex lists all {MOST_MODES + 2} modes."
    assert [table["title"] for table in much["tables"]] == ["All modes", "Recipe", "Origin"]
    assert much["without_frf"] == "No FRF is predicted, as the damping was not fitted: too short."
    assert much["notes"] == ["It fits.", "Look."]
    section = dict(much["facts"]["rows"])["Section"]
    assert section.startswith("laminate of 17 plies [45/45/")
    assert section.endswith("/…]")
    sets = [{"name": name, "thickness_m": 0.004} for name in ("flange", "web")]
    of_deck = a_report(1, {"model": {"filename": "angle.zip", "sets": sets}}, verdict=verdict)
    section = dict(of_deck["facts"]["rows"])["Section"]
    assert section == "model angle.zip: flange 4 mm, web 4 mm"


def test_a_report_has_laboratory_and_photographs_of_any_kind() -> None:
    """Names and captions are words, whatever a typesetter or a browser takes them for; a file that
    is no picture is left out.
    """
    kinds = ("png", "jpeg", "webp")
    photos = {"logo": b"GIF89a", "photo-3": b"\xff\xd8\xff no JPEG"}
    for k, kind in enumerate(kinds):
        Image.new("RGB", (3000, 40), "red").save(written := io.BytesIO(), kind)
        photos[f"photo-{k}"] = written.getvalue()
    caption = "#panic() $x$ <script> 中文 \\ *b*"
    shown = [{"file": f"photo-{k}.jpg", "caption": f"{caption} {k}"} for k in range(4)]
    verdict = {"sentence": caption, "level": "usable", "reasons": []}
    content = a_report(1, {"name": "n" * 300}, verdict=verdict) | {
        "laboratory": {"name": caption, "address": ["First Street 1", "Town"]},
        "photos": shown,
    }
    files = (FOLDER.joinpath(f"report.{each}").read_bytes() for each in ("typ", "css"))
    document = Document(*files, content, {"frf-0": words("title", "sentence")}, photos)
    page = typeset(document, "html").decode()
    assert page.count("data:image/jpeg") == len(kinds)
    for text in (f"<strong>{caption}</strong>", "First Street 1<br>Town"):
        assert text in unescape(page)
    printed = PdfReader(io.BytesIO(typeset(document, "pdf")))
    assert "First Street 1" in printed.pages[0].extract_text()
    assert sum(len(sheet.images) for sheet in printed.pages) == len(kinds)


@pytest.mark.parametrize("content", [b"GIF89a", None])
def test_a_logo_that_is_no_picture_is_refused_at_the_start(
    tmp_path: Path, content: bytes | None
) -> None:
    file = tmp_path / "logo"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(
        ValueError, match=r"cannot read .*logo" if content is None else "is no PNG or JPEG"
    ):
        Settings(laboratory_logo=file)
