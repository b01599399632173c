"""The body of a request: received whole before anything is done with it, in memory while it is
small, else on disk. An upload is streamed to a spool file while it is hashed, raw or as multipart
field `file`.
"""

import asyncio
import hashlib
import io
import tempfile
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import IO, Annotated, Any, Generic, TypeVar

from fastapi import Depends, Query, Request
from fastapi.concurrency import run_in_threadpool
from starlette.datastructures import UploadFile
from starlette.formparsers import MultiPartException, MultiPartParser
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.platform.errors import Fault, Invalid, PayloadTooLarge, TooSlow, pointer
from service.platform.web.bodies import Name
from service.platform.web.negotiation import content_type

MEMORY_BYTES = 64 * 1024  # of a body that waits in memory: a thousand may wait
BLOCK_BYTES = 1024 * 1024
IDLE_SECONDS = 30.0  # between two blocks of a body
GRACE_SECONDS = 60.0  # before its speed counts
SLOWEST = 16_384  # bytes a second, on average
# for which a body that was refused is let come
LINGER_SECONDS, LINGER_BYTES = 20.0, 256 * 1024 * 1024

_SPOOL = "modalbase.body"


@dataclass
class Body:
    """A body that has come in whole."""

    file: IO[bytes]  # its bytes
    size: int  # how many
    sha256: bytes  # their digest

    def replayed(self, receive: Receive) -> Receive:
        """What the application receives: the body block by block, then what comes from the
        client.
        """
        self.file.seek(0)
        ended = False

        async def again() -> Message:
            nonlocal ended
            if ended:
                return await receive()
            block = self.file.read(BLOCK_BYTES)
            ended = self.file.tell() == self.size
            return {"type": "http.request", "body": block, "more_body": not ended}

        return again

    def on_disk(self) -> Path | None:
        """Where the body lies, if it is on disk."""
        return None if isinstance(self.file, io.BytesIO) else Path(self.file.name)


def body_of(scope: Scope) -> Body | None:
    """The body of a request that came through `spooled_body`."""
    body: Body | None = scope.get(_SPOOL)
    return body


@asynccontextmanager
async def spooled_body(
    scope: Scope, receive: Receive, limit: int, better: str = ""
) -> AsyncIterator[Body]:
    """Receive a request's body, which is gone at the end of the block.

    Args:
        scope: of the request.
        receive: gives the body.
        limit: the most bytes that it may have.
        better: what else one may do with more.

    Raises:
        PayloadTooLarge: it has more bytes than `limit`.
        TooSlow: it comes more slowly than an honest line is.
        ClientDisconnect: the client broke it off.
    """
    loop = asyncio.get_running_loop()
    began, digest, size = loop.time(), hashlib.sha256(), 0
    file: IO[bytes] = io.BytesIO()
    try:
        more = True
        while more:
            message = await _next(receive)
            block = message.get("body", b"")
            size += len(block)
            if size > limit:
                raise PayloadTooLarge(too_large(limit, better))
            if loop.time() - began > GRACE_SECONDS + size / SLOWEST:
                raise TooSlow(
                    f"the body comes too slowly: {size} bytes in {loop.time() - began:.0f} s"
                )
            if size > MEMORY_BYTES and isinstance(file, io.BytesIO):
                file = _moved_to_disk(file)
            file.write(block)
            digest.update(block)
            more = message.get("more_body", False)
        file.flush()
        body = Body(file, size, digest.digest())
        scope[_SPOOL] = body
        yield body
    finally:
        scope.pop(_SPOOL, None)
        file.close()


def too_large(limit: int, better: str = "") -> str:
    """What is said of a body of more bytes than `limit`, and what else one may do."""
    return f"the body is larger than {limit} bytes, the limit for its kind{better}"


