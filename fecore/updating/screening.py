"""Whether a body shows something that nobody stated: a mass at a point, a foot that it stands on.

With a size a at a place that the modes move by Φ (N, q), mass-normalised, the frequencies are those
of Λ and I + aΦΦᵀ (a mass), of Λ + aΦΦᵀ and I (a foot); of supports `support_compliance` has them.
With this as one more unknown, a ~ |N(0, σ²)|, and the change d(a) of ln f linear about its
likeliest â, d = c + ea, the data are likelier than without by

    B = 2 Φ(b/√q) exp(cᵀWμ - ½ cᵀMc + b²/2q)/√(σ²q),     μ = r - Sδ,     b = eᵀ(Wμ - Mc),     q = eᵀMe + σ⁻²,

M = W - WSH⁻¹SᵀW, in the terms of `posterior`. Of all places and all sizes of slips, each as likely,
and of the posterior of the discrepancy B is the mean. Where there is nothing E[B] = 1, whatever the
constants are, so P(B ≥ 1/p) ≤ p (Ville 1939; Shafer, Shen, Vereshchagin and Vovk, Statistical
Science 26, 2011).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.correlation import most_alike
from fecore.updating.additions import Addition
from fecore.updating.posterior import LinearProblem, Mixture
from fecore.updating.state import ForwardState

_ROUNDS = 4  # linearisations about the likeliest size of each place


class Effect(Protocol):
    """What P additions do to the frequencies, each by itself."""

    def at(self, size: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n, P) change of ln f of the elastic modes by the (P,) sizes, and its derivative."""
        ...


@dataclass(frozen=True)
class AdditionScreening:
    """What the frequencies say of some additions to one body, one at a time, beside none."""

    evidence: float  # ln B
    share: FloatArray  # (P,) probability of each, where it is one of them
    size: FloatArray  # (P,) its mean, SI
    mean: float  # of the size of whichever it is
    sd: float  # likewise
    # (n, n) second moments of the change of ln f by the slip, over places and sizes
    covariance: FloatArray
    stated: float = 0.0  # ln B of what is stated to be possible, which is taken off the evidence


def screened(
    effect: Effect,
    at: slice,
    columns: Sequence[int],
    problem: LinearProblem,
    posterior: tuple[Mixture, FloatArray],
    sigma: FloatArray,
) -> AdditionScreening:
    """Compare each of P additions with none.

    Args:
        effect: of the additions.
        at: the frequencies of their body among all.
        columns: the elastic modes that these belong to.
        problem: at the estimate.
        posterior: about it, one Gaussian for each of s discrepancies, with the logarithms of their
            weights.
        sigma: (k, P) σ of each.
    """
    data, sigma = Data.of(problem, *posterior), sigma[:, None]
    change, by = np.zeros((2, problem.residual.size, sigma.shape[2]))
    size = np.zeros(sigma.shape[2])
    for _ in range(_ROUNDS):
        change[at], by[at] = (each[list(columns)] for each in effect.at(size))
        log, mean, variance = data.likelier(change - by * size, by, sigma)
        share = scipy.special.softmax(log)
        here = share.sum(axis=(0, 1))
        expansion = size
        size = np.maximum(np.sum(share * mean, axis=(0, 1)) / np.maximum(here, 1e-300), 0.0)
    middle = float(np.sum(share * mean))
    secant = np.where(expansion > 0, change / np.where(expansion > 0, expansion, 1.0), by)
    return AdditionScreening(
        evidence=float(scipy.special.logsumexp(log) - np.log(sigma.shape[0] * here.size)),
        share=here,
        size=size,
        mean=middle,
        sd=float(np.sqrt(np.sum(share * (variance + (mean - middle) ** 2)))),
        covariance=(secant * np.sum(share * sigma**2, axis=(0, 1))) @ secant.T,
    )


