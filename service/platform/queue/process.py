"""The child process seen from the worker: start, listen, kill, and say why it ended."""

import multiprocessing
import os
import pickle
import signal
import sys
import tempfile
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from multiprocessing import connection, forkserver
from typing import Any

import psutil

from service.platform.queue.child import (
    Checkpoint,
    Done,
    Failure,
    Item,
    Message,
    Order,
    Progress,
    run_child,
)
from service.platform.queue.kinds import JobKind

_METHOD = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
_context: Any = multiprocessing.get_context(_METHOD)  # the contexts have no common type

PRELOADED = ("numpy", "service.platform.queue.child")
CHANNEL_BYTES = 1024 * 1024
SERVER_GONE = (
    # what multiprocessing gives as the status of a child whose fork server is gone; the kernel
    # killed it too
    255
)
_asking = threading.Lock()
"""Held while the status of a process is asked for, which multiprocessing does for all of them when
one starts: the status can be read once, and a number of a file that was closed meanwhile may be
that of another file.
"""
LOST = Failure("lost", "ForkServerDied", "the process that starts computations was killed")
THREAD_COUNTS = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)


def prepare_children(kinds: Iterable[JobKind], threads: int) -> None:
    """Start the server that children are forked from, with the libraries of every kind loaded.

    Args:
        kinds: whose libraries.
        threads: BLAS threads of a child, which must be set before the libraries are loaded.
    """
    kinds = tuple(kinds)
    libraries = {library for kind in kinds for library in kind.libraries}
    preload(libraries | {kind.compute.__module__ for kind in kinds}, threads)


def preload(modules: Iterable[str], threads: int) -> None:
    """Start the server that children are forked from, with these modules loaded."""
    for name in THREAD_COUNTS:
        os.environ[name] = str(threads)
    if _METHOD == "forkserver":
        _context.set_forkserver_preload([*PRELOADED, *sorted(modules)])
        with _short_folder():
            forkserver.ensure_running()


@contextmanager
def _short_folder() -> Iterator[None]:
    """Within this, temporary files have a folder in which a socket may be: the path of one has at
    most 107 bytes.
    """
    usual = tempfile.gettempdir()
    if len(os.fsencode(f"{usual}/pymp-12345678/listener-12345678")) > 107:
        tempfile.tempdir = "/tmp"
    try:
        yield
    finally:
        tempfile.tempdir = usual


def dismiss_children() -> None:
    """End the fork server, and with it every child, so that nothing outlives the worker."""
    ours = [process for process in psutil.Process().children() if _is_fork_server(process)]
    for process in ours:
        process.kill()
    psutil.wait_procs(ours)


def _is_fork_server(process: psutil.Process) -> bool:
    try:
        return any("multiprocessing.forkserver" in word for word in process.cmdline())
    except psutil.NoSuchProcess:
        return False


class ChildEnded(Exception):  # noqa: N818
    """The computation did not complete.

    Attributes:
        failure: why.
    """

    def __init__(self, failure: Failure) -> None:
        super().__init__(failure.detail)
        self.failure = failure


class Child:
    """One computation in a process of its own. `kill` may be called from any thread."""

    def __init__(self, order: Order) -> None:
        self._killed_for: Failure | None = None
        self._lock = threading.Lock()
        self._channel, theirs = _context.Pipe(duplex=False)
        _widen(self._channel.fileno())
        their_lifeline, self._lifeline = _context.Pipe(duplex=False)
        self._process = _context.Process(
            target=run_child, args=(theirs, their_lifeline, order), daemon=True
        )
        try:
            with _asking:
                self._process.start()
        # the fork server died meanwhile; there is another for the next attempt
        except (OSError, EOFError):
            self._channel.close()
            self._lifeline.close()
            raise ChildEnded(LOST) from None
        finally:
            theirs.close()
            their_lifeline.close()

    @property
    def pid(self) -> int:
        """Process id."""
        return int(self._process.pid)

    def messages(self) -> Iterator[Progress | Checkpoint | Item]:
        """What the child sends, until it is done.

        Raises:
            ChildEnded: it failed, died or was killed.
        """
        while True:
            try:
                data = self._channel.recv_bytes()
            except (EOFError, OSError):
                raise ChildEnded(self._post_mortem()) from None
            message: Message = pickle.loads(data)
            if isinstance(message, Failure):
                raise ChildEnded(message)
            if isinstance(message, Done):
                return
            yield replace(message, size=len(data)) if isinstance(message, Item) else message

    def kill(self, why: Failure) -> None:
        """End the child now, for a reason that `messages` then gives."""
        with self._lock:
            if self._killed_for is None:
                self._killed_for = why
                self._process.kill()

    def close(self) -> None:
        """Leave nothing behind."""
        self.kill(Failure("internal", "Closed", "no longer wanted"))
        self._status()
        with _asking:
            self._process.close()
        self._channel.close()
        self._lifeline.close()

    def _status(self) -> int:
        """The exit status of the child, once it has ended."""
        connection.wait([self._process.sentinel])
        with _asking:
            self._process.join()
            return int(self._process.exitcode)

    def _post_mortem(self) -> Failure:
        status = self._status()
        if self._killed_for is not None:
            return self._killed_for
        if status == SERVER_GONE:
            return LOST
        if status == -signal.SIGKILL:
            detail = (
                "the computation was killed from outside, most likely because the machine ran out"
                " of memory"
            )
        elif status < 0:
            detail = f"the computation crashed with {signal.Signals(-status).name}"
        else:
            detail = f"the computation ended with status {status} and without a word"
        return Failure("crash", "Crash", detail)


def _widen(pipe: int) -> None:
    """Let the child run ahead of who stores by some spectra instead of by one (Linux, where a pipe
    holds 64 kB).
    """
    if sys.platform == "linux":
        import fcntl

        with suppress(PermissionError):  # the user's pipes hold as much as they may
            fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, CHANNEL_BYTES)
