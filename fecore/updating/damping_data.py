"""What stage 2 starts from, and whether the measured FRFs are those of the model at all.

What stage 2 starts from: FRFs, the updated elastic model, and the part that each of its modes
takes.

Whether the measured FRFs are those of the model at all, before damping is sought in them.

Natural frequencies alone cannot distinguish a wrong length or density from other elastic constants:
all scale them alike. The height of the FRFs can: it goes with the modal masses. And a wrong sign,
factor or point of one FRF leaves the frequencies as they are, but not that FRF. So each FRF is
compared, as accelerance, with the model's, whose modes are moved to the measured frequencies and
have the measured damping ratios, by its height s and likeness c over the lines,

    s = median Re H/H_model,     c = Re H_modelᴴ H / (|H_model| |H|);

the median, as peaks that few lines resolve, or a mode that was not measured, would move a mean.

After stage 2: an exponential window that nobody stated. A window exp(-t/τ) makes every mode decay
faster by 1/τ, as a constant part of the damping does (a0 = 2/τ): FRFs alone do not distinguish the
two. But windows are chosen to end a record of T seconds at 10 to 1 % of its first value, so 1/τ
lies between 2/T and 5/T. A body whose own constant part lies there, and makes most of the slowest
modes' decay, looks windowed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, get_args

import numpy as np

from fecore.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from fecore.dynamics.damping_laws import DampingLaw, ModalDamping
from fecore.dynamics.synthesis import ModalFrfModel
from fecore.errors import UpdatingError
from fecore.findings import Finding, Level, listed
from fecore.frf import FrfSet, Quantity
from fecore.modal.arrangement import pair_label
from fecore.modes import MeasuredModes
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.frf_fits import Nuisance
from fecore.updating.inputs import GRID_SD, POINT_SD, UNSTATED_WINDOW, Inputs
from fecore.updating.laws import MeasuredRatios, nearest_positive
from fecore.updating.misfit import FrfMisfit, Weighting
from fecore.updating.parameters import by_name
from fecore.updating.result import amount, finding

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
        fractions = None if strain is None else strain[np.concatenate([self.law_modes, others])]
        return nearest_positive(
            law, self.row_omega, self.first_ratio, self.model.omega[others], fractions
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


# by which the FRFs may be larger or smaller than the model's: twice what calibrations are good for
_COMMON = 0.05
_COMMON_SDS = 2.0  # standard deviations that this is

_UNITS = {
    "acceleration in g is, for m/s²": 1 / 9.80665,
    "acceleration in m/s² is, for g": 9.80665,
    "force in lbf is, for N": 4.448,
    "force in N is, for lbf": 1 / 4.448,
    "values in mm or kN are, for m or N": 1e3,
    "values in m or mN are, for mm or N": 1e-3,
}
"""What is often taken for another unit, and the factor that it gives an FRF."""

_OWN = 0.3  # by which one FRF's factor may lie off that of all
# of where a sensor sits, or a hammer hits, about its point, m
_PLACED = float(np.hypot(POINT_SD, GRID_SD))
_LIKE = 0.7  # likeness below which an FRF is another one
# of the median energy of the FRFs: weaker ones, near a nodal line, are noise and the neighbours'
# tails
_WEAK = 0.05
_NEAR = 0.1  # of its frequency: lines at an unmeasured mode
# times the measured FRFs, from which a model's mode is absent: nine times the damping would hide it
_ABSENT = 3.0
_LARGEST_MISS = 0.1  # of a frequency, after the update
_MOST = 5  # FRFs or modes named in one sentence


@dataclass(frozen=True)
class Likeness:
    """Measured FRFs beside the model's."""

    height: FloatArray  # (N,) s
    likeness: FloatArray  # (N,) c
    loud: BoolArray  # (N,) FRFs with enough energy to be judged
    labels: tuple[str, ...]  # N names, response first
    unmeasured_hz: FloatArray  # (u,) frequencies of the model's modes that were not measured
    # (u,) how much higher the model's FRFs are than the measured ones about each: root of the ratio
    # of energies
    expected: FloatArray
    lowest_hz: float  # of the measured modes
    # standard deviation of the logarithm of the common factor, as a sensor that stands still is off
    # its point
    placed: float

    @classmethod
    def of(cls, data: DampingData, quantity: Quantity | None = None) -> Likeness:
        """Compare on the fitted lines; as if the FRFs were another quantity than is stated, where
        one is given.

        Accelerances are compared: the lines below the first mode, where a free specimen's
        receptance is largest, show what it hangs on and the noise.
        """
        frfs = replace(data.frfs, quantity=quantity or data.frfs.quantity).to_quantity(
            "accelerance"
        )
        law = data.modal_law
        omega = data.first_omega
        rate = law.basis(omega) @ data.start(law) + 2 * (data.inputs.window_rate or 0.0)
        predicted = data.model.with_eigenvalue(omega**2).synthesise(
            frfs.frequency_hz, rate, frfs.quantity
        )
        unknown = [
            mode
            for mode, (row, _) in zip(data.shifted, data.pairs, strict=True)
            if np.isnan(data.modes.damping_ratio[row])
        ]
        unmeasured, unknown_hz = omega[data.unmeasured] / (2 * np.pi), omega[unknown] / (2 * np.pi)
        seen = frfs.measured & _clear_lines(
            frfs.frequency_hz, np.concatenate([unmeasured, unknown_hz])
        )
        values, there = (np.where(seen, each, 0) for each in (frfs.values, predicted))
        own, model = (
            np.maximum(np.sum(np.abs(each) ** 2, axis=1), 1e-300) for each in (values, there)
        )
        both = np.sum((there.conj() * values).real, axis=1)
        height = [
            float(np.median((v[known] / t[known]).real))
            for v, t, known in zip(values, there, seen, strict=True)
        ]
        return cls(
            height=np.array(height),
            likeness=both / np.sqrt(own * model),
            loud=own > _WEAK * np.median(own),
            labels=tuple(
                pair_label(*pair) for pair in zip(frfs.responses, frfs.references, strict=True)
            ),
            unmeasured_hz=unmeasured,
            expected=_expected(frfs, predicted, unmeasured),
            lowest_hz=float(omega[data.shifted].min() / (2 * np.pi)),
            placed=_placed(data),
        )

    @property
    def common(self) -> float:
        """Median factor of the FRFs."""
        return float(np.median(self.height[self.loud]))

    @property
    def usual(self) -> float:
        """Median likeness."""
        return float(np.median(self.likeness[self.loud]))

    @property
    def alike(self) -> bool:
        """Whether most FRFs are the model's, but for one factor, which may be negative."""
        return bool(self.usual * np.sign(self.common) >= _LIKE)

    @property
    def miscalibrated(self) -> bool:
        """Whether the common factor is more than a calibration's error."""
        return bool(abs(np.log(abs(self.common))) > _COMMON)

    def findings(self) -> list[Finding]:
        """What looks wrong."""
        if not self.alike:
            return [finding("frfs_unlike", likeness=self.usual)]
        findings, sign = [], np.sign(self.common)
        if sign < 0:
            findings.append(finding("sign_opposite"))
        if self.miscalibrated:
            by_place = abs(np.log(abs(self.common))) < np.hypot(_COMMON, _COMMON_SDS * self.placed)
            kind = "frfs_scaled_by_place" if by_place else "frfs_scaled"
            findings.append(finding(kind, factor=amount("", abs(self.common)), unit=self._unit()))
        relative = self.height / self.common
        like: BoolArray = sign * self.likeness >= _LIKE
        turned: BoolArray = sign * self.likeness <= -_LIKE
        scaled: BoolArray = like & (np.abs(relative - 1) > _OWN)
        kinds = {"frf_turned": turned, "frf_scaled": scaled, "frf_unlike": ~like & ~turned}
        for kind, which in kinds.items():
            if (rows := np.flatnonzero(which & self.loud)).size:
                of = "model" if sign > 0 else "rest"
                findings.append(finding(kind, of=of, **self._named(rows, relative)))
        return [*findings, *self._absent()]

    def _absent(self) -> list[Finding]:
        """Modes of the model that would stand out of the FRFs, and do not."""
        hz = self.unmeasured_hz[self.expected * abs(self.common) > _ABSENT]
        if not hz.size:
            return []
        which = listed([f"{each:.2f} Hz" for each in hz], _MOST)
        modes = "a mode" if hz.size == 1 else "modes"
        level: Level | None = "do_not_use" if hz.min() < self.lowest_hz else None
        return [finding("modes_absent", level=level, modes=modes, which=which)]

    def _unit(self) -> str:
        """The mistaken unit that the common factor is, in words; nothing where it is none."""
        close = [
            unit
            for unit, factor in _UNITS.items()
            if abs(np.log(abs(self.common) / factor)) < _COMMON
        ]
        return f" (as {close[0]})" if close else ""

    def _named(self, rows: IntArray, relative: FloatArray) -> dict[str, Any]:
        names = listed([f"{self.labels[row]} ({relative[row]:+.2f})" for row in rows], _MOST)
        frf, have = ("FRF", "has") if rows.size == 1 else ("FRFs", "have")
        return {"frfs": f"{frf} {names}", "have": have}


