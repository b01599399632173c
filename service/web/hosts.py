"""The names that the service answers to: a page elsewhere may have a name of its own stand for this machine's address."""

from __future__ import annotations

from collections.abc import Sequence
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from service.web.problems import problem

OWN = ("localhost", "127.0.0.1", "::1")
ANY_NAME = ("/healthz", "/readyz", "/metrics")
"""What probes ask for, by whatever address they have; it depends on no name."""


class KnownHosts:
    """ASGI layer: a request whose `Host` is none of the service's is refused, 421 (RFC 9110, 7.4)."""

    def __init__(self, app: ASGIApp, allowed: Sequence[str]) -> None:
        """Name the hosts.

        Args:
            app: what is behind.
            allowed: names and addresses, `*.name` for all below a name; those of the machine itself are always allowed.
        """
        self.app = app
        self._names = {*OWN, *(name for name in allowed if not name.startswith("*."))}
        self._suffixes = tuple(name[1:] for name in allowed if name.startswith("*."))

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI entry."""
        if scope["type"] == "http" and scope["path"] not in ANY_NAME and not self._knows(Headers(scope=scope)):
            answer = problem(
                421, "the service has no such name; the operator lists those it has (MODALBASE_ALLOWED_HOSTS)"
            )
            await answer(scope, receive, send)
        else:
            await self.app(scope, receive, send)

    def _knows(self, headers: Headers) -> bool:
        try:
            name = (urlsplit(f"//{headers.get('host', '')}").hostname or "").rstrip(".")
        except ValueError:
            return False
        return name in self._names or name.endswith(self._suffixes)