@dataclass(frozen=True)
class ModesWithAdditions:
    """A body's (N,) eigenvalues, 0 of rigid motions, and the (P, N, q) motion of P additions in its
    modes.
    """

    value: FloatArray
    moved: FloatArray
    rigid: int

    def relative(
        self, value: FloatArray, vectors: FloatArray, by: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Changes of ln f of the elastic modes, and their derivatives, by (P, N') altered
        eigenvalues, those shapes as (P, N', N') columns, and derivatives of ln f (P, N'): which
        mode each was is the one that it is most like, all together.
        """
        order = np.array([most_alike(each[: self.value.size]) for each in vectors])
        value, by = (
            np.take_along_axis(each, order[:, self.rigid :], axis=1) for each in (value, by)
        )
        return (np.log(value / self.value[self.rigid :]) / 2).T, by.T


class MassEffect(ModesWithAdditions):
    """A mass at any of P places."""

    def at(self, size: FloatArray) -> tuple[FloatArray, FloatArray]:
        """As of `Effect`, kg."""
        across = self.moved.transpose(0, 2, 1)
        inside = np.linalg.inv(
            np.eye(across.shape[1]) + size[:, None, None] * (across @ self.moved)
        )
        pushed = np.sqrt(self.value)[:, None] * self.moved
        back = pushed.transpose(0, 2, 1)
        value, vectors = np.linalg.eigh(
            np.diag(self.value) - size[:, None, None] * (pushed @ inside @ back)
        )
        by = -np.sum((inside @ back @ vectors) ** 2, axis=1) / np.where(value > 0, value, 1.0) / 2
        return self.relative(value, vectors, by)


class FootEffect(ModesWithAdditions):
    """A spring to the ground at any of P places; `moved` is (P, N, N) of ΦΦᵀ, since a foot may
    stand under many nodes.
    """

    def at(self, size: FloatArray) -> tuple[FloatArray, FloatArray]:
        """As of `Effect`, N/m."""
        value, vectors = np.linalg.eigh(np.diag(self.value) + size[:, None, None] * self.moved)
        by = np.sum(vectors * (self.moved @ vectors), axis=1) / np.where(value > 0, value, 1.0) / 2
        return self.relative(value, vectors, by)


def effect_of(state: ForwardState, additions: Sequence[Addition]) -> Effect:
    """What each of some masses or feet does to a solved body."""
    moving = np.arange(state.modes.eigenvalue.size) >= state.modes.rigid
    value, shapes = np.where(moving, state.modes.eigenvalue, 0.0), state.modes.shapes
    shapes = shapes if state.basis is None else state.basis @ shapes
    own = [each.motion @ shapes for each in additions]
    if not additions[0].of_mass:
        return FootEffect(value, np.array([rows.T @ rows for rows in own]), state.modes.rigid)
    moved = np.zeros((len(own), shapes.shape[1], max(map(len, own))))
    for place, rows in enumerate(own):
        moved[place, :, : len(rows)] = rows.T
    return MassEffect(value, moved, state.modes.rigid)


@dataclass(frozen=True)
class Data:
    """The data at each of s discrepancies: (s,) logarithms of weights, (s, n) Wμ and (s, n, n)
    M.
    """

    log_weight: FloatArray
    score: FloatArray
    M: FloatArray

    @classmethod
    def of(cls, problem: LinearProblem, posterior: Mixture, log_weight: FloatArray) -> Data:
        """At an estimate, about which the posterior is."""
        root, S = np.sqrt(problem.weights)[:, None], problem.sensitivity
        variance = problem.noise + posterior.scale[:, None, None] ** 2 * np.eye(len(S))
        W = root * np.linalg.inv(variance) * root.T
        missed = problem.residual - posterior.shift @ S.T
        across = W @ S
        M = W - across @ posterior.covariance @ across.transpose(0, 2, 1)
        return cls(log_weight, (W @ missed[..., None])[..., 0], M)

    def likeliest(self, change: FloatArray) -> FloatArray:
        """(P,) logarithms of how much likelier the data are by (n, P) changes of ln f."""
        each = self.score @ change - np.sum(change * (self.M @ change), axis=1) / 2
        return np.asarray(scipy.special.logsumexp(self.log_weight[:, None] + each, axis=0))

    def likelier(
        self, c: FloatArray, e: FloatArray, sigma: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(k, s, P) logarithms of the weights times B of (n, P) c and e, with the size's means and
        variances.
        """
        Mc, Me = self.M @ c, self.M @ e
        offset = self.score @ c - np.sum(c * Mc, axis=1) / 2
        b, q = self.score @ e - np.sum(e * Mc, axis=1), np.sum(e * Me, axis=1) + sigma**-2
        half = np.log(2) + scipy.special.log_ndtr(b / np.sqrt(q)) - np.log(sigma**2 * q) / 2
        return self.log_weight[:, None] + offset + b**2 / q / 2 + half, b / q, 1 / q
