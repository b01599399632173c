"""Whether the measured FRFs are those of the model at all, before damping is sought in them.

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
from typing import Any, get_args

import numpy as np

from fecore.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from fecore.errors import UpdatingError
from fecore.findings import Finding, Level, listed
from fecore.frf import FrfSet, Quantity
from fecore.least_squares import nearest
from fecore.modal.arrangement import pair_label
from fecore.updating.amounts import amount
from fecore.updating.damping_data import DampingData
from fecore.updating.damping_stage import DampingResult
from fecore.updating.findings import finding
from fecore.updating.inputs import GRID_SD, POINT_SD, Inputs
from fecore.updating.parameters import by_name

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
    missed = np.abs(data.first_shift)
    likeness = Likeness.of(data)
    pairs, updated = data.pairs, data.elastic.updated
    if missed.max() > _LARGEST_MISS:
        row, column = pairs[int(np.argmax(missed))]
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


_USUAL = (2.0, 5.0)  # 1/τ of usual windows, over the record's length
_OF_DECAY = 0.5  # share of the slowest mode's decay that a window has where FRFs look windowed
_FEWEST_MODES = 3  # that show a constant part of the decay
_MATTERS = 0.05  # share of a coefficient that an unstated window may take


def unstated_window(damping: DampingResult, inputs: Inputs, record_s: float) -> list[Finding]:
    """What a user must know of a window that nobody stated; nothing where it was, or where it would
    hardly matter.

    Args:
        damping: the fitted law.
        inputs: what the laboratory says of the window.
        record_s: T, the length of the records that the FRFs' line spacing is of.
    """
    if inputs.window_known:
        return []
    values, names = damping.fit.coefficients, damping.fit.law.coefficient_names
    shares = np.abs(damping.window / np.where(values == 0, 1.0, values))
    worst = int(np.argmax(shares))
    if shares[worst] < _MATTERS:
        return []
    omega, ratio = damping.reference.ratios.omega, damping.reference.ratios.ratio
    rate = looks_windowed(omega, ratio - (inputs.window_rate or 0.0) / omega, record_s)
    if rate is None:
        return [finding("window_unstated", name=names[worst], percent=100 * shares[worst])]
    return [
        finding("looks_windowed", rate=rate, record=record_s, end=100 * np.exp(-rate * record_s))
    ]


def looks_windowed(omega: FloatArray, ratio: FloatArray, record_s: float) -> float | None:
    """The part of the decay that all modes share, 1/s, where it is that of a usual window; else
    None.

    Args:
        omega: (n,) circular frequencies, rad/s.
        ratio: (n,) damping ratios.
        record_s: T, s.
    """
    if omega.size < _FEWEST_MODES:
        return None
    decay = ratio * omega
    basis = np.column_stack([np.ones_like(omega), omega**2]) / decay[:, None]
    constant = float(nearest(basis, np.ones_like(omega))[0])
    usual = _USUAL[0] <= constant * record_s <= _USUAL[1]
    return constant if usual and constant > _OF_DECAY * decay.min() else None
