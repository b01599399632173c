"""Our own models as matrices, as another solver would hand them out."""

import io
import zipfile

import numpy as np
import scipy

from fecore.arrays import IntArray
from fecore.body.structure import Structure

Matrices = dict[str, scipy.sparse.csc_array]


def matrices_of_sets(body: Structure) -> tuple[IntArray, Matrices, Matrices]:
    """(d, 2) node and dof of each row, and the stiffness of each set, and the mass of all, at
    nominal constants.
    """
    q = np.array(list(body.nominal.values()))
    c, model = body.stiffness_coefficients(q), body.model
    owners = np.array([name.partition(".")[0] for name in model.stiffness.names])
    stiffness = {
        name: model.stiffness.at(np.where(owners == name, c, 0.0)) for name in body.mesh.sets
    }
    nodes, dofs = np.nonzero(model.free)
    return (
        np.column_stack([nodes, dofs]),
        stiffness,
        {"0": model.mass.at(body.mass_coefficients(q))},
    )


def archived(body: Structure) -> bytes:
    """An npz of sparse matrices in SI; nodes have numbers from 1."""
    dofs, stiffness, mass = matrices_of_sets(body)
    nodes = np.column_stack([np.arange(1, len(body.mesh.nodes) + 1), body.mesh.nodes])
    arrays = {"nodes": nodes, "dofs": dofs + 1}
    for name, matrix in {**{f"K_{k}": m for k, m in stiffness.items()}, "M_0": mass["0"]}.items():
        arrays |= {
            f"{name}_{part}": getattr(matrix.tocsr(), part)
            for part in ("data", "indices", "indptr")
        }
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def zipped(body: Structure, length: float = 1.0) -> bytes:
    """A zip of Matrix Market files with tables of nodes and dofs; lengths in this unit of m, forces
    in N, masses in t if 1e-3.

    Nodes have numbers from 101.
    """
    dofs, stiffness, mass = matrices_of_sets(body)
    arm = scipy.sparse.diags_array(np.where(dofs[:, 1] < 3, 1.0, 1 / length))
    mass_unit = 1e3 if length == 1e-3 else 1.0
    files = {f"K_{name}.mtx": length * (arm @ matrix @ arm) for name, matrix in stiffness.items()}
    files["M_0.mtx"] = arm @ mass["0"] @ arm / mass_unit
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, matrix in files.items():
            text = io.BytesIO()
            scipy.io.mmwrite(
                text, scipy.sparse.coo_array(matrix), symmetry="symmetric", precision=15
            )
            archive.writestr(f"angle/{name}", text.getvalue())
        rows = [
            f"{n + 101},{x},{y},{z}"
            for n, (x, y, z) in enumerate((body.mesh.nodes / length).tolist())
        ]
        archive.writestr("angle/nodes.csv", "\n".join(["node,x,y,z", *rows]))
        rows = [f"{n + 101},{dof + 1}" for n, dof in dofs.tolist()]
        archive.writestr("angle/dofs.csv", "\n".join(["node,dof", *rows]))
    return buffer.getvalue()