async def answer_early(answer: ASGIApp, scope: Scope, receive: Receive, send: Send) -> None:
    """Answer a request whose body is still coming, and let that come unread for a while: a client
    that sends all of it before it listens would meet a broken connection instead of the answer.
    """

    async def unfinished(message: Message) -> None:
        await send(
            {**message, "more_body": True} if message["type"] == "http.response.body" else message
        )

    await answer(scope, receive, unfinished)
    left = LINGER_BYTES
    with suppress(TimeoutError):
        async with asyncio.timeout(LINGER_SECONDS):
            while left > 0:
                message = await receive()
                left -= len(message.get("body", b""))
                if not message.get("more_body", False):
                    break
    await send({"type": "http.response.body", "body": b""})


async def _next(receive: Receive) -> Message:
    try:
        async with asyncio.timeout(IDLE_SECONDS):
            message = await receive()
    except TimeoutError:
        raise TooSlow(f"nothing of the body came for {IDLE_SECONDS:g} s") from None
    if message["type"] == "http.disconnect":
        raise ClientDisconnect
    return message


def _moved_to_disk(memory: io.BytesIO) -> IO[bytes]:
    file = tempfile.NamedTemporaryFile(prefix="modalbase-upload-")  # noqa: SIM115  closed with the body
    file.write(memory.getvalue())
    return file


@dataclass(frozen=True)
class Spooled:
    """A file on this machine's disk, hashed while it was written."""

    path: Path  # where it lies
    size: int  # bytes
    sha256: bytes  # digest of the bytes


File = TypeVar("File", Spooled, UploadFile)


@dataclass(frozen=True)
class Form(Generic[File]):
    """A file that came with a request, raw or in a multipart form."""

    file: File  # the body, or the form's field `file`, for as long as the request is handled
    filename: str  # what the form calls it, without folders; empty for a raw body
    content_type: str  # of the file, without parameters
    fields: Mapping[str, str] = field(default_factory=dict)  # the other fields of the form, as text

    def text_of(self, name: str, parameter: str | None = None) -> str | None:
        """The one text that a form may have beside its file, as `texts_of`."""
        return self.texts_of({name: parameter})[name]

    def texts_of(self, parameters: Mapping[str, str | None]) -> dict[str, str | None]:
        """The texts that a form may have beside its file, which may come as parameters of the query
        too.

        Args:
            parameters: what the query says, by the names of fields and parameters.

        Raises:
            Invalid: the form has another field, or a text is stated at both places.
        """
        listed = " and ".join(f"`{name}`" for name in ("file", *parameters))
        why = f"is no field of this form, which has {listed}; parameters stand in the address"
        unknown = sorted(self.fields.keys() - parameters.keys())
        twice = "is stated twice, in the address and as a field of the form; state it once"
        both = [name for name in self.fields if parameters.get(name) is not None]
        faults = [Fault(pointer([one]), why) for one in unknown]
        if faults := faults or [Fault(one, twice) for one in both]:
            raise Invalid(faults)
        return {
            name: self.fields.get(name) if value is None else value
            for name, value in parameters.items()
        }


@dataclass(frozen=True)
class Upload(Form[Spooled]):
    """A file that came with a request, on disk."""

    @property
    def stated(self) -> list[Any]:
        """What a request with it states, as JSON: the file by its SHA-256."""
        return [self.file.sha256.hex(), self.filename, dict(self.fields)]


@asynccontextmanager
async def multipart(
    request: Request, field_bytes: int = BLOCK_BYTES
) -> AsyncIterator[Form[UploadFile]]:
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


async def _received(request: Request) -> AsyncIterator[Upload]:
    """The body as a file, raw or as multipart field `file`, which is removed at the end of the
    block.
    """
    kind = content_type(request.headers.get("content-type"))
    body = body_of(request.scope)
    if kind != "multipart/form-data" and body is not None and (path := body.on_disk()):
        yield Upload(Spooled(path, body.size, body.sha256), "", kind)
        return
    filename: str = ""
    fields: Mapping[str, str] = {}
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


UploadDep = Annotated[Upload, Depends(_received)]
FilenameQuery = Annotated[Name | None, Query(description="name of a file that is sent as raw body")]
"""The body as a file. No transaction is open while it is received."""
