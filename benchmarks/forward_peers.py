"""The paper's cantilever, 40 × 4 elements, ten modes, by other people's codes. Each function returns frequencies in Hz."""

from __future__ import annotations

import re
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import eigsh

from fecore.body.laminate import Ply, section
from fecore.body.mesh import rectangle
from fecore.body.specimen import Specimen

MODES = 10


def scikit_fem(specimen: Specimen) -> np.ndarray:
    """The same element family: 8-node serendipity, first-order shear, 2 × 2 stiffness, full mass."""
    from skfem import Basis, BilinearForm, ElementQuadS2, MeshQuad

    laminate = section([Ply(specimen.material, specimen.thickness)])
    D, S, (i0, _, i2) = laminate.D, laminate.S, laminate.inertia
    x, y = np.linspace(0, specimen.length, 41), np.linspace(-specimen.width / 2, specimen.width / 2, 5)
    mesh = MeshQuad.init_tensor(x, y)
    element = ElementQuadS2() * ElementQuadS2() * ElementQuadS2()

    @BilinearForm
    def stiffness(w, a, b, v, p, q, _):
        """Bending and shear energy of w, θx, θy."""

        def strains(w, a, b):
            return b.grad[0], -a.grad[1], b.grad[1] - a.grad[0], w.grad[0] + b, w.grad[1] - a

        k, m = strains(w, a, b), strains(v, p, q)
        bending = sum(D[i, j] * k[i] * m[j] for i in range(3) for j in range(3) if D[i, j])
        return bending + S[0, 0] * k[3] * m[3] + S[1, 1] * k[4] * m[4]

    @BilinearForm
    def mass(w, a, b, v, p, q, _):
        """Kinetic energy."""
        return i0 * w * v + i2 * (a * p + b * q)

    K = stiffness.assemble(Basis(mesh, element, intorder=3))
    full = Basis(mesh, element, intorder=5)
    M = mass.assemble(full)
    free = full.complement_dofs(full.get_dofs(lambda x: x[0] == 0))
    value = eigsh(K[free][:, free].tocsc(), MODES, M[free][:, free].tocsc(), sigma=0.0, return_eigenvectors=False)
    return np.sqrt(np.sort(value)) / (2 * np.pi)


def pyfe3d(specimen: Specimen) -> np.ndarray:
    """Four-node elements with reduced integration and hourglass control, compiled; w, θx, θy kept."""
    from pyfe3d import DOF, DOUBLE, INT, Quad4R, Quad4RData, Quad4RProbe
    from pyfe3d.shellprop_utils import laminated_plate

    m, (nx, ny) = specimen.material, (41, 5)
    prop = laminated_plate(
        stack=[0.0], plyt=specimen.thickness, laminaprop=(m.Ex, m.Ey, m.nu_xy, m.Gxy, m.Gxz, m.Gyz), rho=m.density
    )
    prop.scf_k13 = prop.scf_k23 = 5 / 6
    x, y = np.meshgrid(
        np.linspace(0, specimen.length, nx), np.linspace(-specimen.width / 2, specimen.width / 2, ny), indexing="ij"
    )
    coordinates = np.column_stack([x.ravel(), y.ravel(), np.zeros(nx * ny)]).astype(DOUBLE)
    flat = coordinates.ravel()
    data, probe = Quad4RData(), Quad4RProbe()
    corner = (np.arange(nx - 1)[:, None] * ny + np.arange(ny - 1)).ravel()
    size_k, size_m, count = data.KC0_SPARSE_SIZE, data.M_SPARSE_SIZE, corner.size
    kr, kc, kv = np.zeros(size_k * count, INT), np.zeros(size_k * count, INT), np.zeros(size_k * count, DOUBLE)
    mr, mc, mv = np.zeros(size_m * count, INT), np.zeros(size_m * count, INT), np.zeros(size_m * count, DOUBLE)
    for number, first in enumerate(corner.tolist()):
        quad = Quad4R(probe)
        quad.c1, quad.c2, quad.c3, quad.c4 = (DOF * node for node in (first, first + ny, first + ny + 1, first + 1))
        quad.init_k_KC0, quad.init_k_M = number * size_k, number * size_m
        quad.update_rotation_matrix(flat)
        quad.update_probe_xe(flat)
        quad.update_KC0(kr, kc, kv, prop)
        quad.update_M(mr, mc, mv, prop)
    total = DOF * nx * ny
    keep = np.zeros((nx * ny, DOF), dtype=bool)
    keep[coordinates[:, 0] > 0, 2:5] = True
    free = np.flatnonzero(keep.ravel())
    K = coo_matrix((kv, (kr, kc)), shape=(total, total)).tocsc()[free][:, free]
    M = coo_matrix((mv, (mr, mc)), shape=(total, total)).tocsc()[free][:, free]
    value = eigsh(K, MODES, M, sigma=0.0, return_eigenvectors=False)
    return np.sqrt(np.sort(value)) / (2 * np.pi)


