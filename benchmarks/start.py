"""How long `modalbase up` takes on a data folder that is there: from the command to the first 200 of `/readyz`, asked every
20 ms, and to the line with the key; and the processor time of all processes but PostgreSQL's.
"""

from __future__ import annotations

import http.client
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from http import HTTPStatus
from pathlib import Path

import psutil

from service.app.supervisor import listening_socket

STARTS = 9
LOOK_SECONDS = 0.02


def start(data: Path) -> tuple[float, float, float]:
    """Seconds to readiness, seconds to the last line, and processor seconds until then."""
    with listening_socket("127.0.0.1", 0) as free:
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "service", "up", "--port", str(port), "--data", str(data)]
    began = time.perf_counter()
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, env=os.environ | {"MODALBASE_LOG_LEVEL": "warning"}
    ) as up:
        assert up.stdout is not None
        while not _ready(port):
            if up.poll() is not None:
                raise RuntimeError("it ended; what it wrote says why")
            time.sleep(LOOK_SECONDS)
        ready = time.perf_counter() - began
        while "API key" not in up.stdout.readline():
            pass
        whole, worked = time.perf_counter() - began, _processor_seconds(up.pid)
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


def _processor_seconds(pid: int) -> float:
    command = psutil.Process(pid)
    times = [process.cpu_times() for process in (command, *command.children(recursive=True))]
    ended = command.cpu_times()
    return sum(one.user + one.system for one in times) + ended.children_user + ended.children_system


def main() -> None:
    """Start it so often, and once before that which is not counted, as it makes the folder."""
    with tempfile.TemporaryDirectory(prefix="mb-") as name:
        Path(name).chmod(0o755)  # the server may run as a user of its own
        data = Path(name) / "data"
        start(data)
        found = [start(data) for _ in range(STARTS)]
    for what, values in zip(("ready", "last line", "processor"), zip(*found, strict=True), strict=True):
        print(f"  {what:<10} {statistics.median(values):.2f} s, {min(values):.2f} to {max(values):.2f}")
