"""Spectra out of the database: streamed, verified, cut to a band and stride."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import select
from sqlalchemy.orm import Session

from fecore.arrays import FloatArray
from service.compute.spectra import Axis, Spectrum, decode
from service.db.bytea import stream_rows
from service.errors import Conflict, Invalid
from service.store.frfs.operations import Frf

Values = NDArray[np.complexfloating]


@dataclass(frozen=True)
class Cut:
    """Which lines of a spectrum: from `fmin` to `fmax`, Hz, both included, every `stride`-th of them."""

    fmin: float | None = None
    fmax: float | None = None
    stride: int = 1

    def lines(self, frequency_hz: FloatArray) -> slice:
        """The slice of these frequency lines that the cut keeps.

        Args:
            frequency_hz: (L,) increasing, Hz.

        Raises:
            Invalid: no line is left.
        """
        low = -np.inf if self.fmin is None else self.fmin
        high = np.inf if self.fmax is None else self.fmax
        first, end = np.searchsorted(frequency_hz, low), np.searchsorted(frequency_hz, high, side="right")
        if first == end:
            raise Invalid(
                "fmin",
                f"no line lies in {low:g} to {high:g} Hz; the lines go from {frequency_hz[0]:g} to {frequency_hz[-1]:g} Hz",
            )
        return slice(int(first), int(end), self.stride)


@dataclass(frozen=True)
class FrfTable:
    """FRFs on one frequency axis, spectra still in the database; `modalbase.formats.frfs` writes it.

    Attributes:
        session: where the spectra are read.
        frfs: N rows without their spectra.
        frequency_hz: (L,) the lines that are wanted.
        lines: where they are in the stored spectra.
    """

    session: Session
    frfs: Sequence[Frf]
    frequency_hz: FloatArray
    lines: slice

    @property
    def quantity(self) -> str:
        """Accelerance, mobility or receptance."""
        return self.frfs[0].quantity

    @property
    def dtype(self) -> np.dtype[np.complexfloating]:
        """The narrowest complex type that holds all spectra."""
        return np.result_type(*{frf.dtype for frf in self.frfs})

    @property
    def has_coherence(self) -> bool:
        """Whether any of the FRFs has one."""
        return any(frf.coherence_sha256 is not None for frf in self.frfs)

    @property
    def description(self) -> str:
        """A second line beside each label, in files that have one."""
        return "NONE"

    def spectra(self) -> Iterator[tuple[Frf, Values]]:
        """Each FRF with its (L,) values, in order."""
        for frf, data in _stream(self.session, self.frfs, "data"):
            yield frf, self._spectrum(frf, data)

    def coherences(self) -> Iterator[tuple[Frf, FloatArray | None]]:
        """Each FRF with its (L,) coherence γ², or None."""
        for frf, data in _stream(self.session, self.frfs, "coherence"):
            yield frf, self._coherence(frf, data)

    def both(self) -> Iterator[tuple[Frf, Values, FloatArray | None]]:
        """Each FRF with its values and its coherence."""
        if not self.has_coherence:
            yield from ((frf, values, None) for frf, values in self.spectra())
            return
        for frf, data, coherence in _stream(self.session, self.frfs, "data", "coherence"):
            yield frf, self._spectrum(frf, data), self._coherence(frf, coherence)

    def variances(self) -> Iterator[tuple[Frf, FloatArray]]:
        """Each FRF with the (L,) variance that its hits showed; all of them must have one."""
        for frf, data in _stream(self.session, self.frfs, "variance"):
            assert frf.variance_sha256 is not None
            variance = decode(Spectrum("<f8", frf.lines, data, frf.variance_sha256)).real
            yield frf, variance[self.lines].astype(np.float64)

    def _spectrum(self, frf: Frf, data: bytes) -> Values:
        spectrum = Spectrum(frf.dtype, frf.lines, data, frf.sha256)  # type: ignore[arg-type]
        return np.asarray(decode(spectrum)[self.lines], dtype=frf.dtype)

    def _coherence(self, frf: Frf, data: bytes | None) -> FloatArray | None:
        return None if data is None else read_coherence(frf, data)[self.lines]


def read_coherence(frf: Frf, data: bytes) -> FloatArray:
    """The coherence γ² of an FRF from its stored bytes, (L,), after their SHA-256 has been verified.

    Raises:
        Damaged: the bytes are not the ones that were stored.
    """
    assert frf.coherence_dtype is not None
    assert frf.coherence_sha256 is not None
    spectrum = Spectrum(frf.coherence_dtype, frf.lines, data, frf.coherence_sha256)  # type: ignore[arg-type]
    return decode(spectrum).real.astype(np.float64)


def frequency_axis(session: Session, frf: Frf) -> FloatArray:
    """The frequency lines of an FRF, (L,), Hz: from start, step and count, or the stored array where the axis is
    uneven.
    """
    stored = None if frf.step_hz is not None else session.scalars(select(Frf.axis).where(Frf.id == frf.id)).one()
    return Axis(frf.start_hz, frf.step_hz, frf.lines, stored).frequency_hz()


def make_tables(session: Session, frfs: Sequence[Frf], cut: Cut) -> list[FrfTable]:
    """FRFs as tables of one quantity and one frequency axis each, in the order of their first rows.

    Raises:
        Invalid: the cut leaves no line.
    """
    groups: dict[tuple[object, ...], list[Frf]] = {}
    for frf in frfs:
        uneven = frequency_axis(session, frf).tobytes() if frf.step_hz is None else None
        groups.setdefault((frf.quantity, frf.start_hz, frf.step_hz, frf.lines, uneven), []).append(frf)
    tables = []
    for rows in groups.values():
        frequency = frequency_axis(session, rows[0])
        lines = cut.lines(frequency)
        tables.append(FrfTable(session, rows, frequency[lines], lines))
    return tables


def only_table(tables: Sequence[FrfTable]) -> FrfTable:
    """The table of FRFs that make one.

    Raises:
        Conflict: they are not on one frequency axis, or not of one quantity.
    """
    kinds = {table.quantity for table in tables}
    if len(kinds) > 1:
        raise Conflict(f"the FRFs are of several quantities ({', '.join(sorted(kinds))}); choose one with ?quantity=")
    if len(tables) > 1:
        first, second = tables[0].frfs[0], tables[1].frfs[0]
        raise Conflict(
            f"the FRFs are on different frequency axes: {first.id} has {_axis(first)}, {second.id} has {_axis(second)}; "
            "choose with ?import_id=, ?point= or ?reference=, read them one by one, or all as ?format=uff"
        )
    return tables[0]


def _axis(frf: Frf) -> str:
    return f"{frf.lines} lines from {frf.start_hz:g} to {frf.end_hz:g} Hz"


def _stream(session: Session, frfs: Sequence[Frf], *columns: str) -> Iterator[tuple[Any, ...]]:
    """The rows with these columns, in their order: the server reads the next spectrum while one is worked on."""
    query = (
        f"SELECT {', '.join(columns)} FROM unnest(%s::uuid[]) WITH ORDINALITY AS wanted (id, place)"
        " JOIN frfs USING (id) ORDER BY place"
    )
    rows = stream_rows(session, query, [[frf.id for frf in frfs]], ["bytea"] * len(columns))
    for frf, row in zip(frfs, rows, strict=True):
        yield frf, *row
