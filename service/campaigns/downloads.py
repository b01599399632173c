"""Downloads: an answer that is written to disk while the transaction is open and sent when it is over."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from typing import IO

from fastapi.responses import FileResponse
from starlette.background import BackgroundTask


class _File(FileResponse):
    """A file sent in large blocks: each block costs a change of thread."""

    chunk_size = 8 * 1024 * 1024


def spooled(
    write: Callable[[IO[bytes]], None], media_type: str, filename: str, headers: Mapping[str, str]
) -> FileResponse:
    """A file that `write` fills, sent in parts where the client asks for them, and removed afterwards.

    Memory stays bounded, a slow client holds no database connection, and a fault found while writing is still a problem
    document, since nothing has been sent.
    """
    spool = tempfile.NamedTemporaryFile(prefix="modalbase-download-")  # noqa: SIM115  closed once it is sent
    try:
        write(spool.file)
        spool.flush()
    except BaseException:
        spool.close()
        raise
    return _File(
        spool.name,
        media_type=media_type,
        filename=filename,
        headers=dict(headers),
        background=BackgroundTask(spool.close),
    )
