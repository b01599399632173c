"""A mass at a point of a body that nobody stated: a sensor, a cable, wax.

With a mass m at a place that the modes move by Φ (N, 3), mass-normalised, the frequencies are those of Λ and I + mΦΦᵀ, over the
N modes of the model. With this as one more unknown, m ~ |N(0, σ²)|, and the change d(m) of ln f linear about its likeliest m̂,
d = c + em, the data are likelier than without by

    B = 2 Φ(b/√q) exp(cᵀWμ - ½ cᵀMc + b²/2q)/√(σ²q),     μ = r - Sδ,     b = eᵀ(Wμ - Mc),     q = eᵀMe + σ⁻²,

M = W - WSH⁻¹SᵀW, in the terms of `posterior`. Of all places and all sizes of slips, each as likely, and of the posterior of the
discrepancy B is the mean. Where nothing was added E[B] = 1, whatever the constants are, so P(B ≥ 1/p) ≤ p (Ville 1939; Shafer,
Shen, Vereshchagin and Vovk, Statistical Science 26, 2011).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.updating.effects import motion_at_sites
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.posterior import LinearProblem, Mixture
from fecore.updating.state import ForwardState

_ROUNDS = 4  # linearisations about the likeliest mass of each place


@dataclass(frozen=True)
class AddedMass:
    """What the frequencies say of a mass on one body."""

    evidence: float  # ln B
    # mean, sd: of the mass, kg
    mean: float
    sd: float
    place: tuple[float, ...]  # m, the likeliest
    covariance: FloatArray  # (n, n) second moments of the change of ln f by the slip, over places and sizes


def added_mass(
    elastic: ElasticResult,
    number: int,
    problem: LinearProblem,
    posterior: tuple[Mixture, FloatArray],
    sizes: Sequence[float],
) -> AddedMass:
    """Compare a mass at each of P places of a campaign's body with none.

    Args:
        elastic: the update.
        number: of the campaign.
        problem: at the estimate.
        posterior: about it, one Gaussian for each of s discrepancies, with the logarithms of their weights.
        sizes: (k,) σ, kg.
    """
    data, sigma = _Data.of(problem, *posterior), np.array(sizes)[:, None, None]
    loaded = _Loaded.of(elastic.states[number])
    columns = [column for _, column in elastic.pairings[number].pairs]
    change, by = np.zeros((2, problem.residual.size, len(loaded.sites)))
    mass = np.zeros(len(loaded.sites))
    for _ in range(_ROUNDS):
        change[elastic.rows[number]], by[elastic.rows[number]] = (each[columns] for each in loaded.with_mass(mass))
        log, mean, variance = data.likelier(change - by * mass, by, sigma)
        share = scipy.special.softmax(log)
        here = share.sum(axis=(0, 1))
        expansion, mass = mass, np.maximum(np.sum(share * mean, axis=(0, 1)) / np.maximum(here, 1e-300), 0.0)
    found = float(np.sum(share * mean))
    secant = np.where(expansion > 0, change / np.where(expansion > 0, expansion, 1.0), by)
    return AddedMass(
        evidence=float(scipy.special.logsumexp(log) - np.log(sigma.size * here.size)),
        mean=found,
        sd=float(np.sqrt(np.sum(share * (variance + (mean - found) ** 2)))),
        place=tuple(loaded.sites[np.argmax(here)].tolist()),
        covariance=(secant * np.sum(share * sigma**2, axis=(0, 1))) @ secant.T,
    )


@dataclass(frozen=True)
class _Loaded:
    """A body with a mass at any of P places: (P, 3) sites, (N,) eigenvalues of its modes and (P, N, 3) their motion there."""

    sites: FloatArray
    value: FloatArray
    moved: FloatArray
    rigid: int

    @classmethod
    def of(cls, state: ForwardState) -> _Loaded:
        sites, moved = motion_at_sites(state)
        moving = np.arange(state.modes.eigenvalue.size) >= state.modes.rigid
        value = np.where(moving, state.modes.eigenvalue, 0.0)
        return cls(sites, value, moved.transpose(1, 0, 2), state.modes.rigid)

    def with_mass(self, mass: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n, P) change of ln f of the elastic modes by the (P,) masses at their places, and its derivative, 1/kg."""
        across = self.moved.transpose(0, 2, 1)
        inside = np.linalg.inv(np.eye(3) + mass[:, None, None] * (across @ self.moved))
        root = np.sqrt(self.value)
        pushed = root[:, None] * self.moved
        value, vectors = np.linalg.eigh(
            np.diag(self.value) - mass[:, None, None] * (pushed @ inside @ pushed.transpose(0, 2, 1))
        )
        # Which mode each was: the one that it is most like, all together.
        order = np.array([scipy.optimize.linear_sum_assignment(-(each**2))[1] for each in vectors])[:, self.rigid :]
        value = np.take_along_axis(value, order, axis=1)
        motion = inside @ pushed.transpose(0, 2, 1) @ np.take_along_axis(vectors, order[:, None], axis=2)
        change = np.log(value / self.value[self.rigid :]) / 2
        return change.T, (-np.sum(motion**2, axis=1) / value / 2).T


@dataclass(frozen=True)
class _Data:
    """The data at each of s discrepancies: (s,) logarithms of weights, (s, n) Wμ and (s, n, n) M."""

    log_weight: FloatArray
    pull: FloatArray
    M: FloatArray

    @classmethod
    def of(cls, problem: LinearProblem, posterior: Mixture, log_weight: FloatArray) -> _Data:
        root, S = np.sqrt(problem.weights)[:, None], problem.sensitivity
        variance = problem.noise + posterior.scale[:, None, None] ** 2 * np.eye(len(S))
        W = root * np.linalg.inv(variance) * root.T
        missed = problem.residual - posterior.shift @ S.T
        across = W @ S
        M = W - across @ posterior.covariance @ across.transpose(0, 2, 1)
        return cls(log_weight, (W @ missed[..., None])[..., 0], M)

    def likelier(self, c: FloatArray, e: FloatArray, sigma: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(k, s, P) logarithms of the weights times B of (n, P) c and e, with the mass's means and variances."""
        Mc, Me = self.M @ c, self.M @ e
        offset = self.pull @ c - np.sum(c * Mc, axis=1) / 2
        b, q = self.pull @ e - np.sum(e * Mc, axis=1), np.sum(e * Me, axis=1) + sigma**-2
        half = np.log(2) + scipy.special.log_ndtr(b / np.sqrt(q)) - np.log(sigma**2 * q) / 2
        return self.log_weight[:, None] + offset + b**2 / q / 2 + half, b / q, 1 / q
