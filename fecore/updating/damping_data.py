"""What stage 2 starts from: FRFs, the updated elastic model, and the part that each of its modes takes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.dynamics.damping_laws import DampingLaw, ModalDamping
from fecore.dynamics.synthesis import ModalFrfModel
from fecore.frf import FrfSet
from fecore.modes import MeasuredModes
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.inputs import UNSTATED_WINDOW, Inputs
from fecore.updating.law_problem import Nuisance
from fecore.updating.measured_ratios import MeasuredRatios, nearest_positive
from fecore.updating.misfit import FrfMisfit, Weighting
from fecore.updating.mode_roles import ModeRoles, assign_roles

_UNMEASURED_SHIFT = 0.01  # prior standard deviation of the shift of an unmeasured mode, the constants given
_UNMEASURED_DEVIATION = 2.0  # and of the logarithm of its damping over the law's: nobody measured it
_GAIN_SD = 0.01  # prior standard deviation of a mode's own gain: where a sensor stands, say
_COMMON_GAIN_SD = 0.05  # of the gain of all modes: calibrations, and the model's mass


@dataclass(frozen=True)
class DampingData:
    """What stage 2 starts from.

    Attributes:
        frfs: FRFs on the fitted lines.
        elastic: stage 1's result.
        modes: measured modes, an exponential window's rate subtracted from their damping.
        weighting: of the residuals.
        inputs: what the laboratory says of window and delay.
        model: the updated elastic model between the measured dofs.
        roles: which part each mode takes.
        modal_law: a damping ratio of its own for every measured mode that the law damps.
    """

    frfs: FrfSet
    elastic: ElasticResult
    modes: MeasuredModes
    weighting: Weighting
    inputs: Inputs
    model: ModalFrfModel
    roles: ModeRoles
    modal_law: ModalDamping

    def as_accelerance(self, factor: float = 1.0) -> DampingData:
        """The same with accelerances, times a factor.

        In accelerances the lines below the first mode, where a free specimen swings on its cords, weigh least.
        """
        frfs = self.frfs.to_quantity("accelerance")
        variance = None if frfs.variance is None else frfs.variance * factor**2
        return replace(self, frfs=replace(frfs, values=frfs.values * factor, variance=variance))

    def start(self, law: DampingLaw) -> FloatArray:
        """(p,) coefficients that come nearest to the measured damping ratios (2 % where none was measured)."""
        omega = 2 * np.pi * self.modes.frequency_hz[self.roles.rows]
        others, strain = self.roles.unmeasured, self.model.strain
        at = np.concatenate([self.roles.lawful, others])
        shares = None if strain is None else strain[at]
        return nearest_positive(law, omega, self.roles.first_ratio, self.model.omega[others], shares)

    def nuisance(self, deviation_sd: float, excess: float = 1.0) -> Nuisance:
        """Measured modes shift freely and deviate from the law a little, the others do both as far as priors let them.

        Where the misfit is `excess` times what noise alone makes of it, the model's residues are wrong: a peak that is too
        high passes for less damping. The modes' ratios were identified with residues of their own and do not suffer from
        that, so they are data too, with the share 1 - 1/excess of their information that the FRFs do not carry then.

        Suspended ones have rates of their own, which may lie as far from the lowest elastic mode's as nobody knows. How far
        an unmeasured mode may shift includes the constants' own uncertainty.
        """
        roles, state = self.roles, self.elastic.updated
        others, measured = roles.unmeasured.size, len(roles.pairs)
        by = state.eigenvalue_jacobian[roles.unmeasured] / (2 * state.modes.eigenvalue[roles.unmeasured, None])
        variance = np.einsum("kp,pq,kq->k", by, self.elastic.covariance, by)
        modes = np.concatenate([roles.shifted, roles.unmeasured])
        deviation = np.concatenate([np.full(measured, deviation_sd), np.full(others, _UNMEASURED_DEVIATION)])
        lowest = 2 * roles.first_ratio[0] * 2 * np.pi * self.modes.frequency_hz[roles.rows[0]]
        seen, seen_rate, seen_sd = self._seen()
        if excess <= 1:
            seen, seen_rate, seen_sd = seen[:0], seen_rate[:0], seen_sd[:0]
        return Nuisance(
            modes=modes,
            first_shift=np.concatenate([roles.first_shift, np.zeros(others)]),
            shift_sd=np.concatenate([np.full(measured, np.inf), np.sqrt(_UNMEASURED_SHIFT**2 + variance)]),
            deviation_sd=np.where(np.isin(modes, roles.suspended), 0.0, deviation),
            suspended=roles.suspended,
            suspended_rate=np.full(roles.suspended.size, lowest),
            window_rate=2 * (self.inputs.window_rate or 0.0),
            seen=seen,
            seen_rate=seen_rate,
            seen_sd=seen_sd / np.sqrt(max(1 - 1 / excess, 1e-300)),
        )

    def _seen(self) -> tuple[IntArray, FloatArray, FloatArray]:
        """Numbers, rates in 1/s and relative standard deviations of the lawful modes whose ratios were identified."""
        ratios = measured_ratios(self)
        if ratios is None:
            return np.arange(0), np.zeros(0), np.zeros(0)
        sd = np.sqrt(np.diag(ratios.relative_covariance))
        known = np.isfinite(sd) & (sd > 0)
        return self.roles.lawful[known], (2 * ratios.ratio * ratios.omega)[known], sd[known]

    def misfit(self, frfs: FrfSet, weighting: Weighting, variance: FloatArray) -> FrfMisfit:
        """The misfit of some FRFs; only `noise` weights give gains and a delay a unit."""
        if weighting != "noise":
            return FrfMisfit(frfs, self.model, weighting, variance)
        gain = np.where(np.isin(np.arange(self.model.omega.size), self.roles.lawful), _GAIN_SD, 0.0)
        delay = self.inputs.standard_deviation("delay")
        return FrfMisfit(
            frfs=frfs,
            model=self.model,
            weighting=weighting,
            variance=variance,
            gain_sd=gain,
            common_gain_sd=_COMMON_GAIN_SD,
            delay_sd=delay,
        )

    def window_sd(self) -> float:
        """Standard deviation of an exponential window's rate 1/τ, 1/s; where none was stated it is one-sided.

        A window that nobody stated cannot decay faster than the slowest mode was seen to.
        """
        if self.inputs.window_rate is not None:
            return self.inputs.window_rate_sd
        seen = self.roles.first_ratio * 2 * np.pi * self.modes.frequency_hz[self.roles.rows]
        spacing = float(np.median(np.diff(self.frfs.frequency_hz))) if self.frfs.frequency_hz.size > 1 else 0.0
        return min(UNSTATED_WINDOW * spacing, float(seen.min()))


def damping_data(
    frfs: FrfSet, elastic: ElasticResult, modes: MeasuredModes, weighting: Weighting, inputs: Inputs | None = None
) -> DampingData:
    """Assign the modes their parts in stage 2.

    Raises:
        UpdatingError: no measured mode in the band strains the specimen.
    """
    roles = assign_roles(frfs, elastic, modes)
    model = elastic.updated.frf_model(frfs.responses, frfs.references)
    shift = roles.first_shift[~np.isin(roles.shifted, roles.suspended)]
    modal_law = ModalDamping(tuple(np.sort(model.omega[roles.lawful] * (1 + shift))))
    return DampingData(
        frfs=frfs,
        elastic=elastic,
        modes=modes,
        weighting=weighting,
        inputs=inputs or Inputs.exact(),
        model=model,
        roles=roles,
        modal_law=modal_law,
    )


def measured_ratios(data: DampingData) -> MeasuredRatios | None:
    """Damping ratios that the law has to explain as they were measured; None where one of them was not."""
    rows = data.roles.rows
    measured = data.modes.damping_ratio[rows]
    if not np.all(np.nan_to_num(measured) > 0):
        return None
    covariance = np.zeros((len(rows), len(rows)))
    if data.modes.covariance is not None:
        places = len(data.modes) + np.array(rows)
        covariance = data.modes.covariance[np.ix_(places, places)]
    omega = 2 * np.pi * data.modes.frequency_hz[rows]
    return MeasuredRatios(omega, measured, covariance / np.outer(measured, measured), lawful_strain(data))


def lawful_strain(data: DampingData) -> FloatArray | None:
    """(n, q) shares of strain energy of the modes that the law damps."""
    return None if data.model.strain is None else data.model.strain[data.roles.lawful]
