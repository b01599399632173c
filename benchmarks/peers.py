"""Other people's codes on the problems of `core`: ten modes of the paper's cantilever, and both
stages of an update.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cholesky
from scipy.optimize import OptimizeResult, least_squares
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import eigsh

from fecore.body.generators import strip
from fecore.body.laminate import Ply
from fecore.body.sections import section
from fecore.body.specimen import Specimen
from fecore.dynamics.damping_laws import RAYLEIGH
from fecore.modes import MeasuredModes
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.forward import ForwardModel
from fecore.updating.frf_fits import Nuisance
from fecore.updating.misfit import FrfMisfit
from tests.support.calculix import ccx
from tests.support.calculix import frequencies as calculix_frequencies

MODES = 10


def _frequencies(K: object, M: object) -> np.ndarray:
    value = eigsh(K, MODES, M, sigma=0.0, return_eigenvectors=False)
    return np.asarray(np.sqrt(np.sort(value)) / (2 * np.pi))


def scikit_fem(specimen: Specimen) -> np.ndarray:
    """The same element family: 8-node serendipity, first-order shear, 2 × 2 stiffness, full
    mass.
    """
    from skfem import Basis, BilinearForm, ElementQuadS2, MeshQuad

    laminate = section([Ply(specimen.material, specimen.thickness)])
    D, S, (i0, _, i2) = laminate.D, laminate.S, laminate.inertia
    x, y = (
        np.linspace(0, specimen.length, 41),
        np.linspace(-specimen.width / 2, specimen.width / 2, 5),
    )
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
    return _frequencies(K[free][:, free].tocsc(), M[free][:, free].tocsc())


def pyfe3d(specimen: Specimen) -> np.ndarray:
    """Four-node elements with reduced integration and hourglass control, compiled; w, θx, θy
    kept.
    """
    from pyfe3d import DOF, DOUBLE, INT, Quad4R, Quad4RData, Quad4RProbe
    from pyfe3d.shellprop_utils import laminated_plate

    m, (nx, ny) = specimen.material, (41, 5)
    constants = (m.Ex, m.Ey, m.nu_xy, m.Gxy, m.Gxz, m.Gyz)
    prop = laminated_plate(
        stack=[0.0], plyt=specimen.thickness, laminaprop=constants, rho=m.density
    )
    prop.scf_k13 = prop.scf_k23 = 5 / 6
    along, across = (
        np.linspace(0, specimen.length, nx),
        np.linspace(-specimen.width / 2, specimen.width / 2, ny),
    )
    x, y = np.meshgrid(along, across, indexing="ij")
    coordinates = np.column_stack([x.ravel(), y.ravel(), np.zeros(nx * ny)]).astype(DOUBLE)
    flat, data, probe = coordinates.ravel(), Quad4RData(), Quad4RProbe()
    corner = (np.arange(nx - 1)[:, None] * ny + np.arange(ny - 1)).ravel()
    size_k, size_m, count = data.KC0_SPARSE_SIZE, data.M_SPARSE_SIZE, corner.size
    kr, kc, kv = (np.zeros(size_k * count, kind) for kind in (INT, INT, DOUBLE))
    mr, mc, mv = (np.zeros(size_m * count, kind) for kind in (INT, INT, DOUBLE))
    for number, first in enumerate(corner.tolist()):
        quad = Quad4R(probe)
        quad.c1, quad.c2, quad.c3, quad.c4 = (
            DOF * node for node in (first, first + ny, first + ny + 1, first + 1)
        )
        quad.init_k_KC0, quad.init_k_M = number * size_k, number * size_m
        quad.update_rotation_matrix(flat)
        quad.update_probe_xe(flat)
        quad.update_KC0(kr, kc, kv, prop)
        quad.update_M(mr, mc, mv, prop)
    total = DOF * nx * ny
    keep = np.zeros((nx * ny, DOF), dtype=bool)
    keep[coordinates[:, 0] > 0, 2:5] = True
    free = np.flatnonzero(keep.ravel())
    triples = ((kv, kr, kc), (mv, mr, mc))
    return _frequencies(
        *(
            coo_matrix((v, (r, c)), shape=(total, total)).tocsc()[free][:, free]
            for v, r, c in triples
        )
    )


def calculix(specimen: Specimen) -> np.ndarray:
    """Ten frequencies of a cantilever of 40 × 4 S8R shells; it has in-plane modes too."""
    return calculix_frequencies(
        ccx([*_shells(specimen), "*STEP", "*FREQUENCY", str(MODES), "*END STEP"])
    )


def _shells(specimen: Specimen) -> list[str]:
    """Mesh, material and clamp."""
    mesh, m = strip(specimen.length, specimen.width, 40, 4), specimen.material
    lines = [
        "*NODE, NSET=ALL",
        *(f"{i + 1},{x:.12g},{y:.12g},0" for i, (x, y, _) in enumerate(mesh.nodes)),
    ]
    lines.append("*ELEMENT, TYPE=S8R, ELSET=E")
    lines += [",".join(map(str, [i + 1, *(e + 1)])) for i, e in enumerate(mesh.blocks[0].nodes)]
    root = ",\n".join(str(node + 1) for node in mesh.node_sets["start"])
    lines += ["*NSET, NSET=ROOT", root, "*MATERIAL, NAME=M", "*ELASTIC, TYPE=ENGINEERING CONSTANTS"]
    nu = m.nu_xy
    lines += [f"{m.Ex:g},{m.Ey:g},{m.Ey:g},{nu:g},{nu:g},{nu:g},{m.Gxy:g},{m.Gxz:g}", f"{m.Gyz:g}"]
    lines += [
        "*DENSITY",
        f"{m.density:g}",
        "*SHELL SECTION, ELSET=E, MATERIAL=M",
        f"{specimen.thickness:g}",
    ]
    return [*lines, "*BOUNDARY", "ROOT,1,6"]


# Both stages as `least_squares` solves them: the same misfits, unknowns, priors and starts, by
# differences. What it has of us is the model, and the weights that our estimate took; so it must
# come to the same estimates.


@dataclass
class ElasticByDifferences:
    """Stage 1: a residual with a full eigenvalue solution in it, counted."""

    forward: ForwardModel
    modes: MeasuredModes
    ours: ElasticResult

    def __post_init__(self) -> None:
        self.solves = 0
        self.rows, self.columns = (
            list(side) for side in zip(*self.ours.pairing.pairs, strict=True)
        )
        n = self.ours.problem.residual.size
        self.root = cholesky(
            np.linalg.inv(self.ours.problem.noise + self.ours.discrepancy**2 * np.eye(n))
        )

    def residual(self, theta: np.ndarray) -> np.ndarray:
        """Frequency errors and distances from the prior, in standard deviations."""
        self.solves += 1
        found = self.forward.solve(theta).frequency_hz[self.columns]
        prior = self.ours.prior
        errors = self.root @ np.log(found / self.modes.frequency_hz[self.rows])
        return np.concatenate([errors, (prior.xi(theta) - prior.xi_mean) / prior.xi_sd])

    def fit(self) -> OptimizeResult:
        """From the prior's mean, in units of the prior; smaller steps drown in the round-off of the
        eigenvalues.
        """
        prior = self.forward.parametrisation
        return least_squares(
            self.residual, prior.prior_mean, x_scale=prior.prior_sd, method="trf", diff_step=1e-5
        )


@dataclass
class DampingByDifferences:
    """Stage 2: Rayleigh's a0 and a1, a shift and a rate of its own of each mode, a gain of each
    measured one; counted.
    """

    misfit: FrfMisfit
    nuisance: Nuisance
    unit: np.ndarray  # of a0 and a1, so that its steps suit them

    def __post_init__(self) -> None:
        assert self.misfit.gain_sd is not None, "`noise` weights have gains"
        self.syntheses = 0
        self.sd = np.sqrt(self.misfit.variance / 2)  # of the real and of the imaginary part
        self.ends = np.cumsum([2, self.nuisance.modes.size, self.nuisance.modes.size])
        self.gain_sd = self.misfit.gain_sd[self.misfit.gained]

    def residual(self, x: np.ndarray) -> np.ndarray:
        """Real and imaginary parts of all lines of all FRFs, and the priors, in standard
        deviations.
        """
        self.syntheses += 1
        (a, shift, own, gain), model, n = np.split(x, self.ends), self.misfit.model, self.nuisance
        omega, residues = model.omega.copy(), model.residues.copy()
        omega[n.modes] *= 1 + shift
        residues[:, self.misfit.gained] *= 1 + gain
        law = RAYLEIGH.basis(omega) @ (a * self.unit)
        rate = law.copy()
        rate[n.modes] = np.exp(own)
        body, frfs = replace(model, eigenvalue=omega**2, residues=residues), self.misfit.frfs
        error = (body.synthesise(frfs.frequency_hz, rate) - frfs.values) / self.sd
        off = (own - np.log(np.abs(law[n.modes]))) / n.deviation_sd
        prior = [shift / n.shift_sd, off, gain / self.gain_sd]
        return np.concatenate([error.real.ravel(), error.imag.ravel(), *prior])

    def fit(self, start: np.ndarray) -> OptimizeResult:
        """From coefficients of the law."""
        n, omega = self.nuisance, self.misfit.model.omega.copy()
        omega[n.modes] *= 1 + n.first_shift
        own = np.log(RAYLEIGH.basis(omega)[n.modes] @ start)
        first = np.concatenate([start / self.unit, n.first_shift, own, np.zeros(self.gain_sd.size)])
        return least_squares(self.residual, first, x_scale="jac", method="trf")
