"""The FRFs between pairs of measured points out of a solved model: residues, residual of truncated modes, derivatives."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from fecore.arrays import ComplexArray, FloatArray, IntArray
from fecore.dynamics.damping_laws import DampingLaw
from fecore.dynamics.sensitivity import Matrix, same_cluster, static_series
from fecore.dynamics.synthesis import RESIDUAL_TERMS, residual_powers
from fecore.frf import Quantity, convert
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

    def changes(
        self,
        state: Solution,
        frequency_hz: FloatArray,
        law: DampingLaw,
        law_coefficients: FloatArray,
        quantity: Quantity,
        beyond: tuple[float, float],
    ) -> ComplexArray:
        """(p, N, L) derivative of the FRFs without a roving mass."""
        omega, natural = 2 * np.pi * frequency_hz, state.modes.omega
        rate = law.basis(natural) @ law_coefficients
        moving = natural > 0
        rate_by = np.zeros_like(natural)  # ∂c/∂λ
        rate_by[moving] = law.slope(natural[moving]) @ law_coefficients / (2 * natural[moving])
        D = state.modes.eigenvalue[:, None] - omega**2 + 1j * omega * rate[:, None]
        change = self.product_derivatives(state.all_shapes, state.shape_jacobian) @ (1 / D)
        first, second = np.nonzero(same_cluster(state.modes.eigenvalue))
        G = state.eigenvalue_matrix[:, first, second]
        left, right = state.all_shapes[first][:, self.response], state.all_shapes[second][:, self.reference]
        resonance = (1 + 1j * omega * rate_by[first, None]) / (D[first] * D[second])
        change = change - (self.sign[:, None] * (left * right).T * G[:, None, :]) @ resonance
        residual_by = self.residual_derivatives(state)
        power = residual_powers(omega, state.modes.shift, RESIDUAL_TERMS, beyond)
        converted: ComplexArray = (change + residual_by @ power) * convert(omega, quantity)
        return converted

    def residual(self, state: Solution) -> FloatArray:
        """(N, t) terms of the truncated modes' series in ω² - σ: solves with the factor of K - σM."""
        value, _ = self._static(state, ([], []))
        return value - self.products(state.all_shapes) @ _powers(state)

    def residual_derivatives(self, state: Solution) -> FloatArray:
        """(p, N, t) derivatives of `residual` by the parameters."""
        _, by = self._static(state, state.by_parameter)
        moved = self.product_derivatives(state.all_shapes, state.shape_jacobian) @ _powers(state)
        first, second = np.nonzero(same_cluster(state.modes.eigenvalue))
        crossed = state.all_shapes[first][:, self.response] * state.all_shapes[second][:, self.reference]
        crossed = self.sign[:, None] * crossed.T * state.eigenvalue_matrix[:, None, first, second]
        away, term = _away(state)[first, None], np.arange(1, RESIDUAL_TERMS + 1)
        derivatives: FloatArray = by - moved + crossed @ (term * away ** (term + 1))
        return derivatives

    def _static(self, state: Solution, by: tuple[list[Matrix], list[Matrix]]) -> tuple[FloatArray, FloatArray]:
        """(N, t) terms of the series of all modes, and (p, N, t) their derivatives by the p matrices of `by`."""
        used, column = np.unique(self.reference, return_inverse=True)
        load = state.observation[used].T
        load = load if isinstance(load, np.ndarray) else load.toarray()
        mass = state.terms.sum("mass", state.coefficients.mass)
        y, y_by = static_series(state.modes, mass, load, RESIDUAL_TERMS, *by)

        def seen(terms: Iterable[FloatArray]) -> FloatArray:
            at_points = [(state.observation @ each)[self.response, column] for each in terms]
            return np.array(at_points).T * self.sign[:, None]

        derivatives = np.array([seen(terms) for terms in y_by])
        return seen(y), derivatives.reshape(-1, self.sign.size, RESIDUAL_TERMS)


def _away(state: Solution) -> FloatArray:
    """(m,) 1 / (λ - σ) of all modes."""
    away: FloatArray = 1 / (state.modes.eigenvalue - state.modes.shift)
    return away


def _powers(state: Solution) -> FloatArray:
    """(m, t) what a residue counts for in each term of the series: 1 / (λ - σ)ᵗ."""
    powers: FloatArray = _away(state)[:, None] ** np.arange(1, RESIDUAL_TERMS + 1)
    return powers
