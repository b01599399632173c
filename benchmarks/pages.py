"""What a person waits for: a figure of three FRFs with the database, the report, and a result's page up to a drawn figure.

Processor time is that of the API's process; elapsed time is what the caller waits, the least and the middle of some repeats.
The page is the system's Chromium's, which keeps scripts; it is left out where there is none.
"""

from __future__ import annotations

import os
import shutil
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import httpx
import numpy as np

from service.app.demo.run import Laboratory
from service.app.supervisor import LocalService
from service.settings import Settings
from tests.support.browser import PROGRAMS, browser, watched_page
from tests.support.rest import ok

FIGURES, REPORTS, PAGES = 30, 3, 7


def main() -> None:
    """Print each cost beside its limit."""
    with tempfile.TemporaryDirectory(prefix="mb-") as data:
        settings = Settings(data=Path(data), port=0, log_level="error")
        with LocalService(settings) as service:
            key = service.new_key("benchmark")
            headers = {"Authorization": f"Bearer {key}"}
            with httpx.Client(base_url=service.url, headers=headers, timeout=60, trust_env=False) as api:
                job = Laboratory(api).update_beam()["provenance"]["update_job"]
                process = service.processes["api"].pid
                print(f"load average {os.getloadavg()[0]:.1f}")
                print(f"{'':32}{'processor ms':>14}{'least ms':>10}{'middle ms':>10}{'limit ms':>10}")
                for name, path, repeats, limit in (
                    ("FRF figure of three curves", "figures/frf", FIGURES, 30),
                    ("report, HTML", "report", REPORTS, 5000),
                    ("report, PDF", "report?format=pdf", REPORTS, 5000),
                ):
                    address = f"/api/v1/update-jobs/{job}/{path}"

                    def get(address: str = address) -> None:
                        ok(api.get(address)) if "report" not in address else api.get(address).raise_for_status()

                    _row(name, process, get, repeats, limit)
            if any(map(shutil.which, PROGRAMS)):
                _page(service.url, key, job, process)


def _row(name: str, process: int, once: Callable[[], None], repeats: int, limit: float) -> None:
    once()  # what is loaded and kept by the first
    began, times = _processor_seconds(process), []
    for _ in range(repeats):
        start = time.perf_counter()
        once()
        times.append(1e3 * (time.perf_counter() - start))
    used = 1e3 * (_processor_seconds(process) - began) / repeats
    print(f"{name:32}{used:14.1f}{min(times):10.0f}{float(np.median(times)):10.0f}{limit:10.0f}", flush=True)


def _processor_seconds(process: int) -> float:
    fields = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _page(url: str, key: str, job: str, process: int) -> None:
    """A result's page, from the request to the first figure that is drawn."""
    with browser() as running, watched_page(running, url) as seen:
        seen.page.goto("sign-in")
        seen.page.fill("#key", key)
        seen.page.press("#key", "Enter")
        seen.page.wait_for_url("**/ui/")
        marked = "performance.getEntriesByType('mark').find((mark) => mark.name.startsWith('drawn'))?.startTime ?? null"

        def visit() -> float:
            seen.page.goto(f"ui/update-jobs/{job}")
            seen.page.locator("figure[data-figure] .main-svg").first.wait_for(state="attached")
            while (at := seen.page.evaluate(marked)) is None:
                time.sleep(0.01)
            return float(at)

        visit()
        began = _processor_seconds(process)
        times = [visit() for _ in range(PAGES)]
        used = 1e3 * (_processor_seconds(process) - began) / PAGES
        print(f"{'page of a result, drawn':32}{used:14.1f}{min(times):10.0f}{float(np.median(times)):10.0f}{700:10.0f}")
