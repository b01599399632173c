"""One way to run something in the background: a thread that goes round as long as a `with` block
runs.

The listener hears what the database announces at commit (LISTEN/NOTIFY). A notice is a hint: who
needs to be sure also looks.
"""

import threading
from collections.abc import Callable, Sequence
from typing import Self

import psycopg
import structlog
from psycopg import sql

from service.platform.db.engine import psycopg_url

AGAIN_SECONDS = 1.0  # between two tries to reach the database
WAKE_SECONDS = 0.5

log = structlog.stdlib.get_logger("modalbase.notices")


class Background:
    """Calls a function again and again in a thread of its own while the block runs; a context
    manager.

    Attributes:
        ending: set when the block ends. A long round looks at it, or waits for it in place of
            sleeping.
    """

    def __init__(self, name: str, work: Callable[[], float]) -> None:
        """Prepare.

        Args:
            name: of the thread, for the log.
            work: one round; returns the seconds until the next, which `wake` shortens. An error
                ends the thread, so it handles those that pass.
        """
        self.ending = threading.Event()
        self._work, self._woken = work, threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True, name=name)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_error: object) -> None:
        self.ending.set()
        self._woken.set()
        self._thread.join()

    def wake(self) -> None:
        """Begin the next round now, or as soon as the present one is over."""
        self._woken.set()

    def _run(self) -> None:
        while not self.ending.is_set():
            self._woken.clear()
            seconds = self._work()
            if not self.ending.is_set():
                self._woken.wait(seconds)


class Listener(Background):
    """Listens in a thread of its own, and connects again as often as needed; a context manager.

    Attributes:
        connected: whether notices come through at the moment.
    """

    def __init__(self, url: str, channels: Sequence[str], on_notify: Callable[[str], None]) -> None:
        """Prepare.

        Args:
            url: the database.
            channels: what to listen to.
            on_notify: called with each payload, in the listener's thread.
        """
        super().__init__("notices", self._round)
        self.connected = threading.Event()
        self._url, self._channels, self._on_notify = psycopg_url(url), channels, on_notify

    def _round(self) -> float:
        try:
            self._listen()
        except psycopg.Error as error:
            log.warning("notices are interrupted; connecting again", error=str(error).strip())
        finally:
            self.connected.clear()
        return AGAIN_SECONDS

    def _listen(self) -> None:
        name = "modalbase notices"
        with psycopg.connect(
            self._url, autocommit=True, application_name=name, connect_timeout=5
        ) as connection:
            for channel in self._channels:
                connection.execute(sql.SQL("LISTEN {}").format(sql.Identifier(channel)))
            self.connected.set()
            while not self.ending.is_set():
                for notice in connection.notifies(timeout=WAKE_SECONDS):
                    self._on_notify(notice.payload)
