"""What a kind of job is made of: load in the worker, compute in a child process, store in one
transaction.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol
from uuid import UUID

if TYPE_CHECKING:
    from sqlalchemy.orm import Session


class Reporter(Protocol):
    """What a computation has of the world outside: it says how far it is, and saves what a restart
    goes on from.

    A long computation resumes like this::

        chain = read(report.restored) if report.restored is not None else start(inputs)
        while chain.step < steps:
            chain.advance()
            report("sampling", chain.step / steps)
            if chain.step % 100 == 0:
                report.checkpoint(chain.to_bytes())

    A checkpoint holds everything that the rest depends on, the state of the random generator
    included, so that a resumed computation gives the same bits as one that was not interrupted.
    """

    restored: bytes | None
    """The last checkpoint of an earlier attempt at this job, or None where there is none."""

    def __call__(self, stage: str, progress: float) -> None:
        """Report; as often as the computation likes.

        Args:
            stage: what is being done, in words, such as `fitting damping`.
            progress: share of the whole job that is done, 0 to 1.
        """

    def checkpoint(self, data: bytes) -> None:
        """Save a state to go on from, in place of the one before. It is gone when the job ends.

        Args:
            data: what `restored` will be, 64 MiB at most. Not pickles: a worker of a later version
                may read it.

        Raises:
            ValueError: the state is too large.
        """


Compute = Callable[[Any, Reporter], Iterator[Any]]

CORE_LIBRARIES = tuple(
    f"scipy.{part}"
    for part in ("fft", "linalg", "ndimage", "optimize", "sparse.linalg", "special", "stats.qmc")
)
"""What of scipy the core uses: it loads each part when it first uses it. To load `stats`, for draws
of starts, takes 0.3 s.
"""


JOBS, REQUESTS = "jobs", "requests"
"""Names of the queues. In `requests` waits what a client waits for; a worker keeps one place more
for it, so that a file which a script sends is read while an update runs.
"""


@dataclass(frozen=True)
class JobKind:
    """A kind of job.

    Attributes:
        name: as stored in `jobs.kind`.
        load: (session, job id, workspace) -> inputs. In the worker, in a transaction of its own.
            The workspace is a folder of this attempt, gone afterwards; large inputs go there as
            files. The inputs must pickle.
        compute: (inputs, report) -> items. A generator function at the top of a module that imports
            no database and no web (the child imports it). Runs in the child process; yields items
            that pickle, and is held up while `store` is behind, so memory stays bounded. A
            `FecoreError` or `ServiceError` that it raises is the job's failure, shown to the user;
            anything else is reported as an internal error.
        store: (session, job id, items) -> None. In the worker; consumes the items as the child
            yields them, in one transaction that is committed with the state `succeeded`, or not at
            all.
        queue: name of the queue that its jobs wait in, where nothing else is said.
        max_attempts: how many workers may die with a job before it is given up.
        memory_bytes: memory that the child may take beyond that of an idle one; None: as the
            settings say.
        wall_seconds: time that an attempt may take; None: as the settings say.
        libraries: what `compute` loads when it first uses it, so that it is there before children
            are forked.
    """

    name: str
    load: Callable[[Session, UUID, Path], Any]
    compute: Compute
    store: Callable[[Session, UUID, Iterator[Any]], None]
    queue: str = JOBS
    max_attempts: int = 3
    memory_bytes: int | None = None
    wall_seconds: float | None = None
    libraries: tuple[str, ...] = ()
