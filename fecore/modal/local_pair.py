"""Two modes of rank one in place of a pole: least squares with their shapes and all other terms of
the series eliminated.

The unknowns θ are (ln f₁, ln f₂, ζ₁, ζ₂) and the real and imaginary parts of l_q, how well each
reference sees mode q, but for its largest entry, which is 1. For given θ the shapes ψ_q are linear,
and one matrix serves all roving dofs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from fecore.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from fecore.modal.arrangement import Arrangement
from fecore.modal.basis import DAMPING_RANGE, Terms, columns, derivatives
from fecore.modal.linear import orthonormal, stacked
from fecore.modal.refinement import Fit, widened


@dataclass(frozen=True)
class Modes:
    """Two modes."""

    # frequency_hz, damping_ratio: (2,)
    frequency_hz: FloatArray
    damping_ratio: FloatArray
    seen: ComplexArray  # (2, m) how well each reference sees each mode, largest entry 1

    @property
    def free(self) -> BoolArray:
        """(2, m) the entries of `seen` that are unknown."""
        return np.asarray(
            np.arange(self.seen.shape[1]) != np.argmax(np.abs(self.seen), axis=1)[:, None]
        )

    @property
    def theta(self) -> FloatArray:
        """The unknowns."""
        seen = self.seen[self.free]
        return np.concatenate([np.log(self.frequency_hz), self.damping_ratio, seen.real, seen.imag])

    def at(self, theta: FloatArray) -> Modes:
        """The modes of other unknowns with the same entries free; damping is kept physical."""
        seen, view = np.ones(self.seen.shape, dtype=complex), theta[4:].reshape(2, -1)
        seen[self.free] = view[0] + 1j * view[1]
        return Modes(np.exp(theta[:2]), np.clip(theta[2:4], *DAMPING_RANGE), seen)


@dataclass(frozen=True)
class Site:
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
    def about(cls, arrangement: Arrangement, fit: Fit, k: int) -> Site | None:
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
        frames = tuple(stacked(orthonormal(basis, w)[0], w) for w in root)
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

    def start(self) -> Modes:
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
        seen = np.linalg.pinv(vectors) @ (size[:, None] * right)
        pole = at.poles[0]
        s = pole + np.where(
            np.abs(shift) < -pole.real,
            shift,
            -pole.real * shift / np.maximum(np.abs(shift), np.finfo(float).tiny),
        )
        seen = seen / seen[[0, 1], np.argmax(np.abs(seen), axis=1)][:, None]
        return Modes(np.abs(s) / (2 * np.pi), np.clip(-s.real / np.abs(s), *DAMPING_RANGE), seen)

    def fitted(self, start: Modes, inflation: float) -> tuple[Modes, FloatArray]:
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
        pull = np.einsum(
            "rpn,rp->pn",
            last.jac.reshape(*self.target.shape, -1),
            last.fun.reshape(self.target.shape),
        )
        inverse = np.linalg.pinv(last.jac.T @ last.jac, hermitian=True)
        return start.at(last.x), widened(inverse, inflation, pull, np.arange(len(pull)))

    def residues(self, modes: Modes) -> tuple[ComplexArray, FloatArray]:
        """(N, 2) residues ψ_q l_q of all FRFs, and their variance under the weights."""
        frame, triangle = np.linalg.qr(self._design(modes))
        inverse = np.linalg.inv(triangle)
        c, own = inverse @ (frame.T @ self.target), np.sum(inverse**2, axis=1)
        values, spread = (
            np.zeros((self.place.size, 2), dtype=complex),
            np.zeros((self.place.size, 2)),
        )
        for q, seen in enumerate(modes.seen):
            values[self.place, q] = (c[2 * q] + 1j * c[2 * q + 1])[:, None] * seen
            spread[self.place, q] = (own[2 * q] + own[2 * q + 1]) * np.abs(seen) ** 2
        return values, spread

    def _design(self, modes: Modes) -> FloatArray:
        """(2 m L, 4) columns of Re ψ_q and Im ψ_q, without what the other terms can make of
        them.
        """
        basis = columns(self.omega, Terms(modes.frequency_hz, modes.damping_ratio, ()), self.power)
        real, imag = basis[:, 0::2], basis[:, 1::2]
        both = []
        for seen, root in zip(modes.seen.T, self.root, strict=True):
            own = np.stack(
                [seen.real * real + seen.imag * imag, seen.real * imag - seen.imag * real], axis=2
            )
            both.append(stacked(own.reshape(len(basis), 4), root))
        return _cleared(self.frames, np.stack(both))


def _cleared(frames: tuple[FloatArray, ...], each: FloatArray) -> FloatArray:
    """(2 m L, q) columns (m, 2 L, q) without what the frame of their reference can make of them."""
    return np.concatenate(
        [own - frame @ (frame.T @ own) for frame, own in zip(frames, each, strict=True)]
    )
