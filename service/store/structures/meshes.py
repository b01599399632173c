"""The mesh that a structure is: of the model that was sent, or of the strip or shape that is described."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import accumulate
from typing import TYPE_CHECKING, Any

import numpy as np
from sqlalchemy.orm import Session

from fecore.arrays import FloatArray, IntArray
from fecore.body.generators import strip
from fecore.body.matrices import MatrixBody
from fecore.body.mesh import Block, Mesh
from fecore.body.structure import Structure
from fecore.body.supports import of_boundary
from modalbase.formats.models.matrices import MatrixModel
from service.compute.models.bodies import AS_MODELLED, body_of_model
from service.compute.models.matrices import body_of_matrices
from service.errors import Conflict
from service.store.structures.models import load_model
from service.store.structures.operations import StructureVersion, describe_version

if TYPE_CHECKING:
    from modalbase.formats.models.model import Elements, FiniteElementModel
    from service.store.structures.schemas import StructureIn


def mesh_of(session: Session, version: StructureVersion, boundary: str | None) -> dict[str, Any]:
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
    blocks = zip(mesh.blocks, _first_numbers(mesh), strict=True)
    return {
        "nodes": {"numbers": list(range(1, len(mesh.nodes) + 1)), **_columns(mesh.nodes)},
        "blocks": [_block(block, np.arange(first, first + len(block.nodes))) for block, first in blocks],
        "supports": [_held(mesh.select(each.where), each.dofs) for each in supports],
        "masses": [],
    }


def body_in_space(session: Session, structure: StructureIn) -> Structure | MatrixBody | None:
    """The body of a shape or a model, whoever asks, to see which points lie on it; None of a strip or plate."""
    if structure.shape is not None:
        return Structure(structure.shape.mesh(), structure.shape.sections(1.0))
    if structure.model is None:
        return None
    model = load_model(session, structure.model)
    return body_of_matrices(model, AS_MODELLED) if isinstance(model, MatrixModel) else body_of_model(model)


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
        raise Conflict("the structure states neither a geometry nor a shape, and is no model, so it has no mesh")
    pieces = [piece.to_core() for piece in structure.pieces or ()]
    return strip(g.length_m, g.width_m, pieces=pieces, thickness=g.thickness_m)


def _of_model(model: FiniteElementModel | MatrixModel, *, held: bool) -> dict[str, Any]:
    if isinstance(model, MatrixModel):
        every = np.arange(len(model.numbers))
        return {
            "nodes": {"numbers": model.numbers.tolist(), **_columns(model.nodes)},
            "blocks": [_block(Block("point", every[:, None], "nodes"), every + 1)],
            "supports": [],
            "masses": [],
        }
    return {
        "nodes": {"numbers": model.numbers.tolist(), **_columns(model.nodes)},
        "blocks": [_block(block, block.numbers) for block in model.elements],
        "supports": [_held(each.nodes, each.dofs) for each in (model.supports if held else ())],
        "masses": sorted({int(each.node) for each in model.masses}),
    }


def _columns(nodes: FloatArray) -> dict[str, list[float]]:
    """Coordinates of the nodes by axis, m."""
    return {f"{axis}_m": nodes[:, k].tolist() for k, axis in enumerate("xyz")}


def _first_numbers(mesh: Mesh) -> Iterable[int]:
    return accumulate((len(block.nodes) for block in mesh.blocks[:-1]), initial=1)


def _block(block: Block | Elements, numbers: IntArray) -> dict[str, Any]:
    return {"set": block.set, "kind": block.kind, "numbers": numbers.tolist(), "nodes": block.nodes.tolist()}


def _held(nodes: IntArray, dofs: Iterable[int]) -> dict[str, Any]:
    return {"nodes": nodes.tolist(), "dofs": [dof + 1 for dof in dofs]}
