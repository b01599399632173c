"""What a Universal File Format (UFF) file holds, as frozen values in SI units.

Reading a file yields, for each dataset, its content and then one `DatasetReport`. A dataset that is
refused yields no content.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from modalbase.formats.types import ComplexArray, FloatArray, IntArray, Quantity

Samples = NDArray[np.float32] | NDArray[np.float64] | NDArray[np.complex64] | NDArray[np.complex128]
Outcome = Literal["read", "ignored", "refused"]
ChannelQuantity = Literal["force", "acceleration", "velocity", "displacement"]

FRF_TYPE, COHERENCE = 4, 6
"""Function types of an FRF and of an ordinary coherence γ²."""

HEADER_LINES = 11
"""Lines of text before the ordinates of a set 58, binary ones too."""

ORDINATE_TYPES = {("f", False): 2, ("f", True): 4, ("c", False): 5, ("c", True): 6}
"""By kind of numbers, real or complex, and whether they are double."""

FUNCTION_NAMES: dict[int, str] = {
    0: "general function", 1: "time response", 2: "auto spectrum", 3: "cross spectrum", FRF_TYPE: "frequency response function",
    5: "transmissibility", COHERENCE: "coherence", 7: "auto correlation", 8: "cross correlation",
    9: "power spectral density", 10: "energy spectral density", 11: "probability density function", 12: "spectrum",
    13: "cumulative frequency distribution", 14: "peaks valley", 15: "stress/cycles", 16: "strain/cycles", 17: "orbit",
    18: "mode indicator function", 19: "force pattern", 20: "partial power", 21: "partial coherence", 22: "eigenvalue",
    23: "eigenvector", 24: "shock response spectrum", 25: "finite impulse response filter", 26: "multiple coherence",
    27: "order function", 28: "phase compensation",
}  # fmt: skip
"""Function types of set 58, record 6, field 1."""


class UffError(Exception):
    """The file as a whole cannot be read: its framing is broken, and nothing of it was taken.

    Attributes:
        reason: what was found, what was expected and what to do.
        offset: byte offset in the file at which it was found.
    """

    def __init__(self, reason: str, offset: int = 0) -> None:
        super().__init__(f"{reason} (byte {offset})")
        self.reason = reason
        self.offset = offset

    def __reduce__(self) -> tuple[type[UffError], tuple[str, int]]:
        """Survive pickling: the error crosses from the child process to its parent."""
        return type(self), (self.reason, self.offset)


@dataclass(frozen=True)
class DatasetReport:
    """What became of one dataset."""

    number: int  # 1 for the first dataset of the file
    type: str  # dataset type as the file has it: "15", "58", "58b" ...
    offset: int  # byte offset of the dataset's opening delimiter
    # "read", "ignored" (sound, but of no use here) or "refused" (damaged or ambiguous)
    outcome: Outcome
    reason: str | None = None  # why it was ignored or refused; None where it was read
    notes: tuple[str, ...] = ()  # every conversion and assumption made while reading it


@dataclass(frozen=True)
class Units:
    """Set 164: divide a value in the file's units by the factor and it is in SI."""

    dataset: int
    code: int
    description: str
    length: float
    force: float
    temperature: float
    temperature_offset: float


@dataclass(frozen=True)
class FileHeader:
    """Set 151: which model and which program the file is from."""

    dataset: int
    model_name: str
    description: str
    program: str
    written: str


@dataclass(frozen=True)
class CoordinateSystem:
    """A coordinate system of set 18 or 2420."""

    dataset: int
    label: int  # number by which grid points name it
    name: str
    # what the three coordinates of a point in it are
    kind: Literal["cartesian", "cylindrical", "spherical"]
    origin_m: FloatArray  # (3,) origin, m, in the global system
    axes: FloatArray  # (3, 3) rows are its unit x, y, z axes in the global system


@dataclass(frozen=True)
class GridPoint:
    """A measurement point of set 15 or 2411."""

    number: int  # label of the point
    xyz_m: tuple[float, float, float]  # coordinates in the file's global Cartesian system, m


@dataclass(frozen=True, eq=False)
class Axis:
    """An even abscissa as start, step and count, or an uneven one as its values."""

    start: float  # first abscissa
    step: float  # increment; 0 where the axis is uneven or has one line
    count: int  # number of lines
    values: FloatArray | None = None  # (count,) the abscissae where they are uneven, else None

    def points(self) -> FloatArray:
        """(count,) the abscissae."""
        if self.values is not None:
            return self.values
        return self.start + self.step * np.arange(self.count)


class OfDofs:
    """What a function is between."""

    response_point: int
    response_direction: int
    reference_point: int
    reference_direction: int

    @property
    def dofs(self) -> tuple[int, int, int, int]:
        """Response point and direction, reference point and direction."""
        return (
            self.response_point,
            self.response_direction,
            self.reference_point,
            self.reference_direction,
        )


