"""Uploads: a body streamed to a spool file while it is hashed, raw or as multipart field `file`."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import IO, Annotated

from fastapi import Depends, Request
from fastapi.concurrency import run_in_threadpool
from starlette.datastructures import UploadFile
from starlette.formparsers import MultiPartException, MultiPartParser

from service.errors import Invalid
from service.web.negotiation import content_type
from service.web.spool import body_of

BLOCK_BYTES = 1024 * 1024


@dataclass(frozen=True)
class Spooled:
    """A file on this machine's disk, hashed while it was written.

    Attributes:
        path: where it lies.
        size: bytes.
        sha256: digest of the bytes.
    """

    path: Path
    size: int
    sha256: bytes


@dataclass(frozen=True)
class Upload:
    """A received file.

    Attributes:
        file: where it lies, for as long as the request is handled.
        filename: what the multipart field calls it, without folders; empty for a raw body.
        content_type: of the body, without parameters.
        fields: the other fields of a multipart form, as text.
    """

    file: Spooled
    filename: str
    content_type: str
    fields: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Form:
    """A multipart form with a file.

    Attributes:
        file: the field `file`.
        filename: what it is called, without folders.
        content_type: of the file, without parameters.
        fields: the other fields, as text.
    """

    file: UploadFile
    filename: str
    content_type: str
    fields: dict[str, str]


@asynccontextmanager
async def multipart(request: Request, field_bytes: int = BLOCK_BYTES) -> AsyncIterator[Form]:
    """The multipart body of a request; its parts are gone at the end of the block.

    Args:
        request: whose body was not read yet.
        field_bytes: the most that a field besides the file may have.

    Raises:
        Invalid: the body cannot be read, or has no field `file`.
    """
    try:
        parser = MultiPartParser(
            request.headers, request.stream(), max_files=1, max_fields=20, max_part_size=field_bytes
        )
        form = await parser.parse()
    except (MultiPartException, KeyError, ValueError) as error:
        raise Invalid("", f"the multipart body cannot be read: {error}") from None
    try:
        part = form.get("file")
        if not isinstance(part, UploadFile):
            raise Invalid("/file", "is missing: send the file as multipart field `file`")
        name = PurePosixPath(PureWindowsPath(part.filename or "").name).name
        fields = {key: value for key, value in form.items() if isinstance(value, str)}
        yield Form(part, name, content_type(part.content_type), fields)
    finally:
        await form.close()


@asynccontextmanager
async def received(request: Request) -> AsyncIterator[Upload]:
    """The body as a file, raw or as multipart field `file`, which is removed at the end of the block."""
    kind = content_type(request.headers.get("content-type"))
    body = body_of(request.scope)
    if kind != "multipart/form-data" and body is not None and (path := body.on_disk()):
        yield Upload(Spooled(path, body.size, body.sha256), "", kind)
        return
    filename, fields = "", dict[str, str]()
    with tempfile.NamedTemporaryFile(prefix="modalbase-upload-") as spool:
        if kind == "multipart/form-data":
            async with multipart(request) as form:
                filename, kind, fields = form.filename, form.content_type, form.fields
                size, sha256 = await run_in_threadpool(_copy, form.file.file, spool)
        else:
            size, sha256 = await _raw(request.stream(), spool)
        spool.flush()
        yield Upload(Spooled(Path(spool.name), size, sha256), filename, kind, fields)


async def _raw(body: AsyncIterator[bytes], spool: IO[bytes]) -> tuple[int, bytes]:
    digest, size = hashlib.sha256(), 0
    async for block in body:
        digest.update(block)
        size += len(block)
        spool.write(block)
    return size, digest.digest()


def _copy(source: IO[bytes], spool: IO[bytes]) -> tuple[int, bytes]:
    digest, size = hashlib.sha256(), 0
    while block := source.read(BLOCK_BYTES):
        digest.update(block)
        size += len(block)
        spool.write(block)
    return size, digest.digest()


async def _receive(request: Request) -> AsyncIterator[Upload]:
    async with received(request) as upload:
        yield upload


UploadDep = Annotated[Upload, Depends(_receive)]
"""The body as a file. No transaction is open while it is received."""

UPLOAD_CONTENT = {
    "multipart/form-data": {  # first, since the documentation page sends the first, and this one keeps the file's name
        "schema": {
            "type": "object",
            "required": ["file"],
            "properties": {
                "file": {"type": "string", "format": "binary", "description": "the file, with its name"},
                "mapping": {"type": "string", "description": "which variable is what, as JSON"},
            },
        }
    },
    "application/octet-stream": {"schema": {"type": "string", "format": "binary"}},
}
"""Both forms in which a file may be uploaded, for the API's description."""
