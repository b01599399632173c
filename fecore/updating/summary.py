"""From the stages to the result that users read; of a stage that failed, or had no data, what it
leaves.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from fecore.arrays import FloatArray
from fecore.correlation import FEWEST_PAIRS, Agreement, correlate
from fecore.dynamics.damping_laws import (
    DampingLaw,
    beyond,
    damping_rate,
    damping_ratio,
    negative_band,
)
from fecore.findings import Finding
from fecore.modes import MeasuredModes
from fecore.updating.campaigns import curve_of
from fecore.updating.damping_stage import DampingResult
from fecore.updating.elastic_findings import elastic_findings, undetermined
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.estimates import (
    at_reference,
    coefficient_estimates,
    constant_estimates,
    disagreements,
    ratio_estimates,
)
from fecore.updating.forecasts import frequency_effects
from fecore.updating.forward import directions_of
from fecore.updating.inputs import Inputs
from fecore.updating.laws import LawRanking, RankedLaw
from fecore.updating.measurement import PreparedMeasurement, Recipe
from fecore.updating.parameters import by_name, damping_per_k
from fecore.updating.result import (
    Correlation,
    DampingModelFit,
    DampingSearch,
    Discrepancy,
    HeldOut,
    LawCurve,
    ModelMode,
    ModeShapes,
    PairingSummary,
    ParameterEstimate,
    Partner,
    PosteriorSummary,
    Prediction,
    RivalPairing,
    StageOutcome,
    UnseenDirections,
    UpdateResult,
    finding,
    judge,
    ordered,
    warnings,
)
from fecore.updating.sampling import Posterior, Predictor, agreement

_CURVE_POINTS, _BEYOND_MODES = 80, 1.5  # of a law's curve: how many, and how far beyond the modes
_FEWEST_LINES = 10  # of a held-out band that is worth comparing


@dataclass(frozen=True)
class DampingOutcome:
    """How stage 2 ended."""

    status: Literal["succeeded", "failed", "skipped"]  # of the stage
    message: str = ""  # why, where it did not succeed, or succeeded without FRFs
    band: tuple[float, float] | None = None  # lines that it saw, Hz; None without FRFs
    ranking: LawRanking | None = None  # of the laws; None where no measured mode has a damping
    # the fitted law; None where there was nothing for it, or it failed
    result: DampingResult | None = None
    findings: tuple[Finding, ...] = ()  # what a user must know


@dataclass(frozen=True)
class Summary:
    """The stages' results: stage 1 and its modes, stage 2, the measurement as it was used, inputs,
    recipe, samples.
    """

    elastic: ElasticResult
    modes: MeasuredModes
    outcome: DampingOutcome
    data: PreparedMeasurement
    inputs: Inputs
    recipe: Recipe
    sampled: Posterior | None

    @property
    def damping(self) -> DampingResult | None:
        """The law fitted to the FRFs."""
        return self.outcome.result

    @property
    def ranking(self) -> LawRanking | None:
        """Of the damping laws."""
        return self.outcome.ranking

    @property
    def band(self) -> tuple[float, float] | None:
        """Lines of stage 2, Hz."""
        return self.outcome.band

    def result(self, before: Sequence[Finding]) -> UpdateResult:
        """The whole result, with what was found before the stages."""
        damping, elastic = self.damping, self.elastic
        findings = [*before, *self.outcome.findings, *self._own_findings()]
        return UpdateResult(
            verdict=judge(findings, self.parameters),
            outcomes=(
                StageOutcome("elastic", "succeeded"),
                StageOutcome("damping", self.outcome.status, self.outcome.message),
            ),
            parameters=self.parameters,
            modes=elastic.compared_modes(0, self.modes, self._predicted_damping),
            correlation=self._correlation(),
            damping_models=(
                ()
                if self.ranking is None
                else tuple(self._law(ranked) for ranked in self.ranking.laws)
            ),
            damping_fit=self._damping_search(),
            convergence=elastic.history,
            starts=elastic.starts,
            pairing=self._pairing(),
            model_modes=self._model_modes(),
            identifiability=UnseenDirections(
                tuple(by_name(elastic.prior.names, each) for each in elastic.null_directions)
            ),
            discrepancy=Discrepancy(
                elastic.discrepancy, None if damping is None else damping.discrepancy
            ),
            band_hz=self.band,
            channel_delay_s=None if damping is None else damping.reference.delay,
            shapes=self._shapes(),
            prediction=self.prediction,
            identification=self.data.identification,
            posterior=self._posterior(),
            effects=frequency_effects(self.elastic, self.prediction),
            warnings=warnings(findings),
            findings=ordered(findings),
            curve=curve_of(elastic, ()),
        )

    @cached_property
    def constants(self) -> tuple[ParameterEstimate, ...]:
        """Elastic constants."""
        return tuple(constant_estimates(self.elastic, self.inputs, self.sampled))

    @cached_property
    def parameters(self) -> tuple[ParameterEstimate, ...]:
        """Constants, then the coefficients of the first damping law: from the FRFs, or else from
        the modes' ratios.
        """
        if self.damping is not None:
            damping = coefficient_estimates(self.elastic, self.damping, self.inputs)
        else:
            damping = [] if self.ranking is None else ratio_estimates(self.ranking.laws[0])
        priors = damping_per_k(self.recipe.parameters or ())
        return (
            *self.constants,
            *(at_reference(each, self.elastic.prior.warmth, priors) for each in damping),
        )

    def _damping_search(self) -> DampingSearch:
        if self.damping is None:
            return DampingSearch(0, (), np.zeros((0, 0)))
        optima = tuple(self._coefficients(point) for point in self.damping.optima)
        return DampingSearch(self.damping.starts, optima, self.damping.fit.history)

    def _own_findings(self) -> list[Finding]:
        return [
            *elastic_findings(self.elastic, self.modes),
            *undetermined(
                self.constants, self.recipe.parameters, self.elastic.prior.body.default_parameters()
            ),
            *disagreements(self.elastic, self.sampled),
            *([] if self.ranking is None else self.ranking.findings()),
            *self._negative_damping(),
            *self._several_optima(),
        ]

    def _coefficients(self, values: np.ndarray) -> dict[str, float]:
        assert self.damping is not None, "a law was fitted"
        return by_name(self.damping.fit.law.coefficient_names, values)

    def _law(self, ranked: RankedLaw) -> DampingModelFit:
        assert self.ranking is not None, "laws were ranked"
        law = ranked
        if ranked is self.ranking.laws[0] and self.damping is not None:
            law = replace(
                ranked,
                coefficients=self.damping.fit.coefficients,
                covariance=self.damping.covariance,
            )
        return DampingModelFit(
            **law.described,
            preferred=ranked is self.ranking.preferred,
            missed=ranked.missed,
            curve=self._curve(law.law, law.coefficients),
            by_mechanism=bool(ranked.law.groups),
        )

    def _curve(self, law: DampingLaw, coefficients: np.ndarray) -> LawCurve:
        """A law's damping ratios over the range of the measured modes and somewhat
        beyond.
        """
        low = self.modes.frequency_hz[0] / _BEYOND_MODES
        high = self.modes.frequency_hz[-1] * _BEYOND_MODES
        if law.groups:
            state = self.elastic.updated
            inside = (state.frequency_hz >= low) & (state.frequency_hz <= high)
            hz, strain = state.frequency_hz[inside], state.strain[state.modes.rigid :][inside]
            return LawCurve(hz, damping_ratio(law, coefficients, 2 * np.pi * hz, strain))
        grid = np.geomspace(low, high, _CURVE_POINTS)
        return LawCurve(grid, damping_ratio(law, coefficients, 2 * np.pi * grid))

    def _predicted_damping(self, column: int) -> float | None:
        """The law's ratio of an elastic model mode; None where no law damps it."""
        number = column + self.elastic.updated.modes.rigid
        if self.damping is not None:
            fit = self.damping.fit
            if number in fit.nuisance.suspension_modes:
                return None
            return float(fit.law_rate[number] / (2 * np.sqrt(fit.eigenvalue[number])))
        if self.ranking is None or self.elastic.updated.on_springs[column]:
            return None
        omega, first = 2 * np.pi * self.elastic.updated.frequency_hz[[column]], self.ranking.laws[0]
        strain = self.elastic.updated.strain[[number]]
        return float((damping_rate(first.law, first.coefficients, omega, strain) / (2 * omega))[0])

    def _correlation(self) -> Correlation:
        seen, frfs = self.prediction, self.data.frfs
        if seen is None or frfs is None or self.data.fitted is None or self.band is None:
            return Correlation(None, None, None, None, self.elastic.pairing.mac, self._of_shapes())
        low, high = self.band
        lines = np.flatnonzero((frfs.frequency_hz >= low) & (frfs.frequency_hz <= high))
        fitted = np.ix_(np.array(self.data.fitted_rows), lines)
        inside = self.data.fitted.band(low, high)
        return Correlation(
            initial=agreement(inside, seen.initial[fitted]),
            updated=agreement(inside, seen.updated[fitted]),
            held_out_frfs=self._held_out_frfs(),
            held_out_band=self._held_out_band(),
            mac_matrix=self.elastic.pairing.mac,
            shapes=self._of_shapes(),
        )

    def _of_shapes(self) -> Agreement | None:
        """Criteria of the shapes that are paired, at the dofs of the measured ones."""
        pairs = self.elastic.pairing.pairs
        if self.modes.shapes is None or len(pairs) < FEWEST_PAIRS:
            return None
        measured, model = map(list, zip(*pairs, strict=True))
        there = self.elastic.updated.shapes[model, : self.modes.shapes.shape[1]].astype(complex)
        return correlate("shapes", self.modes.shapes[measured], there)

    def _held_out_frfs(self) -> HeldOut | None:
        if (
            self.data.held is None
            or self.data.fitted is None
            or self.damping is None
            or self.band is None
        ):
            return None
        frfs = self.data.held.band(*self.band)
        points = {dof.point for dof in (*frfs.responses, *frfs.references)}
        fixed = {dof.point for dof in (*self.data.fitted.responses, *self.data.fitted.references)}
        held = tuple(sorted(points - fixed)) or tuple(sorted(points))
        return Predictor(self.elastic, self.damping).hold_against(frfs, held, self.band)

    def _held_out_band(self) -> HeldOut | None:
        """The recipe's band, or the lines above the fitted one."""
        assert self.data.fitted is not None, "FRFs were predicted"
        assert self.damping is not None, "by a law"
        assert self.band is not None, "in a band"
        lines = self.data.fitted.frequency_hz
        above = (float(np.nextafter(self.band[1], np.inf)), float(lines[-1]))
        low, high = self.recipe.hold_out.band_hz or above
        if np.sum((lines >= low) & (lines <= high)) < _FEWEST_LINES:
            return None
        return Predictor(self.elastic, self.damping).hold_against(
            self.data.fitted.band(low, high), (), (low, high)
        )

    @cached_property
    def prediction(self) -> Prediction | None:
        """All usable FRFs beside the model's: before, with the damping that the measured ratios
        give, and after.

        The model after has its own natural frequencies and all: the shifts are the fit's, not the
        model's. A window that was stated damps both, as it damps what was measured.
        """
        frfs, damping = self.data.frfs, self.damping
        if frfs is None or damping is None:
            return None
        law, window = damping.fit.law, damping.fit.nuisance.window_rate
        before, after = (
            state.frf_model(frfs.responses, frfs.references)
            for state in (self.elastic.initial, self.elastic.updated)
        )
        first_rate = damping_rate(law, damping.start, before.omega, before.strain) + window
        first_tail = beyond(law, damping.start, float(before.omega[-1]), before.strain)
        return Prediction(
            frequency_hz=frfs.frequency_hz,
            responses=frfs.responses,
            references=frfs.references,
            measured=frfs.values,
            initial=before.synthesise(frfs.frequency_hz, first_rate, frfs.quantity, first_tail),
            updated=damping.fit.synthesise(after, frfs.frequency_hz, frfs.quantity),
            spread=Predictor(self.elastic, damping).spread(frfs),
            fitted=tuple(self.data.fitted_rows),
            held=tuple(self.data.held_rows),
        )

    def _posterior(self) -> PosteriorSummary:
        prior = self.elastic.prior
        inputs = np.arange(len(prior.reported), len(prior.names))
        names = prior.reported
        if self.damping is not None:
            names = (*names, *self.damping.fit.law.coefficient_names)
        if self.sampled is None:
            covariance = np.delete(np.delete(self._covariance(), inputs, axis=0), inputs, axis=1)
            scale = np.sqrt(np.diag(covariance))
            return PosteriorSummary(
                "laplace", names=names, correlation=covariance / np.outer(scale, scale)
            )
        chain, samples = self.sampled.chain, np.delete(self.sampled.everything, inputs, axis=1)
        correlation: FloatArray = np.atleast_2d(np.corrcoef(samples.T))
        return PosteriorSummary(
            method="mcmc",
            effective_samples=(float(chain.effective_samples.min()),),
            autocorrelation_time=(float(chain.autocorrelation_time.max()),),
            acceptance=(chain.acceptance,),
            names=names,
            samples=samples,
            correlation=correlation,
        )

    def _covariance(self) -> FloatArray:
        """(q+p, q+p) of θ and the law's coefficients, excursions included."""
        elastic, damping = self.elastic, self.damping
        effects, covariance = elastic.all_systematic_effects, elastic.covariance
        sensitivity = elastic.prior.slope(elastic.theta)[:, None] * elastic.bias_sensitivity
        if damping is not None:
            effects, covariance = damping.systematic_effects, damping.joint(covariance)
            sensitivity = np.vstack(
                [
                    np.pad(sensitivity, ((0, 0), (0, len(effects) - sensitivity.shape[1]))),
                    damping.bias_sensitivity,
                ]
            )
        moved = sensitivity * [each.sd for each in effects]
        whole: FloatArray = covariance + moved @ moved.T
        return whole

    def _pairing(self) -> PairingSummary:
        elastic, rival = self.elastic, None
        if elastic.rivals:
            other = elastic.rivals[0].other
            parameters = by_name(elastic.layout.shared, elastic.layout.material(other.x))
            rival = RivalPairing(_partners(other), parameters, elastic.rivals[0].evidence)
        by: Literal["shapes", "order"] = "order" if elastic.pairing.mac is None else "shapes"
        return PairingSummary(by, _partners(elastic), rival)

    def _shapes(self) -> ModeShapes | None:
        """Shapes at the measured points; None where the modes were typed in and there are no FRFs
        either.
        """
        state, modes = self.elastic.updated, self.modes
        forward = state.forward
        if not forward.points:
            return None
        return ModeShapes(
            points=forward.points,
            places=forward.places,
            measured=(
                np.zeros((len(modes), 0), dtype=complex) if modes.shapes is None else modes.shapes
            ),
            updated=state.shapes,
            pairs=self.elastic.pairing.pairs,
            directions=directions_of(forward.dofs, forward.axes),
            mesh=forward.specimen.model.mesh,
            everywhere=forward.specimen.model.at_nodes(state.full_shapes),
        )

    def _model_modes(self) -> tuple[ModelMode, ...]:
        """None where there are no shapes either."""
        state = self.elastic.updated
        if not state.forward.points:
            return ()
        modes = enumerate(zip(state.frequency_hz.tolist(), state.kinds, strict=True))
        return tuple(ModelMode(k + 1, hz, kind, **state.fractions(k)) for k, (hz, kind) in modes)

    def _negative_damping(self) -> list[Finding]:
        """Where in the band the fitted law, and the preferred one, would feed energy in: between or
        below the modes.
        """
        if self.damping is None or self.ranking is None or self.band is None:
            return []
        low, high = (2 * np.pi * hz for hz in self.band)
        fit, preferred = self.damping.fit, self.ranking.preferred
        laws = [(fit.law, fit.coefficients)]
        if preferred is not self.ranking.laws[0]:
            laws.append((preferred.law, preferred.coefficients))
        findings = []
        for law, coefficients in laws:
            strain = self.damping.reference.ratios.strain if law.groups else None
            negative = negative_band(law, coefficients, low, high, strain)
            if negative is not None:
                first, last = (omega / (2 * np.pi) for omega in negative)
                findings.append(finding("law_negative", law=law.name, first=first, last=last))
        return findings

    def _several_optima(self) -> list[Finding]:
        if self.damping is None or len(self.damping.optima) == 1:
            return []
        points = [
            ", ".join(f"{name} = {value:.4g}" for name, value in self._coefficients(point).items())
            for point in self.damping.optima
        ]
        return [
            finding(
                "optima", law=self.damping.fit.law.name, count=len(points), points="; ".join(points)
            )
        ]


def _partners(elastic: ElasticResult) -> tuple[Partner, ...]:
    hz, kinds = elastic.updated.frequency_hz, elastic.updated.kinds
    return tuple(
        Partner(row + 1, column + 1, float(hz[column]), kinds[column])
        for row, column in elastic.pairing.pairs
    )
