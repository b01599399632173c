"""The two processes of a service, the API and a worker, as their commands and the supervisor run
them.

Each begins with its libraries, `loaded` so that a start is short, and goes on when the database is
open.
"""

from __future__ import annotations

import gc
import os
import signal
import socket
import sys
import threading
import warnings
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from service.platform.settings import Settings


class UnknownQueueError(Exception):
    """No kind of job has such a queue; the message says which there are."""


def serve(
    settings: Callable[[], Settings], listener: int | None = None, *, attached: bool = False
) -> None:
    """Answer requests until SIGTERM or SIGINT.

    Args:
        settings: gives the operator's settings.
        listener: descriptor of a socket that listens; one of its own by default, by the settings.
        attached: another process started this one; see `_follow`.
    """
    with loading():
        from uvicorn.config import Config
        from uvicorn.server import Server

        from service.app.application import create_app
        from service.app.supervisor import listening_socket
        from service.platform.db.opening import open_database
        from service.platform.logs import configure_logs
        from service.platform.web.middleware import PatientProtocol

    config = settings()
    configure_logs(config)
    if attached:
        _follow()
    own = (
        listening_socket(config.host, config.port)
        if listener is None
        else socket.socket(fileno=listener)
    )
    with own, open_database(config) as opened:
        api = create_app(opened)

        class Ending(Server):
            """Ends streams of events, which would go on, before it waits for requests to end."""

            def handle_exit(self, sig: int, frame: FrameType | None) -> None:
                api.state.changes.close()
                super().handle_exit(sig, frame)

        Ending(
            Config(
                api,
                http=PatientProtocol,
                log_config=None,
                access_log=False,
                timeout_graceful_shutdown=10,
                server_header=False,
            )
        ).run(sockets=[own])


def work(
    settings: Callable[[], Settings],
    queues: Collection[str] | None = None,
    ready: Callable[[], None] | None = None,
    *,
    attached: bool = False,
) -> None:
    """Run jobs until SIGTERM or SIGINT.

    Args:
        settings: gives the operator's settings.
        queues: names of the queues to serve; all by default.
        ready: is called once, when it takes jobs.
        attached: another process started this one; see `_follow`.

    Raises:
        UnknownQueueError: a queue that no kind of job has; the message names them.
    """
    with loading():
        from service.monitoring.scheduler import scheduler
        from service.platform.db.opening import open_database
        from service.platform.logs import configure_logs
        from service.platform.queue.kinds import REQUESTS
        from service.platform.queue.worker import run_worker
        from service.tasks.kinds import KINDS

    config, known = settings(), {REQUESTS, *(kind.queue for kind in KINDS)}
    if queues is not None and not known.issuperset(queues):  # it would wait for ever
        raise UnknownQueueError(
            f"there is {', '.join(sorted(known))}, separated by commas where several"
        )
    configure_logs(config)
    if attached:
        _follow()
    with open_database(config) as opened, scheduler(opened):
        run_worker(opened, KINDS, queues, ready)


@contextmanager
def loading() -> Iterator[None]:
    """Load no more than a start needs.

    - The garbage collector keeps from what is being loaded, now and later: one object in a hundred
      of it is garbage, and to look through it takes 0.1 s at a time, in which everybody waits.
    - Pydantic puts a model together when it is first used, FastAPI's own models too. FastAPI
      silences a warning that does not concern it only where it is put together at once.
    - structlog does not find rich, which it loads for tracebacks that `service.platform.logs` writes without
      it.

    SIGTERM ends the process at once, as nothing is open yet: an error raised from the handler may
    be swallowed or disguised by whatever is being loaded at that moment.
    """
    from pydantic import BaseModel
    from pydantic.warnings import UnsupportedFieldAttributeWarning

    unwinds = signal.signal(signal.SIGTERM, lambda _signal, _frame: os._exit(0))
    gc.disable()
    _load_structlog()
    BaseModel.model_config["defer_build"] = True
    warnings.simplefilter("ignore", UnsupportedFieldAttributeWarning)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, unwinds)
        del BaseModel.model_config["defer_build"]
        gc.freeze()
        gc.enable()


def _load_structlog() -> None:
    there = "rich" in sys.modules
    sys.modules.setdefault("rich", None)  # type: ignore[arg-type]  # Python's own mark of what is not there
    import structlog  # noqa: F401

    if not there:
        del sys.modules["rich"]


def _follow() -> None:
    """Go on when the process that started this one has opened the database, which it says by a byte
    on standard input, and end when it is gone: the pipe closes.
    """
    if not os.read(0, 1):
        sys.exit()

    def watch() -> None:
        while os.read(0, 4096):
            pass
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=watch, daemon=True, name="lifeline").start()
