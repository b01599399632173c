"""Logging: every line, ours or a library's, leaves through structlog on stderr with its request's
or job's id. The id of the request in hand is also in every problem and audit event.
"""

from __future__ import annotations

import logging
import re
import sys
from contextvars import ContextVar
from typing import TYPE_CHECKING
from uuid import uuid4

if TYPE_CHECKING:
    from structlog.typing import Processor

    from service.platform.settings import Settings

QUIET = ("alembic", "fontTools", "httpx", "matplotlib", "procrastinate", "uvicorn.access")
REQUEST_ID_HEADER = "X-Request-ID"
_SANE = re.compile(r"[A-Za-z0-9._:-]{1,100}")
_current: ContextVar[str | None] = ContextVar("request_id", default=None)


def configure_logs(settings: Settings) -> None:
    """Set up logging of this process."""
    import structlog  # loaded here: many a command asks for the request id alone

    shared: list[Processor] = [
        structlog.contextvars.merge_contextvars,
        structlog.stdlib.add_log_level,
        structlog.stdlib.add_logger_name,
        structlog.processors.TimeStamper(fmt="iso", utc=True),
        structlog.processors.format_exc_info,
    ]
    structlog.configure(
        processors=[*shared, structlog.stdlib.ProcessorFormatter.wrap_for_formatter],
        logger_factory=structlog.stdlib.LoggerFactory(),
        wrapper_class=structlog.stdlib.BoundLogger,
        cache_logger_on_first_use=True,
    )
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(
            foreign_pre_chain=shared, processors=_writers(settings.log_format)
        )
    )
    logging.captureWarnings(capture=True)  # a glyph that a print lacks, say: a line as any other
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(settings.log_level.upper())
    for name in QUIET:
        logging.getLogger(name).setLevel(logging.WARNING)
    if not settings.access_log:
        logging.getLogger("modalbase.http").setLevel(logging.WARNING)
    for name in ("uvicorn", "uvicorn.error"):
        logging.getLogger(name).handlers.clear()
        logging.getLogger(name).propagate = True


def _writers(form: str) -> list[Processor]:
    import structlog

    in_color = structlog.dev.ConsoleRenderer(colors=sys.stderr.isatty())
    last: Processor = structlog.processors.JSONRenderer() if form == "json" else in_color
    return [structlog.stdlib.ProcessorFormatter.remove_processors_meta, last]


def current_request_id() -> str | None:
    """Id of the request in hand, or None outside a request."""
    return _current.get()


def adopt_request_id(offered: str | None) -> str:
    """The client's id where it is a sane token, else a new one; from here on the current one."""
    chosen = offered if offered and _SANE.fullmatch(offered) else uuid4().hex
    _current.set(chosen)
    return chosen
