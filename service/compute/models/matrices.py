"""Models that are matrices: read, in SI, described, kept, and as the core's body."""

import io
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import PurePosixPath
from typing import Any

import numpy as np
import scipy

from fecore.body.matrices import MatrixBody
from fecore.dynamics.bodies import body_modes
from fecore.errors import InputError
from modalbase.formats.models.matrices import MatrixModel, read_matrices
from modalbase.formats.models.units import units_of

ENDINGS = (".mtx", ".npz", ".pch", ".sti", ".mas")  # of files that are matrices and nothing else
MATRICES = "matrices"  # format of a model that is none of elements
_ROTATIONS = 3  # dofs from here turn


def are_matrices(names: Iterable[str]) -> bool:
    """Whether files of these names are a model of matrices."""
    return any(PurePosixPath(name).suffix.lower() in ENDINGS for name in names)


def matrices_in_si(files: Mapping[str, bytes], units: str, limit_bytes: int) -> MatrixModel:
    """A model of files in these units: K in force by length, M in mass; with turns, times the
    length.

    Raises:
        FormatError: they cannot be read, or the units are none.
    """
    u = units_of(units)
    model = read_matrices(
        {PurePosixPath(name).name: content for name, content in files.items()}, None, limit_bytes
    )
    arms = scipy.sparse.diags_array(np.where(model.dofs[:, 1] < _ROTATIONS, 1.0, u.length))

    def scaled(
        matrices: Mapping[str, scipy.sparse.csc_array], unit: float
    ) -> dict[str, scipy.sparse.csc_array]:
        return {
            name: scipy.sparse.csc_array(unit * (arms @ matrix @ arms))
            for name, matrix in matrices.items()
        }

    stiffness, mass = scaled(model.stiffness, u.force / u.length), scaled(model.mass, u.mass)
    return replace(model, nodes=model.nodes * u.length, stiffness=stiffness, mass=mass)


def body_of_matrices(model: MatrixModel, boundary: str) -> MatrixBody:
    """The core's body.

    Raises:
        InputError: the boundary is not that of the matrices.
    """
    if boundary not in ("free", "as_modelled"):
        raise InputError(
            "boundary",
            f"is {boundary}, but this structure is matrices: as_modelled with what they hold, or"
            " free",
        )
    body = MatrixBody(model.nodes, model.dofs, model.stiffness, model.mass)
    if boundary == "free" and not body.is_free:
        raise InputError("boundary", "is free, but the matrices hold the body: say as_modelled")
    return body


def describe_matrices(model: MatrixModel) -> dict[str, Any]:
    """What is in a model in SI, in the form of a deck's.

    Raises:
        InputError: it cannot vibrate.
    """
    body = body_of_matrices(model, "as_modelled")
    ones = np.ones(len(body.nominal))
    K, M = (
        body.model.stiffness.at(body.stiffness_coefficients(ones)),
        body.model.mass.at(body.mass_coefficients(ones)),
    )
    body_modes(body.model, K, M, 1)  # so that what has no mass or stiffness is refused at once
    shifts = body.model.motions[:, :3]
    none = dict.fromkeys(("elements", "masses", "springs", "links", "supports"), 0)
    return {
        "format": MATRICES,
        "title": "",
        "counts": {"nodes": len(model.nodes), **none},
        "size_m": np.ptp(model.nodes, axis=0).tolist(),
        # along the axis of which rows show most
        "mass_kg": float(np.einsum("di,di->i", shifts, M @ shifts).max()),
        **{
            name: [] for name in ("sets", "materials", "masses", "supports", "ignored", "junctions")
        },
        "factors": list(body.nominal),
        "rows": len(model.dofs),
    }


def kept_matrices(model: MatrixModel) -> bytes:
    """The model as an npz that numpy reads without pickles."""
    arrays: dict[str, Any] = {"numbers": model.numbers, "nodes": model.nodes, "dofs": model.dofs}
    for letter, matrices in (("K", model.stiffness), ("M", model.mass)):
        for name, matrix in matrices.items():
            arrays |= {
                f"{letter}.{name}.{part}": getattr(matrix, part)
                for part in ("data", "indices", "indptr")
            }
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def matrices_of(arrays: Mapping[str, Any]) -> MatrixModel:
    """The model of `kept_matrices`."""
    size = len(arrays["dofs"])

    def of(letter: str) -> dict[str, scipy.sparse.csc_array]:
        names = [
            key[2:-5] for key in arrays if key.startswith(f"{letter}.") and key.endswith(".data")
        ]
        parts = {
            name: [arrays[f"{letter}.{name}.{part}"] for part in ("data", "indices", "indptr")]
            for name in names
        }
        return {
            name: scipy.sparse.csc_array(tuple(each), shape=(size, size))
            for name, each in parts.items()
        }

    return MatrixModel(arrays["numbers"], arrays["nodes"], arrays["dofs"], of("K"), of("M"))
