"""Files that cost little to send and much to read, thrown at a service all at once."""

import io
import json
import multiprocessing
import struct
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field

import httpx
import numpy as np

from modalbase.formats.registry import FORMATS
from service.app.supervisor import LocalService
from tests.support.rest import campaigns_of, client_of, finished
from tests.support.watching import watch

MIB = 1024 * 1024
LARGE, MOST_GROWTH, MOST_SECONDS = 512, 60e6, 0.3
CHANNELS = [
    {"variable": name, "quantity": q, "point": 1}
    for name, q in (("a", "force"), ("b", "acceleration"))
]
MAPPING = json.dumps({"sample_rate_hz": 1000, "channels": CHANNELS})
ALIASES = {
    "npz": ("records", "frfs"),
    "mat": ("records", "frfs"),
    "csv": ("records", "frfs"),
    "wav": ("records",),
}
TYPES = {
    "npz": "application/x-npz",
    "mat": "application/x-matlab-data",
    "csv": "text/csv",
    "wav": "audio/wav",
}


def bomb(form: str, number: int, mib: int = LARGE) -> bytes:
    """A file that is small, or costs little to send, and is large once it is read; each number is
    another file.
    """
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
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<f8", "fortran_order": False, "shape": (count,)}
    )
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in ("a", "b"):
            with archive.open(f"{name}.npy", "w") as member:
                member.write(header.getvalue())
                for block in _zeros(8 * count):
                    member.write(block)
    return packed.getvalue()


def _mat(count: int) -> bytes:
    """A .mat of version 7 with a vector of zeros, which scipy would inflate as a whole."""
    inner = struct.pack("<IIIIIIiiHHI", 6, 8, 6, 0, 5, 8, 1, count, 1, 1, ord("a")) + struct.pack(
        "<II", 9, 8 * count
    )
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
    """Bytes by which the API's memory grew at most, seconds that `/healthz` took at most, ends, and
    what ended without words.
    """

    growth: int = 0
    slowest: float = 0.0
    ends: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)


def throw(
    service: LocalService, count: int, mib: int = LARGE, aliased: Iterable[str] = ALIASES
) -> Outcome:
    """Throw so many bombs of each format, all at once, at `…/imports`, and those of some formats at
    `…/records` and `…/frfs` where these take it.

    The API reads none of them: its memory stays, `/healthz` answers meanwhile, and every file is
    refused in words.
    """
    kinds = [("imports", form) for form in FORMATS]
    kinds += [(where, form) for form in aliased for where in ALIASES[form]]
    files = {(form, n): bomb(form, n, mib) for form in FORMATS for n in range(count)}
    with client_of(service, "bombs") as api:
        (campaign,), found = campaigns_of(api, "bombs"), Outcome()
        # each route is loaded when it is first asked for
        for where in ("imports", "records", "frfs"):
            _throw(api, f"campaigns/{campaign}", where, "csv", b"nothing", found)
        with _watched(service, found), ThreadPoolExecutor(len(kinds) * count) as threads:
            sent = [
                threads.submit(
                    _throw, api, f"campaigns/{campaign}", where, form, files[form, n], found
                )
                for where, form in kinds
                for n in range(count)
            ]
        for one in sent:
            one.result()
    return found


def _throw(
    api: httpx.Client, campaign: str, where: str, form: str, content: bytes, found: Outcome
) -> None:
    """Send one file, and wait for its end."""
    query = {"filename": f"bomb.{form}"} if where != "frfs" else {"quantity": "accelerance"}
    if form != "uff" and where != "frfs":
        query["mapping"] = MAPPING
    headers = {"Content-Type": "application/octet-stream" if where == "imports" else TYPES[form]}
    answer = api.post(f"{campaign}/{where}", params=query, content=content, headers=headers)
    state = answer.json()
    if location := answer.headers.get("location"):
        state = finished(api, location)
    status, words = (
        state.get("status"),
        state.get("detail") or (state.get("error") or {}).get("detail"),
    )
    found.ends[f"{where} {form} {status}"] += 1
    if status in (200, 201, "succeeded", 500) or not words or "internal" in words:
        found.faults.append(f"{where} {form} {status}: {words}")


@contextmanager
def _watched(service: LocalService, found: Outcome) -> Iterator[None]:
    """Within this, the API is looked at, by a process of its own, whose interpreter nobody else
    holds up.
    """
    own = multiprocessing.get_context("spawn")
    here, there = own.Pipe()
    host, _, port = service.url.removeprefix("http://").partition(":")
    process = own.Process(
        target=watch, args=((host, int(port)), service.processes["api"].pid, there)
    )
    process.start()
    here.recv()
    try:
        yield
    finally:
        here.send(None)
        found.growth, found.slowest = here.recv()
        process.join()
