"""Models that users sent, as they were sent and as they were read; and the mesh that a structure is:
of such a model, or of the strip or shape that is described.
"""

from __future__ import annotations

from hashlib import sha256
from io import BytesIO
from itertools import accumulate
from typing import TYPE_CHECKING, Any
from uuid import UUID

import numpy as np
from sqlalchemy import select
from sqlalchemy.orm import Session

from fecore.arrays import IntArray
from fecore.body import structure as core
from fecore.body.generators import strip
from fecore.body.matrices import MatrixBody
from fecore.body.mesh import CellBlock, Mesh
from fecore.body.supports import of_boundary
from modalbase.formats.meshes import Cells
from modalbase.formats.models.matrices import MatrixModel
from service.compute.models.bodies import AS_MODELLED, body_of_model
from service.compute.models.keeping import model_of
from service.compute.models.matrices import body_of_matrices
from service.nouns.storage.originals import copy_original
from service.nouns.structures.drawn import DrawnMesh, Held
from service.nouns.structures.operations import (
    Structure,
    StructureModel,
    StructureVersion,
    current_version,
    describe_version,
    structure_for,
)
from service.platform.access import Lookup
from service.platform.errors import Conflict, Damaged
from service.platform.queue.tables import Job

if TYPE_CHECKING:
    from modalbase.formats.models.model import Elements, FiniteElementModel
    from service.nouns.structures.schemas import StructureIn


def new_model(
    filename: str, units: str | None, accepted: list[str], sections: dict[str, Any] | None
) -> StructureModel:
    """A row that nothing has been kept of."""
    return StructureModel(filename=filename, units=units, accepted=accepted, sections=sections)


model_for = Lookup(StructureModel, "model", "structure_id", structure_for)


def same_model(
    session: Session, structure: Structure, draft: StructureModel
) -> StructureModel | None:
    """The newest model of a structure, where it has these bytes, read alike, and waits, is read, or
    is the present version.
    """
    query = select(StructureModel, Job.state).join(Job, Job.id == StructureModel.id)
    newest = (
        query.where(StructureModel.structure_id == structure.id)
        .order_by(StructureModel.id.desc())
        .limit(1)
    )
    known = session.execute(newest).one_or_none()
    if known is None:
        return None
    row, state = known
    same = all(
        getattr(row, part) == getattr(draft, part)
        for part in ("sha256", "filename", "units", "accepted", "sections")
    )
    there = state in ("queued", "running") or row.id == current_version(session, structure).model
    return row if same and there else None


def model_of_structure(session: Session, structure: Structure) -> StructureModel:
    """The model that a structure is in its current version.

    Raises:
        Conflict: it is none.
    """
    key = current_version(session, structure).model
    if key is None:
        raise Conflict("the structure is no model: POST /structures/{id}/model sends a deck")
    return model_for.row(session, key)


def load_model(session: Session, key: UUID) -> FiniteElementModel | MatrixModel:
    """A model in SI, of elements or of matrices, whoever asks.

    Raises:
        Damaged: what was stored is not what was read.
    """
    row = model_for.row(session, key)
    assert row.arrays is not None, "a version refers to a model that was read"
    assert row.arrays_sha256 is not None, "arrays are stored with their digest"
    if sha256(row.arrays).digest() != row.arrays_sha256:
        raise Damaged("model", row.arrays_sha256)
    return model_of(row.arrays)


def model_in_short(session: Session, key: UUID) -> dict[str, Any]:
    """The file of a model, and its sets, whoever asks."""
    row = model_for.row(session, key)
    assert row.document is not None, "a version refers to a model that was read"
    return {"filename": row.filename, "sets": row.document["sets"]}


def deck_of(session: Session, row: StructureModel) -> bytes:
    """The deck of a model as it was sent.

    Raises:
        Damaged: what was stored is not what was sent.
    """
    buffer = BytesIO()
    copy_original(session, row.sha256, buffer)
    return buffer.getvalue()


def sets_of(session: Session, structure: Structure) -> list[str]:
    """Names of a structure's sets, whoever asks; a strip or plate has none."""
    version = current_version(session, structure)
    if version.model is not None:
        return [each["name"] for each in model_in_short(session, version.model)["sets"]]
    return sorted((version.shape or {}).get("walls", ()))


def versions_of_models(session: Session, keys: list[UUID]) -> dict[UUID, int]:
    """Numbers of the first versions that are these models."""
    query = select(StructureVersion.model, StructureVersion.number).where(
        StructureVersion.model.in_(keys)
    )
    latest_first = session.execute(query.order_by(StructureVersion.number.desc()))
    return {key: number for key, number in latest_first if key is not None}


def mesh_of(session: Session, version: StructureVersion, boundary: str | None) -> DrawnMesh:
    """Nodes and elements of a structure, with what holds and loads it, for a page that draws it.

    Args:
        session: of the request.
        version: what the structure is.
        boundary: how it is held; of a model its own supports where none is stated.

    Raises:
        Conflict: nothing is said of the structure that has a mesh.
        InputError: the boundary is of models, and this is none.
    """
    if version.model is not None:
        return _of_model(load_model(session, version.model), held=boundary in (None, AS_MODELLED))
    mesh = described_mesh(version)
    supports = () if boundary is None else of_boundary(boundary)  # type: ignore[arg-type]
    first = accumulate((len(block.nodes) for block in mesh.blocks), initial=1)
    return DrawnMesh(
        np.arange(1, len(mesh.nodes) + 1),
        mesh.nodes,
        [
            _cells(block, np.arange(len(block.nodes)) + start)
            for block, start in zip(mesh.blocks, first, strict=False)
        ],
        [Held(mesh.select(each.where), each.dofs) for each in supports],
        [],
    )


def body_in_space(session: Session, structure: StructureIn) -> core.Structure | MatrixBody | None:
    """The body of a shape or a model, whoever asks, to see which points lie on it; None of a strip
    or plate.
    """
    if structure.shape is not None:
        return core.Structure(structure.shape.mesh(), structure.shape.sections(1.0))
    if structure.model is None:
        return None
    model = load_model(session, structure.model)
    return (
        body_of_matrices(model, AS_MODELLED)
        if isinstance(model, MatrixModel)
        else body_of_model(model)
    )


def described_mesh(version: StructureVersion) -> Mesh:
    """The mesh of a strip, a plate or a shape.

    Raises:
        Conflict: the structure states no dimensions.
    """
    structure = describe_version(version, "")
    if structure.shape is not None:
        return structure.shape.mesh()
    g = structure.geometry
    if g is None:
        raise Conflict(
            "the structure states neither a geometry nor a shape, and is no model, so it has no"
            " mesh"
        )
    pieces = [piece.to_core() for piece in structure.pieces or ()]
    return strip(g.length_m, g.width_m, pieces=pieces, thickness=g.thickness_m)


def _of_model(model: FiniteElementModel | MatrixModel, *, held: bool) -> DrawnMesh:
    if isinstance(model, MatrixModel):
        every = np.arange(len(model.numbers))
        return DrawnMesh(
            model.numbers, model.nodes, [Cells("point", "nodes", every + 1, every[:, None])], [], []
        )
    return DrawnMesh(
        model.numbers,
        model.nodes,
        [_cells(block, block.numbers) for block in model.elements],
        [Held(each.nodes, each.dofs) for each in (model.supports if held else ())],
        sorted({int(each.node) for each in model.masses}),
    )


def _cells(block: CellBlock | Elements, numbers: IntArray) -> Cells:
    return Cells(block.kind, block.set, numbers, block.nodes)
