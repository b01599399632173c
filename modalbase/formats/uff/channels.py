"""Functions of one or two channels: time blocks in SI, and FRFs and coherences of power spectra
(set 58).

Analysers write auto and cross spectra (function types 2 and 3) beside FRFs or in their place:

    H1 = S_af / S_ff,    γ² = |S_af|² / (S_ff S_aa)

with a the response and f the force. Programs differ in which channel of a cross spectrum they
conjugate, and files do not say. A body cannot move before it is hit: of the two readings only one
has its impulse response in the first half of its period, and that one is taken. Where neither
stands out, the spectra are left alone.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from modalbase.formats.types import ComplexArray, FloatArray, Quantity
from modalbase.formats.uff.content import (
    COHERENCE,
    Axis,
    ChannelQuantity,
    DatasetReport,
    Frf,
    Function,
    PowerSpectrum,
    TimeResponse,
    Units,
)
from modalbase.formats.uff.frf import UNSTATED_TYPES, frequency_of, global_dofs
from modalbase.formats.uff.function import RawFunction
from modalbase.formats.uff.geometry import Geometry
from modalbase.formats.uff.text import Refusal
from modalbase.formats.units import (
    FORCE,
    NO_UNIT,
    NUMBER,
    RESPONSE,
    TIME,
    Dimension,
    factor_of,
    read_unit,
    without_amplitude,
)

TIME_RESPONSE, AUTO_SPECTRUM, CROSS_SPECTRUM = 1, 2, 3
_TYPES: dict[int, ChannelQuantity] = {
    8: "displacement",
    11: "velocity",
    12: "acceleration",
    9: "force",
    13: "force",
}
_DIMENSIONS: dict[Dimension, ChannelQuantity] = {
    FORCE: "force",
    RESPONSE["accelerance"]: "acceleration",
    RESPONSE["mobility"]: "velocity",
    RESPONSE["receptance"]: "displacement",
}
# of the last abscissa, to which six digits round it
_ROUNDED = 1e-5
# energy of the first half of the impulse response over the second, or the other way round
_CAUSAL = 4.0
_APART = 0.01  # of a sample, by which blocks of a hit may begin apart
_ABOVE_ONE = 1.001
_QUANTITY: dict[ChannelQuantity, Quantity] = {
    "acceleration": "accelerance",
    "velocity": "mobility",
    "displacement": "receptance",
}
# powers of the amplitude and of the time in the unit of an auto spectrum: N, N², N²/Hz, N²·s/Hz
_SQUARES = ((1, 0), (2, 0), (2, 1), (2, 2))
_IDS = ("", "", "", "", "")
Dof = tuple[int, int]


def time_of(
    raw: RawFunction, dataset: int, units: Units | None, geometry: Geometry
) -> tuple[TimeResponse, list[str]] | None:
    """A time block in SI and the notes on how it came there; None where it is a block of another
    kind (pressure, strain).

    Raises:
        Refusal: it is complex, uneven or without a sampling rate, its unit
            contradicts its data type, or SI takes it out of range.
    """
    notes: list[str] = []
    channel = _channel(raw, units, notes)
    if channel is None:
        return None
    quantity, factor = channel
    if raw.values.dtype.kind == "c" and raw.values.imag.any():
        raise Refusal("is a time block of complex samples, expected real ones", 6)
    over = read_unit(raw.denominator.unit)
    if over is not None and over.dimension != NUMBER:
        notes.append(
            f"its denominator is in '{raw.denominator.unit}', as an impulse response has it; it is"
            " taken as a time block"
        )
    unit = raw.abscissa.unit.strip()
    seconds = 1.0 if unit.lower() in NO_UNIT else factor_of("time", unit)
    if seconds is None or raw.abscissa.data_type not in (*UNSTATED_TYPES, 17):
        raise Refusal(f"is a time block over '{unit}', expected seconds", 7)
    step = _step(raw.axis)
    if not step > 0:
        raise Refusal("is a time block without an even time step: its sample rate is missing", 6)
    with np.errstate(over="ignore"):
        samples = raw.values.real if factor == 1.0 else raw.values.real.astype(np.float64) * factor
    if not np.isfinite(samples).all():
        raise Refusal(
            "its samples are beyond double precision in SI, first at"
            f" {np.argmin(np.isfinite(samples)) + 1}"
        )
    dofs = global_dofs(raw, geometry, notes)
    rate = float(f"{1 / (step * seconds):.12g}")
    return TimeResponse(dataset, raw.id_lines[0], quantity, *dofs, rate, samples), notes


def _step(axis: Axis) -> float:
    """The step of an axis that is even, or whose values are but for the rounding of six digits;
    else 0.
    """
    if axis.values is None:
        return axis.step
    steps = np.diff(axis.values)
    mean = float(steps.mean()) if steps.size else 0.0
    even = np.ptp(steps) <= 1e-3 * mean + _ROUNDED * abs(axis.values[-1]) if steps.size else False
    return mean if even else 0.0


@dataclass
class Hits:
    """Where the time blocks of each hit begin: the n-th block of a channel is of the n-th hit."""

    _counts: Counter[tuple[object, ...]] = field(default_factory=Counter)
    _begun: dict[tuple[int, int], tuple[int, float]] = field(default_factory=dict)
    _struck: int = 0

    def take(self, block: TimeResponse, axis: Axis) -> None:
        """The next block of the file.

        Raises:
            Refusal: it begins apart from the others of its hit.
        """
        force = block.quantity == "force"
        point = block.reference_point or (block.response_point if force else self._struck)
        self._struck = point if force else self._struck
        channel = (block.quantity, block.response_point, block.response_direction, point)
        self._counts[channel] += 1
        hit = point, self._counts[channel]
        other, start = self._begun.setdefault(hit, (block.dataset, axis.start))
        if abs(axis.start - start) > _APART * _step(axis):
            raise Refusal(
                f"is a time block that begins at {axis.start:g}, and that of dataset {other}, of the"
                f" same hit, at {start:g}; export the channels of a hit over the same times",
                6,
            )


def spectrum_of(
    raw: RawFunction, dataset: int, units: Units | None, geometry: Geometry
) -> tuple[PowerSpectrum, list[str]] | None:
    """A power spectrum and the notes on it; None where its channel is neither force nor motion.

    The unit label of an auto spectrum is that of its channel, the square of it, or its density, as
    programs differ; what all spectra of a file share leaves their ratios.

    Raises:
        Refusal: it is not over frequency, or its unit contradicts its data type.
    """
    notes: list[str] = []
    kind: Literal["auto", "cross"] = "auto" if raw.function_type == AUTO_SPECTRUM else "cross"
    channel = _channel(raw, units, notes, squared=True) if kind == "auto" else (None, 1.0)
    if channel is None:
        return None
    quantity, factor = channel
    axis: Axis = frequency_of(raw, notes)
    values = np.asarray(raw.values, dtype=np.complex128)
    dofs = global_dofs(raw, geometry, notes)
    return (
        PowerSpectrum(dataset, raw.id_lines[0], kind, quantity, factor, *dofs, axis, values),
        notes,
    )


def _channel(
    raw: RawFunction, units: Units | None, notes: list[str], *, squared: bool = False
) -> tuple[ChannelQuantity, float] | None:
    """What a channel is, and the factor of its amplitude to SI; None where it is none of ours."""
    described = raw.ordinate
    unit, _ = without_amplitude(described.unit)
    label, by_type = read_unit(unit), _TYPES.get(described.data_type)
    if label is not None:
        for power, density in _SQUARES if squared else ((1, 0),):
            root = _root(label.dimension.times(TIME, -density), power)
            if root in _DIMENSIONS:
                quantity = _DIMENSIONS[root]
                if by_type not in (None, quantity):
                    raise Refusal(
                        f"its data type says {by_type}, its unit '{described.unit}' says"
                        f" {quantity}",
                        8,
                    )
                return quantity, label.factor ** (1 / power)
        if label.dimension.voltage:
            raise Refusal(
                f"its ordinate is in '{described.unit}', and a UFF file states no sensitivity:"
                " export it in N and m/s², or as npz or .mat, whose mapping states one",
                8,
            )
        return None
    if by_type is None:
        return None
    length, force = (1.0, 1.0) if units is None else (units.length, units.force)
    by = (
        "SI (the file has no set 164)"
        if units is None
        else f"set 164 ({units.description or units.code})"
    )
    notes.append(
        f"its ordinate has no unit label that is understood ('{described.unit}'); units of {by}"
        " assumed"
    )
    return by_type, 1 / force if by_type == "force" else 1 / length


def _root(dimension: Dimension, power: int) -> Dimension | None:
    if any(d % power for d in dimension):
        return None
    return Dimension(*(d // power for d in dimension))


@dataclass
class Spectra:
    """The power spectra of a file; they make FRFs once all of them are known."""

    _autos: dict[Dof, list[PowerSpectrum]] = field(default_factory=dict)
    _crosses: list[PowerSpectrum] = field(default_factory=list)
    _taken: set[int] = field(default_factory=set)
    _held: dict[int, DatasetReport] = field(default_factory=dict)
    _known: set[tuple[Dof, Dof]] = field(default_factory=set)

    def take(self, spectrum: PowerSpectrum) -> None:
        """One spectrum of the file."""
        self._taken.add(spectrum.dataset)
        if spectrum.kind == "cross":
            self._crosses.append(spectrum)
        else:
            self._autos.setdefault(
                (spectrum.response_point, abs(spectrum.response_direction)), []
            ).append(spectrum)

    def holds(self, report: DatasetReport) -> bool:
        """Keep the report of a spectrum's dataset until it is known what the spectrum is good
        for.
        """
        if report.number not in self._taken:
            return False
        self._held[report.number] = report
        return True

    def note(self, frf: Frf) -> None:
        """The file has this FRF itself; its spectra are not needed."""
        self._known.add(
            (
                (frf.response_point, abs(frf.response_direction)),
                (frf.reference_point, abs(frf.reference_direction)),
            )
        )

    def finish(self) -> Iterator[Frf | Function | DatasetReport]:
        """FRFs and coherences, then the reports of all spectra."""
        reasons: dict[int, str] = {}
        notes: dict[int, str] = {}
        used: set[int] = set()
        for cross in self._crosses:
            made = self._made(cross)
            if isinstance(made, str):
                reasons[cross.dataset] = made
                continue
            frf, coherence, note, autos = made
            notes[cross.dataset] = note
            used |= autos
            yield frf
            yield coherence
        for number, report in self._held.items():
            if number in notes:
                yield replace(report, notes=(*report.notes, notes[number]))
            elif number in reasons:
                yield replace(report, outcome="ignored", reason=reasons[number])
            elif number in used:
                yield report
            else:
                yield replace(
                    report,
                    outcome="ignored",
                    reason="is an auto spectrum that no cross spectrum needs",
                )

    def _made(self, cross: PowerSpectrum) -> tuple[Frf, Function, str, set[int]] | str:
        """What a cross spectrum makes with the auto spectra of its channels, or why it makes
        nothing.
        """
        response = cross.response_point, abs(cross.response_direction)
        reference = cross.reference_point, abs(cross.reference_direction)
        if (response, reference) in self._known:
            return "is the cross spectrum of an FRF that the file has itself"
        force = self._auto(reference, cross, forces=True)
        motion = self._auto(response, cross, forces=False)
        if force is None or motion is None:
            lacks = "the force at its reference" if force is None else "the motion at its response"
            return f"is a cross spectrum without an auto spectrum of {lacks}, on the same lines"
        ff, aa, af = np.abs(force.values), np.abs(motion.values), cross.values
        with np.errstate(divide="ignore", invalid="ignore"):
            coherence = np.nan_to_num(np.abs(af) ** 2 / (ff * aa))
            values = np.nan_to_num(af / ff) * (motion.factor / force.factor)
        if float(np.percentile(coherence, 90)) > _ABOVE_ONE:
            return "makes a coherence above 1 with its auto spectra: they are not scaled alike"
        conjugated = _conjugated(values)
        if conjugated is None:
            return (
                "has an impulse response that lies before the hit as much as after it: which"
                " channel is conjugated?"
            )
        if conjugated:
            values = values.conj()
        assert motion.quantity is not None, "an auto spectrum has a quantity"
        note = (
            f"H1 and coherence made with the auto spectra of datasets {force.dataset} and"
            f" {motion.dataset}"
            + (
                "; its response is the conjugated channel, as the impulse response shows"
                if conjugated
                else ""
            )
        )
        quantity, gamma = _QUANTITY[motion.quantity], np.clip(coherence, 0, 1)
        frf = Frf(cross.dataset, cross.label, _IDS, *cross.dofs, quantity, cross.frequency, values)
        again = Function(
            cross.dataset,
            cross.label,
            _IDS,
            COHERENCE,
            *cross.dofs,
            cross.frequency,
            "Hz",
            gamma,
            "",
        )
        return frf, again, note, {force.dataset, motion.dataset}

    def _auto(self, dof: Dof, cross: PowerSpectrum, *, forces: bool) -> PowerSpectrum | None:
        """The auto spectrum of a channel on the lines of a cross spectrum, the last before it."""
        fit = [
            auto
            for auto in self._autos.get(dof, [])
            if (auto.quantity == "force") is forces and _same_lines(auto, cross)
        ]
        before = [auto for auto in fit if auto.dataset < cross.dataset]
        return before[-1] if before else fit[0] if fit else None


def _same_lines(a: PowerSpectrum, b: PowerSpectrum) -> bool:
    return a.frequency.count == b.frequency.count and bool(
        np.allclose(a.frequency.points(), b.frequency.points(), rtol=1e-6, atol=1e-9)
    )


def _conjugated(values: ComplexArray) -> bool | None:
    """Whether the conjugate of an FRF is the causal one; None where that cannot be seen.

    What lies at time 0 belongs to either half and is left out, with a sixty-fourth of the period
    about it.
    """
    size = 2 * max(values.size - 1, 1)
    impulse: FloatArray = np.fft.irfft(values, size)
    edge = max(size // 64, 1)
    first = float(np.sum(impulse[edge : size // 2] ** 2))
    second = float(np.sum(impulse[size // 2 : size - edge] ** 2))
    if first > _CAUSAL * second:
        return False
    return True if second > _CAUSAL * first else None
