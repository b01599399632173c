"""What a Universal File Format (UFF) file holds, as frozen values in SI units.

Reading a file yields, for each dataset, its content and then one `DatasetReport`. A dataset that is refused yields no
content.
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

COHERENCE = 6
"""Function type of an ordinary coherence γ²."""

FUNCTION_NAMES: dict[int, str] = {
    0: "general function", 1: "time response", 2: "auto spectrum", 3: "cross spectrum", 4: "frequency response function",
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
    """What became of one dataset.

    Attributes:
        number: 1 for the first dataset of the file.
        type: dataset type as the file has it: "15", "58", "58b" ...
        offset: byte offset of the dataset's opening delimiter.
        outcome: "read", "ignored" (sound, but of no use here) or "refused" (damaged or ambiguous).
        reason: why it was ignored or refused; None where it was read.
        notes: every conversion and assumption made while reading it.
    """

    number: int
    type: str
    offset: int
    outcome: Outcome
    reason: str | None = None
    notes: tuple[str, ...] = ()


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
    """A coordinate system of set 18 or 2420.

    Attributes:
        label: number by which grid points name it.
        kind: what the three coordinates of a point in it are.
        origin_m: (3,) origin, m, in the global system.
        axes: (3, 3) rows are its unit x, y, z axes in the global system.
    """

    dataset: int
    label: int
    name: str
    kind: Literal["cartesian", "cylindrical", "spherical"]
    origin_m: FloatArray
    axes: FloatArray


@dataclass(frozen=True)
class GridPoint:
    """A measurement point of set 15 or 2411.

    Attributes:
        number: label of the point.
        xyz_m: coordinates in the file's global Cartesian system, m.
    """

    number: int
    xyz_m: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Axis:
    """An even abscissa as start, step and count, or an uneven one as its values.

    Attributes:
        start: first abscissa.
        step: increment; 0 where the axis is uneven or has one line.
        count: number of lines.
        values: (count,) the abscissae where they are uneven, else None.
    """

    start: float
    step: float
    count: int
    values: FloatArray | None = None

    def points(self) -> FloatArray:
        """(count,) the abscissae."""
        if self.values is not None:
            return self.values
        return self.start + self.step * np.arange(self.count)


@dataclass(frozen=True, eq=False)
class Frf:
    """A frequency response function of set 58 or 58b, in SI units.

    Attributes:
        dataset: number of the dataset.
        label: first ID line.
        id_lines: the five ID lines; the third is usually the date and time.
        response_point: grid point of the response, 0 where the file states none.
        response_direction: ±1 … ±6, or 0 for a scalar or an unstated direction; axes of the global system.
        reference_point: grid point of the force, 0 where the file states none.
        reference_direction: as `response_direction`.
        quantity: accelerance, mobility or receptance.
        frequency: frequency lines, Hz.
        values: (L,) complex64 or complex128 as the file had it; m/s² per N, m/s per N or m per N.
        load_case: load case of the file, 0 for single-point excitation.
    """

    dataset: int
    label: str
    id_lines: tuple[str, str, str, str, str]
    response_point: int
    response_direction: int
    reference_point: int
    reference_direction: int
    quantity: Quantity
    frequency: Axis
    values: NDArray[np.complex64] | ComplexArray
    load_case: int = 0


@dataclass(frozen=True, eq=False)
class Function:
    """A function of set 58 or 58b that is not an FRF: coherence, time response, power spectral density ...

    Ordinates stay in the units that their labels state: a spectrum is not converted to SI.

    Attributes:
        function_type: set 58's number of what it is; see `FUNCTION_NAMES`.
        abscissa: abscissae as the file has them.
        abscissa_unit: unit label of the abscissa.
        values: (L,) float32, float64, complex64 or complex128 as the file had it.
        unit: unit label of the ordinate, empty where the file states none.
    """

    dataset: int
    label: str
    id_lines: tuple[str, str, str, str, str]
    function_type: int
    response_point: int
    response_direction: int
    reference_point: int
    reference_direction: int
    abscissa: Axis
    abscissa_unit: str
    values: Samples
    unit: str

    @property
    def name(self) -> str:
        """The function type in words."""
        return FUNCTION_NAMES.get(self.function_type, f"function of type {self.function_type}")


@dataclass(frozen=True, eq=False)
class TimeResponse:
    """A time block of set 58 or 58b (function type 1), in SI units: the hammer's force, or what a sensor recorded.

    Attributes:
        quantity: what the samples are, by unit label or data type.
        response_point, response_direction: where the channel sits; axes of the global system.
        reference_point, reference_direction: where the hammer hit, 0 where the file states none.
        sample_rate_hz: samples a second.
        samples: (n,) float32 or float64, N, m/s², m/s or m.
    """

    dataset: int
    label: str
    quantity: ChannelQuantity
    response_point: int
    response_direction: int
    reference_point: int
    reference_direction: int
    sample_rate_hz: float
    samples: FloatArray


@dataclass(frozen=True, eq=False)
class PowerSpectrum:
    """An auto or cross spectrum of set 58 or 58b (function types 2 and 3), as an analyser writes them beside FRFs.

    Attributes:
        kind: "auto" or "cross".
        quantity: of an auto spectrum's channel; None for a cross spectrum.
        factor: multiply the channel's amplitude by it for SI; 1 for a cross spectrum, which takes those of its channels.
        frequency: lines, Hz.
        values: (L,) complex128, in the file's units.
    """

    dataset: int
    label: str
    kind: Literal["auto", "cross"]
    quantity: ChannelQuantity | None
    factor: float
    response_point: int
    response_direction: int
    reference_point: int
    reference_direction: int
    frequency: Axis
    values: ComplexArray

    @property
    def dofs(self) -> tuple[int, int, int, int]:
        """Response point and direction, reference point and direction."""
        return self.response_point, self.response_direction, self.reference_point, self.reference_direction


@dataclass(frozen=True, eq=False)
class ModeShape:
    """A mode of set 55 or 2414.

    Attributes:
        dataset: number of the dataset.
        label: first ID line.
        mode: number of the mode in the file.
        frequency_hz: undamped natural frequency, Hz; |λ|/2π of a complex eigenvalue λ.
        damping_ratio: viscous damping ratio; -Re λ/|λ| of a complex eigenvalue. NaN where the file states none.
        points: (p,) grid points, as the file lists them.
        values: (p, 3) translations or (p, 6) translations and rotations, complex, in global axes, arbitrarily scaled.
        kind: "normal" (real mode analysis) or "complex".
    """

    dataset: int
    label: str
    mode: int
    frequency_hz: float
    damping_ratio: float
    points: IntArray
    values: ComplexArray
    kind: Literal["normal", "complex"]


@dataclass(frozen=True)
class TraceLine:
    """Set 82: a line drawn through grid points; 0 lifts the pen."""

    dataset: int
    number: int
    label: str
    points: tuple[int, ...]


@dataclass(frozen=True)
class Element:
    """Set 2412: an element of the drawing or of a finite element model.

    Attributes:
        number: its label.
        descriptor: what it is: 21 a beam, 94 a thin shell of four corners …
        points: that it joins, in the order of the file.
        properties: number of its physical property table.
        line: of the dataset in which it begins, from 1 for the one after the type line.
    """

    number: int
    descriptor: int
    points: tuple[int, ...]
    properties: int = 1
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
    """What a file may claim before it is refused, and the one thing that a user may state for it.

    Attributes:
        dataset_bytes: largest dataset, bytes; memory follows the largest dataset.
        cross_check_bytes: of each dataset type, the first so many bytes are read by pyuff as well and the two readings
            compared; 0 for none.
        datasets: number of datasets in a file.
        line_bytes: longest text line, bytes.
        blank_bytes: bytes of white space between datasets.
        quantity: what an FRF is whose file states neither a data type nor a unit; None refuses such FRFs.
    """

    dataset_bytes: int = 124 * 1024 * 1024
    cross_check_bytes: int = 4 * 1024 * 1024
    datasets: int = 200_000
    line_bytes: int = 4096
    blank_bytes: int = 1024 * 1024
    quantity: Quantity | None = None
