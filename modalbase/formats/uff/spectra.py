"""FRFs and coherences of the auto and cross spectra that analysers write (set 58, function types 2 and 3).

    H1 = S_af / S_ff,    γ² = |S_af|² / (S_ff S_aa)

with a the response and f the force. Programs differ in which channel of a cross spectrum they conjugate, and files do not
say. A body cannot move before it is hit: of the two readings only one has its impulse response in the first half of its
period, and that one is taken. Where neither stands out, the spectra are left alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from modalbase.formats.types import ComplexArray, FloatArray, Quantity
from modalbase.formats.uff.content import (
    COHERENCE,
    ChannelQuantity,
    DatasetReport,
    Frf,
    Function,
    PowerSpectrum,
)

_CAUSAL = 4.0  # energy of the first half of the impulse response over the second, or the other way round
_ABOVE_ONE = 1.001
_QUANTITY: dict[ChannelQuantity, Quantity] = {
    "acceleration": "accelerance",
    "velocity": "mobility",
    "displacement": "receptance",
}
_IDS = ("", "", "", "", "")
Dof = tuple[int, int]


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
            self._autos.setdefault((spectrum.response_point, abs(spectrum.response_direction)), []).append(spectrum)

    def holds(self, report: DatasetReport) -> bool:
        """Keep the report of a spectrum's dataset until it is known what the spectrum is good for."""
        if report.number not in self._taken:
            return False
        self._held[report.number] = report
        return True

    def note(self, frf: Frf) -> None:
        """The file has this FRF itself; its spectra are not needed."""
        self._known.add(
            ((frf.response_point, abs(frf.response_direction)), (frf.reference_point, abs(frf.reference_direction)))
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
                yield replace(report, outcome="ignored", reason="is an auto spectrum that no cross spectrum needs")

    def _made(self, cross: PowerSpectrum) -> tuple[Frf, Function, str, set[int]] | str:
        """What a cross spectrum makes with the auto spectra of its channels, or why it makes nothing."""
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
            return "has an impulse response that lies before the hit as much as after it: which channel is conjugated?"
        if conjugated:
            values = values.conj()
        assert motion.quantity is not None, "an auto spectrum has a quantity"
        note = f"H1 and coherence made with the auto spectra of datasets {force.dataset} and {motion.dataset}" + (
            "; its response is the conjugated channel, as the impulse response shows" if conjugated else ""
        )
        frf = Frf(
            dataset=cross.dataset,
            label=cross.label,
            id_lines=_IDS,
            response_point=cross.response_point,
            response_direction=cross.response_direction,
            reference_point=cross.reference_point,
            reference_direction=cross.reference_direction,
            quantity=_QUANTITY[motion.quantity],
            frequency=cross.frequency,
            values=values,
        )
        return frf, _coherence(cross, np.clip(coherence, 0, 1)), note, {force.dataset, motion.dataset}

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

    What lies at time 0 belongs to either half and is left out, with a sixty-fourth of the period about it.
    """
    size = 2 * max(values.size - 1, 1)
    impulse: FloatArray = np.fft.irfft(values, size)
    edge = max(size // 64, 1)
    first = float(np.sum(impulse[edge : size // 2] ** 2))
    second = float(np.sum(impulse[size // 2 : size - edge] ** 2))
    if first > _CAUSAL * second:
        return False
    return True if second > _CAUSAL * first else None


def _coherence(cross: PowerSpectrum, values: FloatArray) -> Function:
    return Function(
        dataset=cross.dataset,
        label=cross.label,
        id_lines=_IDS,
        function_type=COHERENCE,
        response_point=cross.response_point,
        response_direction=cross.response_direction,
        reference_point=cross.reference_point,
        reference_direction=cross.reference_direction,
        abscissa=cross.frequency,
        abscissa_unit="Hz",
        values=values,
        unit="",
    )
