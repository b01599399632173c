"""From the two stages to the result that users read."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypedDict

import numpy as np

from fecore.arrays import FloatArray
from fecore.damping import beyond, damping_rate, negative_band
from fecore.modes import MeasuredModes
from fecore.updating.damping_stage import DampingResult
from fecore.updating.elastic import ElasticResult
from fecore.updating.ladder import Ladder, Rung
from fecore.updating.measurement import Prepared
from fecore.updating.parameters import by_name
from fecore.updating.posterior import interval_95
from fecore.updating.result import (
    ConvergenceStep,
    Correlation,
    DampingModelFit,
    HeldOut,
    ModeComparison,
    ParameterEstimate,
    PosteriorSummary,
    Prediction,
    UpdateResult,
)
from fecore.updating.sampling import Posterior
from fecore.updating.validation import Predictor, agreement


class _Width(TypedDict):
    standard_deviation: float
    interval_95: tuple[float, float]


_FEWEST_LINES = 10  # of a held-out band that is worth comparing


@dataclass(frozen=True)
class Report:
    """Collects the stages' results.

    Attributes:
        elastic, damping, ladder: the stages.
        modes: measured modes.
        data: the measurement as it was used.
        band: lines of stage 2, Hz.
        held_band: lines that the recipe held out, or None.
        sampled: samples of the posterior, or None for the Gaussian one.
    """

    elastic: ElasticResult
    damping: DampingResult
    ladder: Ladder
    modes: MeasuredModes
    data: Prepared
    band: tuple[float, float]
    held_band: tuple[float, float] | None
    sampled: Posterior | None

    def result(self) -> UpdateResult:
        """The whole result."""
        names = self.elastic.updated.forward.parametrisation.names
        law = self.damping.fit.law
        return UpdateResult(
            parameters=(*self._constants(), *self._coefficients()),
            modes=tuple(self._mode(row) for row in range(len(self.modes))),
            correlation=self._correlation(),
            damping_models=tuple(self._law(rung) for rung in self.ladder.rungs),
            damping_starts=self.damping.starts,
            damping_optima=tuple(by_name(law.coefficient_names, point) for point in self.damping.optima),
            damping_history=self.damping.fit.history,
            convergence=tuple(
                ConvergenceStep(by_name(names, step.theta), step.frequency_hz, step.cost)
                for step in self.elastic.history
            ),
            null_directions=tuple(by_name(names, direction) for direction in self.elastic.null_directions),
            frequency_discrepancy=self.elastic.discrepancy,
            damping_discrepancy=self.damping.discrepancy,
            band_hz=self.band,
            prediction=self.prediction,
            identification=self.data.identification,
            posterior=self._posterior(),
            warnings=(
                *self.elastic.warnings,
                *self.ladder.sentences(),
                *self._negative_damping(),
                *self._optima_warnings(),
            ),
        )

    def _law(self, rung: Rung) -> DampingModelFit:
        first = rung is self.ladder.rungs[0]
        coefficients = self.damping.fit.coefficients if first else rung.coefficients
        return DampingModelFit(
            name=rung.law.name,
            coefficients=by_name(rung.law.coefficient_names, coefficients),
            bic=rung.bic,
            preferred=rung is self.ladder.preferred,
            missed=rung.missed,
        )

    def _constants(self) -> list[ParameterEstimate]:
        """Free and tied constants; a tied one follows its master in everything."""
        prior = self.elastic.updated.forward.parametrisation
        estimate = prior.constants(self.elastic.theta)
        initial = prior.constants(prior.prior_mean)
        spread = _spread(prior.spread, self.elastic.covariance)
        samples = None if self.sampled is None else self.sampled.elastic @ prior.spread.T + prior.base
        noise = _spread(prior.spread, self.elastic.noise_covariance)
        prior_sd = np.abs(prior.spread) @ prior.prior_sd
        verdict = {item.name: item.identifiable for item in self.elastic.verdicts}
        rows = []
        for row, name in enumerate(prior.constant_names):
            masters = np.flatnonzero(prior.spread[row])
            if masters.size:
                rows.append(
                    ParameterEstimate(
                        name=name,
                        unit=prior.units[row],
                        initial=float(initial[row]),
                        estimate=float(estimate[row]),
                        noise_standard_deviation=float(noise[row]),
                        **_width(
                            float(estimate[row]), float(spread[row]), None if samples is None else samples[:, row]
                        ),
                        identifiable=verdict[prior.names[int(masters[0])]],
                        prior_mean=float(initial[row]),
                        prior_sd=float(prior_sd[row]),
                    )
                )
        return rows

    def _coefficients(self) -> list[ParameterEstimate]:
        fit = self.damping.fit
        spread = np.sqrt(np.diag(self.damping.covariance))
        noise = np.sqrt(np.diag(fit.noise_covariance))
        return [
            ParameterEstimate(
                name=name,
                unit=unit,
                initial=float(self.damping.start[i]),
                estimate=float(fit.coefficients[i]),
                noise_standard_deviation=float(noise[i]),
                **_width(
                    float(fit.coefficients[i]),
                    float(spread[i]),
                    None if self.sampled is None else self.sampled.damping[:, i],
                ),
                identifiable=bool(spread[i] < abs(fit.coefficients[i]) / 2),
                prior_mean=None,
                prior_sd=None,
            )
            for i, (name, unit) in enumerate(zip(fit.law.coefficient_names, fit.law.coefficient_units, strict=True))
        ]

    def _mode(self, row: int) -> ModeComparison:
        updated = dict(self.elastic.pairing.pairs).get(row)
        initial = dict(self.elastic.initial_pairing.pairs).get(row)
        measured = float(self.modes.frequency_hz[row])
        ratio = float(self.modes.damping_ratio[row])
        frequency = None if updated is None else float(self.elastic.updated.frequency_hz[updated])
        matrix = self.elastic.pairing.mac
        predicted = None
        number = None if updated is None else updated + self.elastic.updated.modes.rigid
        if number is not None and number not in self.damping.fit.nuisance.suspended:
            predicted = float(self.damping.fit.law_rate[number] / (2 * np.sqrt(self.damping.fit.eigenvalue[number])))
        return ModeComparison(
            number=row + 1,
            kind=None if updated is None else self.elastic.updated.kinds[updated],
            measured_hz=measured,
            initial_hz=None if initial is None else float(self.elastic.initial.frequency_hz[initial]),
            updated_hz=frequency,
            error_percent=None if frequency is None else 100 * (frequency / measured - 1),
            mac=None if matrix is None or updated is None else float(matrix[row, updated]),
            measured_damping=None if np.isnan(ratio) else ratio,
            predicted_damping=predicted,
        )

    def _correlation(self) -> Correlation:
        frequency, (low, high) = self.data.frfs.frequency_hz, self.band
        lines = np.flatnonzero((frequency >= low) & (frequency <= high))
        fitted = np.ix_(np.array(self.data.fitted_rows), lines)
        seen, frfs = self.prediction, self.data.fitted.band(low, high)
        return Correlation(
            initial=agreement(frfs, seen.initial[fitted]),
            updated=agreement(frfs, seen.updated[fitted]),
            held_out_frfs=self._held_out_frfs(),
            held_out_band=self._held_out_band(),
            mac_matrix=self.elastic.pairing.mac,
        )

    def _held_out_frfs(self) -> HeldOut | None:
        if self.data.held is None:
            return None
        frfs = self.data.held.band(*self.band)
        points = {dof.point for dof in (*frfs.responses, *frfs.references)}
        fixed = {dof.point for dof in (*self.data.fitted.responses, *self.data.fitted.references)}
        held = tuple(sorted(points - fixed)) or tuple(sorted(points))
        return Predictor(self.elastic, self.damping).hold_against(frfs, held, self.band)

    def _held_out_band(self) -> HeldOut | None:
        """The recipe's band, or the lines above the fitted one."""
        lines = self.data.fitted.frequency_hz
        above = (float(np.nextafter(self.band[1], np.inf)), float(lines[-1]))
        low, high = self.held_band or above
        if np.sum((lines >= low) & (lines <= high)) < _FEWEST_LINES:
            return None
        frfs = self.data.fitted.band(low, high)
        return Predictor(self.elastic, self.damping).hold_against(frfs, (), (low, high))

    @cached_property
    def prediction(self) -> Prediction:
        """All usable FRFs beside the model's: before, with the damping that the measured ratios give, and after.

        The model after has its own natural frequencies and all: the shifts are the fit's, not the model's.
        """
        frfs, law = self.data.frfs, self.damping.fit.law
        before, after = (
            state.frf_model(frfs.responses, frfs.references) for state in (self.elastic.initial, self.elastic.updated)
        )
        first_rate = damping_rate(law, self.damping.start, before.omega)
        first_tail = beyond(law, self.damping.start, float(before.omega[-1]))
        return Prediction(
            frfs.frequency_hz,
            frfs.responses,
            frfs.references,
            frfs.values,
            before.synthesise(frfs.frequency_hz, first_rate, frfs.quantity, first_tail),
            self.damping.fit.synthesise(after, frfs.frequency_hz, frfs.quantity),
        )

    def _posterior(self) -> PosteriorSummary:
        if self.sampled is None:
            return PosteriorSummary("laplace")
        names = (*self.elastic.updated.forward.parametrisation.names, *self.damping.fit.law.coefficient_names)
        return PosteriorSummary(
            "mcmc",
            self.sampled.effective_samples,
            self.sampled.autocorrelation_time,
            self.sampled.acceptance,
            names,
            np.hstack([self.sampled.elastic, self.sampled.damping]),
        )

    def _negative_damping(self) -> list[str]:
        """Where in the band the fitted law, and the preferred one, would feed energy in: between or below the modes."""
        low, high = (2 * np.pi * hz for hz in self.band)
        fit, preferred = self.damping.fit, self.ladder.preferred
        laws = [(fit.law, fit.coefficients)]
        if preferred is not self.ladder.rungs[0]:
            laws.append((preferred.law, preferred.coefficients))
        found = []
        for law, coefficients in laws:
            negative = negative_band(law, coefficients, low, high)
            if negative is not None:
                first, last = (omega / (2 * np.pi) for omega in negative)
                found.append(
                    f"the {law.name} law as fitted is negative from {first:.4g} to {last:.4g} Hz, where it would feed energy "
                    "in: use it at the measured modes alone, or another law"
                )
        return found

    def _optima_warnings(self) -> list[str]:
        if len(self.damping.optima) == 1:
            return []
        law = self.damping.fit.law
        points = [
            ", ".join(f"{name} = {value:.4g}" for name, value in by_name(law.coefficient_names, point).items())
            for point in self.damping.optima
        ]
        return [f"the {law.name} fit has {len(points)} optima, of which the first is reported: {'; '.join(points)}"]


def _width(estimate: float, spread: float, samples: FloatArray | None) -> _Width:
    """Standard deviation and interval: of the samples where there are any, else of the Gaussian posterior."""
    if samples is None:
        return {"standard_deviation": spread, "interval_95": interval_95(estimate, spread)}
    low, high = np.quantile(samples, [0.025, 0.975])
    return {"standard_deviation": float(np.std(samples)), "interval_95": (float(low), float(high))}


def _spread(by: FloatArray, covariance: FloatArray) -> FloatArray:
    """(n,) standard deviations of by·θ."""
    variance: FloatArray = np.einsum("ip,pq,iq->i", by, covariance, by)
    return np.sqrt(np.maximum(variance, 0))
