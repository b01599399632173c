"""Do the sources agree? Each campaign, coupon and stated input against what all the others say of
it.

Node splitting (Marshall and Spiegelhalter, Bayesian Analysis 2, 2007): a source says y ± σ of one
combination of the unknowns, and the rest of the data, the source left out, m ± v. Of a source that
is as good as stated

    z = (y - m)/√(σ² + v) ~ N(0, 1),        p = Σ_c w_c 2Φ(-|z_c|)

over the posterior c of the discrepancy. The scatter between specimens is its prior's scale there,
as an estimate of it would grow with every contradiction and hide it; that specimens scatter more is
one of the possible causes. An input speaks of itself, a coupon of its constant, and a campaign of
the combination of its frequencies that says most about the material, as well as of all of them
together (posterior predictive χ²). That a body carries, stands on and yields to nothing that was
not stated is a source too (`additions`), and that no stretch has lost stiffness (`damage`).

Where a source contradicts, each one is a possible cause. A slip of k stated errors multiplies the
evidence by the mean of N(y; m, k²σ² + v)/N(y; m, σ² + v) over the sizes k of slips; that of a
campaign is another material, or any other body. A source explains what contradicts where some of it
does so no longer once the slip is allowed for. One that the rest says nothing of (v ≫ k²σ²), or
says what no body could be, changes nothing and explains nothing. A clamp may yield and need not:
one that is firmer than expected contradicts nothing. What may have been added to a body, and the
likeliest inputs, are compared by fits that have them (`explanations`). The likeliest explanation is
the cause. It is allowed for, and the others are looked at anew: those that still contradict have
causes of their own, the rest are cleared.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray, log_sum
from fecore.quantities import CLAMP
from fecore.updating.additions import Kind
from fecore.updating.damage import lost_stiffness
from fecore.updating.damage_effects import DamageEffects
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.explanations import Explanation, Hints, Search, Suspects, loosened
from fecore.updating.layout import Unknown
from fecore.updating.posterior import LinearProblem, Mixture
from fecore.updating.result import (
    CampaignAgreement,
    Check,
    Conflict,
    SourceStatement,
    Statement,
    loosened_by,
)

FALSE_ALARMS = 0.05
"""Probability that any source of an update is said to contradict the others where all are as good
as stated.
"""

SLIPS = (3.0, 10.0, 30.0, 100.0)
"""Standard deviations of slips, in those that are stated, each as likely: a worn edge, a digit,
another specimen, a unit.
"""

ANYTHING = 0.05
"""Standard deviation of a frequency of a campaign that is of another body or boundary than stated,
as a share of it.
"""

SCATTER = "scatter between specimens"

RIVAL = float(np.log(20.0))
"""Log evidence by which another cause must be behind to be ruled out."""


_REFITTED = 3  # inputs that are fitted anew, the likeliest
_ADDED: dict[Kind, str] = {"mass": "mass on", "foot": "foot under", "support": "support of"}
_UNSAID = 1e-9  # of what a source says is left beside the rest, so that matrices can be inverted


def compare_sources(
    elastic: ElasticResult,
) -> tuple[tuple[Conflict, ...], tuple[CampaignAgreement, ...]]:
    """Sources that contradict the others, each with its likeliest cause; and each campaign beside
    the others, in its order.

    Args:
        elastic: an update; of a single campaign its inputs and priors are the sources.
    """
    sources = _Sources.of(elastic)
    return _conflicts(sources), tuple(
        _agreement(sources, number) for number in range(len(elastic.rows))
    )


def _conflicts(sources: _Sources) -> tuple[Conflict, ...]:
    conflicts = list[Conflict]()
    while against := sources.contradicting:
        ((cause, allowing), *rivals), odds = sources.explanations()
        moved, sources = allowing.moved_from(sources.elastic), allowing
        left = {each.name for each in sources.contradicting}
        cleared = tuple(each.name for each in against if each.name not in {cause.name, *left})
        conflicts.append(Conflict(cause, tuple(rival for rival, _ in rivals), cleared, moved, odds))
    return tuple(conflicts)


@dataclass(frozen=True)
class _Sources:
    """All sources of an update, those apart that are allowed a slip."""

    elastic: ElasticResult
    problem: LinearProblem
    scatter: float
    statements: tuple[Statement, ...]
    count: float = 1.0  # of independent checks
    allowed: frozenset[str] = frozenset()  # names of those that are allowed a slip
    # of each body, None where nobody looks for any
    damage_effects: tuple[DamageEffects | None, ...] = ()
    suspects: tuple[Suspects, ...] = ()  # of each body

    @classmethod
    def of(cls, elastic: ElasticResult) -> _Sources:
        layout = elastic.layout
        statements = [
            Statement(
                "input", _labelled(unknown), unknown.owner or "", row[None], np.zeros(1), sd[None]
            )
            for row, unknown, sd in zip(
                np.eye(elastic.x.size), layout.unknowns, layout.sd(layout.scatter), strict=True
            )
            if not unknown.is_scatter
        ]
        for batch in dict.fromkeys(coupon.batch for coupon in layout.coupons):
            own = [coupon.batch == batch for coupon in layout.coupons]
            statements.append(
                Statement("coupons", batch, "", *(part[own] for part in layout.of_coupons))
            )
        bodies, looks = len(elastic.rows), elastic.damage_intervals is None and not elastic.unlike
        effects = tuple(
            DamageEffects.of(elastic, number) if looks else None for number in range(bodies)
        )
        sources = cls(
            elastic,
            elastic.problem,
            layout.scatter,
            tuple(statements),
            damage_effects=effects,
            suspects=tuple(Suspects(elastic, number) for number in range(bodies)),
        )
        return replace(sources, count=sources.independent + (6 * bodies if bodies > 1 else 4))

    @property
    def independent(self) -> float:
        """How many independent checks the statements are (Galwey, Genetic Epidemiology 33, 2009):
        (Σ√λ)²/Σλ, with λ the eigenvalues of the correlation of their differences from the
        posterior, whose covariance is R - ACAᵀ.
        """
        combinations = np.concatenate([each.rows for each in self.statements])
        own = np.concatenate([each.sds for each in self.statements]) ** 2
        spread = np.einsum("m,mij->ij", self.posterior.weight, self.posterior.covariance)
        left = np.diag(own) - combinations @ spread @ combinations.T
        sd = np.sqrt(np.maximum(np.diag(left), 1e-9 * own))
        value = np.maximum(np.linalg.eigvalsh(left / np.outer(sd, sd)), 0)
        return float(np.sum(np.sqrt(value)) ** 2 / value.sum())

    @property
    def posterior(self) -> Mixture:
        return self.posterior_with_logs[0]

    @cached_property
    def posterior_with_logs(self) -> tuple[Mixture, FloatArray]:
        return self.problem.at_scatter(self.scatter)

    @cached_property
    def contradicting(self) -> list[Check]:
        """The checks that are too improbable to be chance."""
        return [check for check, _ in self.checks if check.p < FALSE_ALARMS / self.count]

    def explanations(self) -> tuple[list[tuple[Check, _Sources]], float | None]:
        """Which sources explain what contradicts, the likeliest first, each with all sources where
        it may be off by a slip; where none does, what contradicts most. And the log odds of the
        first to the next of all.
        """
        explanations = list[tuple[Check, _Sources]]()
        names = {each.name for each in self.contradicting}
        ranked = sorted(self._candidates, key=lambda each: -each[0].evidence)
        for check, slipped in ranked:
            if check.evidence <= (explanations[0][0].evidence - RIVAL if explanations else 0.0):
                break
            sources = slipped()
            if names - {other.name for other in sources.contradicting}:
                explanations.append((check, sources))
        if not explanations:
            most, slipped = min(self.checks, key=lambda each: each[0].p)
            return [(most, slipped())], None
        others = [check.evidence for check, _ in ranked if check.name != explanations[0][0].name]
        return explanations, explanations[0][0].evidence - max(others) if others else None

    @property
    def _is_first(self) -> bool:
        """Whether no source is allowed a slip but in the fit."""
        return self.problem is self.elastic.problem

    @cached_property
    def _searches(self) -> dict[int, Search]:
        """Of each campaign, for what its body may have."""
        return {number: Search.of(self.elastic, number) for number in range(len(self.elastic.rows))}

    @property
    def _candidates(self) -> list[tuple[Check, Callable[[], _Sources]]]:
        """The checks; of what may be added to bodies, and of the likeliest inputs, as fits anew
        say, not the linear problem.
        """
        if not self._is_first:
            return self.checks
        candidates = list[tuple[Check, Callable[[], _Sources]]]()
        p = min(check.p for check, _ in self.checks)
        for number, hints in self._hints.items():
            if max(hint.evidence for _, hint in hints.values()) > 0:
                candidates += [
                    self._with(each, number, p) for each in self._searches[number].best(hints)
                ]
        added = {check.name for check, _ in candidates}
        rest = sorted(
            (c for c in self.checks if c[0].name not in added), key=lambda each: -each[0].evidence
        )
        return [*candidates, *map(self._anew, rest[:_REFITTED]), *rest[_REFITTED:]]

    def _with(
        self, explanation: Explanation, number: int, p: float
    ) -> tuple[Check, Callable[[], _Sources]]:
        """Additions to a campaign's body, by the fit that has them, and all sources there.

        The frequencies of the campaign are no source of their own any more: they say where it is,
        and of what size.
        """
        first, name = explanation.additions[0], self._of_body(explanation.additions[0].kind, number)
        statements = tuple(
            SourceStatement(each.name, 0.0, 0.0, size, sd) for each, size, sd in explanation.sizes
        )
        check = Check(
            first.kind,
            name,
            p,
            explanation.evidence,
            owner=self._named(number),
            said=statements,
            place=first.place,
        )
        unknowns = explanation.result.layout.unknowns[-len(explanation.additions) :]
        names = name, self._named(number), *(unknown.label for unknown in unknowns)
        return check, lambda: self._fitted_anew(explanation.result, names)

    def _anew(
        self, candidate: tuple[Check, Callable[[], _Sources]]
    ) -> tuple[Check, Callable[[], _Sources]]:
        """An input or prior with the evidence of a fit where it may be off by a slip."""
        check, _ = candidate
        places = [
            n
            for n, each in enumerate(self.elastic.layout.unknowns)
            if _labelled(each) == check.name
        ]
        if check.kind != "input" or not places or check.evidence <= 0:
            return candidate
        slip = min(
            SLIPS,
            key=lambda k: abs(
                np.log(k * check.said[0].stated_sd / abs(check.said[0].rest - check.said[0].stated))
            ),
        )
        fitted = loosened(self.elastic, places[0], slip)
        if fitted is None:
            return candidate
        evidence, result = fitted
        return (
            replace(check, evidence=evidence - float(np.log(len(SLIPS)))),
            lambda: self._fitted_anew(result, (check.name,)),
        )

    def _fitted_anew(self, result: ElasticResult, names: tuple[str, ...]) -> _Sources:
        """The sources of another fit, in which some may be off."""
        return replace(_Sources.of(result), count=self.count, allowed=self.allowed | set(names))

    def moved_from(self, other: ElasticResult) -> float:
        """How far a shared constant is at most from another estimate, in the standard deviations
        stated there.
        """
        q = len(other.layout.shared)
        off = self.elastic.x[:q] + (self.posterior.weight @ self.posterior.shift)[:q] - other.x[:q]
        return float(np.max(np.abs(off) / np.sqrt(np.diag(other.mixture.total)[:q])))

    @cached_property
    def _hints(self) -> dict[int, Hints]:
        """Of each campaign, what may be added to its body."""
        return {
            number: each.hints(self.problem, self.posterior_with_logs, SLIPS)
            for number, each in enumerate(self.suspects)
            if not any(self._of_body(kind, number) in self.allowed for kind in _ADDED)
        }

    @cached_property
    def checks(self) -> list[tuple[Check, Callable[[], _Sources]]]:
        """Each source that is not allowed a slip beside all others, and the sources where it is."""
        bodies = range(len(self.elastic.rows))
        checks = [
            self._of_statement(each) for each in self.statements if each.name not in self.allowed
        ]
        if len(bodies) > 1:
            checks += [
                self._of_campaign(each) for each in bodies if self._named(each) not in self.allowed
            ]
        checks += [each for number in self._hints for each in self._of_additions(number)]
        looked = [
            (each, effects)
            for each, effects in enumerate(self.damage_effects)
            if effects is not None
        ]
        checks += [
            self._of_loss(*each)
            for each in looked
            if self._stiffness_of(each[0]) not in self.allowed
        ]
        scatters = self.elastic.layout.specimens_scatter and SCATTER not in self.allowed
        return [*checks, self._of_scatter()] if scatters else checks

    def _allowing(self, name: str, **changes: Any) -> _Sources:
        """The same where one source may be off by a slip."""
        return replace(self, allowed=self.allowed | {name}, **changes)

    def _with_noise(self, name: str, more: FloatArray) -> Callable[[], _Sources]:
        """The same by (n, n) more covariance of the frequencies."""
        return lambda: self._allowing(
            name, problem=replace(self.problem, noise=self.problem.noise + more)
        )

    def _of_scatter(self) -> tuple[Check, Callable[[], _Sources]]:
        """That specimens scatter more than the prior's scale."""
        evidence, estimate = self.problem.evidence_of_scatter(self.scatter)
        check = Check(
            "scatter",
            SCATTER,
            1.0,
            evidence,
            said=(SourceStatement("", self.scatter, 0.0, estimate, 0.0),),
        )
        return check, lambda: self._allowing(SCATTER, scatter=estimate)

    def _of_statement(self, source: Statement) -> tuple[Check, Callable[[], _Sources]]:
        (posterior, logs), A, own = self.posterior_with_logs, source.rows, np.diag(source.sds**2)
        mean = (self.problem.x + posterior.shift) @ A.T
        precision = np.linalg.inv(A @ posterior.covariance @ A.T)
        # The source taken out of a Gaussian: W⁻¹ = V⁻¹ + R⁻¹, W⁻¹μ = V⁻¹m + R⁻¹y.
        V = np.linalg.inv(precision - np.diag((1 - _UNSAID) / source.sds**2))
        m = (V @ (precision @ mean[..., None] - (source.values / source.sds**2)[:, None]))[..., 0]
        off = source.values - m
        as_stated = _log_gaussian(off, V + own)
        log_weight = logs - as_stated
        weight = scipy.special.softmax(log_weight)
        slipped = np.array(
            [log_sum(log_weight + _log_gaussian(off, V + k**2 * own)) for k in SLIPS]
        )
        evidence = log_sum(slipped) - np.log(len(SLIPS)) - log_sum(log_weight + as_stated)
        rest, elsewhere = weight @ m, self.problem.x.copy()
        elsewhere[source.places] = rest
        layout = self.elastic.layout
        firmer = layout.unknowns[source.places[0]].name == CLAMP and rest[0] < source.values[0]
        if firmer or not layout.are_believable(elsewhere):
            return Check(source.kind, source.name, 1.0, 0.0, source.owner), lambda: self
        spread = np.sqrt(weight @ (np.diagonal(V, axis1=1, axis2=2) + (m - rest) ** 2))
        statements = tuple(
            map(self._as_statement, source.places, source.values, source.sds, rest, spread)
        )
        p, slip = _beyond(weight, off, V + own), SLIPS[int(np.argmax(slipped))]
        check = Check(source.kind, source.name, p, float(evidence), source.owner, said=statements)
        return check, lambda: self._allowing(
            source.name, problem=loosened_by(self.problem, source, slip)
        )

    def _of_campaign(self, number: int) -> tuple[Check, Callable[[], _Sources]]:
        name, at = self._named(number), self.elastic.rows[number]
        kept, (logs, residual, V) = (
            self.problem.weights[at] > 0,
            _beside_the_rest(self.problem, at, self.scatter),
        )
        weight = np.exp(logs)
        other = self._by_material(number)[np.ix_(kept, kept)]
        along = scipy.linalg.eigh(other, np.einsum("m,mij->ij", weight, V))[1][:, -1]
        z = residual @ along / np.sqrt(along @ V @ along)
        p = min(2 * scipy.special.ndtr(-np.abs(z)) @ weight, _beyond(weight, residual, V))
        as_stated, another, any_body = (
            scipy.special.logsumexp(logs + _log_gaussian(residual, V + more))
            for more in (0.0, other, ANYTHING**2 * np.eye(len(other)))
        )
        evidence = np.logaddexp(another, any_body) - np.log(2) - as_stated
        more = np.diag(np.where(_among(self.problem, at), ANYTHING**2, 0.0))
        return Check("campaign", name, float(p), float(evidence), name), self._with_noise(
            name, more
        )

    def _of_additions(self, number: int) -> list[tuple[Check, Callable[[], _Sources]]]:
        checks = list[tuple[Check, Callable[[], _Sources]]]()
        for kind, (additions, hint) in self._hints[number].items():
            first, name = additions[int(np.argmax(hint.share))], self._of_body(kind, number)
            statements = (SourceStatement(first.name, 0.0, first.usual, hint.mean, hint.sd),)
            evidence = hint.evidence
            if (
                kind == "support"
                and 0 < evidence < -np.log(FALSE_ALARMS / self.count)
                and self._is_first
            ):
                # Where constants are far off by it, they do not follow linearly.
                fitted = self._searches[number].of_supports(additions)
                evidence = (
                    evidence if fitted is None else max(fitted.evidence - hint.stated, evidence)
                )
            p = float(np.exp(-max(evidence, 0.0)))
            check = Check(
                kind, name, p, evidence, self._named(number), said=statements, place=first.place
            )
            checks.append((check, self._with_noise(name, hint.covariance)))
        return checks

    def _of_loss(self, number: int, effects: DamageEffects) -> tuple[Check, Callable[[], _Sources]]:
        lost, known = lost_stiffness(self.elastic, number, effects, self.problem), self.problem
        p, name = float(np.exp(-max(lost.evidence, 0.0))), self._stiffness_of(number)
        statements = (SourceStatement("factor", 1.0, 0.0, lost.factor, lost.factor_sd),)
        stated = "stiffness", name, p, lost.by_frequencies, self._named(number), statements
        check = Check(*stated, stretch=lost.in_words, level=FALSE_ALARMS / self.count)
        slipped = replace(
            known, residual=known.residual - lost.mean, noise=known.noise + lost.covariance
        )
        return check, lambda: self._allowing(name, problem=slipped)

    def _stiffness_of(self, number: int) -> str:
        return f"stiffness of {self._named(number) or 'the body'}"

    def _named(self, number: int) -> str:
        name = self.elastic.layout.campaigns[number].name
        return f"campaign {name}" if name else ""

    def _of_body(self, kind: Kind, number: int) -> str:
        return f"{_ADDED[kind]} {self._named(number) or 'the body'}"

    def _by_material(self, number: int) -> FloatArray:
        """(n, n) covariance of a campaign's frequencies where its material is any that the priors
        allow.
        """
        q = len(self.elastic.layout.shared)
        S = (
            self.problem.sensitivity[self.elastic.rows[number], :q]
            * self.elastic.layout.sd(self.elastic.layout.scatter)[:q]
        )
        covariance: FloatArray = S @ S.T
        return covariance

    def _as_statement(
        self, place: int, value: float, sd: float, rest: float, rest_sd: float
    ) -> SourceStatement:
        """The same of an unknown as its constant, SI."""
        campaign = next(each for each in self.elastic.layout.campaigns if each.pick[:, place].any())
        row, prior = int(np.argmax(campaign.pick[:, place])), campaign.prior
        stated, estimated = (
            prior.theta(prior.xi_mean + campaign.pick[:, place] * at) for at in (value, rest)
        )
        slopes = [float(prior.slope(theta)[row]) for theta in (stated, estimated)]
        return SourceStatement(
            prior.names[row],
            float(stated[row]),
            sd * slopes[0],
            float(estimated[row]),
            rest_sd * slopes[1],
        )


