"""Measured damping ratios: what a law has to do with them before any FRF is looked at, and where it
disagrees with them after.

The FRFs are fitted with the model's own shapes and frequencies, the modes were identified without
the model: what a wrong clamp, an unstated sensor or a delay leaves in the FRFs moves the first and
not the second. With a the law from the FRFs and a_r the one that comes nearest to the ratios, d = a
- a_r has the variance V by noise and by the scatter of the modes about the law; what d² has above V
  is an error of the model, and enters the variance of a.

A law is never exact: each ratio is off it by a share ε ~ N(0, s²), and s is learnt from how far
they are off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.dynamics.damping_laws import DampingLaw, fit_ratios
from fecore.errors import UpdatingError
from fecore.least_squares import nearest, unit_columns
from fecore.modes import MeasuredModes
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.mixing import Mixing

TYPED_RATIO_SD = 0.02
"""Relative standard deviation of a damping ratio that came without one."""


@dataclass(frozen=True)
class MeasuredRatios:
    """Damping ratios of the paired modes that the law has to explain."""

    omega: FloatArray  # (n,) circular frequencies, rad/s
    ratio: FloatArray  # (n,) damping ratios
    relative_covariance: FloatArray  # (n, n) covariance of their noise, relative
    # (n, q) shares of the modes' strain energy by mechanism; None where the modes belong to no
    # model
    strain: FloatArray | None = None
    mixings: tuple[Mixing, ...] = ()  # close modes that may have other shares than these
    # (n,) how much warmer than the reference each was measured, K; None where all are at the
    # temperature that counts
    warmer: FloatArray | None = None

    @classmethod
    def stacked(cls, parts: Sequence[MeasuredRatios]) -> MeasuredRatios:
        """Those of several campaigns of one material, one after the other."""
        first = np.cumsum([0, *(part.ratio.size for part in parts)]).tolist()
        mixings = [
            replace(each, rows=tuple(start + row for row in each.rows))
            for start, part in zip(first, parts, strict=False)
            for each in part.mixings
        ]
        return cls(
            np.concatenate([part.omega for part in parts]),
            np.concatenate([part.ratio for part in parts]),
            scipy.linalg.block_diag(*(part.relative_covariance for part in parts)),
            np.vstack([part.strain for part in parts if part.strain is not None]),
            tuple(mixings),
            (
                None
                if any(part.warmer is None for part in parts)
                else np.concatenate([part.warmer for part in parts])
            ),
        )

    def mixed(self, mixing: Mixing, change: FloatArray) -> MeasuredRatios:
        """With the shares of two modes changed."""
        assert self.strain is not None, "mixed modes are a model's"
        strain = self.strain.copy()
        strain[list(mixing.rows)] += change
        return replace(self, strain=strain)

    def basis(self, law: DampingLaw) -> FloatArray:
        """(n, p) derivative of the ratios by a law's coefficients."""
        by: FloatArray = law.basis(self.omega, self.strain) / (2 * self.omega)[:, None]
        return by

    def relative_basis(self, law: DampingLaw) -> FloatArray:
        """(n, p) the same of the ratios' logarithms: relative_basis @ a = 1 where the law holds."""
        relative: FloatArray = self.basis(law) / self.ratio[:, None]
        return relative


def paired_ratios(
    elastic: ElasticResult, number: int, modes: MeasuredModes
) -> tuple[list[int], MeasuredRatios]:
    """Numbers, from 0, of a campaign's paired modes that have a damping ratio and strain the body,
    and these ratios.
    """
    state, pairing = elastic.states[number], elastic.believed(number)
    pairs = [
        (i, j) for i, j in pairing.pairs if modes.damping_ratio[i] > 0 and not state.on_springs[j]
    ]
    rows, columns = [i for i, _ in pairs], [j for _, j in pairs]
    ratio = modes.damping_ratio[rows]
    relative: FloatArray = np.eye(len(rows)) * TYPED_RATIO_SD**2
    if modes.covariance is not None:
        places = len(modes) + np.array(rows, dtype=int)
        relative = modes.covariance[np.ix_(places, places)] / np.outer(ratio, ratio)
    strain = state.strain[state.modes.rigid + np.array(columns, dtype=int)]
    hz = modes.frequency_hz[rows]
    return rows, MeasuredRatios(
        2 * np.pi * hz, ratio, relative, strain, elastic.mixings(number, rows, columns, hz)
    )


def law_of_window(law: DampingLaw, ratios: MeasuredRatios) -> FloatArray:
    """(p,) change of a law's coefficients per rate 1/τ of an exponential window: every modal rate
    grows by 2/τ.
    """
    return nearest(ratios.relative_basis(law), 1 / (ratios.omega * ratios.ratio))


def law_ratio(law: DampingLaw, ratios: MeasuredRatios) -> FloatArray:
    """(n,) ratios of the law that comes nearest to measured ones."""
    near: FloatArray = ratios.basis(law) @ nearest_positive(
        law, ratios.omega, ratios.ratio, strain=ratios.strain
    )
    return near


