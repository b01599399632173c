"""FRFs and coherences of a .mat file, as analysers export them, by a mapping that says which variable is what.

    {"frequency_hz": {"variable": "f"},
     "frf": {"variable": "H"},                        complex, or {"real": "Hr", "imaginary": "Hi"}
     "coherence": {"variable": "coh"},                may be left out
     "response_point": 33, "response_direction": 3,
     "reference_point": {"variable": "points"},       one for each FRF, or one for all
     "reference_direction": 3,
     "factor": 9.80665}                               multiplies the values for SI; 1 by default

The FRFs lie in a vector or a table one of whose sides is as long as the frequencies.
"""

from pathlib import Path
from typing import Any

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.frfs.table import DOFS, FrfRow, Frfs
from modalbase.formats.records.arrays import Variables, is_named, variable
from modalbase.formats.records.variables import read_variables
from modalbase.formats.types import FloatArray, Quantity

_SPECTRA = ("cross", "spec", "psd", "csd")
"""Parts of the names of complex spectra that are no FRFs."""
_KEYS = ("frequency_hz", "frf", "coherence", *DOFS, "factor")


def read_mat(path: Path, document: Any, quantity: Quantity, limit_bytes: int | None = None) -> Frfs:
    """The FRFs of a .mat file.

    Args:
        path: of the file.
        document: the mapping; see the module.
        quantity: what the FRFs are.
        limit_bytes: the most that the file's arrays may take.

    Raises:
        FormatError: the file or the mapping cannot be read, or they do not fit together; it names the variable or the field.
    """
    return frfs_of(read_variables(path, ".mat", limit_bytes), document, quantity)


def frfs_of(variables: Variables, document: Any, quantity: Quantity) -> Frfs:
    """The same of named arrays.

    Raises:
        FormatError: as of `read_mat`; without a mapping it says which one the names and shapes suggest.
    """
    if document is None:
        raise FormatError("mapping", f"is missing; the file suggests {propose_frfs(variables)}; complete it")
    if not isinstance(document, dict) or document.keys() - set(_KEYS):
        raise FormatError("mapping", f"is not an object of {', '.join(_KEYS)}")
    missing = [name for name in ("frequency_hz", "frf", "response_point", "reference_point") if name not in document]
    if missing:
        raise FormatError([(f"mapping.{name}", "is missing") for name in missing])
    frequency = np.ravel(_named(variables, document, "frequency_hz")).astype(float)
    values = _frf(variables, document["frf"], frequency.size)
    coherence: FloatArray | None = None
    if document.get("coherence") is not None:
        table = _rows(np.asarray(_named(variables, document, "coherence"), dtype=float), frequency.size, "coherence")
        if table.shape != values.shape:
            raise FormatError("mapping.coherence", f"has {len(table)} functions, frf {len(values)}")
        coherence = table
    factor = document.get("factor", 1.0)
    if isinstance(factor, bool) or not isinstance(factor, int | float) or not (np.isfinite(factor) and factor != 0):
        raise FormatError("mapping.factor", f"is {factor!r}, expected a number other than 0")
    dofs = [_integers(variables, document.get(name, 3), len(values), name) for name in DOFS]
    rows = tuple(FrfRow.between(each) for each in zip(*dofs, strict=True))
    return Frfs(frequency, values * factor if factor != 1 else values, rows, quantity, coherence)


def propose_frfs(variables: Variables) -> dict[str, Any]:
    """A mapping that names, types and shapes suggest; points and directions are the user's."""
    lines = [name for name, array in variables.items() if name.lower().rpartition(".")[2][:1] in "fx" and _rises(array)]
    found: dict[str, Any] = {"frequency_hz": {"variable": [*lines, "?"][0]}, "response_point": 1, "reference_point": 1}
    complexes = [n for n, a in variables.items() if a.dtype.kind == "c"]
    frf = min(complexes, key=lambda name: any(part in name.lower() for part in _SPECTRA), default=None)
    found["frf"] = {"variable": frf or "?"}
    alike = [n for n, a in variables.items() if frf and a.shape == variables[frf].shape and a.dtype.kind == "f"]
    shares = [n for n in alike if variables[n].min() >= 0 and variables[n].max() <= 1 + 1e-6]
    if coherence := [n for n in alike if "coh" in n.lower()] or shares:
        found["coherence"] = {"variable": coherence[0]}
    return found


