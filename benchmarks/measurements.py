"""The measurement database: import against pyuff's own reading, spectra over HTTP against a raw SELECT, flat listing.

Each row is measured in this run on this machine, against a real PostgreSQL, API and worker. Beside each stands what bounds
it: the time in which PostgreSQL alone stores the bytes that an import stores, and that in which the client alone reads the
bytes of an answer.
"""

from __future__ import annotations

import base64
import io
import os
import socket
import statistics
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import numpy as np
import psycopg
import pyuff

from benchmarks.service import Cost, campaign_of, copied, ended, load, measured, served
from modalbase.formats.uff import Axis, Frf, GridPoint
from modalbase.formats.uff.write import write_file
from service.app.supervisor import LocalService
from service.db.engine import psycopg_url
from service.store.imports.originals import CHUNK_BYTES

FRFS, LINES = 1000, 3201
LARGE_FRFS = 3900  # 200 MB
PAIRS = 3


def main() -> None:
    """Print the tables."""
    with served() as (service, api, folder):
        _imports(api, service, folder)
        _spectra(api, service)
        _listing(api, service)


def _frfs(count: int, lines: int, seed: int) -> Iterator[GridPoint | Frf]:
    rng = np.random.default_rng(seed)
    yield from (GridPoint(n, (0.001 * n, 0.0, 0.0)) for n in range(1, count + 1))
    for n in range(1, count + 1):
        label = f"FRF {n}Z/1Z"
        values = rng.standard_normal(lines) + 1j * rng.standard_normal(lines)
        ids = (label, "NONE", "NONE", "NONE", "NONE")
        yield Frf(0, label, ids, n, 3, 1, 3, "accelerance", Axis(0.0, 0.5, lines), values)


def _imports(api: httpx.Client, service: LocalService, folder: Path) -> None:
    print(f"import of {FRFS} FRFs × {LINES} lines, upload to result, medians of {PAIRS} pairs of runs, {load()}")
    print("(target: at most 1.5 × pyuff's reading; COPY: PostgreSQL alone stores the file and its spectra;")
    print(" memory: of API, worker and child, pages that they share counted for each; in brackets above idle)")
    print(f"{'':8} {'MB':>6} {'pyuff s':>9} {'COPY s':>9} {'import s':>9} {'ratio':>6} {'peak memory MB':>16}")
    for name, binary, frfs in (("58b", True, FRFS), ("58", False, FRFS), ("58b", True, LARGE_FRFS)):
        path, runs = folder / f"{name}.uff", []
        for pair in range(PAIRS if frfs == FRFS else 1):
            write_file(path, _frfs(frfs, LINES, seed=pair), binary=binary)  # bytes that are not there yet
            peer = _pyuff_seconds(path, frfs)
            file, spectrum = path.read_bytes(), os.urandom(16 * LINES)
            chunks = [file[at : at + CHUNK_BYTES] for at in range(0, len(file), CHUNK_BYTES)]
            bound = copied(service, [chunks, [spectrum] * frfs])
            cost = _import(api, service, path, frfs)
            runs.append((peer, bound.clock, cost.clock, cost.clock / peer, cost.peak / 1e6, cost.above_idle / 1e6))
        row = [statistics.median(column) for column in zip(*runs, strict=True)]
        size = path.stat().st_size / 1e6
        print(
            f"{name:8} {size:6.0f} {row[0]:9.2f} {row[1]:9.2f} {row[2]:9.2f} {row[3]:6.2f} {row[4]:10.0f} ({row[5]:.0f})"
        )
        path.unlink()


def _pyuff_seconds(path: Path, frfs: int) -> float:
    began = time.perf_counter()
    sets = pyuff.UFF(str(path)).read_sets()
    taken = time.perf_counter() - began
    assert sum(s["type"] == 58 for s in sets) == frfs
    return taken


def _import(api: httpx.Client, service: LocalService, path: Path, frfs: int) -> Cost:
    campaign = campaign_of(api, path.name)
    with measured(service) as cost, path.open("rb") as file:
        answer = api.post(f"campaigns/{campaign}/imports", content=iter(lambda: file.read(1 << 20), b""))
        counts = ended(api, answer)["counts"]
    assert counts["frfs"] == counts["grid_points"] == frfs
    return cost


def _median(run: Callable[[], object], times: int = 9) -> float:
    taken = []
    for _ in range(times):
        began = time.perf_counter()
        run()
        taken.append(time.perf_counter() - began)
    return statistics.median(taken)


