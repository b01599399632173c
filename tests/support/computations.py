"""What the tests' kinds of job compute, in a module without database and web, as theirs is in the
service.
"""

import hashlib
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from fecore.errors import InputError, UpdatingError
from service.platform.queue.kinds import Reporter

MIB = 1024 * 1024
GATE = "MODALBASE_TEST_GATE"


def echo(inputs: dict[str, Any], report: Reporter) -> Iterator[Any]:
    report("reading", 0.25)
    yield Path(inputs["file"]).read_text()
    report("writing", 0.75)
    yield inputs | {"child": os.getpid(), "threads": os.environ["OPENBLAS_NUM_THREADS"]}


def hold(inputs: dict[str, Any], report: Reporter, step: int) -> None:
    """Wait in this step, and say so, until the test opens the gate that it gave the worker, if any
    (`working.Gate`).
    """
    if GATE in os.environ:
        report(f"held in step {step}", step / 40)
        while not (Path(os.environ[GATE]) / f"{inputs['job']} {step}").exists():
            time.sleep(0.01)


def slow(inputs: dict[str, Any], report: Reporter) -> Iterator[Any]:
    """Forty steps, of which every tenth gives a row; held in the 10th and the 20th."""
    for step in range(40):
        report("stepping", step / 40)
        if step % 10 == 0:
            yield step
        if step in (10, 20):
            hold(inputs, report, step)
    yield os.getpid()


def stubborn(_: dict[str, Any], report: Reporter) -> Iterator[Any]:
    """Holds the GIL in LAPACK for seconds on end, without end."""
    matrix = np.random.default_rng(0).standard_normal((1500, 1500))
    while True:
        report(f"factorising in process {os.getpid()}", 0.5)
        if np.linalg.eigvals(matrix).size == 0:
            yield "never"


def hungry(_: dict[str, Any], report: Reporter) -> Iterator[Any]:
    report("eating", 0.1)
    yield "a first item, which must not stay"
    held = []
    while True:
        held.append(np.ones(MIB))  # 8 MiB each


def crashing(_: dict[str, Any], report: Reporter) -> Iterator[Any]:
    report("crashing", 0.1)
    yield "a first item, which must not stay"
    os.kill(os.getpid(), signal.SIGSEGV)


def refusing(_: dict[str, Any], report: Reporter) -> Iterator[Any]:
    report("checking", 0.1)
    yield "a first item, which must not stay"
    raise InputError("geometry.length_m", "is 0, expected more")


def diverging(_: dict[str, Any], report: Reporter) -> Iterator[Any]:
    report("fitting", 0.1)
    yield "a first item, which must not stay"
    raise UpdatingError("the fit has run away", {"Ex": float("nan")}, (1.0, float("inf")))


def buggy(_: dict[str, Any], report: Reporter) -> Iterator[Any]:
    report("erring", 0.1)
    yield {}["missing"]


def chain(inputs: dict[str, Any], report: Reporter) -> Iterator[Any]:
    """A long computation that saves its state: steps done, and a digest that depends on every step;
    held in the 20th.
    """
    begun = step = int.from_bytes(report.restored[:2]) if report.restored else 0
    digest = report.restored[2:] if report.restored else b""
    while step < 40:
        digest = hashlib.sha256(digest + bytes([step])).digest()
        step += 1
        report("sampling", step / 40)
        if step % 5 == 0:
            report.checkpoint(step.to_bytes(2) + digest)
        if step == 20:
            hold(inputs, report, step)
    yield {"begun at": begun, "digest": digest.hex()}


def busy(inputs: dict[str, Any], report: Reporter) -> Iterator[dict[str, Any]]:
    """Keep a processor busy for so many seconds, in ten steps."""
    for step in range(10):
        report(f"step {step + 1} of 10", step / 10)
        end = time.thread_time() + inputs["seconds"] / 10
        while time.thread_time() < end:
            pass
    yield {"job": inputs["job"], "child": os.getpid()}


def idle(inputs: dict[str, Any], report: Reporter) -> Iterator[dict[str, Any]]:
    """Take so many seconds, in ten steps, and leave the processor to others."""
    for step in range(10):
        report(f"step {step + 1} of 10", step / 10)
        time.sleep(inputs["seconds"] / 10)
    yield {"job": inputs["job"], "child": os.getpid()}


def empty(_: None, report: Reporter) -> Iterator[None]:
    """Nothing at all."""
    report("nothing", 1.0)
    return iter(())
