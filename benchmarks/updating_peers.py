"""The two stages as `scipy.optimize.least_squares` solves them: the same misfits, unknowns, priors and starts, by differences.

What it has of us is the model, and the weights that our estimate took. So it must come to the same estimates.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cholesky
from scipy.optimize import OptimizeResult, least_squares

from fecore.dynamics.damping_laws import RAYLEIGH
from fecore.frf import FrfSet
from fecore.modes import MeasuredModes
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.forward import ForwardModel
from fecore.updating.law_problem import Nuisance
from fecore.updating.misfit import FrfMisfit


@dataclass
class ElasticByDifferences:
    """Stage 1: a residual with a full eigenvalue solution in it, counted."""

    forward: ForwardModel
    modes: MeasuredModes
    ours: ElasticResult

    def __post_init__(self) -> None:
        self.solves = 0
        self.rows, self.columns = (list(side) for side in zip(*self.ours.pairing.pairs, strict=True))
        n = self.ours.problem.residual.size
        self.root = cholesky(np.linalg.inv(self.ours.problem.noise + self.ours.discrepancy**2 * np.eye(n)))

    def residual(self, theta: np.ndarray) -> np.ndarray:
        """Frequency errors and distances from the prior, in standard deviations."""
        self.solves += 1
        found = self.forward.solve(theta).frequency_hz[self.columns]
        prior = self.ours.prior
        errors = self.root @ np.log(found / self.modes.frequency_hz[self.rows])
        return np.concatenate([errors, (prior.xi(theta) - prior.xi_mean) / prior.xi_sd])

    def fit(self) -> OptimizeResult:
        """From the prior's mean, in units of the prior; smaller steps drown in the round-off of the eigenvalues."""
        prior = self.forward.parametrisation
        return least_squares(self.residual, prior.prior_mean, x_scale=prior.prior_sd, method="trf", diff_step=1e-5)


@dataclass
class DampingByDifferences:
    """Stage 2: Rayleigh's a0 and a1, a shift and a rate of its own of each mode, a gain of each measured one; counted."""

    misfit: FrfMisfit
    nuisance: Nuisance
    unit: np.ndarray  # of a0 and a1, so that its steps suit them

    def __post_init__(self) -> None:
        self.syntheses = 0
        self.frfs: FrfSet = self.misfit.frfs
        self.sd = np.sqrt(self.misfit.variance / 2)  # of the real and of the imaginary part
        self.ends = np.cumsum([2, self.nuisance.modes.size, self.nuisance.modes.size])

    def residual(self, x: np.ndarray) -> np.ndarray:
        """Real and imaginary parts of all lines of all FRFs, and the priors, in standard deviations."""
        self.syntheses += 1
        (a, shift, own, gain), model, n = np.split(x, self.ends), self.misfit.model, self.nuisance
        omega, residues = model.omega.copy(), model.residues.copy()
        omega[n.modes] *= 1 + shift
        residues[:, self.misfit.gained] *= 1 + gain
        law = RAYLEIGH.basis(omega) @ (a * self.unit)
        rate = law.copy()
        rate[n.modes] = np.exp(own)
        body = replace(model, eigenvalue=omega**2, residues=residues)
        error = (body.synthesise(self.frfs.frequency_hz, rate) - self.frfs.values) / self.sd
        off = (own - np.log(np.abs(law[n.modes]))) / n.deviation_sd
        prior = [shift / n.shift_sd, off, gain / self.gain_sd]
        return np.concatenate([error.real.ravel(), error.imag.ravel(), *prior])

    @property
    def gain_sd(self) -> np.ndarray:
        """Prior standard deviations of the gains."""
        assert self.misfit.gain_sd is not None, "`noise` weights have gains"
        return self.misfit.gain_sd[self.misfit.gained]

    def fit(self, start: np.ndarray) -> OptimizeResult:
        """From coefficients of the law."""
        n = self.nuisance
        omega = self.misfit.model.omega.copy()
        omega[n.modes] *= 1 + n.first_shift
        own = np.log(RAYLEIGH.basis(omega)[n.modes] @ start)
        first = np.concatenate([start / self.unit, n.first_shift, own, np.zeros(self.gain_sd.size)])
        return least_squares(self.residual, first, x_scale="jac", method="trf")
