"""Downloads: an answer that is written while the transaction is open, to memory or disk, and sent
when it is over.
"""

import io
import tempfile
from collections.abc import Callable, Mapping
from typing import IO
from urllib.parse import quote

from fastapi import Request, Response
from fastapi.responses import FileResponse
from starlette.background import BackgroundTask

MEMORY_BYTES = 8 * 1024 * 1024
"""What an answer that is being sent may hold in memory."""


def disposition(filename: str, *, inline: bool = False) -> str:
    """Whether a browser shows a file in place or saves it, and under which name.

    >>> print(disposition("Prüfung.pdf", inline=True))
    inline; filename="Prfung.pdf"; filename*=UTF-8''Pr%C3%BCfung.pdf
    """
    plain = "".join(sign for sign in filename if " " <= sign < "\x7f" and sign not in '"\\')
    how = "inline" if inline else "attachment"
    return f"{how}; filename=\"{plain}\"; filename*=UTF-8''{quote(filename, safe='')}"


class _File(FileResponse):
    """A file sent in large blocks: each block costs a change of thread."""

    chunk_size = MEMORY_BYTES


def fits_memory(request: Request, size: int) -> bool:
    """Whether an answer of some size need not go by way of the disk: it is small, and the client
    wants all of it.
    """
    return size <= MEMORY_BYTES and "range" not in request.headers


def in_memory(
    write: Callable[[IO[bytes]], None], media_type: str, filename: str, headers: Mapping[str, str]
) -> Response:
    """A small file that `write` fills, sent as a whole; what it raises is answered as a problem."""
    buffer = io.BytesIO()
    write(buffer)
    described = {
        "Content-Disposition": f'attachment; filename="{filename}"',
        "Accept-Ranges": "bytes",
    }
    return Response(buffer.getvalue(), media_type=media_type, headers={**headers, **described})


def spooled(
    write: Callable[[IO[bytes]], None], media_type: str, filename: str, headers: Mapping[str, str]
) -> FileResponse:
    """A file that `write` fills, sent in parts where the client asks for them, and removed
    afterwards.

    Memory stays bounded, a slow client holds no database connection, and a fault found while
    writing is still a problem document, since nothing has been sent.
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
