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
import tempfile
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import numpy as np
import psutil
import psycopg
import pyuff

from modalbase.formats.uff import Axis, Frf, GridPoint
from modalbase.formats.uff.write import write_file
from service.db.engine import psycopg_url
from service.imports.originals import CHUNK_BYTES
from service.settings import Settings
from service.supervisor import LocalService

FRFS, LINES = 1000, 3201
LARGE_FRFS = 3900  # 200 MB
PAIRS = 3
STRUCTURE = {
    "name": "beam",
    "geometry": {"length_m": 0.5, "width_m": 0.04, "thickness_m": 0.01},
    "density_kg_m3": 2012,
    "material": {"Ex_Pa": 33e9, "Ey_Pa": 32e9, "Gxy_Pa": 6e9, "Gxz_Pa": 5e9, "Gyz_Pa": 5e9, "nu_xy": 0.15},
}


def main() -> None:
    """Print the tables."""
    with tempfile.TemporaryDirectory(prefix="mb-") as folder:
        settings = Settings(data=Path(folder) / "db", port=0, log_level="error")
        with LocalService(settings) as service, client_of(service) as api:
            structure = structure_of(api)
            _imports(api, structure, service, Path(folder))
            _spectra(api, structure, service)
            _listing(api, structure, service)


def client_of(service: LocalService) -> httpx.Client:
    """A client of a service with a key of its own."""
    key = service.new_key("benchmark")
    return httpx.Client(
        base_url=f"{service.url}/api/v1/",
        headers={"Authorization": f"Bearer {key}"},
        timeout=600,
        trust_env=False,
    )


def structure_of(api: httpx.Client) -> str:
    """A new beam in a new project; its id."""
    project = api.post("projects", json={"name": "benchmark"}).raise_for_status().json()["id"]
    return str(api.post(f"projects/{project}/structures", json=STRUCTURE).raise_for_status().json()["id"])


def _campaign(api: httpx.Client, structure: str, name: str) -> str:
    body = {"name": name, "boundary": "cantilever"}
    return str(api.post(f"structures/{structure}/campaigns", json=body).raise_for_status().json()["id"])


def _frfs(count: int, lines: int, seed: int) -> Iterator[GridPoint | Frf]:
    rng = np.random.default_rng(seed)
    yield from (GridPoint(n, (0.001 * n, 0.0, 0.0)) for n in range(1, count + 1))
    for n in range(1, count + 1):
        label = f"FRF {n}Z/1Z"
        values = rng.standard_normal(lines) + 1j * rng.standard_normal(lines)
        ids = (label, "NONE", "NONE", "NONE", "NONE")
        yield Frf(0, label, ids, n, 3, 1, 3, "accelerance", Axis(0.0, 0.5, lines), values)


def _imports(api: httpx.Client, structure: str, service: LocalService, folder: Path) -> None:
    print(f"import of {FRFS} FRFs × {LINES} lines, upload to result, medians of {PAIRS} pairs of runs, load {_load()}")
    print("(target: at most 1.5 × pyuff's reading; COPY: PostgreSQL alone stores the file and its spectra;")
    print(" memory: of API, worker and child, pages that they share counted for each; in brackets above idle)")
    print(f"{'':8} {'MB':>6} {'pyuff s':>9} {'COPY s':>9} {'import s':>9} {'ratio':>6} {'peak memory MB':>16}")
    for name, binary in (("58b", True), ("58", False)):
        path = folder / f"{name}.uff"
        runs = []
        for pair in range(PAIRS):
            write_file(path, _frfs(FRFS, LINES, seed=pair), binary=binary)  # bytes that are not there yet
            limits = _pyuff_seconds(path), _copy_seconds(service, path)
            runs.append((*limits, *_timed_import(api, structure, service, path, FRFS)))
        reading, copying, taken, *peak = (statistics.median(column) for column in zip(*runs, strict=True))
        ratio = statistics.median(run[2] / run[0] for run in runs)
        size = path.stat().st_size / 1e6
        print(f"{name:8} {size:6.0f} {reading:9.2f} {copying:9.2f} {taken:9.2f} {ratio:6.2f} {_memory(*peak)}")
        path.unlink()
    write_file(folder / "large.uff", _frfs(LARGE_FRFS, LINES, seed=PAIRS), binary=True)
    seconds, *peak = _timed_import(api, structure, service, folder / "large.uff", LARGE_FRFS)
    size = (folder / "large.uff").stat().st_size / 1e6
    print(f"{'58b':8} {size:6.0f} {'':9} {'':9} {seconds:9.2f} {'':6} {_memory(*peak)}")
    (folder / "large.uff").unlink()


