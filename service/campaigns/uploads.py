"""Uploads: a body streamed to a spool file while it is hashed, raw or as multipart field `file`."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import IO, Annotated
from uuid import UUID

from fastapi import Depends, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer
from starlette.datastructures import UploadFile
from starlette.formparsers import MultiPartException, MultiPartParser

from service.access.keys import user_of_key
from service.campaigns.operations import campaign_for
from service.campaigns.originals import Spooled
from service.problems import Invalid, Unauthorized

BLOCK_BYTES = 1024 * 1024

_bearer = HTTPBearer(auto_error=False)


@dataclass(frozen=True)
class Upload:
    """A received file.

    Attributes:
        file: where it lies, for as long as the request is handled.
        filename: what the multipart field calls it, without folders; empty for a raw body.
        content_type: of the body, without parameters.
    """

    file: Spooled
    filename: str
    content_type: str


async def _receive(
    request: Request,
    campaign_id: UUID,
    credentials: Annotated[HTTPAuthorizationCredentials | None, Depends(_bearer)],
) -> AsyncIterator[Upload]:
    """The body as a file. Whoever may not upload is told before a byte is read.

    No transaction is open while the bytes arrive: a slow line must not hold a database connection.
    """
    await run_in_threadpool(_check_access, request, campaign_id, credentials)
    content_type = request.headers.get("content-type", "").split(";")[0].strip().lower()
    with tempfile.NamedTemporaryFile(prefix="modalbase-upload-") as spool:
        body = request.stream()
        if content_type == "multipart/form-data":
            filename, content_type, size, sha256 = await _multipart(request, body, spool)
        else:
            filename, (size, sha256) = "", await _raw(body, spool)
        spool.flush()
        yield Upload(Spooled(Path(spool.name), size, sha256), filename, content_type)


UploadDep = Annotated[Upload, Depends(_receive)]


def _check_access(request: Request, campaign_id: UUID, credentials: HTTPAuthorizationCredentials | None) -> None:
    if credentials is None:
        raise Unauthorized("send `Authorization: Bearer KEY`; make a key with `modalbase keys create --name NAME`")
    with request.app.state.sessions.begin() as session:
        campaign_for(session, user_of_key(session, credentials.credentials), campaign_id, "editor")


async def _raw(body: AsyncIterator[bytes], spool: IO[bytes]) -> tuple[int, bytes]:
    digest, size = hashlib.sha256(), 0
    async for block in body:
        digest.update(block)
        size += len(block)
        spool.write(block)
    return size, digest.digest()


async def _multipart(request: Request, body: AsyncIterator[bytes], spool: IO[bytes]) -> tuple[str, str, int, bytes]:
    """Name, type, size and digest of the field `file`; its bytes go to the spool file."""
    try:
        form = await MultiPartParser(request.headers, body, max_files=1, max_fields=20).parse()  # type: ignore[arg-type]
    except (MultiPartException, KeyError, ValueError) as error:
        raise Invalid("", f"the multipart body cannot be read: {error}") from None
    try:
        part = form.get("file")
        if not isinstance(part, UploadFile):
            raise Invalid("/file", "is missing: send the file as multipart field `file`, or as the raw body")
        name = PurePosixPath(PureWindowsPath(part.filename or "").name).name
        kind = (part.content_type or "").split(";")[0].strip().lower()
        return name, kind, *await run_in_threadpool(_copy, part.file, spool)
    finally:
        await form.close()


def _copy(source: IO[bytes], spool: IO[bytes]) -> tuple[int, bytes]:
    digest, size = hashlib.sha256(), 0
    while block := source.read(BLOCK_BYTES):
        digest.update(block)
        size += len(block)
        spool.write(block)
    return size, digest.digest()
