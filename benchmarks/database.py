"""The measurement database on a real PostgreSQL, API and worker, each figure beside what bounds it
in the same run.
"""

import base64
import io
import json
import os
import statistics
import tempfile
import time
import uuid
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx
import numpy as np
import psycopg
import pyuff
from scipy import fft

from benchmarks.clock import timed
from benchmarks.service import Cost, api_of, contents, copied, ended, measured, served
from benchmarks.tables import Table, load
from modalbase.formats.uff.write import write_file
from service.app.supervisor import LocalService
from service.nouns.storage.originals import CHUNK_BYTES
from service.platform.db.engine import psycopg_url
from service.platform.db.opening import embedded_server
from tests.support.backups import run
from tests.support.hammer import campaign as hit_campaign
from tests.support.rest import RAW, campaigns_of

PAIRS = 3


def measurements(frfs: int = 1000, lines: int = 3201) -> None:
    """Imports against pyuff's own reading, spectra over HTTP against a raw SELECT, lists that stay
    flat.
    """
    with served() as service, api_of(service) as api:
        print(
            f"import of {frfs} FRFs × {lines} lines, upload to result, medians of {PAIRS} pairs of"
            f" runs, {load()}"
        )
        print(
            "(target: at most 1.5 × pyuff's reading; COPY: PostgreSQL alone stores the file and its"
            " spectra;"
        )
        print(" memory: of API, worker and child, pages that they share counted for each)")
        columns = (
            "MB:.0f",
            "pyuff s:.2f",
            "COPY s:.2f",
            "import s:.2f",
            "ratio:.2f",
            "peak MB:.0f",
            "over idle:.0f",
        )
        table = Table("", "UFF:4", *columns)
        for binary, count, pairs in (
            (True, frfs, PAIRS),
            (False, frfs, PAIRS),
            (True, 39 * frfs // 10, 1),
        ):
            row = _imports(api, service, (count, lines), binary=binary, pairs=pairs)
            table.row("58b" if binary else "58", *row)
        _spectra(api, service, lines)
        _listing(api, service, (1_000, 1000 * frfs))


def _imports(
    api: httpx.Client, service: LocalService, size: tuple[int, int], *, binary: bool, pairs: int
) -> list[float]:
    """MB of the file, and medians of the pairs: seconds of pyuff, of COPY, of the import; their
    ratio; peak memory.
    """
    (frfs, lines), runs = size, list[tuple[float, ...]]()
    with tempfile.TemporaryDirectory(prefix="mb-") as folder:
        path = Path(folder, "frfs.uff")
        for pair in range(pairs):
            # bytes that are not there yet
            write_file(path, contents(frfs, lines, 0.5, seed=pair), binary=binary)
            sets, (peer, _) = timed(lambda: pyuff.UFF(str(path)).read_sets())
            assert sum(s["type"] == 58 for s in sets) == frfs
            file, spectrum = path.read_bytes(), os.urandom(16 * lines)
            chunks = [file[at : at + CHUNK_BYTES] for at in range(0, len(file), CHUNK_BYTES)]
            bound = copied(service, [chunks, [spectrum] * frfs])
            (campaign,) = campaigns_of(api, "imports")
            with measured(service) as cost, path.open("rb") as sent:
                content = iter(lambda: sent.read(1 << 20), b"")
                counts = ended(api, api.post(f"campaigns/{campaign}/imports", content=content))[
                    "counts"
                ]
            assert counts["frfs"] == counts["grid_points"] == frfs
            memory = cost.peak / 1e6, cost.above_idle / 1e6
            runs.append(
                (len(file) / 1e6, peer, bound.clock, cost.clock, cost.clock / peer, *memory)
            )
    return [statistics.median(column) for column in zip(*runs, strict=True)]


def _spectra(api: httpx.Client, service: LocalService, lines: int) -> None:
    (campaign,), real = (
        campaigns_of(api, "spectra"),
        np.random.default_rng(2).standard_normal((2, 100, lines)),
    )
    given = {"frequency_hz": np.arange(lines) * 0.5, "values": real[0] + 1j * real[1]}
    dofs = {
        "response_point": np.arange(1, 101),
        "response_direction": 3,
        "reference_point": 1,
        "reference_direction": 3,
    }
    npz = {"Content-Type": "application/x-npz"}
    api.post(
        f"campaigns/{campaign}/frfs", content=_npz(**given, **dofs), headers=npz
    ).raise_for_status()
    address = f"campaigns/{campaign}/frfs/data?format=npz"

    def over_http() -> None:
        with np.load(io.BytesIO(api.get(address).raise_for_status().content)) as got:
            assert got["values"].shape == (100, lines)

    with psycopg.connect(psycopg_url(service.settings.database_url)) as connection:
        query = "SELECT data FROM frfs WHERE campaign_id = %s ORDER BY id"

        def select() -> None:
            rows = connection.execute(query, [campaign], binary=True).fetchall()
            assert len([np.frombuffer(row[0], "<c16") for row in rows]) == 100

        turns = [[timed(call)[1][0] for call in (select, over_http)] for _ in range(25)]
    raw, http = (statistics.median(column) for column in zip(*turns, strict=True))
    print(
        f"\n100 FRFs × {lines} lines, medians of 25 turns, {load()} (target: at most 3 × a raw"
        " SELECT)"
    )
    print(
        f"raw SELECT {1000 * raw:.1f} ms, npz over HTTP {1000 * http:.1f} ms, ratio"
        f" {http / raw:.2f}"
    )


def _npz(**arrays: object) -> bytes:
    file = io.BytesIO()
    np.savez(file, **arrays)  # type: ignore[arg-type]  # whatever numpy makes an array of
    return file.getvalue()


def _listing(api: httpx.Client, service: LocalService, sizes: tuple[int, int]) -> None:
    campaigns = campaigns_of(api, "rows", 2)
    with psycopg.connect(psycopg_url(service.settings.database_url), autocommit=True) as connection:
        middles = [_fill(connection, c, rows) for c, rows in zip(campaigns, sizes, strict=True)]
        connection.execute("VACUUM ANALYZE frfs")
        connection.execute("CHECKPOINT")
    title = f"\npage of 100 FRFs, medians of 31 turns, {load()} (target: flat within 1.5 times)"
    table = Table(title, "rows:10", "first ms:.1f", "deep ms:.1f", "by point ms:.1f")
    taken = np.empty((31, 2, 3))
    for turn in range(31):  # by turns, so that the machine's load is the same for both
        for size, (campaign, middle) in enumerate(zip(campaigns, middles, strict=True)):
            cursor = base64.urlsafe_b64encode(middle).rstrip(b"=").decode()
            for kind, query in enumerate(("", f"?cursor={cursor}", "?point=7")):
                path = f"campaigns/{campaign}/frfs{query}"
                taken[turn, size, kind] = timed(lambda path=path: api.get(path).raise_for_status())[
                    1
                ][0]
    times = 1000 * np.median(taken, axis=0)
    for rows, row in zip((*sizes, "ratio"), (*times, times[1] / times[0]), strict=True):
        table.row(rows, *row)


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
    return middle[0].bytes


def backup(frfs: int = 10_000, lines: int = 801) -> None:
    """A backup of so many FRFs while the service runs, and its restore into a data folder and into
    an empty server.
    """
    with (
        tempfile.TemporaryDirectory(prefix="mb-") as name,
        served() as service,
        api_of(service) as api,
    ):
        folder = Path(name)
        folder.chmod(0o755)  # the server may run as a user of its own
        sent, file = folder / "frfs.uff", folder / "all.modalbase"
        write_file(sent, contents(frfs, lines), binary=True)
        (campaign,) = campaigns_of(api, "backup")
        ended(
            api, api.post(f"campaigns/{campaign}/imports", content=sent.read_bytes(), headers=RAW)
        )
        table = Table(f"{frfs} FRFs × {lines} lines, {load()}", "what:28", "s:.1f", "MB:.0f")

        def shown(what: str, *words: str, **settings: str) -> None:
            seconds = timed(lambda: run(*words, **settings))[1][0]
            table.row(what, seconds, file.stat().st_size / 1e6)

        shown("backup", "backup", str(file), MODALBASE_DATABASE_URL=service.settings.database_url)
        shown("restore, data folder", "restore", str(file), "--data", str(folder / "data"))
        with embedded_server(folder / "empty") as url:
            shown("restore, empty server", "restore", str(file), MODALBASE_DATABASE_URL=url)


# --- hits ---------------------------------------------------------------------------------------------------------------

SAMPLES, RATE_HZ, AT_A_POINT, IN_A_FILE = 16_384, 12_800.0, 5, 50


def _mapping(**more: object) -> dict[str, str]:
    """The query of a file of hits."""
    channels = [
        {"variable": "force", "quantity": "force", "point": {"variable": "point"}},
        {"variable": "acceleration", "quantity": "acceleration", "point": 999_999},
    ]
    return {"filename": "hits.npz", "mapping": json.dumps({"channels": channels, **more})}


def many_hits(hits: int = 10_000) -> None:
    """Hits uploaded and processed, beside reading the same files, one transform a block, and COPY.

    The first COPY is not shown: it makes the files of the log, which the others use again.
    """
    with (
        served() as service,
        api_of(service) as api,
        tempfile.TemporaryDirectory(prefix="mb-") as folder,
    ):
        files = _write_files(Path(folder), hits)
        size = sum(path.stat().st_size for path in files)
        title = (
            f"{hits} hits of {SAMPLES} samples in {len(files)} files, {size / 2**20:.0f} MB,"
            f" {load()}"
        )
        table = Table(title, "what:28", "clock s:.1f", "processor s:.1f", "peak MB:.0f")

        def shown(name: str, cost: Cost) -> Cost:
            table.row(name, cost.clock, cost.processor, cost.above_idle / 2**20)
            return cost

        bound = shown("reading and transforms", _alone(files))
        rows = [[os.urandom(4 * SAMPLES)] * 2 * IN_A_FILE] * (size // (8 * SAMPLES * IN_A_FILE))
        copied(service, rows)
        stored = shown("PostgreSQL alone, one COPY", copied(service, rows))
        (campaign,) = campaigns_of(api, "many hits")
        query = _mapping(sample_rate_hz=RATE_HZ, hit={"variable": "hit"})

        def send(path: Path) -> None:
            with path.open("rb") as file:
                body = iter(lambda: file.read(1 << 20), b"")
                api.post(
                    f"campaigns/{campaign}/records", content=body, params=query, headers=RAW
                ).raise_for_status()

        with measured(service) as imported, ThreadPoolExecutor(2) as pool:
            list(pool.map(send, files))
        shown("import over HTTP", imported)
        with measured(service) as processed:
            ended(api, api.post(f"campaigns/{campaign}/processings", json={}))
        shown("processing, default band", processed)
    for what, cost, floor in (
        ("import, over reading and transforms", imported, bound),
        ("processing, over reading and transforms", processed, bound),
        ("import, over one COPY", imported, stored),
    ):
        own = cost.processor / floor.processor
        print(
            f"{what}: {cost.clock / floor.clock:.1f} times by the clock, {own:.1f} by the"
            " processors"
        )


def _write_files(folder: Path, hits: int) -> list[Path]:
    """Npz files of hits on a body of one mode, with white noise; ten points of five in each."""
    rng, t, paths = np.random.default_rng(1), np.arange(SAMPLES) / RATE_HZ - 0.05, []
    pulse, ring = (
        np.exp(-((t / 4e-4) ** 2)),
        np.where(t > 0, np.exp(-8 * t) * np.sin(2 * np.pi * 200 * t), 0.0),
    )
    for first in range(0, hits, IN_A_FILE):
        number = np.arange(first, min(first + IN_A_FILE, hits))
        heights = rng.uniform(50, 100, (number.size, 1))
        noise = np.float32(0.05) * rng.standard_normal((2, number.size, SAMPLES), np.float32)
        force, ringing = (
            (heights * x).astype(np.float32) + n for x, n in zip((pulse, ring), noise, strict=True)
        )
        point, hit = 1 + number // AT_A_POINT, 1 + number % AT_A_POINT
        paths.append(folder / f"{first}.npz")
        np.savez(paths[-1], force=force, acceleration=ringing, point=point, hit=hit)
    return paths


def _alone(files: Sequence[Path]) -> Cost:
    def read() -> None:
        for path in files:
            with np.load(path) as arrays:
                for block in (*arrays["force"], *arrays["acceleration"]):
                    fft.rfft(block.astype(float))

    return Cost(*timed(read)[1])


def live_hits(points: int = 10) -> None:
    """How long each answer takes that says whether a hit was good, one request each; a fifth of the
    hits has a fault.
    """
    _, _, simulated = hit_campaign(np.random.default_rng(18), "free", points, 5, 0.2)
    with served() as service, api_of(service) as api:
        (campaign,), query = campaigns_of(api, "live"), _mapping(sample_rate_hz={"variable": "fs"})
        took, found = [], 0
        for one in simulated:
            force, ringing = (
                x.samples.astype(np.float32) for x in (one.hit.force, one.hit.responses[0])
            )
            body = _npz(
                force=force,
                acceleration=ringing,
                point=one.hit.force.dof.point,
                fs=one.hit.sample_rate_hz,
            )
            start = time.perf_counter()
            answer = api.post(
                f"campaigns/{campaign}/records", content=body, params=query, headers=RAW
            )
            took.append(1e3 * (time.perf_counter() - start))
            found += answer.raise_for_status().json()["hits"][-1]["accepted"] == (one.fault is None)
    middle, most = np.percentile(took, (50, 95))
    print(
        f"{len(took)} hits of {simulated[0].hit.samples} samples, one request each: p50"
        f" {middle:.0f} ms, ",
        end="",
    )
    print(
        f"p95 {most:.0f} ms, longest {max(took):.0f} ms; judged as they are: {found} of {len(took)}"
    )
