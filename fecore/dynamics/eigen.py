"""Undamped modes of K φ = λ M φ: block Lanczos with shift-invert and full reorthogonalisation.

With a shift σ below the wanted eigenvalues, the operator (K - σM)⁻¹M has the eigenvalues 1/(λ - σ),
so the lowest modes are its largest and converge first. One start vector finds them with the fewest
solves, but of a repeated root it finds one mode; a block finds as many as it is wide (Grimes, Lewis
and Simon, SIAM J. Matrix Anal. Appl. 15, 1994). So where modes are found missing, the iteration
runs again with a block.

Rigid-body modes are known exactly, so the iteration is kept M-orthogonal to them and they are
returned with λ = 0. An image has parts along the last two blocks only; what else round-off brings
is taken out of it in full, and where need be once more after scaling, so no ghost modes appear; and
the inertia of K - μM (Sylvester: its negative eigenvalues are the modes below μ) proves that none
is missing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from fecore.arrays import FloatArray, IntArray
from fecore.dynamics.factor import Factor, factorise, negative_eigenvalues
from fecore.errors import InputError, ModelError

_MOST = 12  # vectors a wanted mode, and blocks; beyond it the iteration has failed
# dofs from where a factor outgrows the caches: it is read once for six vectors, not for each
_LARGE, _WIDE = 20_000, 6
_TOLERANCE = 1e-10  # relative residual of 1/(λ - σ); the eigenvalue's own error is its square
_INDEFINITE = 1e-8  # share of a block's energy that round-off may make of nothing
# share of the longest direction's square above which the others lose nothing that matters
_EVEN = 1e-4
_ABOVE_ROUND_OFF = (
    # first shift, as a share of the energy that a rigid motion's terms would have if none cancelled
    1e-9
)
_NEAR = 0.01  # share of the first elastic eigenvalue's scale that is as good a shift
# share of what a motion's terms would have if none cancelled: its energy is their round-off alone
_NO_ENERGY = 1e-15
_CAUSE = {"stiffness": "support", "mass": "density"}
# rows with mass, up to which a dense problem stands in: where others have none, or the iteration
# fails
_FEW = 300
_MASS_INDEFINITE = "the mass matrix is not positive definite: some motion has a mass below 0"
_DEPENDENT = 1e-12  # a direction that shrank so much in orthogonalisation is round-off


class MechanismError(ModelError):
    """Nothing resists a motion that is not one of the whole body.

    Attributes:
        shape: (dofs,) the motion.
    """

    def __init__(self, message: str, shape: FloatArray | None = None) -> None:
        super().__init__(message)
        self.shape = np.zeros(0) if shape is None else shape


class FewModesError(InputError):
    """There are fewer modes than are asked for.

    Attributes:
        available: how many there are besides rigid motions.
    """

    def __init__(self, count: int, rigid: int, available: int, dofs: int) -> None:
        there = (
            f"the model has {dofs} dofs, {rigid} rigid-body modes and {max(available, 0)} others"
        )
        expected = f"expected at least {rigid + 1} and at most {rigid + available}: {there}"
        super().__init__(
            "count",
            f"is {count}, {expected if available > 0 else f'and nothing vibrates: {there}'}",
        )
        self.arguments, self.available = (count, rigid, available, dofs), available

    def __reduce__(self) -> tuple[type[FewModesError], tuple[int, int, int, int]]:
        """Survive pickling."""
        return type(self), self.arguments


@dataclass(frozen=True)
class NormalModes:
    """Undamped modes, in ascending order, rigid-body modes first."""

    eigenvalue: FloatArray  # (n,) λ = ω², rad²/s²
    shapes: FloatArray  # (dofs, n) mass-normalised shapes, φᵀMφ = 1
    rigid: int  # number of rigid-body modes
    shift: float  # σ of the factorisation, rad²/s²
    factor: Factor  # factorisation of K - σM, for residual terms and derivatives

    @property
    def omega(self) -> FloatArray:
        """(n,) natural circular frequencies, rad/s."""
        return np.sqrt(self.eigenvalue)

    @property
    def frequency_hz(self) -> FloatArray:
        """(n,) natural frequencies, Hz."""
        return self.omega / (2 * np.pi)


def modes_below(
    stiffness: scipy.sparse.csc_array,
    mass: scipy.sparse.csc_array,
    eigenvalue: float,
    like: Factor | None = None,
) -> int:
    """Number of modes with λ < `eigenvalue`, from the inertia of K - λM; `like` as in
    `factorise`.
    """
    return negative_eigenvalues(shifted(stiffness, mass, eigenvalue), like)


def normal_modes(
    stiffness: scipy.sparse.csc_array,
    mass: scipy.sparse.csc_array,
    count: int,
    rigid_modes: FloatArray | None = None,
    like: Factor | None = None,
) -> NormalModes:
    """The `count` lowest modes of K φ = λ M φ, rigid-body modes included.

    Args:
        stiffness: (dofs, dofs) K, positive semi-definite.
        mass: (dofs, dofs) M, positive semi-definite; where it is singular K - σM is definite on its
            null space.
        count: how many modes.
        rigid_modes: (dofs, r) a basis of the null space of K; None where K is definite.
        like: as in `factorise`.

    Raises:
        FewModesError: there are not so many modes.
        ModelError: K - σM is not positive definite, the iteration does not converge, or a mode is
            missing.
        MechanismError: K resists nothing of a motion that `rigid_modes` do not have.
    """
    rigid = mass_orthonormal(rigid_modes, mass)
    free = rigid.shape[1]
    elastic = count - free
    heavy = np.flatnonzero(mass.diagonal())
    if elastic < 1 or elastic > len(heavy) - free:
        raise FewModesError(count, free, len(heavy) - free, stiffness.shape[0])
    _check_diagonal(stiffness, mass)
    shift, factor = (
        _near_first(stiffness, mass, rigid, like) if free else (0.0, factorise(stiffness, like))
    )
    # symmetry repeats a root no more than twice
    first = (1, 2) if stiffness.shape[0] < _LARGE else (_WIDE,)
    few = len(heavy) <= _FEW
    missing, pairs = 0, None
    # and so many hold any
    for width in () if few and len(heavy) < mass.shape[0] else (*first, elastic + 2):
        pairs = _lanczos(factor, mass, rigid, elastic, width)
        if pairs is None:
            break
        value, vectors = pairs
        eigenvalue = shift + 1 / value
        missing = _missing(stiffness, mass, eigenvalue, free, factor)
        if not missing:
            break
    else:
        pairs = None
    if pairs is None and few:
        value, vectors = _condensed(factor, mass, rigid, heavy)
        if elastic > len(value):
            raise FewModesError(count, free, len(value), stiffness.shape[0])
        eigenvalue, vectors = shift + 1 / value[:elastic], vectors[:, :elastic]
    elif pairs is None:
        raise ModelError(f"of the {count} lowest modes {missing or 'some'} were not found")
    _require_energy(stiffness, vectors)
    shapes = np.hstack([rigid, vectors])
    return NormalModes(np.concatenate([np.zeros(free), eigenvalue]), shapes, free, shift, factor)


def _require_energy(stiffness: scipy.sparse.csc_array, vectors: FloatArray) -> None:
    """Refuse modes whose energy φᵀKφ is round-off of |φ|ᵀ|K||φ|: mechanisms, whose λ has no digit
    that is right.
    """
    energy = np.einsum("dn,dn->n", vectors, stiffness @ vectors)
    terms = np.einsum("dn,dn->n", abs(vectors), abs(stiffness) @ abs(vectors))
    without = np.flatnonzero(energy <= _NO_ENERGY * terms)
    if without.size:
        raise MechanismError(
            f"the stiffness resists nothing of {without.size} motions that are not of the whole"
            " body: is it a mechanism?",
            vectors[:, without[0]],
        )


def mass_orthonormal(vectors: FloatArray | None, mass: scipy.sparse.csc_array) -> FloatArray:
    """(dofs, r) M-orthonormal basis of the span of (dofs, r) vectors; none for None."""
    if vectors is None or vectors.shape[1] == 0:
        return np.zeros((mass.shape[0], 0))
    scaled: FloatArray = vectors / np.linalg.norm(vectors, axis=0)
    for _ in range(2):  # the second pass removes what the Gram matrix squared of the round-off
        try:
            lower = np.linalg.cholesky(scaled.T @ (mass @ scaled))
        except np.linalg.LinAlgError:
            raise ModelError(
                "a motion of the whole body moves no mass: hold the body, or give what turns an"
                " inertia"
            ) from None
        scaled = scaled @ np.linalg.inv(lower).T
    return scaled


def _check_diagonal(stiffness: scipy.sparse.csc_array, mass: scipy.sparse.csc_array) -> None:
    """Name the dof where a fault of the model shows at once."""
    for name, matrix in (("stiffness", stiffness), ("mass", mass)):
        diagonal = matrix.diagonal()
        if (
            diagonal.min() < 0
            or not diagonal.any()
            or (name == "stiffness" and diagonal.min() == 0)
        ):
            raise ModelError(
                f"the {name} matrix is not positive definite: is the {_CAUSE[name]} right? "
                f"At dof {diagonal.argmin()} it has {diagonal.min():.3g} on its diagonal"
            )


def _near_first(
    stiffness: scipy.sparse.csc_array,
    mass: scipy.sparse.csc_array,
    rigid: FloatArray,
    like: Factor | None,
) -> tuple[float, Factor]:
    """A negative shift at which K - σM is definite and well conditioned, and its factor.

    Rigid motions have no energy because large terms cancel, to round-off of these terms. A shift
    far above that is definite, and the quotient xᵀKx / xᵀMx after one inverse iteration with it
    has the scale of the first elastic eigenvalue, which is a good shift.
    """
    shift = -_ABOVE_ROUND_OFF * float(np.max(stiffness.diagonal() @ rigid**2))
    factor = factorise(shifted(stiffness, mass, shift), like)
    start = np.random.default_rng(0).standard_normal(mass.shape[0])
    vector = factor.solve(mass @ (start - rigid @ (rigid.T @ (mass @ start))))
    vector = vector - rigid @ (rigid.T @ (mass @ vector))
    scale = float((vector @ (stiffness @ vector)) / (vector @ (mass @ vector)))
    if scale <= 0 or _NEAR * scale <= -shift <= scale:  # below 0 is round-off, of a mechanism
        return shift, factor
    return -scale, factorise(shifted(stiffness, mass, -scale), factor)


def shifted(
    stiffness: scipy.sparse.csc_array, mass: scipy.sparse.csc_array, shift: float
) -> scipy.sparse.csc_array:
    """K - σM, which is a difference of arrays where both have one pattern."""
    if not shift:
        return stiffness
    if stiffness.nnz != mass.nnz or not np.array_equal(stiffness.indices, mass.indices):
        return scipy.sparse.csc_array(stiffness - shift * mass)
    data = stiffness.data - shift * mass.data
    return scipy.sparse.csc_array(
        (data, stiffness.indices, stiffness.indptr), shape=stiffness.shape
    )


def _condensed(
    factor: Factor, mass: scipy.sparse.csc_array, rigid: FloatArray, heavy: IntArray
) -> tuple[FloatArray, FloatArray]:
    """All eigenpairs of (K - σM)⁻¹M outside the rigid modes, descending, M-orthonormal, where few
    rows have mass.

    With M = L Lᵀ of as many columns as its rank, those of Lᵀ(K - σM)⁻¹L, which is dense: rows
    without mass follow the others.
    """
    weight, turn = np.linalg.eigh(mass[heavy][:, heavy].toarray())
    if weight[0] < -_INDEFINITE * weight[-1]:
        raise ModelError(_MASS_INDEFINITE)
    keep = weight > _DEPENDENT * weight[-1]
    root = np.zeros((mass.shape[0], int(keep.sum())))
    root[heavy] = turn[:, keep] * np.sqrt(weight[keep])
    images = factor.solve(root)
    inside = root.T @ rigid
    outside = np.eye(root.shape[1]) - inside @ inside.T
    value, small = np.linalg.eigh(outside @ (root.T @ images) @ outside)
    count = root.shape[1] - rigid.shape[1]
    value, small = value[::-1][:count], small[:, ::-1][:, :count]
    return value, images @ small / value


def _lanczos(
    factor: Factor, mass: scipy.sparse.csc_array, rigid: FloatArray, number: int, width: int
) -> tuple[FloatArray, FloatArray] | None:
    """The `number` largest eigenpairs of (K - σM)⁻¹M outside the rigid modes, descending,
    M-orthonormal; None where the iteration does not find them.
    """
    dofs, free = rigid.shape
    basis = _Basis(rigid, mass, 4 * number + 2 * width)
    random, light = np.random.default_rng(0), not mass.diagonal().all()

    def start(count: int) -> FloatArray:
        """Random vectors, without parts that have no mass, which the M-norm would not see (Ericsson
        1986).
        """
        rows = random.standard_normal((count, dofs))
        return factor.solve(mass @ rows.T).T if light else rows

    basis.append(basis.orthonormalise(start(min(width, dofs - free))))
    projected: FloatArray = np.zeros((0, 0))
    look = 7 * number // 4 + 8 * width  # before, nothing has converged
    before = 0  # where the last block but one begins
    while len(projected) <= _MOST * (number + width):
        done = len(projected)
        image = factor.solve(basis.mass_images[free + done :].T).T
        block = basis.orthonormalise(image, free + before)
        before = done
        projected = _bordered(projected, block.inside[:, free:])
        size = len(projected)
        exhausted = len(block.vectors) == 0
        if size >= number and (exhausted or size >= look):
            value, small = np.linalg.eigh(projected)
            value, small = value[: -number - 1 : -1], small[:, : -number - 1 : -1]
            worst = float(np.max(np.linalg.norm(block.coupling @ small[done:], axis=0) / value))
            if exhausted or worst <= _TOLERANCE:
                return value, basis.vectors[free:].T @ small
            # a step gains about a digit
            look = size + width * max(1, round(np.log10(worst / _TOLERANCE)))
        if exhausted:  # the space is invariant, and what is missing lies outside it
            block = basis.orthonormalise(start(min(width, dofs - free - size)))
        basis.append(block)
    return None


def _bordered(matrix: FloatArray, rows: FloatArray) -> FloatArray:
    """A symmetric matrix with (b, s) rows appended below, and the same as columns."""
    done, size = len(matrix), rows.shape[1]
    bordered = np.empty((size, size))
    bordered[:done, :done] = matrix
    bordered[done:] = rows
    bordered[:, done:] = rows.T
    return bordered


@dataclass(frozen=True)
class _Block:
    """What orthonormalising a (b, dofs) block Y gives: Y = H V + RᵀX with V the space so far."""

    vectors: FloatArray  # X, (r, dofs), M-orthonormal and M-orthogonal to V
    mass_images: FloatArray  # X M
    inside: FloatArray  # H, (b, s)
    coupling: FloatArray  # R, (r, b)


class _Basis:
    """An M-orthonormal basis that grows by blocks, with the images of its vectors under M; vectors
    are rows.
    """

    def __init__(self, vectors: FloatArray, mass: scipy.sparse.csc_array, room: int) -> None:
        # M is symmetric: its columns are its rows, and products by rows are the faster ones. Its
        # pattern is K's, so most of what it stores is zero.
        self._mass = scipy.sparse.csr_array(
            (mass.data, mass.indices, mass.indptr), shape=mass.shape, copy=True
        )
        self._mass.eliminate_zeros()
        self._size = vectors.shape[1]
        self._store = np.empty((2, self._size + room, len(vectors)))
        self._store[:, : self._size] = vectors.T, self._image(vectors.T)

    @property
    def vectors(self) -> FloatArray:
        """(s, dofs) basis."""
        return self._store[0, : self._size]

    @property
    def mass_images(self) -> FloatArray:
        """(s, dofs) the basis times M."""
        return self._store[1, : self._size]

    def append(self, block: _Block) -> None:
        """Take in a block."""
        size, width = self._size, len(block.vectors)
        if size + width > self._store.shape[1]:
            larger = np.empty((2, 2 * size + width, self._store.shape[2]))
            larger[:, :size] = self._store[:, :size]
            self._store = larger
        self._store[0, size : size + width] = block.vectors
        self._store[1, size : size + width] = block.mass_images
        self._size += width

    def orthonormalise(self, block: FloatArray, first: int = 0) -> _Block:
        """M-orthonormal basis of what of `block` lies outside the space. Of vectors before the
        `first` it has only round-off.

        Twice is enough for orthogonality to round-off (Kahan and Parlett) unless the block's
        directions shrink to very different lengths; then once more after scaling restores what the
        short ones have lost.
        """
        inside = np.zeros((len(block), self._size))
        inside[:, first:] = block @ self.mass_images[first:].T
        outside = block - inside[:, first:] @ self.vectors[first:]
        outside -= (outside @ self.mass_images.T) @ self.vectors
        image = self._image(outside)
        gram = outside @ image.T
        # the block's energy, inside and outside
        scale = float(np.vdot(inside, inside) + gram.trace())
        root, indefinite = scipy.linalg.lapack.dpotrf(gram, lower=1)
        length = root.diagonal() ** 2
        if indefinite or length.min() < max(_EVEN * length.max(), _EVEN**2 * scale):
            scaled, image, coupling = self._uneven(outside, image, gram, scale)
            return _Block(scaled, image, inside, coupling)
        inverse, _ = scipy.linalg.lapack.dtrtri(root, lower=1)
        if len(block) == 1:  # products of one row cost as much as solving for it
            return _Block(inverse * outside, inverse * image, inside, root.T)
        return _Block(inverse @ outside, inverse @ image, inside, root.T)

    def _uneven(
        self, outside: FloatArray, image: FloatArray, gram: FloatArray, scale: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Orthonormal vectors of directions of very different lengths, their images, and R; those
        of round-off are left out.
        """
        weight, turn = np.linalg.eigh(gram)
        if weight[0] < -_INDEFINITE * scale:
            raise ModelError(_MASS_INDEFINITE)
        keep = weight > _DEPENDENT**2 * scale
        root, turn = np.sqrt(weight[keep]), turn[:, keep]
        scaled, image, again = self._restored((turn / root).T @ outside)
        return scaled, image, again @ (root[:, None] * turn.T)

    def _restored(self, scaled: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Nearly orthonormal vectors made orthonormal, their images, and by what they were
        multiplied, inverted.

        The squares of a Gram matrix lose its nearly dependent directions in round-off; measured
        again they are right.
        """
        scaled = scaled - (scaled @ self.mass_images.T) @ self.vectors
        image = self._image(scaled)
        weight, turn = np.linalg.eigh(scaled @ image.T)
        keep = weight > _INDEFINITE
        root, turn = np.sqrt(weight[keep]), turn[:, keep]
        return (turn / root).T @ scaled, (turn / root).T @ image, root[:, None] * turn.T

    def _image(self, rows: FloatArray) -> FloatArray:
        return np.ascontiguousarray((self._mass @ rows.T).T)


def _missing(
    stiffness: scipy.sparse.csc_array,
    mass: scipy.sparse.csc_array,
    eigenvalue: FloatArray,
    rigid: int,
    like: Factor,
) -> int:
    """How many modes lie below the last gap between well-separated modes and were not found
    (Sturm).
    """
    gaps = np.flatnonzero(eigenvalue[1:] > eigenvalue[:-1] * (1 + 1e-6))
    if gaps.size == 0:
        return 0
    last = int(gaps[-1])
    # Just below the next mode, so that none can hide between the two; the margin is for round-off.
    below = max(np.sqrt(eigenvalue[last] * eigenvalue[last + 1]), 0.999 * eigenvalue[last + 1])
    return modes_below(stiffness, mass, float(below), like) - last - 1 - rigid
