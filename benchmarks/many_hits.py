"""Ten thousand hits through a service: upload, storage and processing, beside reading the same files and transforming them.

Npz files of 50 hits (ten points of five, force and one response of 16,384 samples as float32) go to a service of its own,
two at a time, and one processing starts over the default band. What bounds it is measured in the same run: reading the
files and one transform a block; and what PostgreSQL alone needs to store the same bytes by COPY, over one connection and
over two. The first COPY is not shown: it makes the files of the log, which the others use again.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx
import numpy as np
from scipy import fft

from benchmarks.service import RAW, Cost, campaign_of, copied, ended, load, measured, served
from fecore.arrays import FloatArray

SAMPLES, RATE_HZ = 16_384, 12_800.0
AT_A_POINT, IN_A_FILE = 5, 50
SENDERS = 2
MAPPING = {
    "sample_rate_hz": RATE_HZ,
    "hit": {"variable": "hit"},
    "channels": [
        {"variable": "force", "quantity": "force", "point": {"variable": "point"}},
        {"variable": "acceleration", "quantity": "acceleration", "point": 999_999},
    ],
}


def main(hits: int = 10_000) -> None:
    """Print the table."""
    with served() as (service, api, folder):
        files = write_files(folder, hits)
        size = sum(path.stat().st_size for path in files)
        print(f"{hits} hits of {SAMPLES} samples in {len(files)} files, {size / 2**20:.0f} MB, {load()}")
        print(f"{'':28}{'clock s':>9}{'processor s':>13}{'peak MB':>9}")
        bound = _row("reading and transforms", _alone(files))
        rows = [[os.urandom(4 * SAMPLES)] * 2 * IN_A_FILE] * (size // (8 * SAMPLES * IN_A_FILE))
        copied(service, rows)
        stored = _row("PostgreSQL alone, one COPY", copied(service, rows))
        _row("PostgreSQL alone, two at once", copied(service, rows, 2))
        campaign = campaign_of(api, "many hits")
        with measured(service) as imported:
            _send(api, campaign, files)
        _row("import over HTTP", imported)
        with measured(service) as processed:
            ended(api, api.post(f"campaigns/{campaign}/processings", json={}))
        _row("processing, default band", processed)
    for what, cost, floor in (
        ("import, over reading and transforms", imported, bound),
        ("processing, over reading and transforms", processed, bound),
        ("import, over one COPY", imported, stored),
    ):
        own = cost.processor / floor.processor
        print(f"{what}: {cost.clock / floor.clock:.1f} times by the clock, {own:.1f} by the processors")


def write_files(folder: Path, hits: int) -> list[Path]:
    """Npz files of hits on a body of one mode, with white noise."""
    rng = np.random.default_rng(1)
    t = np.arange(SAMPLES) / RATE_HZ - 0.05
    pulse = np.exp(-((t / 4e-4) ** 2))
    ring = np.where(t > 0, np.exp(-8 * t) * np.sin(2 * np.pi * 200 * t), 0.0)
    paths = []
    for first in range(0, hits, IN_A_FILE):
        number = np.arange(first, min(first + IN_A_FILE, hits))
        heights = rng.uniform(50, 100, (number.size, 1))
        paths.append(folder / f"{first}.npz")
        np.savez(
            paths[-1],
            force=_noisy(rng, heights * pulse),
            acceleration=_noisy(rng, heights * ring),
            point=1 + number // AT_A_POINT,
            hit=1 + number % AT_A_POINT,
        )
    return paths


def _noisy(rng: np.random.Generator, clean: FloatArray) -> FloatArray:
    return clean.astype(np.float32) + np.float32(0.05) * rng.standard_normal(clean.shape, np.float32)


def _row(name: str, cost: Cost) -> Cost:
    print(f"{name:28}{cost.clock:9.1f}{cost.processor:13.1f}{cost.above_idle / 2**20:9.0f}", flush=True)
    return cost


def _alone(files: Sequence[Path]) -> Cost:
    clock, processor = time.perf_counter(), time.process_time()
    for path in files:
        with np.load(path) as arrays:
            for name in ("force", "acceleration"):
                for block in arrays[name]:
                    fft.rfft(block.astype(float))
    return Cost(time.perf_counter() - clock, time.process_time() - processor)


def _send(api: httpx.Client, campaign: str, files: Sequence[Path]) -> None:
    query = {"filename": "hits.npz", "mapping": json.dumps(MAPPING)}

    def send(path: Path) -> None:
        with path.open("rb") as file:
            body = iter(lambda: file.read(1 << 20), b"")
            api.post(f"campaigns/{campaign}/records", content=body, params=query, headers=RAW).raise_for_status()

    with ThreadPoolExecutor(SENDERS) as pool:
        list(pool.map(send, files))
