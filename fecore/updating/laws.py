"""Damping laws by the measured ratios: what the ratios are worth, and which law they support.

Measured damping ratios: what a law has to do with them before any FRF is looked at, and where it
disagrees with them after.

The FRFs are fitted with the model's own shapes and frequencies, the modes were identified without
the model: what a wrong clamp, an unstated sensor or a delay leaves in the FRFs moves the first and
not the second. With a the law from the FRFs and a_r the one that comes nearest to the ratios, d = a
- a_r has the variance V by noise and by the scatter of the modes about the law; what d² has above V
  is an error of the model, and enters the variance of a.

A law is never exact: each ratio is off it by a share ε ~ N(0, s²), and s is learnt from how far
they are off.

The damping laws of a recipe by their names, and which of them the measured damping supports.

FRFs are so many values that, taken as independent, they would prefer the richest law always: what
limits a law is not noise but that no body follows it to the last per cent. So laws are ranked on
the damping ratios of the measured modes, each known to its own noise and to the discrepancy s₀ = 2
% that any law is allowed:

    χ² = rᵀ (C_noise + s₀² 1)⁻¹ r,   r_k = ζ_law(ω_k)/ζ_k - 1,      BIC = χ² + p ln n

with n modes and p coefficients (Schwarz 1978). Two close modes have the shares of strain energy of
the angle, by which they may be mixed (`state`), that suits a law by mechanism best; -2 ln of the
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
from fecore.dynamics.damping_laws import DampingLaw, ModalDamping, fit_ratios
from fecore.dynamics.laws import LAWS, laws_for
from fecore.errors import InputError, UpdatingError
from fecore.findings import Finding
from fecore.least_squares import nearest, unit_columns
from fecore.modes import MeasuredModes
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.measurement import Recipe
from fecore.updating.parameters import DAMPING_PER_K, PER_K, by_name
from fecore.updating.result import CommonLaw, finding
from fecore.updating.state import Mixing

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


STRONG_EVIDENCE = 10.0
"""Difference of two BICs above which the worse law is called inadequate."""

# standard deviations below zero that refute a mechanism's coefficient: a material feeds no energy
# in
_NEGATIVE = 3.0
# of its strain energy that some mode must have in a mechanism for the modes to show its damping
_LEAST_SHARE = 0.05
# smallest singular value, of columns of unit length, of mechanisms that the modes distinguish
_APART = 0.02
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
        for _ in range(6):  # turns of a fit in a coefficient and its coefficient of temperature
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


DAMPING_DISCREPANCY = 0.02
"""Prior standard deviation of a damping ratio about its law, as a share of it: root mean square of
the prior of s.
"""
