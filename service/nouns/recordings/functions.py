"""Functions of a recording's sensors as a UFF: spectra and transmissibilities alike."""

import itertools
from collections.abc import Iterable, Iterator, Mapping
from typing import IO, Any

import numpy as np

from fecore.arrays import FloatArray
from fecore.frf import Dof
from modalbase.formats import uff
from modalbase.formats.uff.write import encode


def write_functions(
    points: Mapping[int, tuple[float, float, float]],
    functions: Iterable[uff.Function],
    file: IO[bytes],
) -> None:
    """Write grid points, and functions behind them."""
    placed: Iterator[uff.Content] = (uff.GridPoint(name, xyz) for name, xyz in points.items())
    for block in encode(itertools.chain(placed, functions)):
        file.write(block)


def function_of(
    label: str,
    pair: tuple[Dof, Dof],
    frequency_hz: FloatArray,
    values: np.ndarray[Any, Any],
    *,
    function_type: int,
    unit: str = "",
) -> uff.Function:
    """A function of a response and its reference, in this order, over the lines of a recording."""
    response, reference = pair
    return uff.Function(
        dataset=0,
        label=label,
        id_lines=(label, "NONE", "NONE", "NONE", "NONE"),
        function_type=function_type,
        response_point=response.point,
        response_direction=response.direction,
        reference_point=reference.point,
        reference_direction=reference.direction,
        abscissa=uff.Axis(float(frequency_hz[0]), 0.0, frequency_hz.size, frequency_hz),
        abscissa_unit="Hz",
        values=values,
        unit=unit,
    )
