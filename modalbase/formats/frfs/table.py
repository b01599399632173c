"""FRFs of one quantity on one frequency axis: what the files of this package hold."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from modalbase.formats.errors import FormatError
from modalbase.formats.types import FloatArray, Quantity

DOFS = ("response_point", "response_direction", "reference_point", "reference_direction")

UNITS: Mapping[str, str] = {"accelerance": "m/s²/N", "mobility": "m/s/N", "receptance": "m/N"}

Values = NDArray[np.complexfloating]


@dataclass(frozen=True)
class FrfRow:
    """What is said of one FRF besides its values.

    Attributes:
        response_point, reference_point: grid points.
        response_direction, reference_direction: ±1 … ±3 along x, y, z, ±4 … ±6 about them.
        label: free text.
        averages: number of averages, None where it is not known.
        id: key of the FRF where it comes from a database, else empty.
    """

    response_point: int
    response_direction: int
    reference_point: int
    reference_direction: int
    label: str = ""
    averages: int | None = None
    id: str = ""

    @classmethod
    def between(cls, dofs: Iterable[int], label: str = "", averages: int | None = None) -> FrfRow:
        """The row of an FRF between two degrees of freedom.

        Args:
            dofs: response point, response direction, reference point, reference direction: the
                order of `DOFS`.
            label: free text.
            averages: number of averages, None where it is not known.
        """
        point, direction, reference, reference_direction = dofs
        return cls(point, direction, reference, reference_direction, label, averages)


class FrfTable(Protocol):
    """What is written: FRFs of one quantity on one frequency axis, whose values come one by one, so
    that memory need not hold them all. `Frfs` is one that is in memory.
    """

    @property
    def frfs(self) -> Sequence[Any]:
        """N rows with the attributes of `FrfRow`."""

    @property
    def frequency_hz(self) -> FloatArray:
        """(L,) frequency lines, Hz."""

    @property
    def quantity(self) -> str:
        """Accelerance, mobility or receptance."""

    @property
    def dtype(self) -> np.dtype[np.complexfloating]:
        """The narrowest complex type that holds all values."""

    @property
    def has_coherence(self) -> bool:
        """Whether any of the FRFs has one."""

    def both(self) -> Iterator[tuple[Any, Values, FloatArray | None]]:
        """Each row with its (L,) values and its (L,) coherence γ², None where it has none."""

    def spectra(self) -> Iterator[tuple[Any, Values]]:
        """Each row with its (L,) values."""

    def coherences(self) -> Iterator[tuple[Any, FloatArray | None]]:
        """Each row with its (L,) coherence γ², None where it has none."""


def without_gap(frfs: Frfs) -> tuple[Frfs, list[str]]:
    """The FRFs without their line at 0 Hz where some are no number there, as double integration
    leaves 0/0; and a note.

    Raises:
        FormatError: a value at another line is NaN or infinite; names FRF and line.
    """
    bad = ~np.isfinite(frfs.values)
    if not bad.any() or not np.isfinite(frfs.frequency_hz).all():
        return frfs, []
    first = 1 if frfs.frequency_hz[:1] == 0 and frfs.frequency_hz.size > 1 else 0
    if len(others := np.argwhere(bad[:, first:])):
        row, line = int(others[0][0]), int(others[0][1]) + first
        raise FormatError(
            "values",
            f"holds {len(others)} that are NaN or infinite, first of FRF {row + 1} at line"
            f" {line + 1} ({frfs.frequency_hz[line]:g} Hz); only a line at 0 Hz can be left out",
        )
    kept = None if frfs.coherence is None else frfs.coherence[:, 1:]
    note = (
        f"{int(bad.sum())} of {len(frfs.frfs)} FRFs are NaN or infinite at 0 Hz: this line is"
        " left out"
    )
    return replace(
        frfs, frequency_hz=frfs.frequency_hz[1:], values=frfs.values[:, 1:], coherence=kept
    ), [note]


@dataclass(frozen=True, eq=False)
class Frfs:
    """FRFs in memory, as they are read; they can be written again.

    Attributes:
        frequency_hz: (L,) frequency lines, Hz.
        values: (N, L) complex64 or complex128; m/s², m/s or m per N.
        frfs: N rows that say what they are.
        quantity: accelerance, mobility or receptance.
        coherence: (N, L) ordinary coherence γ², NaN where one FRF has none; None where none has.
    """

    frequency_hz: FloatArray
    values: Values
    frfs: tuple[FrfRow, ...]
    quantity: Quantity = "accelerance"
    coherence: FloatArray | None = None

    @property
    def dtype(self) -> np.dtype[np.complexfloating]:
        """The values' type."""
        return self.values.dtype

    @property
    def has_coherence(self) -> bool:
        """Whether any of the FRFs has one."""
        return self.coherence is not None

    def both(self) -> Iterator[tuple[FrfRow, Values, FloatArray | None]]:
        """Each row with its values and its coherence."""
        for (row, values), (_, coherence) in zip(self.spectra(), self.coherences(), strict=True):
            yield row, values, coherence

    def spectra(self) -> Iterator[tuple[FrfRow, Values]]:
        """Each row with its values."""
        return zip(self.frfs, self.values, strict=True)

    def coherences(self) -> Iterator[tuple[FrfRow, FloatArray | None]]:
        """Each row with its coherence, or None."""
        for i, row in enumerate(self.frfs):
            known = None if self.coherence is None else self.coherence[i]
            yield row, None if known is None or np.isnan(known).all() else known
