"""FRFs as UFF: grid points of the campaign (set 2411), FRFs and their coherences (set 58b, or 58 as
text), SI.
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import IO, Protocol

import numpy as np

from modalbase.formats import uff
from modalbase.formats.frfs.table import DOFS, FrfTable
from modalbase.formats.types import FloatArray
from modalbase.formats.uff.write import encode


class PlacedTable(FrfTable, Protocol):
    """FRFs with the points that they are between."""

    @property
    def points(self) -> Mapping[int, tuple[float, float, float]]:
        """Label to coordinates of the points, m."""

    @property
    def description(self) -> str:
        """A second line beside each label."""


def write_uff(tables: Sequence[PlacedTable], file: IO[bytes], *, binary: bool = True) -> None:
    """Write FRFs of one campaign with its grid points; their binary form keeps every bit, the text
    13 digits.
    """
    contents: Iterator[uff.Content] = (
        uff.GridPoint(label, xyz) for label, xyz in tables[0].points.items()
    )
    for block in encode(itertools.chain(contents, _functions(tables)), binary=binary):
        file.write(block)


def write_text(tables: Sequence[PlacedTable], file: IO[bytes]) -> None:
    """The same with FRFs as text."""
    write_uff(tables, file, binary=False)


def _functions(tables: Sequence[PlacedTable]) -> Iterator[uff.Content]:
    """Each FRF, and its coherence after it."""
    for table in tables:
        axis = _axis(table.frequency_hz)
        for frf, values, coherence in table.both():
            dofs = {key: getattr(frf, key) for key in DOFS}
            ids = (frf.label, table.description, "NONE", "NONE", "NONE")
            yield uff.Frf(
                dataset=0,
                label=frf.label,
                id_lines=ids,
                **dofs,
                quantity=table.quantity,  # type: ignore[arg-type]  # checked on the way in
                frequency=axis,
                values=values,
            )
            if coherence is not None:
                yield uff.Function(
                    dataset=0,
                    label=frf.label,
                    id_lines=ids,
                    function_type=uff.COHERENCE,
                    **dofs,
                    abscissa=axis,
                    abscissa_unit="Hz",
                    values=coherence,
                    unit="",
                )


def _axis(frequency: FloatArray) -> uff.Axis:
    """Start and step where they give the lines exactly, else the lines."""
    if frequency.size > 1:
        even = uff.Axis(float(frequency[0]), float(frequency[1] - frequency[0]), frequency.size)
        if np.array_equal(even.points(), frequency):
            return even
    return uff.Axis(float(frequency[0]), 0.0, frequency.size, frequency)