def nearest_positive(
    law: DampingLaw,
    omega: FloatArray,
    ratio: FloatArray,
    others: FloatArray | tuple[()] = (),
    strain: FloatArray | None = None,
) -> FloatArray:
    """Coefficients nearest to given ratios; where those would damp one of these or other modes
    negatively, to their median.

    A law by mechanism needs the shares of strain energy of all these modes, the others' last.

    Raises:
        UpdatingError: there are fewer modes than coefficients.
    """
    if omega.size < len(law.coefficient_names):
        raise UpdatingError(
            f"{omega.size} measured {'mode' if omega.size == 1 else 'modes'} cannot fix the"
            f" {len(law.coefficient_names)} coefficients of the {law.name} law; measure a wider"
            " band, or put `modal` first in damping_models",
            best={},
            history=(),
        )
    own = None if strain is None else strain[: omega.size]
    everywhere = law.basis(np.concatenate([omega, others]), strain)
    coefficients = fit_ratios(law, omega, ratio, own)
    if np.all(everywhere @ coefficients > 0):
        return coefficients
    return fit_ratios(law, omega, np.full_like(ratio, float(np.median(ratio))), own)


def disagreement(
    basis: FloatArray,
    noise: FloatArray,
    spread: float,
    coefficients: FloatArray,
    coefficient_noise: FloatArray,
) -> FloatArray:
    """(p,) standard deviations that a model's errors add to a law's coefficients.

    Args:
        basis: (n, p) relative derivative of the measured ratios by the coefficients: basis @ a = 1
            where a law holds.
        noise: (n, n) relative covariance of the ratios by noise.
        spread: relative standard deviation of a ratio about the law.
        coefficients: (p,) the law fitted to the FRFs.
        coefficient_noise: (p, p) their covariance by noise.
    """
    weight = np.linalg.inv(noise + spread**2 * np.eye(len(noise)))
    scaled, scale = unit_columns(basis)
    near = np.linalg.pinv(scaled.T @ weight @ scaled, hermitian=True)
    apart = coefficients - near @ scaled.T @ weight @ np.ones(len(basis)) / scale
    expected = np.diag(near) / scale**2 + np.diag(coefficient_noise)
    added: FloatArray = np.sqrt(np.maximum(apart**2 - expected, 0))
    return added


@dataclass(frozen=True)
class ScaleMixture:
    """What is known of the scale s of deviations about a law: weights on a grid."""

    weight: FloatArray  # (m,) posterior probabilities
    scale: FloatArray  # (m,) s

    @property
    def rms(self) -> float:
        """Root of the posterior mean of s²."""
        return float(np.sqrt(self.weight @ self.scale**2))

    def reach(self, fixed: float, deviating: float, probability: float = 0.95) -> float:
        """How far the central interval of a Gaussian of variance `fixed` + (s/rms)² `deviating`
        reaches to each side.
        """
        sd = np.sqrt(fixed + (self.scale / self.rms) ** 2 * deviating)
        if not np.any(sd > 0):
            return 0.0
        tail = (1 + probability) / 2
        return float(
            scipy.optimize.brentq(
                lambda x: float(self.weight @ scipy.special.ndtr(x / sd)) - tail, 0.0, 40 * sd.max()
            )
        )


# s over the root mean square of its prior
_LAW_GRID = np.exp(np.linspace(np.log(5e-4), np.log(4.0), 61))


def scale_of_deviations(
    residual: FloatArray, noise: FloatArray, basis: FloatArray, prior_rms: float
) -> ScaleMixture:
    """The scale s of the relative deviations ε ~ N(0, s²) of n values from a law that is linear in
    its p coefficients.

    The coefficients are integrated out under a flat prior (restricted likelihood, Patterson and
    Thompson 1971):

        p(s | r) ∝ p(s) |W|^½ |BᵀWB|^-½ exp(-½ rᵀ(W - WB(BᵀWB)⁻¹BᵀW) r),     W = (C + s²)⁻¹.

    The prior of s is even in ln s, over four decades: of a scale nobody knows the order of
    magnitude (Jeffreys 1946). So where the values follow the law to their noise, s is learnt to be
    as small as that, and where they do not as large as they are off; a prior that is even in s, as
    a half Student t is near 0, has nine tenths of its probability in the decade of the largest, and
    a few values that follow a law do not outweigh it. With no more values than coefficients the
    prior is all that is known.

    Args:
        residual: (n,) relative residuals of the law.
        noise: (n, n) their covariance by measurement noise, C.
        basis: (n, p) relative derivative B of the values by the coefficients.
        prior_rms: root mean square of the prior.
    """
    scale, log_weight = prior_rms * _LAW_GRID, np.zeros(_LAW_GRID.size)
    values, turn = np.linalg.eigh(noise)
    # what the coefficients cannot take up: |W|/|BᵀWB| = 1/|FᵀVF|
    free = np.linalg.svd(basis)[0][:, basis.shape[1] :]
    r, V = free.T @ residual, free.T @ ((turn * np.maximum(values, 0)) @ turn.T) @ free
    for number, s in enumerate(scale):
        covariance = V + s**2 * np.eye(r.size)
        log_weight[number] -= (
            np.linalg.slogdet(covariance)[1] + r @ np.linalg.solve(covariance, r)
        ) / 2
    return ScaleMixture(np.exp(log_weight - scipy.special.logsumexp(log_weight)), scale)
