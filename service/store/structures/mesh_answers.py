"""Meshes as an answer: JSON for pages, VTU for viewers, UFF for programs of modal analysis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import IO, Annotated, Any

import numpy as np
from fastapi import Response

from modalbase.formats.meshes import Cells, MeshFile, columns, uff_of, write_vtu
from modalbase.formats.uff.write import encode
from service.web.downloads import spooled
from service.web.parameters import form_of

MEDIA_TYPES = {"json": "application/json", "vtu": "application/vnd.kitware.vtu+xml", "uff": "application/x-uff"}
MESH_FILES: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "The mesh.",
        "content": {kind: {} for kind in MEDIA_TYPES.values() if kind != "application/json"},
    }
}


MeshForm = Annotated[str, form_of(MEDIA_TYPES, "default: by Accept, else json")]
"""Name of the format that a request wants."""


def file_of(mesh: Mapping[str, Any]) -> MeshFile:
    """A mesh as a page has it, as what a file says of it."""
    cells = [
        Cells(each["kind"], each["set"], np.array(each["numbers"]), np.array(each["nodes"])) for each in mesh["blocks"]
    ]
    return MeshFile(np.array(mesh["nodes"]["numbers"]), columns(mesh["nodes"]), cells)


def mesh_answer(mesh: MeshFile, form: str, name: str, headers: Mapping[str, str] | None = None) -> Response:
    """A file for download."""

    def write(file: IO[bytes]) -> None:
        if form == "vtu":
            file.write(write_vtu(mesh))
        else:
            file.writelines(encode(uff_of(mesh)))

    return spooled(write, MEDIA_TYPES[form], f"{name}.{form}", headers or {})
