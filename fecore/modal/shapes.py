"""Residues to mode shapes, and two modes under one pole.

With viscous damping that does not couple the modes, the residue of pole k between dofs i and j is
R_ij = φ_i φ_j / (2iω_d), with φ normalised to unit modal mass. A = 2iω_d R is therefore real, of
rank one, and positive at a driving point. Measured A are complex and noisy: the shape is the best
rank-one factor, turned to the phase in which it is as real as can be.

The residues of one mode, roving by fixed dofs, are a matrix of rank one, ψ lᵀ: l, its modal
participation, is how well each reference sees it. Modes so near to each other that the series has
one pole for them leave a matrix of rank two. With several references l distinguishes them even where
their frequencies agree. In place of the pole

    H_ij(s) = Σ_q ψ_qi l_qj/(s - s_q) + conj.  + all other terms of the series,     q = 1, 2,

and to first order in the shifts δ_q = s_q - s_0 the sum is P/(s - s_0) + Q/(s - s_0)², P = Σ ψ_q
l_qᵀ, Q = Σ δ_q ψ_q l_qᵀ. In the two leading singular directions of P, Q P⁻¹ = A diag(δ) A⁻¹: its
eigenvalues are the shifts, the rows of A⁻¹P are the l_q. From there the unknowns θ, (ln f₁, ln f₂,
ζ₁, ζ₂) and the real and imaginary parts of l_q but for its largest entry, which is 1, are refined by
least squares over all lines. The shapes ψ and the coefficients of the other terms are eliminated
(variable projection), one matrix for all roving dofs: the skirts of neighbours are as large as what
separates the two modes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy

from fecore.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from fecore.findings import Finding
from fecore.modal.arrangement import CLEAR, FEW, Arrangement
from fecore.modal.errors import widened
from fecore.modal.findings import finding
from fecore.modal.refine import PoleFit
from fecore.modal.series import (
    DAMPING_RANGE,
    Terms,
    columns,
    derivatives,
    solved,
    stacked,
    whitening,
)

# second singular value of the residues over the first from which there are two modes
_SECOND_SHAPE = 0.1
_FAULTY = 0.1  # of the dofs that may be met with a wrong sign
# standard deviations that a driving-point residue must be above zero to normalise by it
_SURE = 4.0
_NEAR = 2.0  # half bandwidths of the pole within which both modes must lie


@dataclass(frozen=True)
class Shapes:
    """Shapes of n modes at p roving dofs."""

    # (n, p) complex shapes, largest magnitude 1, turned as near to real as they go
    complex: ComplexArray
    real: FloatArray  # (n, p) realised shapes (the real part of `complex`), signed
    # (n, p) standard deviation of `complex` (root of E|error|²) beside its largest entry, which is
    # 1 by definition
    sd: FloatArray
    collinearity: FloatArray  # (n,) modal phase collinearity, 1 for a real mode
    # (n, p) real shapes for unit modal mass, 1/√kg; None where no driving point was measured, NaN
    # rows where its residue is not clearly positive
    mass_normalised: FloatArray | None

    def select(self, which: IntArray) -> Shapes:
        """The shapes of some modes."""
        mass = None if self.mass_normalised is None else self.mass_normalised[which]
        return Shapes(
            self.complex[which], self.real[which], self.sd[which], self.collinearity[which], mass
        )


@dataclass(frozen=True)
class ClosePair:
    """Two modes in place of pole k."""

    pole: int  # k, its number in the terms
    frequency_hz: FloatArray  # (2,) ascending
    damping_ratio: FloatArray  # (2,)
    covariance: FloatArray  # (4, 4) of (ln f₁, ln f₂, ζ₁, ζ₂)
    residues: ComplexArray  # (N, 2) of rank one each
    variance: FloatArray  # (N, 2) E|error|² of the residues


@dataclass(frozen=True)
class SeparatedFit(PoleFit):
    """A fit in which some poles stand for two modes each, whose residues are of rank one."""

    base: PoleFit = field(kw_only=True)  # the fit with one pole for both
    places: IntArray = field(kw_only=True)  # number of the old pole of each new one
    pairs: tuple[ClosePair, ...] = field(
        kw_only=True
    )  # the pairs, in ascending number of their pole

    @cached_property
    def residues(self) -> ComplexArray:
        """(N, n) residues of the receptance; those beside a pair are of the fit with one pole for
        it.
        """
        values = self.base.residues[:, self.places]
        for first, pair in _first_of(self.pairs):
            values[:, first : first + 2] = pair.residues
        return values

    @cached_property
    def residue_variance(self) -> FloatArray:
        """(N, n) E|error|² of the residues."""
        spread = self.base.residue_variance[:, self.places]
        for first, pair in _first_of(self.pairs):
            spread[:, first : first + 2] = pair.variance
        return spread

    @cached_property
    def parameter_covariance(self) -> FloatArray:
        """Covariance of the non-linear parameters; that of a pair stands alone."""
        n, base, at = self.base.terms.pairs, self.base.parameter_covariance, self.places
        which = np.concatenate([at, n + at, np.arange(2 * n, len(base))])
        covariance = base[np.ix_(which, which)]
        for first, pair in _first_of(self.pairs):
            own = np.array([first, first + 1, at.size + first, at.size + first + 1])
            covariance[own, :] = covariance[:, own] = 0.0
            covariance[np.ix_(own, own)] = pair.covariance
        return np.asarray(covariance)


def phase_collinearity(shape: ComplexArray) -> float:
    """Modal phase collinearity, 1 when all entries share a phase (or its opposite) and 0 when
    phases are scattered.

    MPC = ((S_xx - S_yy)² + 4 S_xy²) / (S_xx + S_yy)², x and y the real and imaginary parts (Pappa,
    Elliott and Schenk 1993, without the removal of means, which has no meaning for shapes) =
    |Σψ²|²/(Σ|ψ|²)².
    """
    total = float(np.sum(np.abs(shape) ** 2))
    return float(np.abs(np.sum(shape**2)) ** 2 / total**2) if total > 0 else float("nan")


def turn_real(shape: ComplexArray) -> ComplexArray:
    """The shape times the unit phase that makes its imaginary part least, ½ arg Σψ²; largest real
    entry positive.
    """
    turned = shape * np.exp(-0.5j * np.angle(np.sum(shape**2)))
    largest = turned[np.argmax(np.abs(turned))]
    return np.asarray(turned if largest.real >= 0 else -turned)


def shapes_from_residues(
    arrangement: Arrangement, residues: ComplexArray, variance: FloatArray, damped_omega: FloatArray
) -> Shapes:
    """Shapes at the roving dofs from residues of all FRFs.

    Args:
        arrangement: which FRF lies between which dofs.
        residues: (N, n) receptance residues.
        variance: (N, n) their variance E|error|².
        damped_omega: (n,) damped circular frequencies of the poles, rad/s.
    """
    p, n = len(arrangement.roving), damped_omega.size
    scaled = 2j * damped_omega * residues
    spread = (2 * damped_omega) ** 2 * variance
    psi, sd = np.zeros((n, p), dtype=complex), np.zeros((n, p))
    collinearity, mass = np.ones(n), np.full((n, p), np.nan)
    for k in range(n):
        vector, error, factor = _rank_one(arrangement, scaled[:, k], spread[:, k])
        turned = turn_real(vector)
        largest = int(np.argmax(np.abs(turned)))
        unit = turned / np.abs(turned[largest])
        psi[k] = unit
        sd[k] = np.sqrt(error**2 + np.abs(unit) ** 2 * error[largest] ** 2) / np.abs(
            turned[largest]
        )
        sd[k, largest] = 0.0
        collinearity[k] = phase_collinearity(unit)
        mass[k] = _mass_normalised(
            arrangement, scaled[:, k], spread[:, k], unit.real, vector, factor
        )
    driven = any(a == b for a, b in arrangement.pairs)
    return Shapes(psi, psi.real.copy(), sd, collinearity, mass if driven else None)


def residue_matrix(arrangement: Arrangement, residues: ComplexArray) -> ComplexArray:
    """(p, m) residues of one mode, roving by fixed dof; NaN where that pair was not measured."""
    matrix = np.full((len(arrangement.roving), len(arrangement.fixed)), np.nan, dtype=complex)
    matrix[arrangement.row[:, 0], arrangement.row[:, 1]] = residues
    return matrix


def of_rank_two(
    arrangement: Arrangement, residues: ComplexArray, variance: FloatArray
) -> BoolArray:
    """(n,) whether the residues (N, n) of each pole against several fixed dofs are two shapes: two
    modes at one frequency.

    The dofs at which the second is largest do not count where there are enough: the wrong sign of
    one FRF is a second shape there, of all modes.
    """
    p, m = len(arrangement.roving), len(arrangement.fixed)
    two = np.zeros(residues.shape[1], dtype=bool)
    measured = {tuple(row) for row in arrangement.row.tolist()}
    if len(arrangement.pairs) != p * m or len(measured) != p * m or min(p, m) < 2:
        return two
    for k in range(two.size):
        matrix = residue_matrix(arrangement, residues[:, k])
        if p >= FEW:
            second = np.abs(np.linalg.svd(matrix, full_matrices=False)[0][:, 1])
            matrix = matrix[np.argsort(second)[: p - max(1, round(_FAULTY * p))]]
        singular = np.linalg.svd(matrix, compute_uv=False)
        # about the largest value of noise alone
        noise = (np.sqrt(p) + np.sqrt(m)) * np.sqrt(np.mean(variance[:, k]))
        two[k] = singular[1] > CLEAR * noise and singular[1] > _SECOND_SHAPE * singular[0]
    return two


def _rank_one(
    arrangement: Arrangement, entries: ComplexArray, variance: FloatArray
) -> tuple[ComplexArray, FloatArray, ComplexArray]:
    """Weighted rank-one fit entries_r ≈ ψ_i l_j (alternating least squares): ψ, its standard
    deviation, and l.
    """
    i, j = arrangement.row.T
    of_roving, of_fixed = (
        np.eye(len(arrangement.roving))[i],
        np.eye(len(arrangement.fixed))[j],
    )  # sum over the entries of a dof
    m, tiny = len(arrangement.fixed), np.finfo(float).tiny
    weight: FloatArray = 1 / np.maximum(variance, 1e-30 * np.max(variance, initial=1e-270))
    strongest = int(np.argmax((np.abs(entries) ** 2 * weight) @ of_fixed))
    factor = np.eye(m, dtype=complex)[strongest]
    if m > 1:  # start: correlate every column with the strongest one over the dofs that they share
        columns = np.nan_to_num(residue_matrix(arrangement, entries))
        known = columns[:, strongest]
        for column, other in enumerate(columns.T):
            shared = np.abs(known) * (other != 0)
            factor[column] = np.vdot(known, other) / np.sum(shared**2) if np.any(shared) else 0.0
    for _ in range(60):  # more change no digit that counts
        information = np.maximum((weight * np.abs(factor[j]) ** 2) @ of_roving, tiny)
        vector = (weight * factor[j].conj() * entries) @ of_roving / information
        if m == 1:
            if _usual(information).all():  # it sees all dofs alike
                return vector, 1 / np.sqrt(information), factor
            break
        own = (weight * np.abs(vector[i]) ** 2) @ of_fixed
        factor = (weight * vector[i].conj() * entries) @ of_fixed / np.maximum(own, tiny)
        factor /= np.max(np.abs(factor))
    return *_shrunk(vector, information), factor


def _usual(information: FloatArray) -> BoolArray:
    """(p,) entries that are known about as well as most."""
    return np.asarray(information * CLEAR**2 >= np.median(information))


def _shrunk(vector: ComplexArray, information: FloatArray) -> tuple[ComplexArray, FloatArray]:
    """Posterior means and standard deviations of entries whose prior spread is that of the entries
    that are known about as well as most.

    ψ_i ~ N(0, s²), s² the mean of |ψ̂_i|² - 1/w_i with w_i = 1/var ψ̂_i. A dof that only a reference
    near a node sees, or an FRF that is noise or has no line there, is noise alone: it must not be
    the largest of the shape.
    """
    usual = _usual(information)
    power = float(np.mean((np.abs(vector) ** 2 - 1 / information)[usual]))
    if power <= 0:
        return vector, 1 / np.sqrt(information)
    total = information + 1 / power
    return np.asarray(vector * information / total), 1 / np.sqrt(total)


def _mass_normalised(
    arrangement: Arrangement,
    entries: ComplexArray,
    variance: FloatArray,
    real: FloatArray,
    vector: ComplexArray,
    factor: ComplexArray,
) -> FloatArray:
    """Shape for unit modal mass, from the strongest driving point; NaN where none is clearly
    positive.
    """
    driving = [r for r, (a, b) in enumerate(arrangement.pairs) if a == b]
    sure = [r for r in driving if entries[r].real > _SURE * np.sqrt(variance[r])]
    if not sure:
        return np.full(real.size, np.nan)
    i, j = arrangement.row[max(sure, key=lambda r: float(entries[r].real))]
    modal = (vector[i] * factor[j]).real  # φ_i² from all data of the mode, not from the one entry
    if modal <= 0 or real[i] == 0:
        return np.full(real.size, np.nan)
    return np.asarray(real * np.sqrt(modal) / abs(real[i]))


def separate_close_modes(
    arrangement: Arrangement, fit: PoleFit, among: IntArray
) -> tuple[PoleFit, IntArray, list[Finding]]:
    """The fit with two modes for each pole, of those numbered, whose residues are of rank two.

    Returns:
        the fit; the number of the old pole of each new one; and what was done.
    """
    f, width = fit.terms.frequency_hz, fit.terms.half_bandwidth_hz
    # a pole beside it is the other mode
    isolated = np.sum(np.abs(f[among] - f[:, None]) < width[:, None], axis=1) <= 1
    two = np.intersect1d(
        among,
        np.flatnonzero(of_rank_two(arrangement, fit.residues, fit.residue_variance) & isolated),
    )
    pairs = tuple(pair for k in two if (pair := _pair(arrangement, fit, int(k))) is not None)
    terms, n = fit.terms, fit.terms.pairs
    at = np.repeat(np.arange(n), 1 + np.isin(np.arange(n), [pair.pole for pair in pairs]))
    if not pairs:
        return fit, at, []
    notes = [
        finding("parted", first=pair.frequency_hz[0], second=pair.frequency_hz[1]) for pair in pairs
    ]
    f, zeta = terms.frequency_hz[at], terms.damping_ratio[at]
    c = fit.linear.coefficients
    c = c[
        :,
        np.concatenate(
            [np.stack([2 * at, 2 * at + 1], axis=1).ravel(), np.arange(2 * n, c.shape[1])]
        ),
    ]
    own = np.zeros(c.shape[1], dtype=bool)
    for first, pair in _first_of(pairs):
        f[first : first + 2], zeta[first : first + 2] = pair.frequency_hz, pair.damping_ratio
        c[:, 2 * first : 2 * first + 4] = np.stack(
            [pair.residues.real, pair.residues.imag], axis=2
        ).reshape(-1, 4)
        own[2 * first : 2 * first + 4] = True
    terms = replace(terms, frequency_hz=f, damping_ratio=zeta)
    basis = columns(arrangement.omega, terms, arrangement.power)
    measured = arrangement.values - fit.background
    values = measured - c[:, own] @ basis[:, own].T
    c[:, ~own] = solved(np.ascontiguousarray(basis.T[~own]).T, values, fit.weights).coefficients
    kept = {name: getattr(fit, name) for name in PoleFit.__dataclass_fields__}
    kept |= {
        "terms": terms,
        "linear": replace(fit.linear, coefficients=c, basis=basis),
        "residual": np.where(arrangement.measured, measured - c @ basis.T, 0),
    }
    return SeparatedFit(**kept, base=fit, places=at, pairs=pairs), at, notes


def _first_of(pairs: tuple[ClosePair, ...]) -> list[tuple[int, ClosePair]]:
    """Each pair with the number of its first mode among the new poles."""
    return [(pair.pole + number, pair) for number, pair in enumerate(pairs)]


def _pair(arrangement: Arrangement, fit: PoleFit, k: int) -> ClosePair | None:
    """The two modes under pole k; None where they are not about it. The errors of the poles reach
    the residues, by one standard deviation along each of their axes.
    """
    site = PairProblem.about(arrangement, fit, k)
    if site is None:
        return None
    two, covariance = site.fitted(site.start(), fit.inflation)
    if not np.all(
        np.abs(two.frequency_hz - site.frequency_hz)
        < _NEAR * site.damping_ratio * site.frequency_hz
    ):
        return None
    residues, variance = site.residues(two)
    variance = variance * fit.inflation
    value, vector = np.linalg.eigh(covariance[:4, :4])
    for size, axis in zip(np.sqrt(np.maximum(value, 0)), vector.T, strict=True):
        theta = two.theta
        theta[:4] += size * axis
        variance = variance + np.abs(site.residues(two.at(theta))[0] - residues) ** 2
    order = np.argsort(two.frequency_hz)
    both = np.concatenate([order, 2 + order])
    return ClosePair(
        pole=k,
        frequency_hz=two.frequency_hz[order],
        damping_ratio=two.damping_ratio[order],
        covariance=covariance[np.ix_(both, both)],
        residues=residues[:, order],
        variance=variance[:, order],
    )


@dataclass(frozen=True)
class PairModes:
    """Two modes."""

    # frequency_hz, damping_ratio: (2,)
    frequency_hz: FloatArray
    damping_ratio: FloatArray
    participation: ComplexArray  # (2, m) how well each reference sees each mode, largest entry 1

    @property
    def free(self) -> BoolArray:
        """(2, m) the entries of `participation` that are unknown."""
        return np.asarray(
            np.arange(self.participation.shape[1])
            != np.argmax(np.abs(self.participation), axis=1)[:, None]
        )

    @property
    def theta(self) -> FloatArray:
        """The unknowns."""
        own = self.participation[self.free]
        return np.concatenate([np.log(self.frequency_hz), self.damping_ratio, own.real, own.imag])

    def at(self, theta: FloatArray) -> PairModes:
        """The modes of other unknowns with the same entries free; damping is kept physical."""
        own, view = np.ones(self.participation.shape, dtype=complex), theta[4:].reshape(2, -1)
        own[self.free] = view[0] + 1j * view[1]
        return PairModes(np.exp(theta[:2]), np.clip(theta[2:4], *DAMPING_RANGE), own)


@dataclass(frozen=True)
class PairProblem:
    """FRFs of p roving against m fixed dofs on all lines, weighted, less what the series without a
    pole can make of them.
    """

    omega: FloatArray  # (L,) rad/s
    power: int  # of iω that makes these FRFs of a receptance
    root: FloatArray  # (m, L) root of the weights 2/v, alike for all roving dofs
    frames: tuple[FloatArray, ...]  # m orthonormal (2 L, r) frames of the other terms
    target: FloatArray  # (2 m L, p) the FRFs, real above imaginary parts, reference after reference
    place: IntArray  # (p, m) number of each FRF
    # frequency_hz, damping_ratio: of the pole
    frequency_hz: float
    damping_ratio: float

    @classmethod
    def about(cls, arrangement: Arrangement, fit: PoleFit, k: int) -> PairProblem | None:
        """The place of pole k, where FRFs were measured between all roving and fixed dofs; None
        where lines are few.
        """
        terms, use = fit.terms, arrangement.measured.all(axis=0)
        others = terms.some(np.arange(terms.pairs) != k)
        if 2 * use.sum() <= others.columns + 4:
            return None
        place = np.empty((len(arrangement.roving), len(arrangement.fixed)), dtype=np.int64)
        place[arrangement.row[:, 0], arrangement.row[:, 1]] = np.arange(len(arrangement.pairs))
        root = np.sqrt(2 / fit.variance[:, use][place].mean(axis=0))
        basis = columns(arrangement.omega[use], others, arrangement.power)
        weighted = [stacked(basis, w) for w in root]
        frames = tuple(each @ whitening(each) for each in weighted)
        own = arrangement.values - fit.background
        values = np.stack(
            [stacked(own[:, use][rows].T, w) for rows, w in zip(place.T, root, strict=True)]
        )
        target = _cleared(frames, values)
        return cls(
            omega=arrangement.omega[use],
            power=arrangement.power,
            root=root,
            frames=frames,
            target=target,
            place=place,
            frequency_hz=float(terms.frequency_hz[k]),
            damping_ratio=float(terms.damping_ratio[k]),
        )

    def start(self) -> PairModes:
        """The two modes to first order in their distance from the pole."""
        at = Terms(np.array([self.frequency_hz]), np.array([self.damping_ratio]), ())
        design = np.concatenate(
            [of(self.omega, at, self.power) for of in (columns, derivatives)], axis=1
        )
        first, second = np.empty((2, *self.place.shape), dtype=complex)
        for j, (frame, root) in enumerate(zip(self.frames, self.root, strict=True)):
            own = _cleared((frame,), stacked(design, root)[None])
            c = np.linalg.lstsq(own, np.split(self.target, len(self.frames))[j], rcond=None)[0]
            first[:, j], second[:, j] = c[0] + 1j * c[1], c[2] + 1j * c[3]
        left, size, right = np.linalg.svd(first, full_matrices=False)
        left, size, right = left[:, :2], size[:2], right[:2]
        shift, vectors = np.linalg.eig(left.conj().T @ second @ right.conj().T / size)
        participation = np.linalg.pinv(vectors) @ (size[:, None] * right)
        pole = at.poles[0]
        s = pole + np.where(
            np.abs(shift) < -pole.real,
            shift,
            -pole.real * shift / np.maximum(np.abs(shift), np.finfo(float).tiny),
        )
        participation = (
            participation / participation[[0, 1], np.argmax(np.abs(participation), axis=1)][:, None]
        )
        return PairModes(
            np.abs(s) / (2 * np.pi), np.clip(-s.real / np.abs(s), *DAMPING_RANGE), participation
        )

    def fitted(self, start: PairModes, inflation: float) -> tuple[PairModes, FloatArray]:
        """Least squares from a start: the modes, and the covariance of θ by the variances'
        inflation, widened by the scatter between the roving dofs. Steps take the roving dofs
        together in the few combinations of them that hold the two modes.
        """
        unit = np.linalg.qr(self._design(start))[0]
        few = self.target @ np.linalg.svd(unit.T @ self.target, full_matrices=False)[2].T
        scale = np.concatenate([np.full(4, self.damping_ratio), np.ones(start.theta.size - 4)])

        def apart(theta: FloatArray, target: FloatArray) -> FloatArray:
            frame = np.linalg.qr(self._design(start.at(theta)))[0]
            return np.asarray(target - frame @ (frame.T @ target)).ravel()

        best = scipy.optimize.least_squares(
            apart, start.theta, x_scale=scale, max_nfev=40, args=(few,)
        ).x
        last = scipy.optimize.least_squares(
            apart, best, x_scale=scale, max_nfev=1, args=(self.target,)
        )
        scores = np.einsum(
            "rpn,rp->pn",
            last.jac.reshape(*self.target.shape, -1),
            last.fun.reshape(self.target.shape),
        )
        inverse = np.linalg.pinv(last.jac.T @ last.jac, hermitian=True)
        return start.at(last.x), widened(inverse, inflation, scores, np.arange(len(scores)))

    def residues(self, modes: PairModes) -> tuple[ComplexArray, FloatArray]:
        """(N, 2) residues ψ_q l_q of all FRFs, and their variance under the weights."""
        frame, triangle = np.linalg.qr(self._design(modes))
        inverse = np.linalg.inv(triangle)
        c, own = inverse @ (frame.T @ self.target), np.sum(inverse**2, axis=1)
        values, spread = (
            np.zeros((self.place.size, 2), dtype=complex),
            np.zeros((self.place.size, 2)),
        )
        for q, participation in enumerate(modes.participation):
            values[self.place, q] = (c[2 * q] + 1j * c[2 * q + 1])[:, None] * participation
            spread[self.place, q] = (own[2 * q] + own[2 * q + 1]) * np.abs(participation) ** 2
        return values, spread

    def _design(self, modes: PairModes) -> FloatArray:
        """(2 m L, 4) columns of Re ψ_q and Im ψ_q, without what the other terms can make of
        them.
        """
        basis = columns(self.omega, Terms(modes.frequency_hz, modes.damping_ratio, ()), self.power)
        real, imag = basis[:, 0::2], basis[:, 1::2]
        both = [
            np.stack(
                [gain.real * real + gain.imag * imag, gain.real * imag - gain.imag * real], axis=2
            )
            for gain in modes.participation.T
        ]
        rows = [
            stacked(own.reshape(len(basis), 4), root)
            for own, root in zip(both, self.root, strict=True)
        ]
        return _cleared(self.frames, np.stack(rows))


def _cleared(frames: tuple[FloatArray, ...], each: FloatArray) -> FloatArray:
    """(2 m L, q) columns (m, 2 L, q) without what the frame of their reference can make of them."""
    return np.concatenate(
        [own - frame @ (frame.T @ own) for frame, own in zip(frames, each, strict=True)]
    )
