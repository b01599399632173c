"""A reduced basis of an affine model: modes for new coefficients in a fraction of a millisecond,
with their error.

The motion is sought in a space V of some tens of vectors: the modes at the coefficients c₀ of the
start, the vectors F₀⁻¹ΔKφ and F₀⁻¹ΔMφ into which they move when a parameter changes the
coefficients (F₀ = K(c₀) - σM(c₀)), and the static deflections under unit forces at reference points
with theirs. As K and M are linear in their coefficients, so are VᵀKV and VᵀMV, and their terms are
projected once (Balmès, Mech. Syst. Signal Process. 10, 1996).

The error of each mode is estimated on every solve. With the residual r = Kφ - λMφ and μ = 1/(λ -
σ),

    |δμ|/μ ≤ ε²/gap,    ε² = rᵀF(c)⁻¹r/(λ - σ) ≤ rᵀF₀⁻¹r / (α (λ - σ))                 (Kato and Temple)

where α is the smallest eigenvalue of the section's coefficients at c against those at c₀, so F(c) ≥
αF₀, and the gap is that to the other modes found, close ones pooled. The norm of r is estimated by
a few random vectors of covariance F₀⁻¹, whose products with K_kV are stored too (Balabanov and
Nouy, Adv. Comput. Math. 45, 2019), with a factor of safety. Where the error is too large the full
model is solved and its modes join the basis.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.body.affine import AffineMatrix
from fecore.body.model import Model
from fecore.dynamics.bodies import body_modes
from fecore.dynamics.dense import DenseFactor, largest_eigenpairs
from fecore.dynamics.eigen import NormalModes
from fecore.dynamics.factor import Factor, factorise
from fecore.dynamics.synthesis import RESIDUAL_TERMS, residual_series

FREQUENCY_TOLERANCE = 1e-6
"""Largest estimated relative error of a natural frequency. The true one is some ten times
smaller.
"""

_SKETCH = 32  # random vectors: χ² with 32 degrees of freedom …
_SAFETY = 3.0  # … falls below a third of its mean once in 10⁵
# energy norm below which a direction is left out of the basis, for vectors of unit energy …
_KEPT = 3e-4
# … or this share of what would make the tolerance, which is more where that is a wide one …
_SHARE = 0.3
_MENDED = 0.1  # … and this of vectors that are to mend an error
_AT_ONCE = 1 << 21  # numbers of the vectors from which directions are taken at once: 17 MB
_REACH = 0.5  # relative change of a coefficient, where no changes are given
# vectors; a basis that has grown beyond is begun anew at the coefficients then asked for …
_LARGEST = 160
# … unless it began nearly as large, with many changes to come: then it may grow by so many times
# its modes
_GROWTH = 3
_CLOSE = 0.1  # relative distance in μ below which modes are pooled


@dataclass(frozen=True, eq=False)
class ReducedSystem:
    """An affine model projected on a basis."""

    basis: FloatArray  # (dofs, r) V: rigid-body modes first, the rest orthonormal in F₀
    rigid: int  # number of rigid-body modes
    shift: float  # σ
    # stiffness, mass: (k, r, r) and (j, r, r) projected terms
    stiffness: FloatArray
    mass: FloatArray
    # stiffness_sketch, mass_sketch: (k, s, r) and (j, s, r) products XᵀK_kV and XᵀM_jV
    stiffness_sketch: FloatArray
    mass_sketch: FloatArray

    def modes(self, stiffness: FloatArray, mass: FloatArray, count: int) -> NormalModes:
        """The `count` lowest modes at (k,) and (j,) coefficients; their shapes are coordinates in
        the basis.
        """
        K, M = _sum(stiffness, self.stiffness), _sum(mass, self.mass)
        free = self.rigid
        if free == 0:
            return self._elastic(M, K - self.shift * M, count)
        # Rigid-body modes are exact; the others are kept M-orthogonal to them, whatever M has
        # become.
        lower = np.linalg.cholesky(M[:free, :free])
        rigid = np.zeros((len(M), free))
        rigid[:free] = np.linalg.inv(lower).T
        follow = np.linalg.solve(M[:free, :free], M[:free, free:])
        outside = M[free:, free:] - M[free:, :free] @ follow
        inner = self._elastic(outside, K[free:, free:] - self.shift * outside, count - free)
        shapes = np.hstack([rigid, np.vstack([-follow @ inner.shapes, inner.shapes])])
        value = np.concatenate([np.zeros(free), inner.eigenvalue])
        return NormalModes(value, shapes, free, self.shift, DenseFactor(K - self.shift * M))

    def _elastic(self, M: FloatArray, F: FloatArray, count: int) -> NormalModes:
        value, vectors = largest_eigenpairs(M, F, count)
        return NormalModes(
            self.shift + 1 / value, vectors / np.sqrt(value), 0, self.shift, DenseFactor(F)
        )

    def residual_energy(
        self, stiffness: FloatArray, mass: FloatArray, modes: NormalModes
    ) -> FloatArray:
        """(n,) estimates of rᵀF₀⁻¹r, r = Kφ - λMφ, with the factor of safety."""
        K, M = _sum(stiffness, self.stiffness_sketch), _sum(mass, self.mass_sketch)
        seen = K @ modes.shapes - (M @ modes.shapes) * modes.eigenvalue
        energy: FloatArray = _SAFETY * np.einsum("sn,sn->n", seen, seen) / len(seen)
        return energy


def bordered(known: FloatArray, fresh: FloatArray) -> FloatArray:
    """(k, r, r) symmetric matrices of which the first columns are known and (k, r, f) the last ones
    are given.
    """
    size = known.shape[1]
    top = np.concatenate([known, fresh[:, :size]], axis=2)
    return np.concatenate([top, np.swapaxes(fresh, 1, 2)], axis=1)


def _sum(weights: FloatArray, matrices: FloatArray) -> FloatArray:
    """Σ_k weights_k matrices_k."""
    total: FloatArray = weights @ matrices.reshape(len(matrices), -1)
    return total.reshape(matrices.shape[1:])


class ReducedModel:
    """A reduced basis of a model about some coefficients, which grows where it is found wanting.

    The answer at given coefficients depends, within the tolerance, on what was asked before.

    Args:
        model: the full model.
        stiffness, mass: (k,) and (j,) coefficients at the start.
        count: how many modes are asked for.
        loads: (dofs, l) unit forces whose static deflections the basis has to hold too.
        tolerance: largest estimated relative error of a natural frequency.
        held: eigenvalue up to which modes keep the tolerance, wherever they come to lie. They have
            derivative vectors, and so have those close above them, whose errors would be pooled
            with theirs.
        changes: (k, d) and (j, d) changes of the coefficients that are to come, about as large as
            they will; it starts with the motion's first derivatives along them. None: each
            coefficient by itself.
    """

    def __init__(
        self,
        model: Model,
        stiffness: FloatArray,
        mass: FloatArray,
        count: int,
        loads: FloatArray | None = None,
        tolerance: float = FREQUENCY_TOLERANCE,
        held: float = np.inf,
        changes: tuple[FloatArray, FloatArray] | None = None,
    ) -> None:
        self._model, self._count, self._tolerance, self._held = model, count, tolerance, held
        self._kept = max(_KEPT, _SHARE * np.sqrt(tolerance))
        self._changes = (
            (np.diag(_REACH * stiffness), np.diag(_REACH * mass)) if changes is None else changes
        )
        self._loads = np.zeros((model.stiffness.size, 0)) if loads is None else loads
        self._covered: frozenset[int] = frozenset()
        self.full_solves = 0
        self._begin(stiffness, mass)

    def _begin(self, stiffness: FloatArray, mass: FloatArray, like: Factor | None = None) -> None:
        """A fresh basis about given coefficients: modes, their derivative vectors, static
        deflections and theirs.
        """
        model = self._model
        modes = self._solve_full(stiffness, mass, like)  # where this fails all stays as it was
        self._start = stiffness, mass
        self._known: ReducedSystem | None = None  # what is projected already: the basis only grows
        self._ratio = (
            CoefficientRatio(model.stiffness, stiffness),
            CoefficientRatio(model.mass, mass),
        )
        K, M = model.stiffness.at(stiffness), model.mass.at(mass)
        self._factor, self._shift, self._rigid = modes.factor, modes.shift, modes.rigid
        self._metric = K - modes.shift * M
        white = np.random.default_rng(0).standard_normal((K.shape[0], _SKETCH))
        self._probe = self._factor.solve(self._factor.colour(white))
        rigid = modes.shapes[:, : modes.rigid]
        first = rigid / np.sqrt(-modes.shift) if modes.rigid else rigid
        self._parts = [(first, self._metric @ first)]  # of V, with their images under the metric
        held = max(int(np.searchsorted(modes.eigenvalue, self._held / (1 - _CLOSE))), modes.rigid)
        self._add_with_derivatives(modes.shapes[:, modes.rigid : held])
        if held < modes.eigenvalue.size:
            self._add(self._unit_energy(modes.shapes[:, held:]), self._kept)
        self._hold_static(self._loads, modes, mass)
        self._begun = self.basis.shape[1]

    @property
    def basis(self) -> FloatArray:
        """(dofs, r) V."""
        return self.system.basis

    @property
    def system(self) -> ReducedSystem:
        """The projected model on the basis as it is now."""
        known, size = self._known, sum(part.shape[1] for part, _ in self._parts)
        if known is None or known.basis.shape[1] < size:
            known = self._known = self._projected(known)
        return known

    def _projected(self, known: ReducedSystem | None) -> ReducedSystem:
        """The projected model, of whose basis the first vectors may be known already."""
        V, model = np.hstack([part for part, _ in self._parts]), self._model
        first = 0 if known is None else known.basis.shape[1]
        with_probe, fresh = np.hstack([V, self._probe]), slice(first, V.shape[1])
        stiffness, stiffness_sketch = np.split(
            model.stiffness.project(with_probe, fresh), [fresh.stop], axis=1
        )
        mass, mass_sketch = np.split(model.mass.project(with_probe, fresh), [fresh.stop], axis=1)
        if known is not None:
            stiffness, mass = bordered(known.stiffness, stiffness), bordered(known.mass, mass)
            stiffness_sketch = np.concatenate([known.stiffness_sketch, stiffness_sketch], axis=2)
            mass_sketch = np.concatenate([known.mass_sketch, mass_sketch], axis=2)
        return ReducedSystem(
            basis=V,
            rigid=self._rigid,
            shift=self._shift,
            stiffness=stiffness,
            mass=mass,
            stiffness_sketch=stiffness_sketch,
            mass_sketch=mass_sketch,
        )

    def modes(self, stiffness: FloatArray, mass: FloatArray) -> NormalModes:
        """Modes at (k,) and (j,) coefficients, enriched first where the error estimate asks for it.

        Returns:
            Modes whose shapes are coordinates in `basis`.

        Raises:
            ModelError: the full model cannot be solved.
        """
        modes = self.system.modes(stiffness, mass, self._count)
        if self._keep_tolerance(self.frequency_error(stiffness, mass, modes), modes):
            return modes
        if self.basis.shape[1] > max(_LARGEST, self._begun + _GROWTH * self._count):
            return self._begun_anew(stiffness, mass)
        full = self._solve_full(stiffness, mass, self._factor)
        # What is left out of a vector has there no more than 1/α of its energy at the start.
        kept = _MENDED * np.sqrt(self._tolerance * self._smallest(stiffness, mass))
        self._add(self._unit_energy(full.shapes[:, full.rigid :]), min(kept, self._kept))
        modes = self.system.modes(stiffness, mass, self._count)
        off = np.abs(modes.frequency_hz[full.rigid :] / full.frequency_hz[full.rigid :] - 1)
        # By a hair, where the metric of the start is a poor one here, or round-off is as large as
        # the tolerance.
        return modes if self._keep_tolerance(off, full) else self._begun_anew(stiffness, mass)

    def _keep_tolerance(self, errors: FloatArray, modes: NormalModes) -> bool:
        """Whether no elastic mode that is to keep the tolerance has an error beyond it."""
        held = modes.eigenvalue[modes.rigid :] <= self._held
        return bool(errors[held].max(initial=0.0) <= self._tolerance)

    def _begun_anew(self, stiffness: FloatArray, mass: FloatArray) -> NormalModes:
        """The modes on a basis about these coefficients: the full model's."""
        self._begin(stiffness, mass, self._factor)
        return self.system.modes(stiffness, mass, self._count)

    def frequency_error(
        self, stiffness: FloatArray, mass: FloatArray, modes: NormalModes
    ) -> FloatArray:
        """(n,) estimated relative errors of the natural frequencies of the elastic modes."""
        alpha = self._smallest(stiffness, mass)
        if alpha <= 0:
            return np.full(modes.eigenvalue.size - modes.rigid, np.inf)
        shifted = (modes.eigenvalue - self._shift)[modes.rigid :]
        energy = self.system.residual_energy(stiffness, mass, modes)[modes.rigid :] / (
            alpha * shifted
        )
        distance = np.abs(1 - shifted[:, None] / shifted[None, :])
        close = distance < _CLOSE
        gap = np.minimum(np.where(close, np.inf, distance).min(axis=1), 1.0)
        return np.asarray((close @ energy) / gap * (shifted / modes.eigenvalue[modes.rigid :]) / 2)

    def _smallest(self, stiffness: FloatArray, mass: FloatArray) -> float:
        """α with F(c) ≥ αF₀."""
        alpha = self._ratio[0].smallest(stiffness)
        return min(alpha, self._ratio[1].smallest(mass)) if self._shift else alpha

    def cover(
        self,
        observation: scipy.sparse.csr_array,
        rows: Iterable[int],
        stiffness: FloatArray,
        mass: FloatArray,
    ) -> None:
        """Take the static deflections at given coefficients under unit forces along some rows of an
        (r, dofs) observation into the basis, where it does not hold them yet.
        """
        if not (missing := sorted(set(rows) - self._covered)):
            return
        loads = observation[missing].T.toarray()
        self._loads, self._covered = np.hstack([self._loads, loads]), self._covered.union(missing)
        K, M = self._model.stiffness.at(stiffness), self._model.mass.at(mass)
        modes = self.system.modes(stiffness, mass, self._count)
        factor = factorise(K - self._shift * M, self._factor)
        self._hold_static(
            loads, replace(modes, shapes=self.basis @ modes.shapes, factor=factor), mass
        )

    def static(self, loads: FloatArray) -> FloatArray:
        """(dofs, l) what the deflections under (dofs, l) forces at the start have outside the
        basis, of unit energy.
        """
        return self._unit_energy(self._outside(self._factor.solve(loads)))

    def _hold_static(self, loads: FloatArray, modes: NormalModes, mass: FloatArray) -> None:
        loads = loads[:, loads.any(axis=0)]  # at a support a force moves nothing
        if loads.shape[1] == 0:
            return
        M = self._model.mass.at(mass)
        # Nearly all of a deflection are the lowest modes; FRFs are judged by what it has besides
        # them.
        for each in residual_series(modes, M, loads, RESIDUAL_TERMS):
            self._add(self._unit_energy(self._outside(each)), self._kept)
        self._add_with_derivatives(modes.factor.solve(loads))

    def _solve_full(
        self, stiffness: FloatArray, mass: FloatArray, like: Factor | None
    ) -> NormalModes:
        self.full_solves += 1
        K, M = self._model.stiffness.at(stiffness), self._model.mass.at(mass)
        return body_modes(self._model, K, M, self._count - self._model.rigid_modes.shape[1], like)

    def _unit_energy(self, vectors: FloatArray) -> FloatArray:
        energy = np.einsum("di,di->i", vectors, self._metric @ vectors)
        unit: FloatArray = vectors / np.sqrt(energy)
        return unit

    def _add_with_derivatives(self, vectors: FloatArray) -> None:
        """Take vectors of unit energy, and for each change F₀⁻¹ ΔK and λ F₀⁻¹ ΔM of them, λ the
        vector's quotient xᵀKx / xᵀMx.

        Of a large model there are many more than directions that matter, so they come in parts.
        """
        unit, model = self._unit_energy(vectors), self._model
        stiffer, heavier = (change.T[change.any(axis=0)] for change in self._changes)
        mass = np.einsum("di,di->i", unit, model.mass.at(self._start[1]) @ unit)
        forces = chain(
            (model.stiffness.at(change) @ unit for change in stiffer),
            (model.mass.at(change) @ unit / mass for change in heavier),
        )
        part = [unit]
        for force in forces:
            part.append(self._factor.solve(force))
            if len(part) * unit.size > _AT_ONCE:
                self._add(np.hstack(part), self._kept)
                part = []
        if part:
            self._add(np.hstack(part), self._kept)

    def _add(self, vectors: FloatArray, kept: float) -> None:
        """Take what lies outside the basis into it, in F₀-orthonormal directions of enough
        energy.
        """
        vectors = self._outside(vectors)
        weight, turn = np.linalg.eigh(vectors.T @ (self._metric @ vectors))
        keep = weight > kept**2
        if not keep.any():
            return
        # Once more, as the first time leaves round-off of the whole.
        fresh = self._outside(vectors @ (turn[:, keep] / np.sqrt(weight[keep])))
        images = self._metric @ fresh
        upright = np.linalg.inv(np.linalg.cholesky(fresh.T @ images)).T
        self._parts.append((fresh @ upright, images @ upright))

    def _outside(self, vectors: FloatArray) -> FloatArray:
        """What lies outside the basis."""
        for part, image in self._parts:
            vectors = vectors - part @ (image.T @ vectors)
        return vectors


class CoefficientRatio:
    """The largest α with A(c) ≥ α A(c₀), from the coefficient matrices of the blocks of an affine
    matrix A.
    """

    def __init__(self, matrix: AffineMatrix, start: FloatArray) -> None:
        self._single = np.array(
            [block[0, 0] for block in matrix.blocks if block.size == 1], dtype=np.int64
        )
        self._single = self._single[start[self._single] > 0]
        self._start = start[self._single]
        self._blocks = [
            (block, np.linalg.inv(np.linalg.cholesky(start[block])))
            for block in matrix.blocks
            if block.size > 1 and start[block].any()
        ]

    def smallest(self, coefficients: FloatArray) -> float:
        """α at (k,) coefficients."""
        singles = float(np.min(coefficients[self._single] / self._start, initial=np.inf))
        blocks = (
            float(np.linalg.eigvalsh(T @ coefficients[block] @ T.T)[0]) for block, T in self._blocks
        )
        return min(singles, *blocks) if self._blocks else singles
