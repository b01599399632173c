"""The misfit of complex FRFs, and the noise that its residual shows.

The misfit between measured FRFs and the model's, and its normal equations by the modes'
eigenvalues and damping rates.

With D_k = λ_k - ω² + iωc_k and f the factor of the quantity, ∂H_i/∂λ_k = -f A_ik/D_k² and ∂H_i/∂c_k
= iω ∂H_i/∂λ_k. All residuals are sums over the few modes, so the normal equations of all lines and
FRFs come from Hermitian (modes × modes) sums.

A mode may have a **gain** g_k, common to all FRFs: H = Σ (1 + g_k) A_k f/D_k. A sensor's
calibration, or what it stands on, scales a resonance as damping does, but does not widen it. A
**delay** d between the channels turns the phase by -ωd, which looks like damping too. A **driving
point** gives way under its own force as no plate theory says: a point load leaves a dent, and the
deflection of a plate that shears has no limit there, so what a mesh makes of it is the mesh's. That
is a real flexibility r of such an FRF, H + fr, of which nothing is known beforehand; left out, the
gains of the modes make up for it, and their damping for these. The misfit is linear in gains, such
flexibilities and small delays, so they are minimised out of it at every point (variable projection;
Golub and Pereyra, Inverse Problems 19, 2003): cost, gradient and hessian are those that remain.

The noise that the residual of an FRF fit shows: a part that is constant over the record and one
proportional to the FRF.

v_il = a_i² + b_i² |H_il|² covers the electronics' floor and the scatter of hits and cable alike.
a_i, b_i come by iterated regression of |r|² on (1, |H|²) with weights 1/v², the scoring iteration
of the Gaussian likelihood.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, get_args

import numpy as np
import scipy

from fecore.arrays import BoolArray, ComplexArray, FloatArray, IntArray, real_times
from fecore.dynamics.synthesis import ModalFrfModel
from fecore.errors import InputError
from fecore.frf import FrfSet, convert

Weighting = Literal["linear", "relative", "log", "noise"]


@dataclass(frozen=True)
class NormalEquations:
    """Normal equations of the misfit by u = (λ_1 … λ_m, c_1 … c_m) at one point, gains minimised
    out.
    """

    cost: float  # misfit E, with the gains' prior
    # gradient, hessian: (2m,) and (2m, 2m)
    gradient: FloatArray
    hessian: FloatArray
    # (b, 2m) how u moves with the gains it draws along: it reduces what `FrfJacobian` gives
    reduction: FloatArray


@dataclass(frozen=True)
class FrfMisfit:
    """Measured FRFs, the model's residues, and the weighting between them."""

    frfs: FrfSet  # measured FRFs in the fitted band
    model: ModalFrfModel  # the elastic model's part of the synthesis
    weighting: Weighting  # name of the residual
    # (N, L) noise variance E|n|², for `noise` weights and for the covariance of the estimate
    variance: FloatArray
    # (m,) prior standard deviation of the modes' gains, 0 where a mode has none; None where none
    # has
    gain_sd: FloatArray | None = None
    # the same of what the gains have in common: calibration, and the model's mass
    common_gain_sd: float = 0.0
    # numbers of the FRFs that have a flexibility of their own at the driving point
    driving: tuple[int, ...] = ()
    # prior standard deviation of a delay d between the channels, s: H e^(-iωd); 0 for none
    delay_sd: float = 0.0

    def __post_init__(self) -> None:
        if self.weighting not in get_args(Weighting):
            raise InputError(
                "weighting",
                f"is {self.weighting!r}, expected one of {', '.join(get_args(Weighting))}",
            )
        if self.weighting in ("relative", "log") and np.any(self.frfs.values[self.counted] == 0):
            raise InputError(
                "weighting",
                f"{self.weighting!r} needs FRFs without zeros; leave out the lines that are 0",
            )

    def predict(self, eigenvalue: FloatArray, rate: FloatArray) -> ComplexArray:
        """(N, L) FRFs with other eigenvalues and rates but the model's residues."""
        return self.model.with_eigenvalue(eigenvalue).synthesise(
            self.frfs.frequency_hz, rate, self.frfs.quantity
        )

    def on_every(self, step: int) -> FrfMisfit:
        """The same misfit of one line of every so many."""
        return replace(self, frfs=self.frfs.on_every(step), variance=self.variance[:, ::step])

    @property
    def counted(self) -> BoolArray:
        """(N, L) where a value was measured: the others have no weight."""
        return self.frfs.measured

    def residual(self, predicted: ComplexArray) -> tuple[ComplexArray, FloatArray]:
        """(N, L) residuals in units of H, and their weights: both 0 where nothing was measured."""
        values = (
            self.frfs.values
            if self.counted.all()
            else np.where(self.counted, self.frfs.values, predicted)
        )
        if self.fixed_weight is None:
            # r = H ln(H_exp/H) has the derivative -∂H of the log residual times H, to first order.
            return predicted * np.log(values / predicted), np.where(
                self.counted, np.abs(predicted) ** -2, 0.0
            )
        return values - predicted, self.fixed_weight

    @cached_property
    def fixed_weight(self) -> FloatArray | None:
        """(N, L) weights of the residuals; None where the model's FRFs are in them."""
        if self.weighting == "log":
            return None
        if self.weighting == "linear":
            return self.counted.astype(float)
        squares = self.variance if self.weighting == "noise" else np.abs(self.frfs.values) ** 2
        return np.where(self.counted, 1 / np.where(self.counted, squares, 1.0), 0.0)

    def scatter(self, weight: FloatArray) -> FloatArray:
        """(N, L) w²v: the noise of weighted residuals."""
        return np.where(self.counted, weight, 0.0) ** 2 * np.where(self.counted, self.variance, 0.0)

    def signal(self) -> float:
        """Weighted sum of squares that the data themselves are worth."""
        values = np.where(self.counted, self.frfs.values, 0)
        if self.weighting in ("relative", "log"):
            return float(np.sum(self.counted))
        weight = 1 / self.variance if self.weighting == "noise" else 1.0
        return float(np.sum(weight * np.abs(values) ** 2))

    @cached_property
    def linear_prior(self) -> FloatArray:
        """(g, g) prior precision of what is minimised out: the gains, the flexibilities of driving
        points, the delay.
        """
        sd = np.zeros(0) if self.gain_sd is None else self.gain_sd[self.gained]
        gains = np.linalg.inv(np.diag(sd**2) + self.common_gain_sd**2)
        of_delay = [self.delay_sd**-2] if self.delay_sd else []
        return np.asarray(
            scipy.linalg.block_diag(gains, np.diag([*np.zeros(len(self.driving)), *of_delay]))
        )

    def delay(self, eigenvalue: FloatArray, rate: FloatArray) -> float:
        """The most probable delay between the channels at given eigenvalues and rates, s."""
        return float(self._linear(eigenvalue, rate)[-1]) if self.delay_sd else 0.0

    def without_driving(self, eigenvalue: FloatArray, rate: FloatArray) -> FrfSet:
        """The FRFs less what flexibilities of their own make of driving points at given eigenvalues
        and rates.
        """
        if not self.driving:
            return self.frfs
        values, gains = self.frfs.values.copy(), self.gained.size
        jacobian = self.jacobian(eigenvalue, rate, self.predict(eigenvalue, rate))
        own = self._linear(eigenvalue, rate)[gains : gains + len(self.driving)]
        for row, size in zip(self.driving, own, strict=True):
            values[row] -= size * jacobian.by_flexibility(row)
        return replace(self.frfs, values=values)

    def _linear(self, eigenvalue: FloatArray, rate: FloatArray) -> FloatArray:
        """(g,) the most probable values of what is minimised out."""
        predicted = self.predict(eigenvalue, rate)
        residual, weight = self.residual(predicted)
        jacobian = self.jacobian(eigenvalue, rate, predicted)
        g = slice(2 * eigenvalue.size, None)
        own = jacobian.hessian(weight)[g, g] + self.linear_prior
        return np.asarray(np.linalg.solve(own, jacobian.gradient(weight * residual)[g]))

    @cached_property
    def gained(self) -> IntArray:
        """Numbers of the modes with a gain."""
        return np.flatnonzero(np.zeros(0) if self.gain_sd is None else self.gain_sd)

    def normal(self, eigenvalue: FloatArray, rate: FloatArray) -> NormalEquations:
        """Normal equations at given eigenvalues and rates."""
        predicted = self.predict(eigenvalue, rate)
        residual, weight = self.residual(predicted)
        jacobian = self.jacobian(eigenvalue, rate, predicted)
        cost = float(np.sum(weight * np.abs(residual) ** 2))
        gradient, hessian = jacobian.gradient(weight * residual), jacobian.hessian(weight)
        plain = np.eye(2 * eigenvalue.size)
        if len(hessian) == len(plain):
            return NormalEquations(cost, gradient, hessian, plain)
        u, g = slice(0, len(plain)), slice(len(plain), None)
        own = hessian[g, g] + self.linear_prior
        gain, drawn = np.linalg.solve(own, gradient[g]), np.linalg.solve(own, hessian[g, u])
        # derivatives by λ and c of a mode with a gain are so much larger
        scale = np.ones((2, eigenvalue.size))
        scale[:, self.gained] += gain[: self.gained.size]
        s = scale.ravel()
        return NormalEquations(
            cost - float(gradient[g] @ gain) / 2,
            s * (gradient[u] - hessian[u, g] @ gain),
            s[:, None] * (hessian[u, u] - hessian[u, g] @ drawn) * s,
            np.vstack([plain, -drawn]) * s,
        )

    def jacobian(
        self, eigenvalue: FloatArray, rate: FloatArray, predicted: ComplexArray
    ) -> FrfJacobian:
        """Derivatives by u = λ, c and the gains at given eigenvalues and rates, where `predict`
        gives so much.
        """
        model = self.model.with_eigenvalue(eigenvalue)
        factors = model.load_factors(self.frfs.frequency_hz, rate, self.frfs.quantity)
        return FrfJacobian(self, eigenvalue, rate, factors, predicted)

    @cached_property
    def pairs(self) -> tuple[IntArray, IntArray]:
        """Both numbers k ≤ j of each pair of modes: what is summed over FRFs and lines is Hermitian
        in them.
        """
        k, j = np.triu_indices(self.model.omega.size)
        return k, j

    @cached_property
    def products(self) -> FloatArray:
        """(pairs, N) products A_ik A_ij of the residues."""
        return self._products(self.model.residues, self.model.residues)

    @cached_property
    def fixed_coupling(self) -> FloatArray:
        """(pairs, L) Σ_i w_i A_ik A_ij by the fixed weights, which no eigenvalue or rate
        changes.
        """
        assert self.fixed_weight is not None, "the weights are fixed"
        return np.asarray(self.products @ self.fixed_weight)

    @cached_property
    def drive_products(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(pairs, N) products A_ik B_ij, B_ik A_ij and B_ik B_ij with the residues B of a roving
        sensor's driving points.
        """
        assert self.model.roving is not None, "a sensor roves"
        A, B = self.model.residues, self.model.roving.residues
        return self._products(A, B), self._products(B, A), self._products(B, B)

    def _products(self, A: FloatArray, B: FloatArray) -> FloatArray:
        k, j = self.pairs
        return np.ascontiguousarray((A[:, k] * B[:, j]).T)


@dataclass(frozen=True)
class FrfJacobian:
    """Derivatives of the FRFs at one point by v = (λ, c, g of the gained modes, r of the driving
    points, d of the delay): A_ik d_k, or under a roving mass (A_ik g_i + B_ik h_i) d_k; f, there f
    (g_i + h_i), for r; and -iωH for the delay.
    """

    misfit: FrfMisfit  # whose FRFs they are
    # eigenvalue, rate: (m,) where
    eigenvalue: FloatArray
    rate: FloatArray
    # (N, L) g and h (`ModalFrfModel.load_factors`), or None
    factors: tuple[ComplexArray, ComplexArray] | None
    predicted: ComplexArray  # (N, L) the FRFs there

    @cached_property
    def denominator(self) -> ComplexArray:
        """(m, L) D."""
        omega = self.misfit.frfs.omega
        return self.eigenvalue[:, None] - omega**2 + 1j * omega * self.rate[:, None]

    @cached_property
    def by_eigenvalue(self) -> ComplexArray:
        """(m, L) d for λ; that for c is iω, and that for g is -D times as large."""
        factor: ComplexArray = (
            -convert(self.misfit.frfs.omega, self.misfit.frfs.quantity) / self.denominator**2
        )
        return factor

    def by_flexibility(self, row: int) -> ComplexArray:
        """(L,) derivative of an FRF by the flexibility of its driving point."""
        factor: ComplexArray = convert(self.misfit.frfs.omega, self.misfit.frfs.quantity) + 0j
        return (
            factor
            if self.factors is None
            else factor * (self.factors[0][row] + self.factors[1][row])
        )

    @cached_property
    def others(self) -> list[tuple[slice, ComplexArray]]:
        """Of each flexibility, then of the delay, the rows that it changes, and the derivative of
        these.
        """
        derivatives = [
            (slice(row, row + 1), self.by_flexibility(row)[None]) for row in self.misfit.driving
        ]
        if self.misfit.delay_sd:
            derivatives.append((slice(None), -1j * self.misfit.frfs.omega * self.predicted))
        return derivatives

    def gradient(self, weighted: ComplexArray) -> FloatArray:
        """(b,) 2 Re Jᴴ(w r): the descent direction's data."""
        own = [2 * float(np.vdot(by, weighted[rows]).real) for rows, by in self.others]
        return np.append(self._modal_gradient(weighted), own)

    def hessian(self, weight: FloatArray) -> FloatArray:
        """(b, b) 2 Re JᴴWJ."""
        modal, others = self._modal_hessian(weight), self.others
        size = len(modal)
        whole = np.zeros((size + len(others),) * 2)
        whole[:size, :size] = modal
        for place, (rows, by) in enumerate(others, start=size):
            weighted = weight[rows] * by
            whole[:size, place] = whole[place, :size] = self._modal_gradient(weighted, rows)
            whole[place, place] = 2 * float(np.vdot(by, weighted).real)
            if self.misfit.delay_sd and place < len(whole) - 1:
                crossed = 2 * float(np.vdot(others[-1][1][rows], weighted).real)
                whole[place, -1] = whole[-1, place] = crossed
        return whole

    def _modal_gradient(self, weighted: ComplexArray, rows: slice = slice(None)) -> FloatArray:
        """(2m + g,) the same by the modes and their gains alone, of some rows."""
        misfit, model = self.misfit, self.misfit.model
        if self.factors is None or model.roving is None:
            projected = real_times(model.residues[rows].T, weighted)
        else:
            g, h = (each[rows] for each in self.factors)
            projected = real_times(model.residues[rows].T, g.conj() * weighted)
            projected = projected + real_times(model.roving.residues[rows].T, h.conj() * weighted)
        by = 2 * self.by_eigenvalue.conj() * projected
        gains = -np.sum((self.denominator.conj() * by)[misfit.gained].real, axis=1)
        return np.concatenate([by.real.sum(axis=1), by.imag @ misfit.frfs.omega, gains])

    def _modal_hessian(self, weight: FloatArray) -> FloatArray:
        """(2m + g, 2m + g) the same by the modes and their gains alone, from sums over lines: all
        else is a power of ω.
        """
        n, (c, lam) = self.misfit.gained, (self.rate[:, None], self.eigenvalue[:, None])
        S = self._sums(self._coupling(weight), 5 if n.size else 3)
        plain = np.block([[S[0], -S[1]], [S[1], S[2]]])
        if not n.size:
            return plain
        turned = lam * S[1] - S[3]
        by_eigenvalue = -(lam * S[0] - S[2] + c * S[1])
        by_rate = turned - c * S[2]
        both = (
            lam * lam.T * S[0]
            - (lam + lam.T) * S[2]
            + S[4]
            + c * c.T * S[2]
            - (c.T * turned + c * turned.T)
        )
        mixed = np.hstack([by_eigenvalue, by_rate])[n]
        return np.block([[plain, mixed.T], [mixed, both[np.ix_(n, n)]]])

    def _sums(self, coupling: FloatArray | ComplexArray, count: int) -> FloatArray:
        """(p, m, m) S_p = 2 Σ_l ω^p d_k* d_j Σ_i w_i A_ik A_ij, of an even p the real part, of an
        odd one the imaginary.

        They are symmetric or skew; the rest of each is not needed.
        """
        d, number = self.by_eigenvalue, np.arange(count)
        # Im x*y = Re (ix)*y
        powers = 2 * (1j ** (number % 2))[:, None] * self.misfit.frfs.omega ** number[:, None]
        S, parts = np.zeros((count, len(d), len(d))), (d.real.copy(), d.imag.copy())
        first = np.searchsorted(self.misfit.pairs[0], np.arange(len(d) + 1))
        sign = (-1.0) ** number[:, None]
        for k in range(len(d)):  # one by one, so that what is summed stays in the processor's cache
            own, lines = coupling[first[k] : first[k + 1]], d[k] * powers
            if np.iscomplexobj(own):
                whole = d[k:] * own
                real, imaginary = whole.real, whole.imag
            else:  # two products of real numbers take half the time of one of complex ones
                real, imaginary = (part[k:] * own.real for part in parts)
            S[:, k, k:] = lines.real @ real.T + lines.imag @ imaginary.T
            S[:, k:, k] = sign * S[:, k, k:]
        return S

    def _coupling(self, weight: FloatArray) -> FloatArray | ComplexArray:
        """(pairs, L) Σ_i w_i (A_ik g_i + B_ik h_i)* (A_ij g_i + B_ij h_i)."""
        misfit = self.misfit
        if self.factors is None:
            return (
                misfit.fixed_coupling if weight is misfit.fixed_weight else misfit.products @ weight
            )
        g, h = self.factors
        mixed, turned, driving = misfit.drive_products
        between = weight * g.conj() * h
        own = misfit.products @ (weight * np.abs(g) ** 2) + driving @ (weight * np.abs(h) ** 2)
        coupled: ComplexArray = own + mixed @ between + turned @ between.conj()
        return coupled


# of the rms of a record: below this nothing is believed, so that clean data keep finite weights
_FLOOR = 1e-5


def residual_variance(
    residual: ComplexArray, model: ComplexArray, measured: BoolArray
) -> FloatArray:
    """(N, L) variance a² + b²|H|², a², b² >= 0, of each FRF's residual of a fit with model H, by
    scoring of the likelihood.
    """
    power = np.sum(np.abs(model) ** 2 * measured, axis=1) / np.maximum(measured.sum(axis=1), 1)
    power = np.where(power > 0, power, 1.0)[:, None]
    square, level = np.abs(residual) ** 2 / power, np.abs(model) ** 2 / power
    count = np.maximum(measured.sum(axis=1), 1)
    constant = np.sum(square * measured, axis=1) / count + _FLOOR**2
    slope = np.zeros_like(constant)
    for _ in range(8):  # iterations of the scoring
        weight = measured / (constant[:, None] + slope[:, None] * level) ** 2
        constant, slope = _regress(square, level, weight)
    # a step that cannot lower the likelihood, for residuals that are not just noise
    for _ in range(8):  # steps more, by the likelihood itself
        v = constant[:, None] + slope[:, None] * level
        numerator, denominator = measured * square / v**2, measured / v
        constant = np.maximum(
            constant * np.sqrt(numerator.sum(1) / np.maximum(denominator.sum(1), 1e-300)), _FLOOR**2
        )
        slope = slope * np.sqrt(
            (numerator * level).sum(1) / np.maximum((denominator * level).sum(1), 1e-300)
        )
    v = constant[:, None] + slope[:, None] * level
    scale = np.maximum(np.sum(measured * square / v, axis=1) / count, _FLOOR**2)
    return np.asarray(
        (np.maximum(constant * scale, _FLOOR**2)[:, None] + (slope * scale)[:, None] * level)
        * power
    )


def _regress(
    square: FloatArray, level: FloatArray, weight: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Weighted straight line square = a² + b² level through each row, with both coefficients held
    at or above zero.
    """
    s0, s1, s2 = weight.sum(1), (weight * level).sum(1), (weight * level**2).sum(1)
    r0, r1 = (weight * square).sum(1), (weight * square * level).sum(1)
    determinant = s0 * s2 - s1**2
    known = determinant > 1e-12 * s0 * s2  # levels that differ
    safe = np.where(known, determinant, 1.0)
    constant, slope = (s2 * r0 - s1 * r1) / safe, (s0 * r1 - s1 * r0) / safe
    only_constant = r0 / np.maximum(s0, 1e-300)
    only_slope = np.where(s2 > 0, r1 / np.where(s2 > 0, s2, 1.0), 0.0)
    flat = ~known | (slope < 0)
    constant, slope = (
        np.where(flat, only_constant, np.where(constant < 0, 0.0, constant)),
        np.where(flat, 0.0, np.where(constant < 0, only_slope, slope)),
    )
    return np.maximum(constant, _FLOOR**2), np.minimum(slope, _FLOOR**-2)