def calculix(specimen: Specimen) -> np.ndarray:
    """S8R by the `ccx` process: input written, solved, frequencies read back. It has in-plane modes too."""
    table = ccx([*_calculix_model(specimen), "*STEP", "*FREQUENCY", str(MODES), "*END STEP"]).split("P A R T I C I P")[
        0
    ]
    rows = re.findall(r"^\s+\d+\s+\S+\s+\S+\s+(\S+)\s+\S+\s*$", table, re.MULTILINE)
    return np.array([float(row) for row in rows])


def calculix_frfs(specimen: Specimen, a0: float, a1: float, highest_hz: float, between: int) -> np.ndarray:
    """Receptances of 33 nodes by CalculiX's steady state dynamics, (lines, 33): modes, then their superposition.

    It places its lines itself, so many between each two natural frequencies.
    """
    nodes = rectangle(specimen.length, specimen.width, 40, 4).nodes
    places = [(x, y) for x in np.linspace(0.05, specimen.length, 11) for y in (-0.02, 0.0, 0.02)]
    seen = [int(np.argmin(np.linalg.norm(nodes - place, axis=1))) + 1 for place in places]
    load = ["*CLOAD", f"{seen[-1]},3,1."]
    table = ccx(
        [
            *_calculix_model(specimen),
            *("*NSET, NSET=SEEN", ",\n".join(map(str, seen))),
            *("*STEP", "*FREQUENCY, STORAGE=YES", str(MODES), *load[:1], f"{seen[-1]},3,0.", "*END STEP"),
            *("*STEP", "*STEADY STATE DYNAMICS", f"0.3125,{highest_hz:g},{between},1."),
            *("*MODAL DAMPING, RAYLEIGH", f",,{a0:g},{a1:g}", *load, "*NODE PRINT, NSET=SEEN", "U", "*END STEP"),
        ]
    )
    blocks = table.split("displacements (vx,vy,vz)")[1:]
    w = np.array([[float(row.split()[3]) for row in block.splitlines()[2 : 2 + len(seen)]] for block in blocks])
    real, imaginary = w[0::2], w[1::2]  # for each line first the one, then the other
    return real + 1j * imaginary


def _calculix_model(specimen: Specimen) -> list[str]:
    """Mesh, material and support."""
    mesh, m = rectangle(specimen.length, specimen.width, 40, 4), specimen.material
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{i + 1},{x:.12g},{y:.12g},0" for i, (x, y) in enumerate(mesh.nodes)]
    lines.append("*ELEMENT, TYPE=S8R, ELSET=E")
    lines += [",".join(map(str, [i + 1, *(e + 1)])) for i, e in enumerate(mesh.elements)]
    root = ",\n".join(str(node + 1) for node in mesh.nodes_at_x(0))
    lines += ["*NSET, NSET=ROOT", root, "*MATERIAL, NAME=M", "*ELASTIC, TYPE=ENGINEERING CONSTANTS"]
    nu_xz = nu_yz = m.nu_xy
    lines += [f"{m.Ex:g},{m.Ey:g},{m.Ey:g},{m.nu_xy:g},{nu_xz:g},{nu_yz:g},{m.Gxy:g},{m.Gxz:g}", f"{m.Gyz:g}"]
    lines += ["*DENSITY", f"{m.density:g}", "*SHELL SECTION, ELSET=E, MATERIAL=M", f"{specimen.thickness:g}"]
    return [*lines, "*BOUNDARY", "ROOT,1,6"]


def ccx_frequencies(deck: str) -> np.ndarray:
    """Natural frequencies in Hz of a deck, by the `ccx` process."""
    table = ccx(deck.splitlines()).split("P A R T I C I P")[0]
    rows = re.findall(r"^\s+\d+\s+\S+\s+\S+\s+(\S+)\s+\S+\s*$", table, re.MULTILINE)
    return np.array([float(row) for row in rows])


def ccx(lines: list[str]) -> str:
    """The printed output of a run of CalculiX."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "beam.inp").write_text("\n".join([*lines, ""]))
        subprocess.run(["ccx", "-i", "beam"], cwd=folder, check=True, capture_output=True)
        return Path(folder, "beam.dat").read_text()
