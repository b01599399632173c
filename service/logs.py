"""Logging: every line, ours or a library's, leaves through structlog on stderr with its request's or job's id."""

from __future__ import annotations

import logging
import sys

import structlog
from structlog.typing import Processor

from service.settings import Settings

QUIET = ("alembic", "fontTools", "httpx", "matplotlib", "procrastinate", "uvicorn.access")


def configure_logs(settings: Settings) -> None:
    """Set up logging of this process."""
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
        structlog.stdlib.ProcessorFormatter(foreign_pre_chain=shared, processors=_writers(settings.log_format))
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
    in_color = structlog.dev.ConsoleRenderer(colors=sys.stderr.isatty())
    last: Processor = structlog.processors.JSONRenderer() if form == "json" else in_color
    return [structlog.stdlib.ProcessorFormatter.remove_processors_meta, last]
