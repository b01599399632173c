"""What the jobs of the shop floor compute, in a module without database and web, as a worker's children want it."""

import os
import time
from collections.abc import Iterator
from typing import Any

from service.jobs.kinds import Report

STEPS = 10


def compute(inputs: dict[str, Any], report: Report) -> Iterator[dict[str, Any]]:
    """Keep a processor busy for so many seconds, in ten steps."""
    total = 0
    for step in range(STEPS):
        report(f"step {step + 1} of {STEPS}", step / STEPS)
        end = time.thread_time() + inputs["seconds"] / STEPS
        while time.thread_time() < end:
            total += 1
    yield {"job": inputs["job"], "child": os.getpid()}


def wait(inputs: dict[str, Any], report: Report) -> Iterator[dict[str, Any]]:
    """Take so many seconds, in ten steps, and leave the processor to others."""
    for step in range(STEPS):
        report(f"step {step + 1} of {STEPS}", step / STEPS)
        time.sleep(inputs["seconds"] / STEPS)
    yield {"job": inputs["job"], "child": os.getpid()}


def empty(_: None, report: Report) -> Iterator[None]:
    """Nothing at all."""
    report("nothing", 1.0)
    return iter(())
