"""The damping ladder: which law the measured damping supports.

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
from fecore.damping import DampingLaw
from fecore.updating.damping_stage import DAMPING_DISCREPANCY, DampingStage

STRONG_EVIDENCE = 10.0
"""Difference of two BICs above which the worse law is called inadequate."""

_MISSED = 3.0  # standard deviations by which a law must miss a mode for the mode to be named


@dataclass(frozen=True)
class Rung:
    """One law on the ladder.

    Attributes:
        law: the law.
        coefficients: (p,) nearest to the modal damping ratios.
        bic: Bayesian information criterion; infinite where the law would damp a mode negatively.
        chi_squared: misfit of the ratios.
        missed: (n,) relative miss of each ratio.
        named: number and relative miss of each mode that it misses by more than three standard deviations.
    """

    law: DampingLaw
    coefficients: FloatArray
    bic: float
    chi_squared: float
    missed: FloatArray
    named: tuple[tuple[int, float], ...]


@dataclass(frozen=True)
class Ladder:
    """All laws, in the order of the recipe, and which of them is preferred."""

    rungs: tuple[Rung, ...]

    @property
    def preferred(self) -> Rung:
        """The law with the least BIC; of two with the same, the later one on the ladder."""
        return min(reversed(self.rungs), key=lambda rung: round(rung.bic, 6))

    def sentences(self) -> list[str]:
        """What a user must know about the first law, in words; none where it is adequate."""
        first, best = self.rungs[0], self.preferred
        inadequate = first.bic - best.bic > STRONG_EVIDENCE or bool(first.named)
        if not inadequate:
            return []
        modes = ", ".join(f"mode {number} by {100 * miss:+.0f} %" for number, miss in first.named)
        text = f"the {first.law.name} law is inadequate for this damping"
        text += f": it misses {modes}" if modes else ""
        if best is not first:
            text += f"; the evidence prefers {best.law.name} (BIC {best.bic:.1f} against {first.bic:.1f})"
        return [text]


def told_by(modes: int, laws: Sequence[DampingLaw]) -> tuple[DampingLaw, ...]:
    """Those of the laws that so many modes can tell: with no more coefficients than modes."""
    return tuple(law for law in laws if len(law.coefficient_names) <= modes)


def climb(stage: DampingStage, laws: Sequence[DampingLaw]) -> Ladder:
    """Rank laws, each of which the modes can tell, by the measured damping ratios."""
    omega, ratio = stage.ratios.omega, stage.ratios.ratio
    covariance = stage.ratios.relative_covariance + np.diag(np.full(ratio.size, DAMPING_DISCREPANCY**2))
    return Ladder(tuple(_rung(law, omega, ratio, covariance, stage.rows) for law in laws))


def _rung(law: DampingLaw, omega: FloatArray, ratio: FloatArray, covariance: FloatArray, rows: list[int]) -> Rung:
    """Generalised least squares of ζ_law/ζ = 1."""
    whiten = np.linalg.inv(np.linalg.cholesky(covariance))
    basis = law.basis(omega) / (2 * omega * ratio)[:, None]
    scale = np.linalg.norm(basis, axis=0)
    coefficients = np.linalg.lstsq(whiten @ (basis / scale), whiten @ np.ones(ratio.size), rcond=None)[0] / scale
    relative = basis @ coefficients
    missed = relative - 1
    chi_squared = float(np.sum((whiten @ missed) ** 2))
    price = coefficients.size * np.log(ratio.size)
    named = np.abs(missed) > _MISSED * np.sqrt(np.diag(covariance))
    return Rung(
        law=law,
        coefficients=coefficients,
        bic=float(chi_squared + price) if np.all(relative > 0) else float("inf"),
        chi_squared=chi_squared,
        missed=missed,
        named=tuple((rows[k] + 1, float(missed[k])) for k in np.flatnonzero(named)),
    )
