"""The damping laws of a recipe by their names, and which of them the measured damping supports.

FRFs are so many values that, taken as independent, they would prefer the richest law always: what
limits a law is not noise but that no body follows it to the last per cent. So laws are ranked on
the damping ratios of the measured modes, each known to its own noise and to the discrepancy s₀ = 2
% that any law is allowed:

    χ² = rᵀ (C_noise + s₀² 1)⁻¹ r,   r_k = ζ_law(ω_k)/ζ_k - 1,      BIC = χ² + p ln n

with n modes and p coefficients (Schwarz 1978). Two close modes have the shares of strain energy of
the angle, by which they may be mixed (`mixing`), that suits a law by mechanism best; -2 ln of the
angle's probability is beside χ² then. The law with the least BIC is preferred; 10 is very strong
evidence (Kass and Raftery 1995).

Over several campaigns one law of the material explains the damping ratios of all their modes
together, each by the shares of strain energy that its own body has at the common estimate:

    ζ_ck = ½ (a₀/ω_ck + Σ_m η_m U_ckm)      with the same a₀ and η_m in every campaign c.

A strip at 90° and one at 45° damp where a strip at 0° has no energy, so mechanisms are kept apart
that one specimen shows as one. How far each campaign is off the common law is the root mean square
of its own misses: a suspension or a clamp that damps shows there. Where campaigns have several
temperatures each coefficient has one of temperature, a(T) = a (1 + k (T - T_ref)) with k ~ N(0, (1
%/K)²) or as stated; k is integrated out in χ², which then has its prior and the logarithm of its
evidence.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.body.constants import Body
from fecore.dynamics.damping_laws import DampingLaw, ModalDamping
from fecore.dynamics.laws import LAWS, laws_for
from fecore.errors import InputError
from fecore.findings import Finding
from fecore.least_squares import unit_columns
from fecore.updating.damping_stage import DAMPING_DISCREPANCY
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.findings import finding
from fecore.updating.measured_ratios import MeasuredRatios, paired_ratios
from fecore.updating.parameters import by_name
from fecore.updating.recipe import Recipe
from fecore.updating.result import CommonLaw
from fecore.updating.temperature import DAMPING_PER_K, PER_K

STRONG_EVIDENCE = 10.0
"""Difference of two BICs above which the worse law is called inadequate."""

# standard deviations below zero that refute a mechanism's coefficient: a material feeds no energy
# in
_NEGATIVE = 3.0
# of its strain energy that some mode must have in a mechanism for the modes to show its damping
_LEAST_SHARE = 0.05
# smallest singular value, of columns of unit length, of mechanisms that the modes distinguish
_APART = 0.02
_TURNS = 6  # of a fit in a coefficient and its coefficient of temperature, which are nearly linear
_MISSED = 3.0  # standard deviations by which a law must miss a mode for the mode to be named

PriorsPerK = Mapping[str, tuple[float, float]]
"""Mean and standard deviation of coefficients of temperature by name, 1/K."""


def laws_of(recipe: Recipe, modal: ModalDamping, body: Body) -> tuple[DampingLaw, ...]:
    """A recipe's laws in its order.

    Args:
        recipe: names them.
        modal: a ratio of its own for each measured mode.
        body: what is damped.

    Raises:
        InputError: a name is not that of a law that this body can have, or there is none.
    """
    if not recipe.damping_models:
        raise InputError("damping_models", "is empty, expected at least one")
    known = laws_for(body, modal.knots)
    for index, name in enumerate(recipe.damping_models):
        if name in known:
            continue
        expected = f"expected one of {', '.join(known)}"
        lacks = f"but {LAWS[name].needs}" if name in LAWS else expected
        raise InputError(f"damping_models.{index}", f"is {name!r}, {lacks}")
    return tuple(known[name] for name in recipe.damping_models)


@dataclass(frozen=True)
class RankedLaw:
    """One law, ranked."""

    law: DampingLaw
    coefficients: FloatArray  # (p,) nearest to the modal damping ratios
    covariance: FloatArray  # (p, p) of the coefficients, the law's discrepancy included
    noise_covariance: FloatArray  # (p, p) without it
    # Bayesian information criterion; infinite where the law would damp a mode negatively, and where
    # the modes cannot distinguish a law's mechanisms or make one of them feed energy in
    bic: float
    chi_squared: float  # misfit of the ratios
    missed: FloatArray  # (n,) relative miss of each ratio
    # number and relative miss of each mode that it misses by more than three standard deviations
    named: tuple[tuple[int, float], ...]
    # (n, q) shares of the modes' strain energy, close ones mixed as suits the law; None where it
    # looks at none
    strain: FloatArray | None
    # (p,) coefficients of temperature, 1/K, and (2p, 2p) covariance of coefficients and these; None
    # at one temperature
    per_k: FloatArray | None = None
    joint: FloatArray | None = None

    @property
    def described(self) -> dict[str, Any]:
        """Name, coefficients and those of temperature, their standard deviations, and BIC."""
        names = self.law.coefficient_names
        values, covariance = self.coefficients, self.covariance
        if self.per_k is not None and self.joint is not None:
            names, covariance = (*names, *(name + PER_K for name in names)), self.joint
            values = np.concatenate([values, self.per_k])
        return {
            "name": self.law.name,
            "coefficients": by_name(names, values),
            "standard_deviations": by_name(names, np.sqrt(np.diag(covariance))),
            "bic": self.bic,
        }


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
        better = (
            f"; the evidence prefers {best.law.name} (BIC {best.bic:.1f} against {first.bic:.1f})"
        )
        return [
            finding(
                "law_inadequate",
                law=first.law.name,
                missed=missed,
                better=better if best is not first else "",
            )
        ]


def identifiable_laws(modes: int, laws: Sequence[DampingLaw]) -> tuple[DampingLaw, ...]:
    """Those of the laws that so many modes can determine: with no more coefficients than modes."""
    return tuple(law for law in laws if len(law.coefficient_names) <= modes)


def rank_laws(
    ratios: MeasuredRatios,
    rows: list[int],
    laws: Sequence[DampingLaw],
    priors: PriorsPerK | None = None,
) -> LawRanking:
    """Rank laws, each of which the modes can determine, by measured damping ratios.

    Args:
        ratios: of the modes.
        rows: their numbers, from 0.
        laws: to rank.
        priors: stated ones of coefficients of temperature.
    """
    return LawRanking(tuple(_ranked(law, ratios, rows, priors or {}) for law in laws))


def _ranked(
    law: DampingLaw, ratios: MeasuredRatios, rows: list[int], priors: PriorsPerK
) -> RankedLaw:
    """The law at the angles of close modes that suit it best; one that misses more than it may has
    the wider covariance.
    """
    fit, cost, by_angles = _at_best_angles(law, ratios, priors)
    ratio, coefficients = ratios.ratio, fit.coefficients
    price = coefficients.size * np.log(ratio.size)
    variance_inflation = max(1.0, fit.chi_squared / max(ratio.size - coefficients.size, 1))
    p = coefficients.size
    if fit.joint is None:
        spread = variance_inflation * fit.gain @ fit.covariance @ fit.gain.T + by_angles
    else:
        spread = variance_inflation * fit.joint[:p, :p] + by_angles
    possible = bool(np.all(fit.missed > -1)) and not _is_refuted(
        law, coefficients, spread, fit.ratios
    )
    named = np.abs(fit.missed) > _MISSED * np.sqrt(np.diag(fit.covariance))
    return RankedLaw(
        law=law,
        coefficients=coefficients,
        covariance=spread,
        noise_covariance=fit.gain @ ratios.relative_covariance @ fit.gain.T,
        bic=float(fit.chi_squared + cost + price) if possible else float("inf"),
        chi_squared=fit.chi_squared,
        missed=fit.missed,
        named=tuple((rows[k] + 1, float(fit.missed[k])) for k in np.flatnonzero(named)),
        strain=fit.ratios.strain,
        per_k=fit.per_k,
        joint=(
            None
            if fit.joint is None
            else variance_inflation * fit.joint + scipy.linalg.block_diag(by_angles, 0 * by_angles)
        ),
    )


@dataclass(frozen=True)
class _Fit:
    """Generalised least squares of ζ_law/ζ = 1: its (n, n) covariance, (p, n) gain, (p,)
    coefficients and (n,) misses.
    """

    ratios: MeasuredRatios
    covariance: FloatArray
    gain: FloatArray
    coefficients: FloatArray
    missed: FloatArray
    chi_squared: float
    per_k: FloatArray | None = None
    joint: FloatArray | None = None

    @classmethod
    def of(cls, law: DampingLaw, ratios: MeasuredRatios, prior_per_k: PriorsPerK) -> _Fit:
        covariance = ratios.relative_covariance + np.diag(
            np.full(ratios.ratio.size, DAMPING_DISCREPANCY**2)
        )
        whiten = np.linalg.inv(np.linalg.cholesky(covariance))
        basis = ratios.relative_basis(law)
        unit, scale = unit_columns(basis)
        gain = np.linalg.pinv(whiten @ unit) @ whiten / scale[:, None]
        coefficients = gain @ np.ones(ratios.ratio.size)
        missed = basis @ coefficients - 1
        at_one = cls(
            ratios, covariance, gain, coefficients, missed, float(np.sum((whiten @ missed) ** 2))
        )
        if ratios.warmer is None:
            return at_one
        priors = np.array(
            [prior_per_k.get(name + PER_K, DAMPING_PER_K) for name in law.coefficient_names]
        )
        return at_one.with_temperature(whiten, basis, ratios.warmer, *priors.T)

    def with_temperature(
        self,
        whiten: FloatArray,
        basis: FloatArray,
        warmer: FloatArray,
        mean: FloatArray,
        sd: FloatArray,
    ) -> _Fit:
        """The same with a coefficient of temperature of each coefficient: Gauss and Newton's steps
        in a and k.

        Args:
            whiten: (n, n) root of the weights.
            basis: (n, p) relative ratios by coefficients.
            warmer: (n,) than the reference, K.
            mean: (p,) of the priors of k.
            sd: (p,) of the same.
        """
        a, k, p = self.coefficients, mean, mean.size
        for _ in range(_TURNS):
            at_own = basis * (1 + np.outer(warmer, k))
            by_k = basis * a * warmer[:, None]
            jacobian = np.vstack(
                [whiten @ np.hstack([at_own, by_k]), np.hstack([np.zeros((p, p)), np.diag(1 / sd)])]
            )
            left = np.concatenate([whiten @ (1 - at_own @ a), (mean - k) / sd])
            unit, scale = unit_columns(jacobian)
            inverse = np.linalg.pinv(unit) / scale[:, None]
            a, k = np.split(np.concatenate([a, k]) + inverse @ left, 2)
        missed = basis * (1 + np.outer(warmer, k)) @ a - 1
        seen = whiten @ by_k * sd
        squares = float(np.sum((whiten @ missed) ** 2) + np.sum(((k - mean) / sd) ** 2))
        narrowed = float(np.linalg.slogdet(np.eye(p) + seen.T @ seen)[1])
        gain = inverse[:p, : len(whiten)] @ whiten
        fitted = self.ratios, self.covariance, gain, a, missed
        return _Fit(*fitted, chi_squared=squares + narrowed, per_k=k, joint=inverse @ inverse.T)


def _at_best_angles(
    law: DampingLaw, ratios: MeasuredRatios, priors: PriorsPerK
) -> tuple[_Fit, float, FloatArray]:
    """The fit where close modes are mixed as suits a law best, the angles' cost, and the
    coefficients' covariance by them.
    """
    best, cost = _Fit.of(law, ratios, priors), 0.0
    by_angles = np.zeros((best.coefficients.size,) * 2)
    for mixing in ratios.mixings if law.groups else ():
        fits = [_Fit.of(law, best.ratios.mixed(mixing, change), priors) for change in mixing.change]
        scores = np.array([fit.chi_squared for fit in fits]) + mixing.cost
        chosen = int(np.argmin(scores))
        off = np.array([fit.coefficients for fit in fits]) - fits[chosen].coefficients
        by_angles += off.T * scipy.special.softmax(-scores / 2) @ off
        best, cost = fits[chosen], cost + float(mixing.cost[chosen])
    return best, cost, by_angles


def _is_refuted(
    law: DampingLaw, coefficients: FloatArray, covariance: FloatArray, ratios: MeasuredRatios
) -> bool:
    """Whether a law by mechanism cannot be: a coefficient is negative beyond doubt, or the modes do
    not distinguish them.

    A series in frequency may have negative coefficients, as only its sum is a rate; a mechanism's
    coefficient is one by itself.
    """
    if not law.groups:
        return False
    assert ratios.strain is not None, "the law was fitted on shares"
    hidden = any(
        ratios.strain[:, list(columns)].sum(axis=1).max() < _LEAST_SHARE
        for _, columns in law.groups
    )
    basis = unit_columns(ratios.relative_basis(law))[0]
    together = float(np.linalg.svd(basis, compute_uv=False)[-1]) < _APART
    return (
        hidden or together or bool(np.any(coefficients < -_NEGATIVE * np.sqrt(np.diag(covariance))))
    )


def common_damping(
    elastic: ElasticResult, priors: PriorsPerK | None = None
) -> tuple[CommonLaw, ...]:
    """The laws that the paired modes of all campaigns can determine, ranked; none where no mode has
    a damping ratio.

    Args:
        elastic: stage 1.
        priors: stated ones of coefficients of temperature.
    """
    parts = {}
    for number, campaign in enumerate(elastic.layout.campaigns):
        ratios, warmth = paired_ratios(elastic, number, campaign.modes)[1], campaign.prior.warmth
        if warmth is not None:
            warmer = float(warmth.above(campaign.theta(elastic.x))[0])
            ratios = replace(ratios, warmer=np.full(ratios.ratio.size, warmer))
        parts[campaign.name] = ratios
    ratios = MeasuredRatios.stacked(list(parts.values()))
    count = ratios.ratio.size
    if not count:
        return ()
    laws = identifiable_laws(count, common_laws(elastic.layout.campaigns[0].forward.specimen))
    ranking = rank_laws(ratios, list(range(count)), laws, priors)
    ends = np.cumsum([part.ratio.size for part in parts.values()])[:-1]

    def by_campaign(missed: FloatArray) -> dict[str, float]:
        each = zip(parts, np.split(missed, ends), strict=True)
        return {name: float(np.sqrt(np.mean(misses**2))) for name, misses in each if misses.size}

    return tuple(
        CommonLaw(
            **ranked.described,
            preferred=ranked is ranking.preferred and bool(np.isfinite(ranked.bic)),
            missed_by=by_campaign(ranked.missed),
            units=ranked.law.coefficient_units,
            joint=ranked.joint,
        )
        for ranked in ranking.laws
    )


def common_laws(body: Body) -> list[DampingLaw]:
    """The laws that campaigns of a body may have in common."""
    return [law for name, law in laws_for(body).items() if LAWS[name].common]
