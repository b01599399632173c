"""What stage 2 starts from: FRFs, the updated elastic model, and the part that each of its modes
takes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fecore.arrays import BoolArray, FloatArray, IntArray
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
# prior standard deviation of the shift of an unmeasured mode, the constants given
_UNMEASURED_SHIFT = 0.01
# and of the logarithm of its damping over the law's: nobody measured it
_UNMEASURED_DEVIATION = 2.0
_GAIN_SD = 0.01  # prior standard deviation of a mode's own gain: where a sensor stands, say
_COMMON_GAIN_SD = 0.05  # of the gain of all modes: calibrations, and the model's mass


@dataclass(frozen=True)
class DampingData:
    """What stage 2 starts from; numbers of modes are among all of the model's, rigid-body modes
    first.
    """

    frfs: FrfSet  # FRFs on the fitted lines
    elastic: ElasticResult  # stage 1's result
    # measured modes, an exponential window's rate subtracted from their damping
    modes: MeasuredModes
    weighting: Weighting  # of the residuals
    inputs: Inputs  # what the laboratory says of window and delay
    model: ModalFrfModel  # the updated elastic model between the measured dofs

    @cached_property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """Measured and elastic model modes with a resonance in the band: of others the FRFs show no
        damping.
        """
        (low, high), hz = self.frfs.frequency_hz[[0, -1]], self.modes.frequency_hz
        return tuple((i, j) for i, j in self.elastic.believed(0).pairs if low <= hz[i] <= high)

    @cached_property
    def shifted(self) -> IntArray:
        """(s,) modes that were measured in the band: they carry a frequency shift."""
        return np.array(
            [self.elastic.updated.modes.rigid + column for _, column in self.pairs], dtype=int
        )

    @cached_property
    def first_shift(self) -> FloatArray:
        """(s,) measured over model frequency of these, relative."""
        hz, model = self.modes.frequency_hz, self.elastic.updated.frequency_hz
        return np.array([hz[i] / model[j] - 1 for i, j in self.pairs])

    @cached_property
    def unmeasured(self) -> IntArray:
        """(u,) elastic modes without a measured partner in the band: their tails reach into it."""
        modes = self.elastic.updated.modes
        return np.setdiff1d(np.arange(modes.rigid, modes.eigenvalue.size), self.shifted)

    @cached_property
    def suspension_modes(self) -> IntArray:
        """(r,) modes that move as a body on its suspension, which damps them as it will."""
        updated = self.elastic.updated
        rigid = updated.modes.rigid
        return np.concatenate([np.arange(rigid), rigid + np.flatnonzero(updated.on_springs)])

    @property
    def _strains(self) -> BoolArray:
        """(s,) measured modes that strain the specimen."""
        return ~np.isin(self.shifted, self.suspension_modes)

    @cached_property
    def rows(self) -> list[int]:
        """N measured modes, by their own numbers, whose damping the law has to explain."""
        return [row for (row, _), strains in zip(self.pairs, self._strains, strict=True) if strains]

    @cached_property
    def law_modes(self) -> IntArray:
        """(n,) the partners of `rows`."""
        return self.shifted[self._strains]

    @property
    def row_omega(self) -> FloatArray:
        """(n,) circular frequencies of `rows` as measured, rad/s."""
        return 2 * np.pi * self.modes.frequency_hz[self.rows]

    @property
    def first_ratio(self) -> FloatArray:
        """(n,) damping ratios of `rows` as measured, 2 % where none was."""
        ratio = np.nan_to_num(self.modes.damping_ratio[self.rows], nan=_FIRST_RATIO)
        return np.where(ratio > 0, ratio, _FIRST_RATIO)

    @property
    def first_omega(self) -> FloatArray:
        """(m,) circular frequencies of all modes, of the measured ones as measured, rad/s."""
        omega = self.model.omega.copy()
        omega[self.shifted] *= 1 + self.first_shift
        return omega

    @cached_property
    def modal_law(self) -> ModalDamping:
        """A damping ratio of its own for every measured mode that the law damps."""
        return ModalDamping(tuple(np.sort(self.first_omega[self.law_modes])))

    @property
    def law_mode_strain(self) -> FloatArray | None:
        """(n, q) shares of strain energy of the modes that the law damps."""
        return None if self.model.strain is None else self.model.strain[self.law_modes]

    def mixed(self, strain: FloatArray | None) -> DampingData:
        """The same with (n, q) shares of strain energy of the modes that the law damps; None: as
        they are.
        """
        if strain is None or self.model.strain is None:
            return self
        whole = self.model.strain.copy()
        whole[self.law_modes] = strain
        return replace(self, model=replace(self.model, strain=whole))

    def as_accelerance(self, factor: float = 1.0) -> DampingData:
        """The same with accelerances, times a factor.

        In accelerances the lines below the first mode, where a free specimen swings on its cords,
        weigh least.
        """
        frfs = self.frfs.to_quantity("accelerance")
        variance = None if frfs.variance is None else frfs.variance * factor**2
        return replace(self, frfs=replace(frfs, values=frfs.values * factor, variance=variance))

    def start(self, law: DampingLaw) -> FloatArray:
        """(p,) coefficients that come nearest to the measured damping ratios (2 % where none was
        measured).
        """
        others, strain = self.unmeasured, self.model.strain
        shares = None if strain is None else strain[np.concatenate([self.law_modes, others])]
        return nearest_positive(
            law, self.row_omega, self.first_ratio, self.model.omega[others], shares
        )

    def nuisance(self, deviation_sd: float, variance_inflation: float = 1.0) -> Nuisance:
        """Measured modes shift freely and deviate from the law a little, the others do both as far
        as priors let them.

        Where the misfit is `variance_inflation` times what noise alone makes of it, the model's
        residues are wrong: a peak that is too high passes for less damping. The modes' ratios were
        identified with residues of their own and do not suffer from that, so they are data too,
        with the share 1 - 1/variance_inflation of their information that the FRFs do not carry
        then.

        Suspended ones have rates of their own, which may lie as far from the lowest elastic mode's
        as nobody knows. How far an unmeasured mode may shift includes the constants' own
        uncertainty.
        """
        state, others, measured = self.elastic.updated, self.unmeasured.size, len(self.pairs)
        by = state.eigenvalue_jacobian[self.unmeasured] / (
            2 * state.modes.eigenvalue[self.unmeasured, None]
        )
        variance = np.einsum("kp,pq,kq->k", by, self.elastic.covariance, by)
        modes = np.concatenate([self.shifted, self.unmeasured])
        deviation = np.concatenate(
            [np.full(measured, deviation_sd), np.full(others, _UNMEASURED_DEVIATION)]
        )
        ratio_data, ratio_data_rate, ratio_data_sd = self._ratio_data(
            max(1 - 1 / variance_inflation, 0.0)
        )
        return Nuisance(
            modes=modes,
            first_shift=np.concatenate([self.first_shift, np.zeros(others)]),
            shift_sd=np.concatenate(
                [np.full(measured, np.inf), np.sqrt(_UNMEASURED_SHIFT**2 + variance)]
            ),
            deviation_sd=np.where(np.isin(modes, self.suspension_modes), 0.0, deviation),
            suspension_modes=self.suspension_modes,
            suspension_rate=np.full(
                self.suspension_modes.size, 2 * self.first_ratio[0] * self.row_omega[0]
            ),
            window_rate=2 * (self.inputs.window_rate or 0.0),
            ratio_data=ratio_data,
            ratio_data_rate=ratio_data_rate,
            ratio_data_sd=ratio_data_sd,
        )

    def _ratio_data(self, share: float) -> tuple[IntArray, FloatArray, FloatArray]:
        """Lawful modes whose ratios were identified, by a share of that information: numbers, rates
        in 1/s, relative sds.
        """
        ratios = self.measured_ratios
        if ratios is None or share == 0:
            return np.arange(0), np.zeros(0), np.zeros(0)
        sd = np.sqrt(np.diag(ratios.relative_covariance))
        known = np.isfinite(sd) & (sd > 0)
        return (
            self.law_modes[known],
            (2 * ratios.ratio * ratios.omega)[known],
            sd[known] / np.sqrt(share),
        )

    def ratios_of(
        self, omega: FloatArray, ratio: FloatArray, covariance: FloatArray
    ) -> MeasuredRatios:
        """Damping ratios of `rows` at (n,) circular frequencies, with their (n, n) covariance, and
        their shares.
        """
        columns = self.law_modes - self.elastic.updated.modes.rigid
        mixings = self.elastic.mixings(0, self.rows, columns.tolist(), omega / (2 * np.pi))
        return MeasuredRatios(
            omega, ratio, covariance / np.outer(ratio, ratio), self.law_mode_strain, mixings
        )

    @cached_property
    def measured_ratios(self) -> MeasuredRatios | None:
        """Damping ratios that the law has to explain as they were measured; None where one of them
        was not.
        """
        measured, count = self.modes.damping_ratio[self.rows], len(self.rows)
        if not np.all(np.nan_to_num(measured) > 0):
            return None
        covariance = np.zeros((count, count))
        if self.modes.covariance is not None:
            places = len(self.modes) + np.array(self.rows)
            covariance = self.modes.covariance[np.ix_(places, places)]
        return self.ratios_of(self.row_omega, measured, covariance)

    def misfit(self, frfs: FrfSet, weighting: Weighting, variance: FloatArray) -> FrfMisfit:
        """The misfit of some FRFs; only `noise` weights give gains and a delay a unit, and
        logarithms are not linear.
        """
        if weighting != "noise":
            driving = () if weighting == "log" else self.driving
            return FrfMisfit(frfs, self.model, weighting, variance, driving=driving)
        gain = np.where(np.isin(np.arange(self.model.omega.size), self.law_modes), _GAIN_SD, 0.0)
        delay = self.inputs.standard_deviation("delay")
        return FrfMisfit(
            frfs,
            self.model,
            weighting,
            variance,
            gain,
            common_gain_sd=_COMMON_GAIN_SD,
            driving=self.driving,
            delay_sd=delay,
        )

    @property
    def driving(self) -> tuple[int, ...]:
        """Numbers of the FRFs whose force and response have one point and direction."""
        pairs = enumerate(zip(self.frfs.responses, self.frfs.references, strict=True))
        measured = np.any(self.frfs.measured, axis=1).tolist()
        return tuple(
            i for i, (a, b) in pairs if (a.point, a.axis) == (b.point, b.axis) and measured[i]
        )

    def window_sd(self) -> float:
        """Standard deviation of an exponential window's rate 1/τ, 1/s; where none is known it is
        one-sided.

        A window that nobody stated cannot decay faster than the slowest mode was seen to, less what
        was stated.
        """
        if self.inputs.window_rate is not None and self.inputs.window_rate_sd is not None:
            return self.inputs.window_rate_sd
        spacing = (
            float(np.median(np.diff(self.frfs.frequency_hz)))
            if self.frfs.frequency_hz.size > 1
            else 0.0
        )
        slowest = float((self.first_ratio * self.row_omega).min()) - (
            self.inputs.window_rate or 0.0
        )
        return min(UNSTATED_WINDOW * spacing, max(slowest, 0.0))


def damping_data(
    frfs: FrfSet,
    elastic: ElasticResult,
    modes: MeasuredModes,
    weighting: Weighting,
    inputs: Inputs | None = None,
) -> DampingData:
    """Assign the modes their parts in stage 2.

    Raises:
        UpdatingError: no paired mode lies in the band, or none of them strains the specimen.
    """
    model = elastic.updated.frf_model(frfs.responses, frfs.references)
    data = DampingData(frfs, elastic, modes, weighting, inputs or Inputs.exact(), model)
    if not data.pairs:
        low, high = frfs.frequency_hz[[0, -1]]
        raise UpdatingError(
            f"no paired mode lies in the band, {low:g} to {high:g} Hz; fit a wider one", {}, ()
        )
    if not data.rows:
        raise UpdatingError(
            "no measured mode strains the specimen: all move on the springs", {}, ()
        )
    return data
