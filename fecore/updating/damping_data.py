"""What stage 2 starts from: FRFs, the updated elastic model, and the part that each of its modes takes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.dynamics.damping_laws import DampingLaw, ModalDamping
from fecore.dynamics.synthesis import ModalFrfModel
from fecore.errors import UpdatingError
from fecore.frf import FrfSet
from fecore.modes import MeasuredModes
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.inputs import UNSTATED_WINDOW, Inputs
from fecore.updating.law_problem import Nuisance
from fecore.updating.measured_ratios import MeasuredRatios, nearest_positive
from fecore.updating.misfit import FrfMisfit, Weighting

_FIRST_RATIO = 0.02  # of modes whose damping was not measured


@dataclass(frozen=True)
class ModeRoles:
    """Numbers of modes are among all of the model's, rigid-body modes first, where nothing else is said.

    Attributes:
        pairs: measured and elastic model modes with a resonance in the band: of others the FRFs show no damping.
        shifted: (s,) modes that were measured in the band: they carry a frequency shift.
        first_shift: (s,) measured over model frequency of these, relative.
        unmeasured: (u,) elastic modes without a measured partner in the band: their tails reach into it.
        suspended: (r,) modes that move as a body on its suspension, which damps them as it will.
        rows: n measured modes, by their own numbers, whose damping the law has to explain: not suspended.
        lawful: (n,) the partners of `rows`.
        first_ratio: (n,) damping ratios of `rows` as measured, 2 % where none was.
    """

    pairs: tuple[tuple[int, int], ...]
    shifted: IntArray
    first_shift: FloatArray
    unmeasured: IntArray
    suspended: IntArray
    rows: list[int]
    lawful: IntArray
    first_ratio: FloatArray


def assign_roles(frfs: FrfSet, elastic: ElasticResult, modes: MeasuredModes) -> ModeRoles:
    """The roles of the updated model's modes in a band of FRFs.

    Raises:
        UpdatingError: no paired mode lies in the band, or none of them strains the specimen.
    """
    updated = elastic.updated
    rigid, hz = updated.modes.rigid, modes.frequency_hz
    low, high = frfs.frequency_hz[[0, -1]]
    pairs = tuple((i, j) for i, j in elastic.pairing.pairs if low <= hz[i] <= high)
    if not pairs:
        raise UpdatingError(f"no paired mode lies in the band, {low:g} to {high:g} Hz; fit a wider one", {}, ())
    shifted = np.array([rigid + column for _, column in pairs])
    suspended = np.concatenate([np.arange(rigid), rigid + np.flatnonzero(updated.on_springs)])
    rows = [row for (row, _), mode in zip(pairs, shifted, strict=True) if mode not in suspended]
    if not rows:
        raise UpdatingError("no measured mode strains the specimen: all move on the springs", {}, ())
    ratio = np.nan_to_num(modes.damping_ratio[rows], nan=_FIRST_RATIO)
    return ModeRoles(
        pairs=pairs,
        shifted=shifted,
        first_shift=np.array([hz[i] / updated.frequency_hz[j] - 1 for i, j in pairs]),
        unmeasured=np.setdiff1d(np.arange(rigid, updated.modes.eigenvalue.size), shifted),
        suspended=suspended,
        rows=rows,
        lawful=shifted[~np.isin(shifted, suspended)],
        first_ratio=np.where(ratio > 0, ratio, _FIRST_RATIO),
    )


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
