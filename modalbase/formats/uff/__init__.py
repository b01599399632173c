"""Universal File Format (UFF) in and out, behind a guard: pure functions over files, no
database.
"""

from modalbase.formats.uff.content import (
    COHERENCE,
    FUNCTION_NAMES,
    Axis,
    Content,
    CoordinateSystem,
    DatasetReport,
    Element,
    FileHeader,
    Frf,
    Function,
    GridPoint,
    Limits,
    ModeShape,
    PowerSpectrum,
    TimeResponse,
    TraceLine,
    UffError,
    Units,
)
from modalbase.formats.uff.read import read_file

__all__ = [
    "COHERENCE",
    "FUNCTION_NAMES",
    "Axis",
    "Content",
    "CoordinateSystem",
    "DatasetReport",
    "Element",
    "FileHeader",
    "Frf",
    "Function",
    "GridPoint",
    "Limits",
    "ModeShape",
    "PowerSpectrum",
    "TimeResponse",
    "TraceLine",
    "UffError",
    "Units",
    "read_file",
]
