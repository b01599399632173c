"""A service that is asked for long, or for what costs; the tests have each in a short form.

Campaigns of few FRFs have arrays that are smaller than the blocks they are read in.
"""

import http.client
import io
import json
import multiprocessing
import random
import struct
import tempfile
import time
import zipfile
import zlib
from collections import Counter, defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import psutil

from benchmarks.service import ASKED_FREELY, api_of, campaigns_of, client_at, served
from modalbase.client.connection import Connection as Line
from modalbase.formats.recognise import FORMATS
from modalbase.objects.campaigns import Campaign
from modalbase.objects.frfs import Frfs
from modalbase.objects.laboratory import Laboratory
from service.app.demo import paper
from service.app.supervisor import LocalService
from service.db.engine import make_engine, make_sessions
from tests.support.furnished import furnish

MIB = 1024 * 1024

# --- fuzz ---------------------------------------------------------------------------------------------------------------

PREFIX, NEWEST = "/api/v1/", 20  # things of a kind that paths name
KINDS = {"coupon-batches": "batch_id", "update-jobs": "job_id"}
"""What a path calls the things of a collection, where it is not the singular."""


@dataclass
class Fuzzed:
    """Statuses of the answers; operations that a request has got through to; faults of answers, each once, in words."""

    statuses: Counter[int] = field(default_factory=Counter)
    answered: Counter[str] = field(default_factory=Counter)
    faults: dict[str, str] = field(default_factory=dict)


def soak_fuzz(minutes: int = 10) -> list[str]:
    """Requests that Schemathesis draws from the OpenAPI document, right and wrong ones; gives the faults."""
    with served(**ASKED_FREELY) as service:
        found = fuzz(service, minutes, examples=10)
    print(f"{found.statuses.total()} requests: " + ", ".join(f"{n} × {s}" for s, n in sorted(found.statuses.items())))
    print(f"{len(found.answered)} operations answered with success")
    return [f"{name}: {fault}" for name, fault in found.faults.items()]


def fuzz(service: LocalService, minutes: float = 0.0, examples: int = 3, start: int = 14) -> Fuzzed:
    """Send requests until the time is over, at least one round.

    What a path names is taken from what exists: at first one thing of each kind, then also what the requests themselves
    have made, so that they meet things in every state. No answer may be an error of the service, or one that the
    document does not know: status, content type, headers and body are held against it.

    Args:
        service: that runs with settings such as `ASKED_FREELY`.
        minutes: time to send for.
        examples: requests of each operation in a round.
        start: seed of the first round.
    """
    engine = make_engine(service.settings.database_url, pool_size=1)
    with api_of(service, "fuzz") as client:
        things = furnish(client, make_sessions(engine), "fuzz")
        things |= {"key_id": client.post("api-keys", json={"name": "spare"}).json()["id"], "member": "fuzz"}
        key = client.headers["Authorization"]
    engine.dispose()
    fuzzer, end, number = _Fuzzer(service, things, key, start), time.monotonic() + 60 * minutes, start
    fuzzer.round(examples, number)
    while time.monotonic() < end:
        number += 1
        fuzzer.round(examples, number)
    return fuzzer.found


def _removes(operation: Any) -> bool:
    return bool(operation.method == "delete" or operation.path.endswith("/purge"))