def _rises(array: np.ndarray[Any, Any]) -> bool:
    """Whether an array is a vector of real numbers that rise from 0 or more."""
    values = np.ravel(array)
    is_vector = array.dtype.kind in "fiu" and array.size == max(array.shape or (0,)) > 1
    return is_vector and bool(np.all(np.diff(values) > 0) and values[0] >= 0)


def _named(variables: Variables, document: dict[str, Any], field: str) -> np.ndarray[Any, Any]:
    given = document[field]
    if not is_named(given):
        raise FormatError(f"mapping.{field}", f'is {given!r}, expected {{"variable": name}}')
    return _real(variables, given["variable"], field)


def _real(variables: Variables, name: str, field: str) -> np.ndarray[Any, Any]:
    found = variable(variables, name)
    if found.dtype.kind == "c":
        raise FormatError(name, f"is complex, expected the real numbers of {field}")
    return found


def _frf(variables: Variables, given: Any, lines: int) -> np.ndarray[Any, np.dtype[np.complexfloating]]:
    if (
        isinstance(given, dict)
        and set(given) == {"real", "imaginary"}
        and all(isinstance(v, str) for v in given.values())
    ):
        real, imaginary = (_rows(_real(variables, given[part], "frf"), lines, "frf") for part in ("real", "imaginary"))
        if real.shape != imaginary.shape:
            raise FormatError("mapping.frf", f"has {len(real)} real and {len(imaginary)} imaginary parts")
        return np.asarray(real + 1j * imaginary)
    if not is_named(given):
        raise FormatError(
            "mapping.frf", f'is {given!r}, expected {{"variable": name}} or {{"real": name, "imaginary": name}}'
        )
    found = variable(variables, given["variable"])
    if found.dtype.kind != "c":
        raise FormatError(
            given["variable"], "is real: an FRF without phase is of no use; name real and imaginary parts"
        )
    table = _rows(found, lines, "frf")
    return table if table.dtype == np.complex64 else table.astype(np.complex128)


def _rows(array: np.ndarray[Any, Any], lines: int, field: str) -> np.ndarray[Any, Any]:
    """(N, lines); the side that is as long as the frequencies is the lines, the last such side where two are."""
    array = np.squeeze(array)
    if array.ndim not in (1, 2, 3) or lines not in array.shape:
        raise FormatError(f"mapping.{field}", f"has shape {list(array.shape)}, none of it the {lines} frequencies")
    axis = max(i for i, size in enumerate(array.shape) if size == lines)
    return np.ascontiguousarray(np.moveaxis(array, axis, -1).reshape(-1, lines))


def _integers(variables: Variables, given: Any, count: int, field: str) -> list[int]:
    if isinstance(given, dict) and set(given) == {"variable"}:
        values = np.ravel(variable(variables, str(given["variable"])))
    else:
        try:
            values = np.ravel(np.array(given, dtype=float))
        except (TypeError, ValueError):  # texts, objects, lists of unequal length
            values = np.array([np.nan])
    if values.size == 1:
        values = np.repeat(values, count)
    if (
        values.size != count
        or values.dtype.kind == "c"
        or not np.all(np.isfinite(values) & (values == np.round(values)))
    ):
        raise FormatError(f"mapping.{field}", f"is no whole number for each of the {count} FRFs, or one for all")
    if field.endswith("direction") and not np.all((np.abs(values) >= 1) & (np.abs(values) <= 6)):
        raise FormatError(f"mapping.{field}", "is no direction, expected ±1 to ±6")
    return [int(v) for v in values]
