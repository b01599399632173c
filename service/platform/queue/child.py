"""The child process: where the numbers are made. This side of the pipe runs in the child.

A child is forked from a server process that has the libraries loaded already, so it starts in some
20 ms. It has a memory limit, and it dies with its worker: the kernel kills it with the fork server,
which ends when the worker does (Linux), and a thread of its own ends it when the worker's end of a
pipe closes (everywhere).
"""

import ctypes
import os
import signal
import sys
import threading
import time
import traceback
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

from fecore.errors import FecoreError, InputError
from service.platform.errors import Invalid, ServiceError
from service.platform.queue.kinds import Compute

PR_SET_PDEATHSIG = 1
REPORT_SECONDS = 0.05
CHECKPOINT_BYTES = 64 * 1024 * 1024
NICENESS = 10
"""By how much a job gives way to whoever answers requests on the same machine: about a tenth of a
core while both want it.
"""
ORPHANED = 86  # exit status of a child whose worker is gone


@dataclass(frozen=True)
class Progress:
    """The computation has come so far."""

    stage: str
    share: float


@dataclass(frozen=True)
class Checkpoint:
    """The computation can go on from here."""

    data: bytes


@dataclass(frozen=True)
class Item:
    """The computation yielded something to store."""

    value: Any  # what
    size: int = 0  # bytes that it took on its way through the channel; set where it arrives


@dataclass(frozen=True)
class Failure:
    """Why a job failed, as kept in `jobs.error`."""

    # `refused` (the input or the data do not allow it), `memory`, `time`, `crash`, `lost` (its
    # workers died) or `internal`; `cancelled` and `drained` are no failures of the job
    reason: str
    type: str  # name of the error
    detail: str  # what the user reads
    field: str | None = None  # the faulty field, where there is one
    # JSON values that the error carries as `details`, such as the best iterate
    extra: dict[str, Any] | None = None
    trace: str | None = None  # stack trace of an internal error, for the log; not stored

    def shown(self) -> dict[str, Any]:
        """What clients read of it."""
        shown = {"reason": self.reason, "type": self.type, "detail": self.detail}
        return shown | ({} if self.field is None else {"field": self.field}) | (self.extra or {})


CANCELLED = Failure("cancelled", "Cancelled", "cancelled on request")
DRAINED = Failure("drained", "Drained", "the worker ended; queued again")
PURGED = Failure("cancelled", "Purged", "cancelled, as what it was for was purged")


@dataclass(frozen=True)
class Done:
    """The computation is complete."""


Message = Progress | Checkpoint | Item | Failure | Done


def storable(text: str) -> str:
    """A text that quotes a file, without what PostgreSQL cannot store: NUL characters and lone
    surrogates.
    """
    return text.replace("\0", "\N{REPLACEMENT CHARACTER}").encode(errors="replace").decode()


def failure_of(error: BaseException) -> Failure:
    """What an error means for the job."""
    name = type(error).__name__
    if isinstance(error, FecoreError | ServiceError):
        field = error.field if isinstance(error, InputError) else None
        details = getattr(error, "details", None)
        if isinstance(error, Invalid):
            field = error.faults[0].pointer
            faults = [
                {"pointer": fault.pointer, "detail": storable(fault.detail)}
                for fault in error.faults
            ]
            details = {"errors": faults, "error_count": error.count}
        return Failure("refused", name, storable(str(error)), field, details)
    if isinstance(error, MemoryError):
        return Failure("memory", name, "the job needs more memory than a job may take")
    trace = "".join(traceback.format_exception(error))
    return Failure(
        "internal", name, f"internal error ({name}); the worker's log has it", trace=trace
    )


@dataclass(frozen=True)
class Order:
    """What a child is to do."""

    compute: Compute  # the kind's computation
    inputs: Any  # what the kind's `load` gave
    restored: bytes | None  # the checkpoint of an earlier attempt
    memory_bytes: int  # memory beyond that of an idle child
    niceness: int = NICENESS  # how far it gives way to other processes


def run_child(channel: Connection, lifeline: Connection, order: Order) -> None:
    """Compute, and send what comes of it through the channel. Entry of the child process."""
    _die_with_worker(lifeline)
    # Ctrl-C is for the worker, which decides about its children
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _limit_memory(order.memory_bytes)
    os.nice(order.niceness)
    last: Message = Done()
    try:
        for value in order.compute(order.inputs, _Reporter(channel, order.restored)):
            channel.send(Item(value))
    except BaseException as error:  # noqa: BLE001  whatever it is, the worker gets it
        last = failure_of(error)
        error.__traceback__ = None  # lets go of what filled the memory
    channel.send(last)
    channel.close()


class _Reporter:
    """Sends each new stage at once, progress within one now and then, and every checkpoint."""

    def __init__(self, channel: Connection, restored: bytes | None) -> None:
        self.restored = restored
        self._channel = channel
        self._stage, self._time = "", -REPORT_SECONDS

    def __call__(self, stage: str, progress: float) -> None:
        now = time.monotonic()
        if stage != self._stage or now - self._time >= REPORT_SECONDS:
            self._stage, self._time = stage, now
            self._channel.send(Progress(stage, round(min(max(float(progress), 0.0), 1.0), 4)))

    def checkpoint(self, data: bytes) -> None:
        if len(data) > CHECKPOINT_BYTES:
            raise ValueError(
                f"a checkpoint of {len(data)} bytes, at most {CHECKPOINT_BYTES} are kept"
            )
        self._channel.send(Checkpoint(data))


def _die_with_worker(lifeline: Connection) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)

    def watch() -> None:
        try:
            lifeline.recv_bytes()
        except (EOFError, OSError):
            os._exit(ORPHANED)

    threading.Thread(target=watch, daemon=True, name="lifeline").start()


def _limit_memory(memory_bytes: int) -> None:
    """Limit the address space to what an idle child has mapped already plus `memory_bytes`
    (Linux).
    """
    if sys.platform != "linux":
        return
    import resource

    with open("/proc/self/statm") as statm:
        mapped = int(statm.read().split()[0]) * resource.getpagesize()
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    limit = mapped + memory_bytes
    resource.setrlimit(
        resource.RLIMIT_AS, (limit if hard == resource.RLIM_INFINITY else min(limit, hard), hard)
    )
