"""A file sent into a campaign. The door has refused whoever may not, before a byte of it was read."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import Depends, Request

from service.web.uploads import Upload, received


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
