"""The measurement database: import against pyuff's own reading, spectra over HTTP against a raw SELECT, flat listing.

Each row is measured in this run on this machine, against a real PostgreSQL, API and worker.
"""

from __future__ import annotations

import base64
import io
import statistics
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import numpy as np
import psutil
import psycopg
import pyuff

from service.campaigns.uff import Axis, Frf, GridPoint
from service.campaigns.uff.write import write_file
from service.db.engine import psycopg_url
from service.settings import Settings
from service.supervisor import LocalService

FRFS, LINES = 1000, 3201
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
        with LocalService(settings) as service, _client(service) as api:
            structure = _structure(api)
            _imports(api, structure, service, Path(folder))
            _spectra(api, structure, service)
            _listing(api, structure, service)


def _client(service: LocalService) -> httpx.Client:
    key = service.new_key("benchmark")
    return httpx.Client(
        base_url=f"{service.url}/api/v1/",
        headers={"Authorization": f"Bearer {key}"},
        timeout=600,
        trust_env=False,
    )


def _structure(api: httpx.Client) -> str:
    project = api.post("projects", json={"name": "benchmark"}).raise_for_status().json()["id"]
    return str(api.post(f"projects/{project}/structures", json=STRUCTURE).raise_for_status().json()["id"])


def _campaign(api: httpx.Client, structure: str, name: str) -> str:
    body = {"name": name, "boundary": "cantilever"}
    return str(api.post(f"structures/{structure}/campaigns", json=body).raise_for_status().json()["id"])


def _frfs(count: int, lines: int) -> Iterator[GridPoint | Frf]:
    rng = np.random.default_rng(1)
    yield from (GridPoint(n, (0.001 * n, 0.0, 0.0)) for n in range(1, count + 1))
    for n in range(1, count + 1):
        label = f"FRF {n}Z/1Z"
        values = rng.standard_normal(lines) + 1j * rng.standard_normal(lines)
        ids = (label, "NONE", "NONE", "NONE", "NONE")
        yield Frf(0, label, ids, n, 3, 1, 3, "accelerance", Axis(0.0, 0.5, lines), values)


def _imports(api: httpx.Client, structure: str, service: LocalService, folder: Path) -> None:
    print(f"import of {FRFS} FRFs × {LINES} lines, upload to result (target: at most 1.5 × pyuff's reading)")
    print(f"{'':8} {'MB':>6} {'pyuff s':>9} {'import s':>9} {'ratio':>6} {'peak memory MB':>15}")
    for name, binary in (("58b", True), ("58", False)):
        path = folder / f"{name}.uff"
        write_file(path, _frfs(FRFS, LINES), binary=binary)
        began = time.perf_counter()
        sets = pyuff.UFF(str(path)).read_sets()
        reading = time.perf_counter() - began
        assert sum(s["type"] == 58 for s in sets) == FRFS
        del sets
        campaign = _campaign(api, structure, name)
        with _peak_memory(service) as peak:
            began = time.perf_counter()
            counts = _import(api, campaign, path)
            taken = time.perf_counter() - began
        assert counts == {"frfs": FRFS, "grid_points": FRFS, "modes": 0}
        size = path.stat().st_size / 1e6
        print(f"{name:8} {size:6.0f} {reading:9.2f} {taken:9.2f} {taken / reading:6.2f} {peak[0] / 1e6:15.0f}")
        path.unlink()


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
def _peak_memory(service: LocalService) -> Iterator[list[int]]:
    """Largest sum of the resident memory of API, worker and their children, above what it was at the beginning."""
    ended = threading.Event()
    peak = [0]

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
            peak[0] = max(peak[0], resident() - before)

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
        with np.load(io.BytesIO(answer.content)) as got:
            assert got["values"].shape == values.shape

    with psycopg.connect(psycopg_url(service.settings.database_url or "")) as connection:
        query = "SELECT data FROM frfs WHERE campaign_id = %s ORDER BY id"

        def select() -> None:
            rows = connection.execute(query, [campaign], binary=True).fetchall()
            assert len([np.frombuffer(row[0], "<c16") for row in rows]) == 100

        raw, http = _median(select), _median(over_http)
    print(f"\n100 FRFs × {LINES} lines (target: at most 3 × a raw SELECT)")
    print(f"raw SELECT {1000 * raw:.1f} ms, npz over HTTP {1000 * http:.1f} ms, ratio {http / raw:.2f}")


def _listing(api: httpx.Client, structure: str, service: LocalService) -> None:
    print("\npage of 100 FRFs (target: flat within 1.5 times)")
    print(f"{'rows':>9} {'first ms':>9} {'deep ms':>9} {'by point ms':>12}")
    first = []
    for rows in (1_000, 1_000_000):
        campaign = _campaign(api, structure, f"{rows} rows")
        with psycopg.connect(psycopg_url(service.settings.database_url or "")) as connection:
            connection.execute(
                "INSERT INTO frfs (campaign_id, label, response_point, response_direction, reference_point,"
                " reference_direction, quantity, start_hz, end_hz, step_hz, lines, dtype, sha256, data)"
                " SELECT %s, '', 1 + i %% 500, 3, 1, 3, 'accelerance', 0, 1, 1, 2, '<c16', '', ''"
                " FROM generate_series(1, %s) i",
                [campaign, rows],
            )
            connection.commit()
            connection.autocommit = True
            connection.execute("VACUUM ANALYZE frfs")
            middle = connection.execute(
                "SELECT id FROM frfs WHERE campaign_id = %s ORDER BY id OFFSET %s LIMIT 1", [campaign, rows // 2]
            ).fetchone()
        assert middle is not None
        cursor = _cursor(middle[0].bytes)
        path = f"campaigns/{campaign}/frfs"
        times = [
            _median(lambda params=params, path=path: api.get(path, params=params).raise_for_status(), 21)
            for params in ({}, {"cursor": cursor}, {"point": 7})
        ]
        first.append(times)
        print(f"{rows:9d} {1000 * times[0]:9.1f} {1000 * times[1]:9.1f} {1000 * times[2]:12.1f}")
    print("ratio     " + " ".join(f"{b / a:9.2f}" for a, b in zip(*first, strict=True)))


def _cursor(key: bytes) -> str:
    return base64.urlsafe_b64encode(key).rstrip(b"=").decode()


if __name__ == "__main__":
    main()
