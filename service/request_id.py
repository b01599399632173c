"""The id of the request in hand: in every log line, problem and audit event."""

from __future__ import annotations

import re
from contextvars import ContextVar
from uuid import uuid4

HEADER = "X-Request-ID"
_SANE = re.compile(r"[A-Za-z0-9._:-]{1,100}")
_current: ContextVar[str | None] = ContextVar("request_id", default=None)


def current_request_id() -> str | None:
    """Id of the request in hand, or None outside a request."""
    return _current.get()


def adopt_request_id(offered: str | None) -> str:
    """The client's id where it is a sane token, else a new one; from here on the current one."""
    chosen = offered if offered and _SANE.fullmatch(offered) else uuid4().hex
    _current.set(chosen)
    return chosen