def _pyuff_seconds(path: Path) -> float:
    began = time.perf_counter()
    sets = pyuff.UFF(str(path)).read_sets()
    taken = time.perf_counter() - began
    assert sum(s["type"] == 58 for s in sets) == FRFS
    return taken


def _copy_seconds(service: LocalService, path: Path) -> float:
    """What PostgreSQL needs for the file's bytes and then for those of its spectra, one transaction each."""
    file, spectrum = path.read_bytes(), os.urandom(16 * LINES)
    chunks = [file[at : at + CHUNK_BYTES] for at in range(0, len(file), CHUNK_BYTES)]
    with psycopg.connect(psycopg_url(service.settings.database_url or ""), autocommit=True) as connection:
        connection.execute("CREATE TABLE copied (id uuid PRIMARY KEY DEFAULT uuidv7(), data bytea)")
        connection.execute("ALTER TABLE copied ALTER COLUMN data SET STORAGE EXTERNAL")
        connection.execute("ALTER TABLE copied SET (toast_tuple_target = 8160)")  # as `original_chunks`
        began = time.perf_counter()
        for rows in (chunks, [spectrum] * FRFS):
            command = "COPY copied (data) FROM STDIN (FORMAT BINARY)"
            with connection.transaction(), connection.cursor() as cursor, cursor.copy(command) as copy:
                copy.set_types(["bytea"])
                for data in rows:
                    copy.write_row((data,))
        taken = time.perf_counter() - began
        connection.execute("DROP TABLE copied")
    return taken


def _timed_import(
    api: httpx.Client, structure: str, service: LocalService, path: Path, frfs: int
) -> tuple[float, float, float]:
    """Seconds, and bytes of memory at the peak, and above what it was before."""
    campaign = _campaign(api, structure, path.name)
    with peak_memory(service) as peak:
        began = time.perf_counter()
        counts = _import(api, campaign, path)
        taken = time.perf_counter() - began
    assert counts["frfs"] == counts["grid_points"] == frfs
    return taken, float(peak[0]), float(peak[1])


def _memory(peak: float, above_idle: float) -> str:
    return f"{peak / 1e6:10.0f} ({above_idle / 1e6:.0f})"


def _load() -> str:
    return f"{os.getloadavg()[0]:.1f} on {os.cpu_count()} processors"


def _import(api: httpx.Client, campaign: str, path: Path) -> dict[str, int]:
    with path.open("rb") as file:
        answer = api.post(f"campaigns/{campaign}/imports", content=iter(lambda: file.read(1 << 20), b""))
    location = api.base_url.join(answer.raise_for_status().headers["Location"])
    while (state := api.get(location).raise_for_status().json())["status"] in ("queued", "running"):
        time.sleep(0.05)
    assert state["status"] == "succeeded", state["error"]
    counts: dict[str, int] = state["counts"]
    return counts


@contextmanager
def peak_memory(service: LocalService) -> Iterator[list[int]]:
    """Largest sum of the resident memory of API, worker and their children; and above what it was at the beginning."""
    ended = threading.Event()
    peak = [0, 0]

    def resident() -> int:
        total = 0
        for process in service.processes.values():
            for each in (psutil.Process(process.pid), *psutil.Process(process.pid).children(recursive=True)):
                try:
                    total += each.memory_info().rss
                except psutil.NoSuchProcess:
                    continue
        return total

    before = resident()

    def watch() -> None:
        while not ended.wait(0.05):
            peak[0] = max(peak[0], resident())
            peak[1] = peak[0] - before

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        yield peak
    finally:
        ended.set()
        thread.join()


def _median(run: Callable[[], object], times: int = 9) -> float:
    taken = []
    for _ in range(times):
        began = time.perf_counter()
        run()
        taken.append(time.perf_counter() - began)
    return statistics.median(taken)


def _spectra(api: httpx.Client, structure: str, service: LocalService) -> None:
    campaign = _campaign(api, structure, "spectra")
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
    print(f"\n100 FRFs × {LINES} lines, medians of 25 turns, load {_load()} (target: at most 3 × a raw SELECT)")
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


def _listing(api: httpx.Client, structure: str, service: LocalService) -> None:
    sizes = (1_000, 1_000_000)
    campaigns = [_campaign(api, structure, f"{rows} rows") for rows in sizes]
    with psycopg.connect(psycopg_url(service.settings.database_url or ""), autocommit=True) as connection:
        middles = [_fill(connection, c, rows) for c, rows in zip(campaigns, sizes, strict=True)]
        connection.execute("VACUUM ANALYZE frfs")
        connection.execute("CHECKPOINT")
    print(f"\npage of 100 FRFs, medians of 31 turns, load {_load()} (target: flat within 1.5 times)")
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
