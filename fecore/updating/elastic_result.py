"""What stage 1 gives: the updated elastic parameters with their posterior, and how the fit came to them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fecore.arrays import FloatArray
from fecore.correlation import Pairing
from fecore.updating.coordinates import Coordinates
from fecore.updating.excursions import Excursion
from fecore.updating.forward import ForwardState
from fecore.updating.pairing import Partners
from fecore.updating.posterior import Identifiability, Mixture

REFUTED = 5.0
"""Log evidence by which a pairing must be behind to be ruled out."""


@dataclass(frozen=True)
class ElasticIterate:
    """One row of the convergence history: parameters (p,), frequencies of the measured modes (n,; NaN unpaired), cost."""

    theta: FloatArray
    frequency_hz: FloatArray
    cost: float


@dataclass(frozen=True)
class Start:
    """One start of the fit.

    Attributes:
        history: iterates, first to last; empty of a start that failed.
        cost: of each iterate.
        failure: why it did not converge; empty where it did.
    """

    history: tuple[ElasticIterate, ...]
    cost: tuple[float, ...]
    failure: str = ""


@dataclass(frozen=True)
class Rival:
    """Another pairing of the modes, at the best point that a start with it came to.

    Attributes:
        theta: (p,) its parameters.
        pairs: its partners, (measured index, model index).
        frequency_hz, kinds: of its model's modes.
        evidence: logarithm of how much more the chosen point is supported.
        mixture: the posterior of ξ about its point.
    """

    theta: FloatArray
    pairs: tuple[tuple[int, int], ...]
    frequency_hz: FloatArray
    kinds: tuple[str, ...]
    evidence: float
    mixture: Mixture


@dataclass(frozen=True)
class ElasticResult:
    """Updated elastic parameters θ, the laboratory's inputs among them.

    Attributes:
        theta: (p,) estimate, SI.
        coordinates: the map to the coordinates ξ in which the posterior is nearly Gaussian.
        mixture: the posterior of ξ about the estimate, given the partners of the modes.
        sources: by name of its source, (p, k) independent standard deviations of which the error of ξ is made at the mean
            discrepancy: Σ LLᵀ is the posterior covariance.
        covariance: (p, p) posterior covariance of θ given the partners, discrepancy included, excursions not.
        noise_covariance: (p, p) covariance of θ under measurement noise alone.
        excursions: inputs that may be something, for what they do.
        sensitivity, gain: (n, p) ∂ln f/∂ξ of the paired modes, and (p, n) ∂ξ̂/∂ln f_measured.
        measured_log: (n,) logarithms of the paired measured frequencies; noise: (n, n) their covariance.
        initial, updated: the model at the prior means and at the estimate.
        initial_pairing, pairing: measured to model modes, before and after.
        identifiability: of each parameter, whichever partners that are not ruled out the modes have.
        null_directions: (q, p) unit vectors, in prior standard deviations, of which the data say next to nothing.
        discrepancy: estimated relative model error of a frequency, which the covariance includes.
        residual: (n,) ln f_measured - ln f_model of the paired modes.
        history: iterates, first to last.
        starts: every start that was tried, this one among them; empty where there was no choice of starts.
        rivals: the best point of each other pairing that a start came to, the likest first.
        held: the partners that the fit held; None where it paired the modes anew in every turn.
        torn: measured modes, from 0, whose partners changed to and fro in the fit from the prior means, so that it had no end.
        unlike: no measured mode was like any of the model's, so the likest were paired, for a comparison alone.
    """

    theta: FloatArray
    coordinates: Coordinates
    mixture: Mixture
    sources: Mapping[str, FloatArray]
    covariance: FloatArray
    noise_covariance: FloatArray
    excursions: tuple[Excursion, ...]
    sensitivity: FloatArray
    gain: FloatArray
    measured_log: FloatArray
    noise: FloatArray
    initial: ForwardState
    updated: ForwardState
    initial_pairing: Pairing
    pairing: Pairing
    identifiability: tuple[Identifiability, ...]
    null_directions: FloatArray
    discrepancy: float
    residual: FloatArray
    history: tuple[ElasticIterate, ...]
    starts: tuple[Start, ...] = ()
    rivals: tuple[Rival, ...] = ()
    held: Partners | None = None
    torn: tuple[int, ...] = ()
    unlike: bool = False

    @property
    def standing(self) -> tuple[Rival, ...]:
        """The rivals that are not ruled out, where there are no shapes to say so."""
        if self.pairing.mac is not None:
            return ()
        return tuple(rival for rival in self.rivals if rival.evidence <= REFUTED)

    @cached_property
    def spanning(self) -> Mixture:
        """The posterior of ξ about the estimate over all pairings that are not ruled out, each by its evidence."""
        if not self.standing:
            return self.mixture
        centre, all_of = self.coordinates.of(self.theta), [(0.0, self.theta, self.mixture)]
        all_of += [(rival.evidence, rival.theta, rival.mixture) for rival in self.standing]
        share = np.exp(-np.array([behind for behind, _, _ in all_of]))
        share /= share.sum()
        return Mixture(
            np.concatenate([part * each.weight for part, (_, _, each) in zip(share, all_of, strict=True)]),
            np.concatenate([self.coordinates.of(theta) - centre + each.shift for _, theta, each in all_of]),
            np.concatenate([each.covariance for _, _, each in all_of]),
            np.concatenate([each.scale for _, _, each in all_of]),
        )

    @property
    def misfit(self) -> float:
        """Root mean square of the residuals."""
        return float(np.sqrt(np.mean(self.residual**2)))

    @cached_property
    def pulls(self) -> FloatArray:
        """(p, e) change of ξ by one standard deviation of each excursion: what the frequencies then belong to."""
        columns = [column for _, column in self.pairing.pairs]
        if not self.excursions:
            return np.zeros((self.theta.size, 0))
        return -self.gain @ np.column_stack([each.shift[columns] for each in self.excursions])