class _Fuzzer:
    def __init__(self, service: LocalService, things: dict[str, str], key: str, start: int) -> None:
        import schemathesis
        from schemathesis import checks
        from schemathesis.core.result import Ok
        from schemathesis.specs.openapi import checks as documented

        self.found, self.choose = Fuzzed(), random.Random(start)
        self.things = defaultdict(list, {name: [value] for name, value in things.items()})
        self.headers = {"Authorization": key}
        schema = schemathesis.openapi.from_url(f"{service.url}/openapi.json")
        self.operations = [made.ok() for made in schema.get_all_operations() if isinstance(made, Ok)]
        names = ("content_type", "response_headers", "response_schema", "status_code")
        self.checks = [checks.not_a_server_error, *(getattr(documented, f"{name}_conformance") for name in names)]

    def round(self, examples: int, number: int) -> None:
        """Some requests of each operation; what removes things comes last, or the others would find nothing."""
        mixed = self.choose.sample(self.operations, len(self.operations))
        for operation in sorted(mixed, key=_removes):
            if not operation.path.endswith("/events"):  # a stream has no end
                self._some(operation, examples, number)

    def _some(self, operation: Any, examples: int, number: int) -> None:
        from hypothesis import HealthCheck, Phase, given, seed, settings

        unhindered = {"deadline": None, "database": None, "suppress_health_check": list(HealthCheck)}

        @seed(number)
        @settings(max_examples=examples, phases=[Phase.generate], **unhindered)
        @given(case=operation.as_strategy())
        def one(case: Any) -> None:
            self._send(operation.label, case)

        one()

    def _send(self, label: str, case: Any) -> None:
        from schemathesis.core.failures import FailureGroup

        for name in case.path_parameters or {}:
            if self.things[name] and self.choose.random() < 0.8:
                case.path_parameters[name] = self.choose.choice(self.things[name][-NEWEST:])
        answer = case.call(headers=self.headers, timeout=60)
        self.found.statuses[answer.status_code] += 1
        if answer.status_code < 300:
            self.found.answered[label] += 1
            steps = (answer.headers.get("location") or [""])[0].removeprefix(PREFIX).split("/")
            if len(steps) == 2:  # what was made may be named by later paths
                self.things[KINDS.get(steps[0], steps[0].removesuffix("s").replace("-", "_") + "_id")].append(steps[1])
        try:
            case.validate_response(answer, checks=self.checks)
        except FailureGroup as error:
            first = str(error).strip().split("\n")
            self.found.faults.setdefault(f"{label} {answer.status_code}", "\n".join(first[:40]))


# --- bombs --------------------------------------------------------------------------------------------------------------

LARGE, MOST_GROWTH, MOST_SECONDS = 512, 60e6, 0.3
CHANNELS = [{"variable": name, "quantity": q, "point": 1} for name, q in (("a", "force"), ("b", "acceleration"))]
MAPPING = json.dumps({"sample_rate_hz": 1000, "channels": CHANNELS})
ALIASES = {"npz": ("records", "frfs"), "mat": ("records", "frfs"), "csv": ("records", "frfs"), "wav": ("records",)}
TYPES = {"npz": "application/x-npz", "mat": "application/x-matlab-data", "csv": "text/csv", "wav": "audio/wav"}


