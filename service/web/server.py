"""What the server itself does about clients that open a line and then say nothing."""

from __future__ import annotations

import asyncio
from typing import Any

from uvicorn.protocols.http.auto import AutoHTTPProtocol

HEAD_SECONDS = 20.0

_Protocol: Any = AutoHTTPProtocol  # one of two classes, by what is installed


class PatientProtocol(_Protocol):  # type: ignore[misc]
    """Closes a connection on which the head of a request does not come whole within `HEAD_SECONDS`."""

    _hurry: asyncio.TimerHandle | None = None

    def connection_made(self, transport: Any) -> None:
        """A client has connected."""
        super().connection_made(transport)
        self._expect_head()

    def data_received(self, data: bytes) -> None:
        """Something came: a whole head, or a part of one."""
        super().data_received(data)
        if self.cycle is None or self.cycle.response_complete:
            self._expect_head()
        else:
            self._expect_nothing()

    def connection_lost(self, exc: Exception | None) -> None:
        """The connection has ended."""
        self._expect_nothing()
        super().connection_lost(exc)

    def _expect_head(self) -> None:
        if self._hurry is None:
            self._hurry = asyncio.get_running_loop().call_later(HEAD_SECONDS, self.transport.abort)

    def _expect_nothing(self) -> None:
        if self._hurry is not None:
            self._hurry.cancel()
            self._hurry = None