def _placed(data: DampingData) -> float:
    """Standard deviation of the logarithm of all FRFs' height, as the dof that they share is met to
    `_PLACED`; 0 without one.

    Where its displacement φ changes by g per metre, in modes that the FRF's other dof sees by ψ, it
    is `_PLACED` √(Σψ²|g|²/Σψ²φ²): large near a clamp.
    """
    state, frfs = data.elastic.updated, data.frfs
    forward, measured = state.forward, data.shifted - state.modes.rigid
    steep = np.sum(state.slopes[measured] ** 2, axis=2)
    shapes = state.shapes[measured] ** 2
    sides = [forward.rows(dofs)[0] for dofs in (frfs.responses, frfs.references)]
    both = np.maximum(np.sum(shapes[:, sides[0]] * shapes[:, sides[1]], axis=0), 1e-300)
    variance = [
        float(np.median(np.sum(steep[:, own] * shapes[:, other], axis=0) / both))
        for own, other in (sides, sides[::-1])
        if np.ptp(own) == 0
    ]
    return _PLACED * float(np.sqrt(sum(variance)))


def _expected(frfs: FrfSet, predicted: ComplexArray, modes_hz: FloatArray) -> FloatArray:
    """(u,) how much higher some predicted FRFs are than the measured ones about each mode; 0 where
    no line is near.
    """
    near = np.abs(frfs.frequency_hz / modes_hz[:, None] - 1) <= _NEAR
    both = (np.where(frfs.measured, each, 0) for each in (frfs.values, predicted))
    measured, there = (near @ np.sum(np.abs(each) ** 2, axis=0) for each in both)
    ratio: FloatArray = np.sqrt(there / np.maximum(measured, 1e-300))
    return ratio


