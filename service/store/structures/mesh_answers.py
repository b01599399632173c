"""Meshes as an answer: JSON for pages, VTU for viewers, UFF for programs of modal analysis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import IO, Annotated, Any

import numpy as np
from fastapi import Depends, Header, Query, Response

from modalbase.formats.meshes import Cells, MeshFile, columns, uff_of, write_vtu
from modalbase.formats.uff.write import encode
from service.web.downloads import spooled
from service.web.negotiation import choose_format, one_of

MEDIA_TYPES = {"json": "application/json", "vtu": "application/vnd.kitware.vtu+xml", "uff": "application/x-uff"}
MESH_FILES: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "The mesh.",
        "content": {kind: {} for kind in MEDIA_TYPES.values() if kind != "application/json"},
    }
}


def _chosen(
    file_format: Annotated[
        Annotated[str, one_of(MEDIA_TYPES)] | None, Query(alias="format", description="default: by Accept, else json")
    ] = None,
    accept: Annotated[str | None, Header(include_in_schema=False)] = None,
) -> str:
    return choose_format(file_format, accept, MEDIA_TYPES)


MeshForm = Annotated[str, Depends(_chosen)]
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
