"""The FRFs between pairs of measured points out of a solved model: residues, residual of truncated modes, derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.dynamics.sensitivity import static_series
from fecore.dynamics.synthesis import RESIDUAL_TERMS
from fecore.updating.solution import Solution


@dataclass(frozen=True)
class PointPairs:
    """Point numbers of N FRFs and the product of their directions' signs, the side with fewer points as reference."""

    response: IntArray
    reference: IntArray
    sign: FloatArray

    @classmethod
    def of(
        cls, response: IntArray, response_sign: FloatArray, reference: IntArray, reference_sign: FloatArray
    ) -> PointPairs:
        """The pairs of some FRFs between (N,) points with (N,) signs of their directions."""
        if np.unique(response).size < np.unique(reference).size:  # H is symmetric (Maxwell, Betti)
            response, reference = reference, response
        return cls(response, reference, response_sign * reference_sign)

    def products(self, shapes: FloatArray) -> FloatArray:
        """(N, m) residues of (m, points) shapes."""
        residues: FloatArray = self.sign[:, None] * (shapes[:, self.response] * shapes[:, self.reference]).T
        return residues

    def product_derivatives(self, shapes: FloatArray, by: FloatArray) -> FloatArray:
        """(p, N, m) derivatives of the residues, from those of the shapes."""
        product = (
            by[:, :, self.response] * shapes[:, self.reference] + shapes[:, self.response] * by[:, :, self.reference]
        )
        signed: FloatArray = self.sign[:, None] * product.transpose(0, 2, 1)
        return signed

    def residual(self, state: Solution) -> FloatArray:
        """(N, t) terms of the truncated modes' series in ω² - σ: solves with the factor of K - σM."""
        used, column = np.unique(self.reference, return_inverse=True)
        load = state.observation[used].T
        load = load if isinstance(load, np.ndarray) else load.toarray()
        mass = state.terms.sum("mass", state.coefficients.mass)
        series = static_series(state.modes, mass, load, RESIDUAL_TERMS)
        seen = np.array([(state.observation @ each)[self.response, column] for each in series]).T
        away = 1 / (state.modes.eigenvalue - state.modes.shift)
        # What a residue counts for in each term of the series: 1 / (λ - σ)ᵗ.
        powers = away[:, None] ** np.arange(1, RESIDUAL_TERMS + 1)
        residual: FloatArray = seen * self.sign[:, None] - self.products(state.all_shapes) @ powers
        return residual