def _spectra(api: httpx.Client, service: LocalService) -> None:
    campaign = campaign_of(api, "spectra")
    buffer = io.BytesIO()
    rng = np.random.default_rng(2)
    points = np.arange(1, 101)
    values = rng.standard_normal((100, LINES)) + 1j * rng.standard_normal((100, LINES))
    np.savez(
        buffer,
        frequency_hz=np.arange(LINES) * 0.5,
        values=values,
        response_point=points,
        response_direction=np.int64(3),
        reference_point=np.int64(1),
        reference_direction=np.int64(3),
    )
    npz = {"Content-Type": "application/x-npz"}
    api.post(f"campaigns/{campaign}/frfs", content=buffer.getvalue(), headers=npz).raise_for_status()

    def over_http() -> None:
        answer = api.get(f"campaigns/{campaign}/frfs/data", params={"format": "npz"}).raise_for_status()
        _check(answer.content)

    def _check(content: bytes) -> None:
        with np.load(io.BytesIO(content)) as got:
            assert got["values"].shape == values.shape

    body = api.get(f"campaigns/{campaign}/frfs/data", params={"format": "npz"}).raise_for_status().content
    with _bare_server(body) as url, psycopg.connect(psycopg_url(service.settings.database_url or "")) as connection:
        query = "SELECT data FROM frfs WHERE campaign_id = %s ORDER BY id"

        def select() -> None:
            rows = connection.execute(query, [campaign], binary=True).fetchall()
            assert len([np.frombuffer(row[0], "<c16") for row in rows]) == 100

        def client_alone() -> None:
            _check(api.get(url).content)

        turns = [[_median(each, 1) for each in (select, client_alone, over_http)] for _ in range(25)]
        raw, client, http = (statistics.median(column) for column in zip(*turns, strict=True))
    print(f"\n100 FRFs × {LINES} lines, medians of 25 turns, {load()} (target: at most 3 × a raw SELECT)")
    print(f"raw SELECT {1000 * raw:.1f} ms, npz over HTTP {1000 * http:.1f} ms, ratio {http / raw:.2f};", end=" ")
    print(f"the client alone, with the same bytes from a bare socket: {1000 * client:.1f} ms, {client / raw:.2f}")


@contextmanager
def _bare_server(body: bytes) -> Iterator[str]:
    """Address of a socket that gives these bytes to whoever connects, whatever is asked."""
    answer = b"HTTP/1.1 200 OK\r\nContent-Length: %d\r\n\r\n%b" % (len(body), body)
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve() -> None:
            with listener.accept()[0] as connection:
                while connection.recv(65536):
                    connection.sendall(answer)

        threading.Thread(target=serve, daemon=True).start()
        yield f"http://127.0.0.1:{listener.getsockname()[1]}/"


def _listing(api: httpx.Client, service: LocalService) -> None:
    sizes = (1_000, 1_000_000)
    campaigns = [campaign_of(api, f"{rows} rows") for rows in sizes]
    with psycopg.connect(psycopg_url(service.settings.database_url or ""), autocommit=True) as connection:
        middles = [_fill(connection, c, rows) for c, rows in zip(campaigns, sizes, strict=True)]
        connection.execute("VACUUM ANALYZE frfs")
        connection.execute("CHECKPOINT")
    print(f"\npage of 100 FRFs, medians of 31 turns, {load()} (target: flat within 1.5 times)")
    print(f"{'rows':>9} {'first ms':>9} {'deep ms':>9} {'by point ms':>12}")
    taken: dict[tuple[int, int], list[float]] = {}
    for _ in range(31):  # by turns, so that the machine's load is the same for both
        for size, (campaign, middle) in enumerate(zip(campaigns, middles, strict=True)):
            for kind, params in enumerate(({}, {"cursor": _cursor(middle)}, {"point": 7})):
                began = time.perf_counter()
                api.get(f"campaigns/{campaign}/frfs", params=params).raise_for_status()
                taken.setdefault((size, kind), []).append(time.perf_counter() - began)
    times = [[1000 * statistics.median(taken[size, kind]) for kind in range(3)] for size in range(2)]
    for rows, row in zip(sizes, times, strict=True):
        print(f"{rows:9d} {row[0]:9.1f} {row[1]:9.1f} {row[2]:12.1f}")
    print("ratio     " + " ".join(f"{b / a:9.2f}" for a, b in zip(*times, strict=True)))


def _fill(connection: psycopg.Connection[tuple[uuid.UUID]], campaign: str, rows: int) -> bytes:
    """Rows of FRFs without much of a spectrum; the key of the middle one."""
    connection.execute(
        "INSERT INTO frfs (campaign_id, label, response_point, response_direction, reference_point,"
        " reference_direction, quantity, start_hz, end_hz, step_hz, lines, dtype, sha256, data)"
        " SELECT %s, '', 1 + i %% 500, 3, 1, 3, 'accelerance', 0, 1, 1, 2, '<c16', '', ''"
        " FROM generate_series(1, %s) i",
        [campaign, rows],
    )
    query = "SELECT id FROM frfs WHERE campaign_id = %s ORDER BY id OFFSET %s LIMIT 1"
    middle = connection.execute(query, [campaign, rows // 2]).fetchone()
    assert middle is not None
    return middle[0].bytes


def _cursor(key: bytes) -> str:
    return base64.urlsafe_b64encode(key).rstrip(b"=").decode()
