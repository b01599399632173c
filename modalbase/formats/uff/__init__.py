"""Universal File Format (UFF) in and out, behind a guard: pure functions over files, no
database.

scan               the framing of the whole file
text, names        fixed columns; degrees of freedom that stand in names alone
content            what a dataset comes to
units, geometry    set 164; sets 15, 18, 82, 151, 2411, 2412, 2420
function           set 58 as it stands
channels, frf      as time blocks and spectra; as FRFs in SI
shapes             sets 55 and 2414
read, write
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
