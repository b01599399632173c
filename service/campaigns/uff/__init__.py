"""Universal File Format (UFF) in and out, behind a guard: pure functions over files, no database."""

from service.campaigns.uff.content import (
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
    TraceLine,
    UffError,
    Units,
)
from service.campaigns.uff.read import read_file

__all__ = [
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
    "TraceLine",
    "UffError",
    "Units",
    "read_file",
]