@dataclass(frozen=True, eq=False)
class Frf:
    """A frequency response function of set 58 or 58b, in SI units."""

    dataset: int  # number of the dataset
    label: str  # first ID line
    # the five ID lines; the third is usually the date and time
    id_lines: tuple[str, str, str, str, str]
    response_point: int  # grid point of the response, 0 where the file states none
    # ±1 … ±6, or 0 for a scalar or an unstated direction; axes of the global system
    response_direction: int
    reference_point: int  # grid point of the force, 0 where the file states none
    reference_direction: int  # as `response_direction`
    quantity: Quantity  # accelerance, mobility or receptance
    frequency: Axis  # frequency lines, Hz
    # (L,) complex64 or complex128 as the file had it; m/s² per N, m/s per N or m per N
    values: NDArray[np.complex64] | ComplexArray
    load_case: int = 0  # load case of the file, 0 for single-point excitation


@dataclass(frozen=True, eq=False)
class Function:
    """A function of set 58 or 58b that is not an FRF: coherence, time response, power spectral
    density ...

    Ordinates stay in the units that their labels state: a spectrum is not converted to SI.
    """

    dataset: int
    label: str
    id_lines: tuple[str, str, str, str, str]
    function_type: int  # set 58's number of what it is; see `FUNCTION_NAMES`
    response_point: int
    response_direction: int
    reference_point: int
    reference_direction: int
    abscissa: Axis  # abscissae as the file has them
    abscissa_unit: str  # unit label of the abscissa
    values: Samples  # (L,) float32, float64, complex64 or complex128 as the file had it
    unit: str  # unit label of the ordinate, empty where the file states none

    @property
    def name(self) -> str:
        """The function type in words."""
        return FUNCTION_NAMES.get(self.function_type, f"function of type {self.function_type}")


@dataclass(frozen=True, eq=False)
class TimeResponse:
    """A time block of set 58 or 58b (function type 1), in SI units: the hammer's force, or what a
    sensor recorded.
    """

    dataset: int
    label: str
    quantity: ChannelQuantity  # what the samples are, by unit label or data type
    # response_point, response_direction: where the channel sits; axes of the global system
    response_point: int
    response_direction: int
    # reference_point, reference_direction: where the hammer hit, 0 where the file states none
    reference_point: int
    reference_direction: int
    sample_rate_hz: float  # samples a second
    samples: FloatArray  # (n,) float32 or float64, N, m/s², m/s or m


@dataclass(frozen=True, eq=False)
class PowerSpectrum(OfDofs):
    """An auto or cross spectrum of set 58 or 58b (function types 2 and 3), as an analyser writes
    them beside FRFs.
    """

    dataset: int
    label: str
    kind: Literal["auto", "cross"]  # "auto" or "cross"
    quantity: ChannelQuantity | None  # of an auto spectrum's channel; None for a cross spectrum
    # multiply the channel's amplitude by it for SI; 1 for a cross spectrum, which takes those of
    # its channels
    factor: float
    response_point: int
    response_direction: int
    reference_point: int
    reference_direction: int
    frequency: Axis  # lines, Hz
    values: ComplexArray  # (L,) complex128, in the file's units


@dataclass(frozen=True, eq=False)
class ModeShape:
    """A mode of set 55 or 2414."""

    dataset: int  # number of the dataset
    label: str  # first ID line
    mode: int  # number of the mode in the file
    frequency_hz: float  # undamped natural frequency, Hz; |λ|/2π of a complex eigenvalue λ
    # viscous damping ratio; -Re λ/|λ| of a complex eigenvalue. NaN where the file states none.
    damping_ratio: float
    points: IntArray  # (p,) grid points, as the file lists them
    # (p, 3) translations or (p, 6) translations and rotations, complex, in global axes, arbitrarily
    # scaled
    values: ComplexArray
    kind: Literal["normal", "complex"]  # "normal" (real mode analysis) or "complex"


@dataclass(frozen=True)
class TraceLine:
    """Set 82: a line drawn through grid points; 0 lifts the pen."""

    dataset: int
    number: int
    label: str
    points: tuple[int, ...]


@dataclass(frozen=True)
class Element:
    """Set 2412: an element of the drawing or of a finite element model."""

    number: int  # its label
    descriptor: int  # what it is: 21 a beam, 94 a thin shell of four corners …
    points: tuple[int, ...]  # that it joins, in the order of the file
    properties: int = 1  # number of its physical property table
    # of the dataset in which it begins, from 1 for the one after the type line
    line: int = field(default=0, compare=False)


Content = (
    Units
    | FileHeader
    | CoordinateSystem
    | GridPoint
    | Frf
    | Function
    | TimeResponse
    | PowerSpectrum
    | ModeShape
    | TraceLine
    | Element
)


@dataclass(frozen=True)
class Limits:
    """What a file may claim before it is refused, and the one thing that a user may state for
    it.
    """

    # largest dataset, bytes; memory follows the largest dataset
    dataset_bytes: int = 124 * 1024 * 1024
    datasets: int = 200_000  # number of datasets in a file
    line_bytes: int = 4096  # longest text line, bytes
    blank_bytes: int = 1024 * 1024  # bytes of white space between datasets
    # what an FRF is whose file states neither a data type nor a unit; None refuses such FRFs
    quantity: Quantity | None = None
