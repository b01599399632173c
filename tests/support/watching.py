"""What a process looks at while another is thrown at; it imports little, as it starts for one test."""

import http.client
import time
from multiprocessing.connection import Connection

import psutil


def watch(address: tuple[str, int], pid: int, channel: Connection) -> None:
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
