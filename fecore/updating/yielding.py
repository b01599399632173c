"""Whether a support gives way that nobody stated to be soft, by the frequencies and the shapes together.

With modes of eigenvalues Λ, and a motion r of the body as its support gives way by a compliance a, where κ is how stiff other
supports make that, the altered modes are those of diag(Λ, κ + 1/a) and of the inertia that the modes and r share. A soft root
may look like softer material, which shapes contradict: they move where it holds. So the evidence of a compliance is that of the
frequencies, with the constants and the discrepancy integrated out (`screening`), times that of the shapes as `of_shapes` has it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.correlation import Pairing, most_alike
from fecore.modes import MeasuredModes
from fecore.updating.additions import Addition, AlteredForward
from fecore.updating.posterior import DISCREPANCY_DOF, SHAPE_DISCREPANCY, LinearProblem, Mixture
from fecore.updating.screening import Data, Modes, Screened
from fecore.updating.shape_error import real_shape
from fecore.updating.state import ForwardState

_FIRM = 1e-15  # of the largest 1/λ, below which a mode is that of a support that does not give way
_ABOVE = 12  # modes above the last paired one that altered ones are made of
_SIZES = np.exp(np.linspace(np.log(0.1), np.log(400.0), 16))  # compliances solved for, over usual ones
_FINE = np.exp(np.linspace(np.log(0.1), np.log(400.0), 200))  # and between


def of_shapes(probability: FloatArray, alike: FloatArray) -> FloatArray:
    """(…) logarithm of the evidence of (…, n) MACs of modes with their partners, which are modes by (n,) probabilities.

    What a model misses of a shape is smooth, so each mode counts for one number, 1 - MAC, whatever its points, of a variance
    that has the prior of a discrepancy.
    """
    off = DISCREPANCY_DOF * SHAPE_DISCREPANCY**2 + (1 - alike) @ probability
    return np.asarray(-(DISCREPANCY_DOF + probability.sum()) / 2 * np.log(off))


def likeness(pairing: Pairing) -> FloatArray:
    """(n,) MAC of the measured modes with their partners, or with the likest where they have none."""
    assert pairing.mac is not None, "shapes are compared"
    alike = np.nan_to_num(pairing.mac).max(axis=1)
    for row, column in pairing.pairs:
        alike[row] = pairing.mac[row, column]
    return np.asarray(alike)


@dataclass(frozen=True)
class SupportEffect(Modes):
    """A support that gives way in any of P motions, each by a compliance."""

    inertia: FloatArray  # (P,) of the motions
    stiffness: FloatArray  # (P,) by which other supports resist them
    seen: FloatArray  # (N, p) the modes, and (P, p) the motions, at the measured rows
    own: FloatArray

    @classmethod
    def of(cls, state: ForwardState, additions: Sequence[Addition]) -> SupportEffect:
        """Of a solved body that nothing lets move as a whole."""
        model, forward = state.forward.specimen.model, state.forward
        motions, stiffness = np.vstack([each.motion for each in additions]), np.zeros(len(additions))
        if any(each.stopped is not None for each in additions):
            motions, stiffness = _resisted(state, additions)
        images = (model.mass.at(state.coefficients.mass[: len(model.mass.names)]) @ motions.T).T
        return cls(
            state.modes.eigenvalue,
            (images @ state.full_shapes)[..., None],
            0,
            np.sum(images * motions, axis=1),
            stiffness,
            state.shapes,
            (forward.observation @ motions.T).T,
        )

    def first(self, count: int) -> SupportEffect:
        """That in the lowest modes alone."""
        return replace(self, value=self.value[:count], moved=self.moved[:, :count], seen=self.seen[:count])

    def at(self, size: FloatArray) -> tuple[FloatArray, FloatArray]:
        """As of `Effect`, by the compliance, m/N or rad/N·m."""
        return self._solved(size)[:2]

    def with_shapes(self, size: FloatArray, columns: Sequence[int]) -> tuple[FloatArray, FloatArray]:
        """(n, P) changes of ln f of some modes, and (P, n, p) their shapes at the measured rows, by the sizes."""
        change, _, vectors = self._solved(size)
        shapes = vectors[:, :, list(columns)].transpose(0, 2, 1)
        return change[list(columns)], shapes[..., :-1] @ self.seen + shapes[..., -1:] * self.own[:, None]

    def _solved(self, size: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """As `at`, and (P, N + 1, N) what the altered modes have of the modes and of the motion."""
        count, modes = self.value.size, np.arange(self.value.size)
        M = np.zeros((size.size, count + 1, count + 1))
        M[:, modes, modes], M[:, -1, -1] = 1.0, self.inertia
        M[:, :-1, -1] = M[:, -1, :-1] = self.moved[..., 0]
        share = 1 / (1 + self.stiffness * size)
        root = np.sqrt(np.column_stack([np.broadcast_to(1 / self.value, (size.size, count)), size * share]))
        inverse, vectors = np.linalg.eigh(root[:, :, None] * M * root[:, None])
        inverse = np.maximum(inverse, _FIRM * inverse.max())
        by = -(((M * root[:, None])[:, -1:] @ vectors)[:, 0] ** 2) / inverse**2 / 2 * share[:, None] ** 2
        order = np.array([most_alike(each[:count]) for each in vectors])
        inverse, by = (np.take_along_axis(each, order, axis=1) for each in (inverse, by))
        vectors = np.take_along_axis(root[:, :, None] * vectors, order[:, None], axis=2)
        return (-np.log(inverse * self.value) / 2).T, by.T, vectors


def _resisted(state: ForwardState, additions: Sequence[Addition]) -> tuple[FloatArray, FloatArray]:
    """(P, dofs) motions of a body as one of its supports gives way, at rest, and (P,) how stiff its other supports make it."""
    system = AlteredForward.of(state.forward, additions).altered
    count, own = len(additions), len(system.stiffness) - len(additions) - len(state.forward.specimen.springs)
    terms = np.delete(system.stiffness, slice(own, own + count), axis=0)
    K = np.tensordot(state.coefficients.stiffness, terms, 1)
    within = np.vstack([-np.linalg.solve(K[:-count, :-count], K[:-count, -count:]), np.eye(count)])
    scale = np.sqrt([each[-count:].max() for each in np.abs(system.stiffness[own : own + count]).max(axis=1)])
    within = within / scale
    return (system.basis @ within).T, np.sum(within * (K @ within), axis=0)


@dataclass(frozen=True)
class Yielding:
    """How much likelier the data are where one support gives way along or about an axis, by P axes and S compliances."""

    size: FloatArray  # (P, S) compliances, m/N or rad/N·m
    usual: FloatArray  # (P,)
    change: FloatArray  # (n, P, S) of all ln f
    likelier: FloatArray  # (P, S) logarithms

    @classmethod
    def of(
        cls,
        state: ForwardState,
        supports: Sequence[Addition],
        at: slice,
        pairing: Pairing,
        measured: tuple[MeasuredModes, FloatArray],
        problem: LinearProblem,
        posterior: tuple[Mixture, FloatArray],
    ) -> Yielding:
        """Those of one body at an estimate.

        Args:
            state: the solved body.
            supports: as of `suspects.supports`.
            at: the frequencies of the body among all.
            pairing: its measured modes with the model's.
            measured: these, and the probability of each to be one.
            problem: at the estimate.
            posterior: about it, as of `screened`.
        """
        rows, columns = (list(side) for side in zip(*pairing.pairs, strict=True))
        usual, (count, steps) = np.array([each.usual for each in supports]), (len(supports), _SIZES.size)
        effect = SupportEffect.of(state, supports)
        solved = [effect.first(max(columns) + 1 + _ABOVE).with_shapes(usual * size, columns) for size in _SIZES]
        grids = np.log(_SIZES), np.log(_FINE)
        change = np.zeros((problem.residual.size, count, _FINE.size))
        change[at] = _between(*grids, np.array([own for own, _ in solved])).transpose(1, 2, 0)
        data = Data.of(problem, *posterior)
        log = data.likeliest(change.reshape(len(change), -1)).reshape(count, -1)
        if pairing.mac is not None:
            modes, probability = measured
            own = np.array([real_shape(modes, row) for row in rows])
            alike = np.array([_alike(own, shapes[..., : own.shape[1]]) for _, shapes in solved])  # (steps, P, n)
            every = np.tile(likeness(pairing), (count, _FINE.size, 1))
            every[..., rows] = _between(*grids, alike).transpose(1, 0, 2)
            log = log + of_shapes(probability, every) - of_shapes(probability, likeness(pairing))
        return cls(usual[:, None] * _FINE, usual, change, log)

    def screened(self, sizes: Sequence[float]) -> Screened:
        """Compared with supports that do not give way, of sizes that are half-normal of so many usual ones each."""
        sigma = np.array(sizes)[:, None]
        density = np.sqrt(2 / np.pi) * _FINE / sigma * np.exp(-((_FINE / sigma) ** 2) / 2)
        step = float(np.log(_FINE[1] / _FINE[0]))
        prior = np.log(np.maximum(density.mean(axis=0) * step / len(self.usual), 1e-300))
        weight = prior + self.likelier
        evidence = float(scipy.special.logsumexp(weight))
        share = np.exp(weight - evidence)
        here = share.sum(axis=1)
        mean = float(np.sum(share * self.size))
        return Screened(
            evidence=evidence,
            share=here,
            size=np.sum(share * self.size, axis=1) / np.maximum(here, 1e-300),
            mean=mean,
            sd=float(np.sqrt(np.sum(share * (self.size - mean) ** 2))),
            covariance=np.einsum("nps,ps,mps->nm", self.change, share, self.change),
        )


def _alike(measured: FloatArray, shapes: FloatArray) -> FloatArray:
    """(…, n) MAC of (n, p) real shapes with (…, n, p)."""
    across = np.sum(measured * shapes, axis=-1) ** 2
    return np.asarray(across / (np.sum(measured**2, axis=-1) * np.maximum(np.sum(shapes**2, axis=-1), 1e-300)))


def _between(known: FloatArray, asked: FloatArray, values: FloatArray) -> FloatArray:
    return np.asarray(scipy.interpolate.pchip_interpolate(known, values, asked))
