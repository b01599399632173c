"""Scripts and styles of the pages, served from memory, compressed once, and kept by browsers under their digest."""

from __future__ import annotations

import gzip
import hashlib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from fastapi import Request, Response

from service.errors import NotFound
from service.web.parameters import not_modified
from service.web.routing import page_router

FOLDER = Path(__file__).parent / "static"
MEDIA_TYPES = {".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml", ".txt": "text/plain"}
LARGE = 1000  # bytes from which compression is worth a browser's work

router = page_router()


@dataclass(frozen=True)
class Asset:
    """A file."""

    content: bytes  # as it is
    compressed: bytes | None  # by gzip; None where that is not worth it
    digest: str  # the first 16 digits of its SHA-256
    media_type: str  # with the character set


@cache
def assets() -> dict[str, Asset]:
    """All files by their names below `static`."""
    files = (file for file in sorted(FOLDER.rglob("*")) if file.suffix in MEDIA_TYPES)
    return {file.relative_to(FOLDER).as_posix(): _read(file) for file in files}


def _read(file: Path) -> Asset:
    content = file.read_bytes()
    compressed = gzip.compress(content, 9, mtime=0) if len(content) > LARGE else None
    media_type = f"{MEDIA_TYPES[file.suffix]}; charset=utf-8"
    return Asset(content, compressed, hashlib.sha256(content).hexdigest()[:16], media_type)


def address(name: str) -> str:
    """Where a page finds a file, relative to the service's root; another content has another address."""
    return f"static/{assets()[name].digest}/{name}"


@router.api_route("/static/{digest}/{name:path}", methods=["GET", "HEAD"])
def get_asset(digest: str, name: str, request: Request) -> Response:
    """A file of the pages; under the digest of its content it never changes."""
    found = assets().get(name)
    if found is None or found.digest != digest:
        raise NotFound("file", name)
    headers = {
        "Cache-Control": "public, max-age=31536000, immutable",
        "ETag": f'"{found.digest}"',
        "Vary": "Accept-Encoding",
    }
    if (unchanged := not_modified(request, headers)) is not None:
        return unchanged
    if found.compressed is not None and "gzip" in request.headers.get("accept-encoding", ""):
        headers["Content-Encoding"] = "gzip"
        return Response(found.compressed, media_type=found.media_type, headers=headers)
    return Response(found.content, media_type=found.media_type, headers=headers)
