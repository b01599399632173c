"""From the two stages to the result that users read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fecore.arrays import ComplexArray, FloatArray
from fecore.correlation import csac, csf, frac, sac
from fecore.damping import damping_rate
from fecore.frf import FrfSet
from fecore.modes import MeasuredModes
from fecore.updating.damping_stage import DampingResult
from fecore.updating.elastic import ElasticResult
from fecore.updating.forward import ForwardState
from fecore.updating.parameters import CONSTANTS, UNITS
from fecore.updating.posterior import interval_95
from fecore.updating.result import (
    ConvergenceStep,
    Correlation,
    DampingModelFit,
    FrfCorrelation,
    ModeComparison,
    ParameterEstimate,
    Prediction,
    UpdateResult,
)


@dataclass(frozen=True)
class Report:
    """Collects the stages' results.

    Attributes:
        elastic, damping: the two stages.
        modes: measured modes.
        frfs: all usable FRFs; fitted: those used in the fits; held: those held out, or None.
        band: lines of stage 2, Hz.
    """

    elastic: ElasticResult
    damping: DampingResult
    modes: MeasuredModes
    frfs: FrfSet
    fitted: FrfSet
    held: FrfSet | None
    band: tuple[float, float]

    def result(self) -> UpdateResult:
        """The whole result."""
        law = self.damping.fit.law
        lines = 2 * self.fitted.band(*self.band).values.size
        names = self.elastic.updated.forward.parametrisation.names
        return UpdateResult(
            parameters=(*self._constants(), *self._coefficients()),
            modes=tuple(self._mode(row) for row in range(len(self.modes))),
            correlation=self._correlation(),
            damping_models=(
                DampingModelFit(
                    law.name,
                    dict(zip(law.coefficient_names, map(float, self.damping.fit.coefficients), strict=True)),
                    2 * self.damping.fit.cost / lines,
                    self.damping.fit.history,
                ),
            ),
            convergence=tuple(
                ConvergenceStep(dict(zip(names, map(float, step.theta), strict=True)), step.frequency_hz, step.cost)
                for step in self.elastic.history
            ),
            null_directions=tuple(
                dict(zip(names, map(float, direction), strict=True)) for direction in self.elastic.null_directions
            ),
            frequency_discrepancy=self.elastic.discrepancy,
            damping_discrepancy=self.damping.discrepancy,
            band_hz=self.band,
            prediction=Prediction(
                self.frfs.frequency_hz,
                self.frfs.responses,
                self.frfs.references,
                self.frfs.values,
                self._initial(self.frfs),
                self._updated(self.frfs),
            ),
            warnings=(*self.elastic.warnings, *self._damping_warnings()),
        )

    def _constants(self) -> list[ParameterEstimate]:
        """Free and tied constants; a tied one follows its master in everything."""
        prior = self.elastic.updated.forward.parametrisation
        estimate = prior.constants(self.elastic.theta)
        initial = prior.constants(prior.prior_mean)
        spread = _spread(prior.spread, self.elastic.covariance)
        noise = _spread(prior.spread, self.elastic.noise_covariance)
        prior_sd = np.abs(prior.spread) @ prior.prior_sd
        verdict = {item.name: item.identifiable for item in self.elastic.verdicts}
        rows = []
        for row, name in enumerate(CONSTANTS):
            masters = np.flatnonzero(prior.spread[row])
            if masters.size:
                rows.append(
                    ParameterEstimate(
                        name=name,
                        unit=UNITS[name],
                        initial=float(initial[row]),
                        estimate=float(estimate[row]),
                        standard_deviation=float(spread[row]),
                        noise_standard_deviation=float(noise[row]),
                        interval_95=interval_95(float(estimate[row]), float(spread[row])),
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
                standard_deviation=float(spread[i]),
                noise_standard_deviation=float(noise[i]),
                interval_95=interval_95(float(fit.coefficients[i]), float(spread[i])),
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
        if updated is not None:
            number = updated + self.elastic.updated.modes.rigid
            predicted = float(self.damping.fit.law_rate[number] / (2 * np.sqrt(self.damping.fit.eigenvalue[number])))
        return ModeComparison(
            number=row + 1,
            measured_hz=measured,
            initial_hz=None if initial is None else float(self.elastic.initial.frequency_hz[initial]),
            updated_hz=frequency,
            error_percent=None if frequency is None else 100 * (frequency / measured - 1),
            mac=None if matrix is None or updated is None else float(matrix[row, updated]),
            measured_damping=None if np.isnan(ratio) else ratio,
            predicted_damping=predicted,
        )

    def _correlation(self) -> Correlation:
        inside = self.fitted.band(*self.band)
        return Correlation(
            initial=_agreement(inside.values, self._initial(inside)),
            updated=_agreement(inside.values, self._updated(inside)),
            held_out=None if self.held is None else _agreement(self.held.values, self._updated(self.held)),
            mac_matrix=self.elastic.pairing.mac,
        )

    def _initial(self, frfs: FrfSet) -> ComplexArray:
        """FRFs of the model before: nominal constants, damping that the measured ratios give."""
        return self._predict(self.elastic.initial, self.damping.start, frfs)

    def _updated(self, frfs: FrfSet) -> ComplexArray:
        """FRFs of the model after, its own natural frequencies and all: the shifts are the fit's, not the model's."""
        return self._predict(self.elastic.updated, self.damping.fit.coefficients, frfs)

    def _predict(self, state: ForwardState, coefficients: FloatArray, frfs: FrfSet) -> ComplexArray:
        model = state.frf_model(frfs.responses, frfs.references)
        rate = damping_rate(self.damping.fit.law, coefficients, model.omega)
        return model.synthesise(frfs.frequency_hz, rate, frfs.quantity)

    def _damping_warnings(self) -> list[str]:
        law, own = self.damping.fit, self.damping.modal
        numbers = [column + self.elastic.updated.modes.rigid for _, column in self.elastic.pairing.pairs]
        ratio = law.law_rate[numbers] / np.sqrt(law.eigenvalue[numbers])
        modal = own.rate[numbers] / np.sqrt(own.eigenvalue[numbers])
        missed = [
            f"mode {row + 1} by {100 * (ratio[i] / modal[i] - 1):+.0f} %"
            for i, (row, _) in enumerate(self.elastic.pairing.pairs)
            if abs(ratio[i] / modal[i] - 1) > _ADEQUATE
        ]
        if not missed:
            return []
        return [f"the {law.law.name} law does not describe this damping: it misses {', '.join(missed)}"]


_ADEQUATE = 0.1  # relative miss of a damping ratio above which a law is called inadequate


def _spread(by: FloatArray, covariance: FloatArray) -> FloatArray:
    """(n,) standard deviations of by·θ."""
    variance: FloatArray = np.einsum("ip,pq,iq->i", by, covariance, by)
    return np.sqrt(np.maximum(variance, 0))


def _agreement(measured: ComplexArray, predicted: ComplexArray) -> FrfCorrelation:
    return FrfCorrelation(
        sac=sac(measured, predicted),
        frac=frac(measured, predicted),
        csac=csac(measured, predicted),
        csf=csf(measured, predicted),
    )
