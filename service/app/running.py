"""Which services run on this machine for this user: each `modalbase up` leaves a note, which ends
with it.

The other commands read the notes, so that `modalbase keys create` reaches the service that runs
without being given its data folder.
"""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

import psutil

from modalbase.client.endpoint import notes_folder

CLOCK_SECONDS = 2.0
"""A process' start is known relative to the machine's, which moves a little where the clock is
set.
"""


@dataclass(frozen=True)
class RunningService:
    """A `modalbase up` that runs."""

    pid: int  # its process
    # when that started, seconds since 1970; a later process with the same id has another
    began: float
    url: str  # where its API is
    data: str | None  # its data folder; None where its database is a server of its own


@contextmanager
def announced(url: str, data: Path | None) -> Iterator[None]:
    """Leave a note of this process' service while the block runs."""
    folder = notes_folder()
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    pid = os.getpid()
    note = RunningService(
        pid, psutil.Process(pid).create_time(), url, None if data is None else str(data)
    )
    file = folder / f"{pid}.json"
    new = file.with_suffix(".new")
    new.write_text(json.dumps(asdict(note)), encoding="utf-8")
    new.replace(file)
    try:
        yield
    finally:
        file.unlink(missing_ok=True)


def running_services() -> list[RunningService]:
    """The services that run; notes of those that were killed are cleared away."""
    running = []
    for file in sorted(notes_folder().glob("*.json")):
        try:
            note = RunningService(**json.loads(file.read_text(encoding="utf-8")))
            alive = abs(psutil.Process(note.pid).create_time() - note.began) < CLOCK_SECONDS
        except (FileNotFoundError, psutil.NoSuchProcess, ValueError, TypeError):
            alive = False
        if alive:
            running.append(note)
        else:
            file.unlink(missing_ok=True)
    return running
