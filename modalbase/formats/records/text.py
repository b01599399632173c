"""Time data in a table of text: its columns as arrays, or part by part where it is one long
recording.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.records.arrays import (
    NO_NUMBERS,
    PREAMBLE_RATE,
    SAMPLE_RATE,
    Variables,
    sampling_rate,
)
from modalbase.formats.records.proposal import is_time
from modalbase.formats.records.wav import FRAMES
from modalbase.formats.tables import Stated, TextTable, open_table
from modalbase.formats.types import FloatArray
from modalbase.formats.units import Measured, factor_of, unit_in_name


@dataclass(frozen=True)
class TextRecording:
    """A table of text whose columns are channels. Its samples are read when they are asked for.

    Attributes:
        table: of the file.
    """

    table: TextTable
    full_scale, declared, began, is_table, numbers = None, True, None, True, NO_NUMBERS

    @property
    def names(self) -> list[str]:
        """Of the columns."""
        return self.table.names

    @property
    def units(self) -> dict[str, str]:
        """That a line of units states, by column."""
        return self.table.units

    @property
    def rate(self) -> str | None:
        """Name of the sampling rate where a preamble states it."""
        return None if self.rate_hz is None else SAMPLE_RATE

    @property
    def rate_hz(self) -> float | None:
        """The sampling rate that a preamble states of a table without a time axis."""
        return None if self._axes else self.table.layout.sample_rate_hz

    @property
    def _rates(self) -> Variables:
        """The rate that a preamble states, by its name as a variable."""
        stated = self.table.layout.sample_rate_hz
        name = PREAMBLE_RATE if self._axes else SAMPLE_RATE
        return {} if stated is None else {name: np.array(stated)}

    @property
    def _axes(self) -> list[str]:
        """Columns that are time axes."""
        return [
            column.name
            for column in self.table.layout.columns
            if column.is_time or is_time(column.name, self.units)
        ]

    def require_one_axis(
        self,
        names: Collection[str],
        mapped: str | None = None,
        frequencies: Collection[str] = (),
    ) -> None:
        """Refuse columns whose axes differ; the axis of a column is the next on its left.

        Args:
            names: of the columns.
            mapped: the axis that they are taken to have.
            frequencies: their axes where these are not of time.

        Raises:
            FormatError: as said; names the row from which they differ.
        """
        axis, axes = "", frequencies or self._axes
        quantity: Measured = "frequency" if frequencies else "time"
        own = [mapped] if mapped is not None and mapped in axes else []
        for name in self.names if len(axes) > 1 else ():
            axis = name if name in axes else axis
            if name in names and axis not in ("", *own):
                own.append(axis)
        first = 0
        units = (unit_in_name(name, quantity)[1] or self.units.get(name, "") for name in own)
        factors = np.array([factor_of(quantity, unit) or 1.0 for unit in units])
        for numbers in self.table.parts(own, FRAMES) if len(own) > 1 else ():
            part = np.frombuffer(numbers).reshape(-1, len(own)) * factors
            step = np.nanmedian(np.abs(np.diff(part[:, 0]))) if len(part) > 1 else 0.0
            apart = ~(np.abs(part - part[:, :1]) <= step / 2)
            if (bad := np.argwhere(apart)).size:
                row, column = bad[0]
                why = (
                    "import the FRFs of each axis by a mapping of their own"
                    if frequencies
                    else "the channels of a hit are on one clock: export them on one time axis"
                )
                raise FormatError(
                    own[column],
                    f"is {part[row, column]:g} in row {first + row + 1} of the data, and {own[0]} is"
                    f" {part[row, 0]:g}; {why}",
                )
            first += len(part)

    def shapes(self) -> dict[str, str]:
        """Type of each column."""
        return dict.fromkeys(self.names, "float64")

    def notes(self, _: Sequence[str]) -> list[str]:
        """What was noticed of the table."""
        return self.table.notes

    def chunks(self, names: Sequence[str]) -> Iterator[FloatArray]:
        """(columns, n) parts of these columns in order, in the unit of the file.

        Raises:
            FormatError: a line is no row of the table, or a cell is empty; names the line or the
                column.
        """
        first = 0
        for numbers in self.table.parts(list(names), FRAMES):
            part = np.frombuffer(numbers).reshape(-1, len(names)).T
            if (bad := np.argwhere(np.isnan(part))).size:
                at = first + int(bad[0][1]) + 1
                raise FormatError(
                    names[bad[0][0]],
                    f"has an empty cell in row {at} of the data, expected a number",
                )
            yield part.copy()
            first += part.shape[1]

    def rate_of(self, names: Sequence[str], stated: float | str) -> float:
        """Rate of the channels: a number, the preamble's, or the time axis that states it.

        Raises:
            FormatError: it is no rate, or the channels are on several clocks.
        """
        self.require_one_axis(names, mapped=stated if isinstance(stated, str) else None)
        own = self._rates
        if isinstance(stated, str) and stated in self.names:
            own[stated] = np.concatenate([part[0] for part in self.chunks([stated])])
        samples = own[stated].size if isinstance(stated, str) and stated in own else 0
        return sampling_rate(own, stated, samples, self.units)

    def arrays(self) -> Variables:
        """All columns, and the rate that the preamble states. NaN where a cell is empty."""
        parts = [np.frombuffer(part) for part in self.table.parts(self.names)]
        rows = (np.concatenate(parts) if len(parts) > 1 else parts[0]).reshape(-1, len(self.names))
        return {**self._rates, **dict(zip(self.names, rows.T, strict=True))}


def open_recording(path: Path, stated: Stated = Stated()) -> TextRecording:  # noqa: B008 - frozen
    """A table of text as a recording.

    Raises:
        FormatError: it is no table.
    """
    return TextRecording(open_table(path, stated))