def bomb(form: str, number: int, mib: int = LARGE) -> bytes:
    """A file that is small, or costs little to send, and is large once it is read; each number is another file."""
    if form == "npz":
        return _npz(mib * MIB // 8 + number)
    if form == "mat":
        return _mat(mib * MIB // 8 + number)
    if form == "csv":  # a table of its columns times its lines
        names = ",".join(f"a{number}_{i}" for i in range(mib * 500))
        return f"{names}\n{'1,1' * 3}\n".encode() + b"1\n" * (mib * 200)
    if form == "wav":  # every count becomes a number of eight bytes
        samples = bytes([number]) * (mib * MIB // 16)
        head = struct.pack("<4sI4s4sIHHIIHH4sI", b"RIFF", 36 + len(samples), b"WAVE", b"fmt ", 16, 1, 1, 8000, 8000, 1, 8,
                           b"data", len(samples))  # fmt: skip
        return head + samples
    return b"    -1\n" + b"\n" * (mib * MIB // 20 + number) + b"    15\n    -1\n"


def _npz(count: int) -> bytes:
    packed, header = io.BytesIO(), io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (count,)})
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in ("a", "b"):
            with archive.open(f"{name}.npy", "w") as member:
                member.write(header.getvalue())
                for block in _zeros(8 * count):
                    member.write(block)
    return packed.getvalue()


def _mat(count: int) -> bytes:
    """A .mat of version 7 with a vector of zeros, which scipy would inflate as a whole."""
    inner = struct.pack("<IIIIIIiiHHI", 6, 8, 6, 0, 5, 8, 1, count, 1, 1, ord("a")) + struct.pack("<II", 9, 8 * count)
    squeeze = zlib.compressobj()
    parts = [squeeze.compress(struct.pack("<II", 14, len(inner) + 8 * count) + inner)]
    parts += [squeeze.compress(block) for block in _zeros(8 * count)]
    data = b"".join([*parts, squeeze.flush()])
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<HH", 0x0100, 0x4D49)
    return head + struct.pack("<II", 15, len(data)) + data


def _zeros(size: int) -> Iterator[bytes]:
    block = bytes(MIB)
    for left in range(size, 0, -MIB):
        yield block[:left]


@dataclass
class Outcome:
    """Bytes by which the API's memory grew at most, seconds that `/healthz` took at most, ends, and what ended without
    words.
    """

    growth: int = 0
    slowest: float = 0.0
    ends: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)


def soak_bombs(count: int = 10) -> list[str]:
    """Files of each format that are made to cost, all at once; gives what was too much."""
    with served(job_memory_bytes=1024 * MIB, **ASKED_FREELY) as service:  # as much as a small machine has
        found = throw(service, count)
    print(f"API memory grew by {found.growth / 1e6:.0f} MB, /healthz took {1e3 * found.slowest:.0f} ms at most")
    print("\n".join(f"{count} × {end}" for end, count in sorted(found.ends.items())))
    too_much = found.growth > MOST_GROWTH or found.slowest > MOST_SECONDS
    return found.faults + [f"more than {MOST_GROWTH / 1e6:.0f} MB or {MOST_SECONDS:g} s"] * too_much


def throw(service: LocalService, count: int, mib: int = LARGE) -> Outcome:
    """Throw so many bombs of each format, all at once, at `…/imports`, and at `…/records` and `…/frfs` where these take it.

    The API reads none of them: its memory stays, `/healthz` answers meanwhile, and every file is refused in words.
    """
    kinds = [(where, form) for form in FORMATS for where in ("imports", *ALIASES.get(form, ()))]
    files = {(form, n): bomb(form, n, mib) for form in FORMATS for n in range(count)}
    with api_of(service, "bombs") as api:
        (campaign,), found = campaigns_of(api, "bombs"), Outcome()
        for where in ("imports", "records", "frfs"):  # each route is loaded when it is first asked for
            _throw(api, f"campaigns/{campaign}", where, "csv", b"nothing", found)
        with _watched(service, found), ThreadPoolExecutor(len(kinds) * count) as threads:
            sent = [
                threads.submit(_throw, api, f"campaigns/{campaign}", where, form, files[form, n], found)
                for where, form in kinds
                for n in range(count)
            ]
        for one in sent:
            one.result()
    return found


def _throw(api: httpx.Client, campaign: str, where: str, form: str, content: bytes, found: Outcome) -> None:
    """Send one file, and wait for its end."""
    query = {"filename": f"bomb.{form}"} if where != "frfs" else {"quantity": "accelerance"}
    if form != "uff" and where != "frfs":
        query["mapping"] = MAPPING
    headers = {"Content-Type": "application/octet-stream" if where == "imports" else TYPES[form]}
    answer = api.post(f"{campaign}/{where}", params=query, content=content, headers=headers)
    state = answer.json()
    if location := answer.headers.get("location"):
        while (state := api.get(api.base_url.join(location)).raise_for_status().json())["status"] in (
            "queued",
            "running",
        ):
            time.sleep(0.1)
    status, words = state.get("status"), state.get("detail") or (state.get("error") or {}).get("detail")
    found.ends[f"{where} {form} {status}"] += 1
    if status in (200, 201, "succeeded", 500) or not words or "internal" in words:
        found.faults.append(f"{where} {form} {status}: {words}")


@contextmanager
def _watched(service: LocalService, found: Outcome) -> Iterator[None]:
    """Within this, the API is looked at, by a process of its own, whose interpreter nobody else holds up."""
    own = multiprocessing.get_context("spawn")
    here, there = own.Pipe()
    host, _, port = service.url.removeprefix("http://").partition(":")
    process = own.Process(target=_watch, args=((host, int(port)), service.processes["api"].pid, there))
    process.start()
    here.recv()
    try:
        yield
    finally:
        here.send(None)
        found.growth, found.slowest = here.recv()
        process.join()


def _watch(address: tuple[str, int], pid: int, channel: Connection) -> None:
    """Look at memory and health until something is sent, then send back the most of both."""
    process, growth, slowest = psutil.Process(pid), 0, 0.0
    before = process.memory_info().rss
    channel.send(None)
    while not channel.poll(0.02):
        line = http.client.HTTPConnection(*address, timeout=60)
        began = time.perf_counter()
        line.request("GET", "/healthz")
        assert line.getresponse().status == 200
        slowest = max(slowest, time.perf_counter() - began)
        line.close()
        growth = max(growth, process.memory_info().rss - before)
    channel.send((growth, slowest))


# --- small campaigns ----------------------------------------------------------------------------------------------------

SIZES = tuple((frfs, stride) for frfs in (1, 2, 3, 5, 12) for stride in (1, 2, 4, 8))
"""FRFs, and which of their 1,000 lines."""
FIGURES = ("plotly", "svg", "png", "pdf")


def soak_small(sizes: int = len(SIZES)) -> list[str]:
    """Every figure and report of campaigns of few FRFs; gives the answers that are no success."""
    with served() as service, client_at(service.url, service.new_key("small")) as client:
        answers = list(small_campaigns(client, SIZES[:sizes]))
    print(f"{sizes} campaigns, {len(answers)} answers")
    return [f"{status}  {asked}" for asked, status in answers if status != httpx.codes.OK]


def small_campaigns(
    client: httpx.Client, sizes: tuple[tuple[int, int], ...] = SIZES, formats: tuple[str, ...] = FIGURES
) -> Iterator[tuple[str, int]]:
    """Update the demonstration's beam from each size of a campaign, and ask for all that can be looked at.

    Args:
        client: at the service's root, with a key.
        sizes: number of FRFs, and the stride of their lines.
        formats: of the figures.

    Yields:
        What was asked for, and the status of the answer.
    """
    lab = Laboratory(Line.over(client))
    structure = lab.new_project("small campaigns").new_structure(**paper.STRUCTURE)
    whole = structure.new_campaign(**paper.CAMPAIGN)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "paper_beam.uff")
        file.write_bytes(paper.uff_file())
        whole.import_file(file)
    frfs, points = whole.frfs(), lab.rest.get_grid_points(whole.fields["id"])
    for count, stride in sizes:
        few = structure.new_campaign(**paper.CAMPAIGN | {"name": f"{count} FRFs, every line of {stride}"})
        lab.rest.put_grid_points(few.fields["id"], body=points)
        few.add_frfs(Frfs(frfs.frequency_hz[::stride], frfs.values[:count, ::stride], frfs.frfs[:count]))
        for asked, status in _looked_at(client, few, formats):
            yield f"{few.fields['name']}: {asked}", status


def _looked_at(client: httpx.Client, campaign: Campaign, formats: tuple[str, ...]) -> Iterator[tuple[str, int]]:
    modes = campaign.new_mode_set("Table 3", paper.MODES)
    path = f"/api/v1/update-jobs/{campaign.update(mode_set=modes).wait().check().fields['id']}"
    available = [one["name"] for one in client.get(f"{path}/figures").json()["items"] if one["available"]]
    asked = [f"figures/{name}?format={kind}" for name in available for kind in formats]
    for address in [*asked, "report?format=html", "report?format=pdf"]:
        yield address, client.get(f"{path}/{address}").status_code
