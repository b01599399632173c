"""What a person waits for: `modalbase up`, a figure, a report, and a result's page up to a drawn
figure.

A start is timed from the command to the first 200 of `/readyz`, and to the line with the key. Of
figure, report and page it is the processor time of the API's process, and elapsed time, the least
and the middle of some repeats; the page is the system's Chromium's, which keeps scripts, and is
left out where there is none.
"""

import http.client
import os
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from pathlib import Path

import httpx
import numpy as np
import psutil

from benchmarks.service import processor_s, served
from benchmarks.tables import Table, load
from service.app.demo.run import Laboratory
from service.app.supervisor import listening_socket
from tests.support.browser import PROGRAMS, browser, watched_page
from tests.support.rest import plain_client


def start(times: int = 9) -> None:
    """`modalbase up` on an existing data folder; once before that, which is not counted, as it
    makes the folder.
    """
    with tempfile.TemporaryDirectory(prefix="mb-") as name:
        Path(name).chmod(0o755)  # the server may run as a user of its own
        found = [_start(Path(name) / "data") for _ in range(times + 1)][1:]
    table = Table("", "until:10", "median s:.2f", "least:.2f", "most:.2f")
    for what, values in zip(
        ("ready", "last line", "processor"), zip(*found, strict=True), strict=True
    ):
        table.row(what, statistics.median(values), min(values), max(values))


def _start(data: Path) -> tuple[float, float, float]:
    """Seconds to readiness, to the last line, and of the processor until then, without
    PostgreSQL's.
    """
    with listening_socket("127.0.0.1", 0) as free:
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "service", "up", "--port", str(port), "--data", str(data)]
    quiet = os.environ | {"MODALBASE_LOG_LEVEL": "warning"}
    began = time.perf_counter()
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=quiet) as up:
        while not _ready(port):
            if up.poll() is not None:
                raise RuntimeError("it ended; what it wrote says why")
            time.sleep(0.02)
        ready = time.perf_counter() - began
        while "API key" not in up.stdout.readline():
            pass
        whole, worked = time.perf_counter() - began, processor_s(up.pid)
        up.send_signal(signal.SIGINT)
        up.stdout.read()
    return ready, whole, worked


def _ready(port: int) -> bool:
    line = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
    try:
        line.request("GET", "/readyz")
        return line.getresponse().status == HTTPStatus.OK
    except OSError:
        return False
    finally:
        line.close()


def pages(figures: int = 30, reports: int = 3, visits: int = 7) -> None:
    """Figure, report and drawn page of a result, beside their limits."""
    with (
        served() as service,
        plain_client(
            service.url, {"Authorization": f"Bearer {service.new_key('reader')}"}, httpx.Limits()
        ) as api,
    ):
        job = Laboratory(api).update_beam()["provenance"]["update_job"]
        process = psutil.Process(service.processes["api"].pid)
        columns = ("processor ms:.1f", "least ms:.0f", "middle ms:.0f", "limit ms:d")
        table = Table(load(), "what:32", *columns)
        for name, path, repeats, limit in (
            ("FRF figure of three curves", "figures/frf", figures, 30),
            ("report, HTML", "report", reports, 5000),
            ("report, PDF", "report?format=pdf", reports, 5000),
        ):

            def get(path: str = path) -> float:
                began = time.perf_counter()
                api.get(f"/api/v1/update-jobs/{job}/{path}").raise_for_status()
                return 1e3 * (time.perf_counter() - began)

            table.row(name, *_cost(process, get, repeats), limit)
        if any(map(shutil.which, PROGRAMS)):
            with _page(service.url, service.new_key("reader"), job) as visit:
                table.row("page of a result, drawn", *_cost(process, visit, visits), 700)


def _cost(
    process: psutil.Process, once: Callable[[], float], repeats: int
) -> tuple[float, float, float]:
    """Of calls that give their milliseconds: those of the processor, the least, the middle."""
    once()  # what is loaded and kept by the first
    began = sum(process.cpu_times()[:2])
    times = [once() for _ in range(repeats)]
    used = 1e3 * (sum(process.cpu_times()[:2]) - began) / repeats
    return used, min(times), float(np.median(times))


@contextmanager
def _page(url: str, key: str, job: str) -> Iterator[Callable[[], float]]:
    """A call that opens a result's page and gives milliseconds from the request to the first figure
    that is drawn.
    """
    marked = (
        "performance.getEntriesByType('mark').find((mark) =>"
        " mark.name.startsWith('drawn'))?.startTime ?? null"
    )
    with browser() as running, watched_page(running, url) as seen:
        seen.page.goto("sign-in")
        seen.page.fill("#key", key)
        seen.page.press("#key", "Enter")
        seen.page.wait_for_url("**/ui/")

        def visit() -> float:
            seen.page.goto(f"ui/update-jobs/{job}")
            seen.page.locator("[data-frf-viewer] .uplot").first.wait_for(state="attached")
            while (at := seen.page.evaluate(marked)) is None:
                time.sleep(0.01)
            return float(at)

        yield visit
