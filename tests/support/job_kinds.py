"""Kinds of job for the tests, and a worker that runs them: `python job_kinds.py` with the settings in the environment."""

from __future__ import annotations

import hashlib
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from uuid import UUID

import numpy as np
from sqlalchemy import select
from sqlalchemy.orm import Session

from fecore.errors import InputError
from service.access.tables import AuditEvent
from service.jobs.kinds import JobKind, Report
from service.jobs.tables import Job

MIB = 1024 * 1024
GATE = "MODALBASE_TEST_GATE"


def load(session: Session, job_id: UUID, workspace: Path) -> dict[str, Any]:
    kind = session.scalars(select(Job.kind).where(Job.id == job_id)).one()
    (workspace / "input.txt").write_text(kind)
    return {"file": str(workspace / "input.txt"), "worker": os.getpid()}


def store(session: Session, job_id: UUID, items: Iterator[Any]) -> None:
    """Each item becomes a row; audit events are a table at hand."""
    for item in items:
        session.add(AuditEvent(action="test.item", subject_type="job", subject_id=job_id, detail={"value": item}))
        session.flush()


def load_badly(session: Session, job_id: UUID, workspace: Path) -> None:
    raise LookupError(f"nothing to load for {job_id} in {session} and {workspace}")


def store_half(session: Session, job_id: UUID, items: Iterator[Any]) -> None:
    store(session, job_id, iter([next(items)]))
    raise ZeroDivisionError


def echo(inputs: dict[str, Any], report: Report) -> Iterator[Any]:
    report("reading", 0.25)
    yield Path(inputs["file"]).read_text()
    report("writing", 0.75)
    yield inputs | {"child": os.getpid(), "threads": os.environ["OPENBLAS_NUM_THREADS"]}


def hold(report: Report, step: int) -> None:
    """Wait in this step, and say so, until the test opens the gate that it gave the worker, if any (`working.Gate`)."""
    if GATE in os.environ:
        report(f"held in step {step}", step / 40)
        while not (Path(os.environ[GATE]) / str(step)).exists():
            time.sleep(0.01)


def slow(_: dict[str, Any], report: Report) -> Iterator[Any]:
    """Forty steps, of which every tenth gives a row; held in the 10th and the 20th."""
    for step in range(40):
        report("stepping", step / 40)
        if step % 10 == 0:
            yield step
        if step in (10, 20):
            hold(report, step)
    yield os.getpid()


def stubborn(_: dict[str, Any], report: Report) -> Iterator[Any]:
    """Holds the GIL in LAPACK for seconds on end, without end."""
    matrix = np.random.default_rng(0).standard_normal((1500, 1500))
    while True:
        report(f"factorising in process {os.getpid()}", 0.5)
        if np.linalg.eigvals(matrix).size == 0:
            yield "never"


def hungry(_: dict[str, Any], report: Report) -> Iterator[Any]:
    report("eating", 0.1)
    yield "a first item, which must not stay"
    held = []
    while True:
        held.append(np.ones(MIB))  # 8 MiB each


def crashing(_: dict[str, Any], report: Report) -> Iterator[Any]:
    report("crashing", 0.1)
    yield "a first item, which must not stay"
    os.kill(os.getpid(), signal.SIGSEGV)


def refusing(_: dict[str, Any], report: Report) -> Iterator[Any]:
    report("checking", 0.1)
    yield "a first item, which must not stay"
    raise InputError("geometry.length_m", "is 0, expected more")


def buggy(_: dict[str, Any], report: Report) -> Iterator[Any]:
    report("erring", 0.1)
    yield {}["missing"]


def chain(_: dict[str, Any], report: Report) -> Iterator[Any]:
    """A long computation that saves its state: steps done, and a digest that depends on every step; held in the 20th."""
    begun = step = int.from_bytes(report.restored[:2]) if report.restored else 0
    digest = report.restored[2:] if report.restored else b""
    while step < 40:
        digest = hashlib.sha256(digest + bytes([step])).digest()
        step += 1
        report("sampling", step / 40)
        if step % 5 == 0:
            report.checkpoint(step.to_bytes(2) + digest)
        if step == 20:
            hold(report, step)
    yield {"begun at": begun, "digest": digest.hex()}


KINDS = {
    kind.name: kind
    for kind in (
        JobKind("echo", load=load, compute=echo, store=store),
        JobKind("slow", load=load, compute=slow, store=store),
        JobKind("stubborn", load=load, compute=stubborn, store=store),
        JobKind("overdue", load=load, compute=stubborn, store=store, wall_seconds=0.5),
        JobKind("hungry", load=load, compute=hungry, store=store, memory_bytes=200 * MIB),
        JobKind("crashing", load=load, compute=crashing, store=store),
        JobKind("refusing", load=load, compute=refusing, store=store),
        JobKind("buggy", load=load, compute=buggy, store=store),
        JobKind("chain", load=load, compute=chain, store=store),
        JobKind("bad load", load=load_badly, compute=echo, store=store),
        JobKind("bad store", load=load, compute=echo, store=store_half),
    )
}

if __name__ == "__main__":
    from service.jobs.worker import run_worker
    from service.logs import configure_logs
    from service.settings import Settings

    configure_logs(Settings())
    run_worker(Settings(), tuple(KINDS.values()))