def _labelled(unknown: Unknown) -> str:
    return f"prior of {unknown.name}" if unknown.owner is None else unknown.label


def _log_gaussian(residual: FloatArray, covariance: FloatArray) -> FloatArray:
    """(m,) ln N(residual; 0, covariance), up to a constant, of (m, n) residuals and (m, n, n)
    covariances.
    """
    distance = np.sum(residual * np.linalg.solve(covariance, residual[..., None])[..., 0], axis=1)
    log: FloatArray = -(np.linalg.slogdet(covariance)[1] + distance) / 2
    return log


def _beside_the_rest(
    problem: LinearProblem, at: slice, scatter: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A campaign's believed frequencies beside what the others predict: (m,) logarithms of weights
    over the discrepancy, (m, n) ln f measured over predicted, and (m, n, n) its covariance.
    """
    others, logs = problem.only(~_among(problem, at)).at_scatter(scatter)
    kept = problem.weights[at] > 0
    S, noise = problem.sensitivity[at][kept], problem.noise[at, at][np.ix_(kept, kept)]
    spanned = (
        noise + others.scale[:, None, None] ** 2 * np.eye(len(S)) + S @ others.covariance @ S.T
    )
    return logs, problem.residual[at][kept] - others.shift @ S.T, spanned


def _beyond(weight: FloatArray, residual: FloatArray, covariance: FloatArray) -> float:
    """Probability of (m, n) differences that lie further out in their (m, n, n) covariances, all
    together: of χ².
    """
    distance = np.sum(residual * np.linalg.solve(covariance, residual[..., None])[..., 0], axis=1)
    return float(weight @ scipy.special.chdtrc(float(residual.shape[1]), distance))


def _agreement(sources: _Sources, number: int) -> CampaignAgreement:
    elastic, problem = sources.elastic, sources.problem
    q = len(elastic.layout.shared)
    p, at = None, elastic.rows[number]
    if len(elastic.rows) > 1:
        logs, residual, V = _beside_the_rest(problem, at, sources.scatter)
        p = _beyond(np.exp(logs), residual, V)
    own = problem.only(_among(problem, at))
    step, covariance = own.solve(elastic.discrepancy, elastic.scatter)
    variance, joint = np.diag(covariance)[:q], np.diag(elastic.inverse)[:q]
    apart = np.sqrt(np.maximum(variance - joint, 1e-12 * variance))
    informed = joint < 0.999 * variance
    return CampaignAgreement(
        p, elastic.x[:q] + step[:q], np.sqrt(variance), np.where(informed, step[:q] / apart, 0.0)
    )


def _among(problem: LinearProblem, at: slice) -> BoolArray:
    """(n,) which frequencies are a campaign's."""
    keep = np.zeros(problem.residual.size, dtype=bool)
    keep[at] = True
    return keep
