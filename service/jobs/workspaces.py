"""Folders of attempts, below one of the worker's own; what a killed worker left is cleared away by the next one.

That a worker lives is known by its lock on a file, which the operating system drops however the worker dies.
"""

from __future__ import annotations

import getpass
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import structlog
from fasteners import InterProcessLock

PREFIX = "modalbase-worker-"
LOCK = ".alive"
GATE = "modalbase-workers-{}.lock"  # a user each: files in a shared folder belong to who made them


log = structlog.stdlib.get_logger("modalbase.worker")


@contextmanager
def worker_folder() -> Iterator[Path]:
    """A folder for the workspaces of this worker while the block runs; those of dead workers are removed first."""
    everyones = Path(tempfile.gettempdir())
    with InterProcessLock(everyones / GATE.format(getpass.getuser())):
        for folder in everyones.glob(f"{PREFIX}*"):
            _clear_if_dead(folder)
        own = Path(tempfile.mkdtemp(prefix=PREFIX))
        alive = InterProcessLock(own / LOCK)
        alive.acquire()
    try:
        yield own
    finally:
        alive.release()
        shutil.rmtree(own, ignore_errors=True)


@contextmanager
def workspace(folder: Path) -> Iterator[Path]:
    """A folder of one attempt."""
    with tempfile.TemporaryDirectory(dir=folder, ignore_cleanup_errors=True) as own:
        yield Path(own)


def _clear_if_dead(folder: Path) -> None:
    """Remove a dead worker's folder. The caller holds the gate, so no worker is between making and locking one."""
    try:
        if folder.is_symlink() or not os.access(folder, os.W_OK):
            return
        lock = InterProcessLock(folder / LOCK)
        if lock.acquire(blocking=False):
            shutil.rmtree(folder, ignore_errors=True)
            lock.release()
    except OSError as error:
        log.warning("a dead worker's folder could not be removed", folder=str(folder), error=str(error))