def _clear_lines(frequency_hz: FloatArray, blunt_hz: FloatArray) -> BoolArray:
    """(L,) lines away from modes whose damping nobody measured; all where none is."""
    clear: BoolArray = np.all(np.abs(frequency_hz[:, None] / blunt_hz - 1) > _NEAR, axis=1)
    return clear if clear.any() else np.ones_like(clear)


def examine(data: DampingData) -> tuple[DampingData, list[Finding]]:
    """What looks wrong with the measurement or the model before stage 2, and the data that damping
    is sought in.

    Damping is in the shape of the peaks, not in their height: FRFs of another height than the
    model's, or of the other sign, are divided by the factor that they have in common.

    Raises:
        UpdatingError: the model is so far off that damping cannot be sought: modes that stay apart
            in frequency, or FRFs of another quantity than stated.
    """
    shift = np.abs(data.first_shift)
    likeness = Likeness.of(data)
    pairs, updated = data.pairs, data.elastic.updated
    if shift.max() > _LARGEST_MISS:
        row, column = pairs[int(np.argmax(shift))]
        hz, model = data.modes.frequency_hz[row], updated.frequency_hz[column]
        raise _refusal(
            data,
            f"the updated model still misses measured mode {row + 1} ({hz:.2f} Hz) by"
            f" {100 * (model / hz - 1):+.0f} %: this is not the model of the specimen, or its modes"
            " were paired wrongly; check boundary, geometry and the points' coordinates, or"
            " measure at more points, across the width too",
        )
    if (not likeness.alike or likeness.common < 0) and (other := _other_quantity(data, likeness)):
        raise _refusal(
            data,
            f"the FRFs are stated to be {data.frfs.quantity} and are like the model's {other}:"
            " correct the quantity",
        )
    changed = likeness.alike and (likeness.miscalibrated or likeness.common < 0)
    return data.as_accelerance(1 / likeness.common if changed else 1.0), likeness.findings()


def _other_quantity(data: DampingData, stated: Likeness) -> Quantity | None:
    """The quantity that the FRFs are, where they are more like it than like the stated one."""
    others = {
        name: Likeness.of(data, name).usual
        for name in get_args(Quantity)
        if name != data.frfs.quantity
    }
    best = max(others, key=lambda name: others[name])
    return best if others[best] >= max(_LIKE, abs(stated.usual)) else None


def _refusal(data: DampingData, message: str) -> UpdatingError:
    best = by_name(data.elastic.updated.forward.parametrisation.names, data.elastic.theta)
    history = tuple(iterate.cost for iterate in data.elastic.history)
    return UpdatingError(message, best, history)
