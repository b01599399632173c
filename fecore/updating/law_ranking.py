"""Ranking of damping laws: which law the measured damping supports.

FRFs are so many values that, taken as independent, they would prefer the richest law always: what limits a law is not noise
but that no body follows it to the last per cent. So laws are ranked on the damping ratios of the measured modes, each known
to its own noise and to the discrepancy s₀ = 2 % that any law is allowed:

    χ² = rᵀ (C_noise + s₀² 1)⁻¹ r,   r_k = ζ_law(ω_k)/ζ_k - 1,      BIC = χ² + p ln n

with n modes and p coefficients (Schwarz 1978). The law with the least BIC is preferred; 10 is very strong evidence (Kass and
Raftery 1995).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray
from fecore.dynamics.damping_laws import DampingLaw
from fecore.dynamics.mechanism_laws import MechanismDamping
from fecore.updating.damping_stage import DAMPING_DISCREPANCY
from fecore.updating.findings import found
from fecore.updating.measured_ratios import MeasuredRatios
from fecore.updating.result import Finding

STRONG_EVIDENCE = 10.0
"""Difference of two BICs above which the worse law is called inadequate."""

_NEGATIVE = (
    3.0  # standard deviations below zero that refute a mechanism's coefficient: a material cannot feed energy in
)
_LEAST_SHARE = 0.05  # of its strain energy that some mode must have in a mechanism for the modes to show its damping
_APART = 0.02  # smallest singular value, of columns of unit length, of mechanisms that the modes distinguish
_MISSED = 3.0  # standard deviations by which a law must miss a mode for the mode to be named


@dataclass(frozen=True)
class RankedLaw:
    """One law, ranked.

    Attributes:
        law: the law.
        coefficients: (p,) nearest to the modal damping ratios.
        covariance: (p, p) of the coefficients, the law's discrepancy included; noise_covariance: without it.
        bic: Bayesian information criterion; infinite where the law would damp a mode negatively, and where the modes cannot
            distinguish a law's mechanisms or make one of them feed energy in.
        chi_squared: misfit of the ratios.
        missed: (n,) relative miss of each ratio.
        named: number and relative miss of each mode that it misses by more than three standard deviations.
    """

    law: DampingLaw
    coefficients: FloatArray
    covariance: FloatArray
    noise_covariance: FloatArray
    bic: float
    chi_squared: float
    missed: FloatArray
    named: tuple[tuple[int, float], ...]


@dataclass(frozen=True)
class LawRanking:
    """All laws, in the order of the recipe, and which of them is preferred."""

    laws: tuple[RankedLaw, ...]

    @property
    def preferred(self) -> RankedLaw:
        """The law with the least BIC; of two with the same, the later one of the recipe."""
        return min(reversed(self.laws), key=lambda ranked: round(ranked.bic, 6))

    def findings(self) -> list[Finding]:
        """What a user must know about the first law; nothing where it is adequate."""
        first, best = self.laws[0], self.preferred
        if first.bic - best.bic <= STRONG_EVIDENCE and not first.named:
            return []
        modes = ", ".join(f"mode {number} by {100 * miss:+.0f} %" for number, miss in first.named)
        missed = f": it misses {modes}" if modes else ""
        better = f"; the evidence prefers {best.law.name} (BIC {best.bic:.1f} against {first.bic:.1f})"
        return [found("law_inadequate", law=first.law.name, missed=missed, better=better if best is not first else "")]


def identifiable_laws(modes: int, laws: Sequence[DampingLaw]) -> tuple[DampingLaw, ...]:
    """Those of the laws that so many modes can determine: with no more coefficients than modes."""
    return tuple(law for law in laws if len(law.coefficient_names) <= modes)


def rank_laws(ratios: MeasuredRatios, rows: list[int], laws: Sequence[DampingLaw]) -> LawRanking:
    """Rank laws, each of which the modes can determine, by measured damping ratios; `rows` are the modes' numbers, from 0."""
    return LawRanking(tuple(_ranked(law, ratios, rows) for law in laws))


def _ranked(law: DampingLaw, ratios: MeasuredRatios, rows: list[int]) -> RankedLaw:
    """Generalised least squares of ζ_law/ζ = 1; a law that misses more than it may has the wider covariance for it."""
    ratio, noise = ratios.ratio, ratios.relative_covariance
    covariance = noise + np.diag(np.full(ratio.size, DAMPING_DISCREPANCY**2))
    whiten = np.linalg.inv(np.linalg.cholesky(covariance))
    basis = ratios.basis(law) / ratio[:, None]
    scale = np.linalg.norm(basis, axis=0)
    scale[scale == 0] = 1.0
    coefficients = np.linalg.lstsq(whiten @ (basis / scale), whiten @ np.ones(ratio.size), rcond=None)[0] / scale
    relative = basis @ coefficients
    missed = relative - 1
    chi_squared = float(np.sum((whiten @ missed) ** 2))
    price = coefficients.size * np.log(ratio.size)
    gain = np.linalg.pinv(whiten @ (basis / scale)) @ whiten / scale[:, None]
    excess = max(1.0, chi_squared / max(ratio.size - coefficients.size, 1))
    spread = excess * gain @ covariance @ gain.T
    possible = bool(np.all(relative > 0)) and not _is_refuted(law, coefficients, spread, ratios, basis / scale)
    named = np.abs(missed) > _MISSED * np.sqrt(np.diag(covariance))
    return RankedLaw(
        law=law,
        coefficients=coefficients,
        covariance=spread,
        noise_covariance=gain @ noise @ gain.T,
        bic=float(chi_squared + price) if possible else float("inf"),
        chi_squared=chi_squared,
        missed=missed,
        named=tuple((rows[k] + 1, float(missed[k])) for k in np.flatnonzero(named)),
    )


def _is_refuted(
    law: DampingLaw, coefficients: FloatArray, covariance: FloatArray, ratios: MeasuredRatios, basis: FloatArray
) -> bool:
    """Whether a law by mechanism cannot be: a coefficient is negative beyond doubt, or the modes do not distinguish them.

    A series in frequency may have negative coefficients, as only its sum is a rate; a mechanism's coefficient is one by itself.
    """
    if not isinstance(law, MechanismDamping):
        return False
    assert ratios.strain is not None, "the law was fitted on shares"
    hidden = any(ratios.strain[:, list(columns)].sum(axis=1).max() < _LEAST_SHARE for _, columns in law.groups)
    together = float(np.linalg.svd(basis, compute_uv=False)[-1]) < _APART
    return hidden or together or bool(np.any(coefficients < -_NEGATIVE * np.sqrt(np.diag(covariance))))
