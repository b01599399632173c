"""FRFs and coherences of a .mat file or a table of text, as analysers export them, by a mapping
that says what is what.

    {"frequency_hz": {"variable": "f"},              or {"start": 0, "step": 0.5}, each a number or {"variable": name};
                                                     "unit": "rad/s" where it is not in Hz
     "frf": {"variable": "H"},                        complex, or {"real": "Hr", "imaginary": "Hi"}, or magnitude and
                                                     phase, see `modalbase.formats.frfs.parts`
     "coherence": {"variable": "coh"},                may be left out; a list of columns, one for each FRF
     "response_point": 33, "response_direction": 3,
     "reference_point": {"variable": "points"},       one for each FRF, or one for all
     "reference_direction": 3,
     "unit": "g/N"}                                   or "factor": 9.80665, which multiplies the values for SI;
                                                     "instead_of": the unit that the file states wrongly

The FRFs lie in a vector or a table one of whose sides is as long as the frequencies. A unit that
the file itself states, in a text beside the array or in its name, is used, or refused where the
mapping contradicts it. Without any the values are in SI.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.factors import factors_among, question
from modalbase.formats.frfs.kinds import kind_by_words
from modalbase.formats.frfs.parts import (
    LINE_STEP,
    PARTS,
    UNITS,
    as_parts,
    combined,
    is_conjugate,
    is_parts,
    names_of,
    unit_in_file,
)
from modalbase.formats.frfs.proposal import is_empty, propose_frfs
from modalbase.formats.frfs.table import DOFS, FrfRow, Frfs
from modalbase.formats.records.arrays import Variables, is_named, variable
from modalbase.formats.records.variables import read_named
from modalbase.formats.types import FloatArray, Quantity
from modalbase.formats.units import FORCE, RESPONSE, factor_of, read_unit, unit_beside, unread_unit

_KEYS = ("frequency_hz", "frf", "coherence", *DOFS, "unit", "instead_of", "factor")
_FEWEST_MIRRORED, _ROUNDED = 8, 1e-5  # lines; of the largest value
_SAME = 0.01  # by which a stated factor may differ from that of the unit
Texts = Mapping[str, str]


def read_mat(
    path: Path, document: Any, quantity: Quantity | None, limit_bytes: int | None = None
) -> Frfs:
    """The FRFs of a .mat file.

    Args:
        path: of the file.
        document: the mapping; see the module.
        quantity: what the FRFs are; None where their unit says it.
        limit_bytes: the most that the file's arrays may take.

    Raises:
        FormatError: the file or the mapping cannot be read, or they do not fit together; it names
            the variable or the field.
    """
    variables, texts = read_named(path, ".mat", limit_bytes)
    return frfs_of(variables, document, quantity, texts)


def frfs_of(
    variables: Variables,
    document: Any,
    quantity: Quantity | None,
    texts: Texts | None = None,
    otherwise: Quantity | None = None,
) -> Frfs:
    """The same of named arrays and the texts beside them; `otherwise` is what FRFs are of which
    nothing says it.

    Raises:
        FormatError: as of `read_mat`; without a mapping it says which one the names and shapes
            suggest.
    """
    texts = {**(texts or {}), **factors_among(variables)}
    if document is None:
        proposed = propose_frfs(variables, texts)
        others = (
            ""
            if proposed["frf"]
            else "; a list of modes is no file of FRFs: type it in as a mode set"
        )
        suggested = json.dumps(proposed, ensure_ascii=False)
        raise FormatError(
            "mapping", f"is missing; the file suggests {suggested}; complete it{others}"
        )
    if not isinstance(document, dict) or document.keys() - set(_KEYS):
        raise FormatError("mapping", f"is not an object of {', '.join(_KEYS)}")
    missing = [
        name
        for name in ("frequency_hz", "frf", "response_point", "reference_point")
        if name not in document
    ]
    given = {"frf": as_parts(document["frf"])} if "frf" in document else {}
    members = ("frequency_hz", "frf", *DOFS)
    empty = [name for name in members if is_empty((document | given).get(name, 3))]
    if missing or empty:
        faults = [(f"mapping.{name}", "is missing") for name in missing]
        raise FormatError(
            faults + [(f"mapping.{name}", f"is empty: {_EMPTY[name]}") for name in empty]
        )
    values, frequency = _spectra(variables, document, texts)
    coherence: FloatArray | None = None
    if document.get("coherence") is not None:
        named = document["coherence"]
        if not (isinstance(named, dict) and set(named) == {"variable"}):
            raise FormatError("mapping.coherence", f'is {named!r}, expected {{"variable": name}}')
        table = _part(variables, named["variable"], frequency.size, "coherence").astype(float)
        if table.shape != values.shape:
            raise FormatError("mapping.coherence", f"has {len(table)} functions, frf {len(values)}")
        coherence = table
    if frequency.size > 1 and np.all(np.diff(frequency) < 0):  # from the last line to the first
        frequency, values = frequency[::-1], values[:, ::-1]
        coherence = None if coherence is None else coherence[:, ::-1]
    what, factor = _scale(document, texts, quantity, otherwise)
    dofs = [_integers(variables, document.get(name, 3), len(values), name) for name in DOFS]
    if len(values) > 1 and all(len(each) == 1 for each in dofs):
        raise FormatError(
            "mapping.response_point",
            f"and the rest state one degree of freedom for {len(values)} FRFs; state a list of"
            f" their {len(values)} points",
        )
    dofs = [each * len(values) if len(each) == 1 else each for each in dofs]
    rows = tuple(FrfRow.between(each) for each in zip(*dofs, strict=True))
    return Frfs(frequency, values * factor if factor != 1 else values, rows, what, coherence)


_EMPTY = {
    "frequency_hz": 'state {"variable": name}, or {"start": …, "step": …}',
    "frf": (
        'state {"variable": name} of complex values, or columns {"real": name, "imaginary": name}'
        ' or {"magnitude": name, "phase": name}'
    ),
    **{
        name: "state a point for each FRF, or one for all"
        for name in DOFS
        if name.endswith("point")
    },
    **{
        name: "state ±1 to ±3 along x, y, z, ±4 to ±6 about them"
        for name in DOFS
        if name.endswith("direction")
    },
}


def _scale(
    document: dict[str, Any], texts: Texts, quantity: Quantity | None, otherwise: Quantity | None
) -> tuple[Quantity, float]:
    """What the FRFs are, and their factor to SI: by the unit that the mapping or the file states,
    or as stated.

    Raises:
        FormatError: two statements contradict each other, or there is none.
    """
    factor = document.get("factor")
    if factor is not None and (
        isinstance(factor, bool)
        or not isinstance(factor, int | float)
        or not (np.isfinite(factor) and factor != 0)
    ):
        raise FormatError("mapping.factor", f"is {factor!r}, expected a number other than 0")
    given: dict[str, str] = document["frf"]  # of which the values were read
    in_file = unit_in_file(given, texts)
    stated, instead = (document.get(name) or "" for name in ("unit", "instead_of"))
    if not isinstance(stated, str):
        raise FormatError(
            "mapping.unit", f"is {stated!r}, expected the text of a unit, such as g/N"
        )
    if stated and read_unit(in_file) not in (None, read_unit(stated)) and instead != in_file:
        if instead:
            raise FormatError(
                "mapping.instead_of", f"is {instead!r}, and the file says {in_file!r}"
            )
        raise FormatError(
            "mapping.unit",
            f"is {stated!r}, and the file says {in_file!r}; which is right? Where the file is wrong,"
            f' state "instead_of": "{in_file}"',
        )
    text = stated or in_file
    unit = read_unit(text)
    own = {unit_of.times(FORCE, -1): name for name, unit_of in RESPONSE.items()}
    if unit is None or unit.dimension not in own:
        if stated or (text and factor is None):
            why = (
                ", which is no response over a force that is known here; state `unit`, such as g/N,"
                " or `factor`"
            )
            raise FormatError("mapping.unit", f"is {text!r}{question(text) or why}")
        if UNITS in texts and factor is None and not text:
            raise FormatError(
                "mapping.unit",
                f"is missing: the columns state none, and {texts[UNITS]}; state that of the FRFs,"
                " such as g/N",
            )
        words = [*texts.values(), *names_of(given, *given)]
        if (known := kind_by_words(words, quantity) or otherwise) is None:
            raise FormatError(
                "quantity",
                "is missing: neither the request nor a unit says what the FRFs are; state it, or"
                " `unit` in the mapping, such as g/N",
            )
        return known, 1.0 if factor is None else float(factor)
    what = own[unit.dimension]
    if quantity not in (None, what):
        raise FormatError(
            "quantity", f"is {quantity}, and the unit {text!r} is that of {what}; which is right?"
        )
    if factor is not None and abs(factor / unit.factor - 1) > _SAME:
        raise FormatError(
            "mapping.factor",
            f"is {factor:g}, and the unit {text!r} makes it {unit.factor:g}; state one",
        )
    return what, unit.factor


def _spectra(
    variables: Variables, document: dict[str, Any], texts: Texts
) -> tuple[np.ndarray[Any, np.dtype[np.complexfloating]], FloatArray]:
    """(N, L) values and the (L,) frequencies in Hz."""
    axis, stated_step = document["frequency_hz"], ""
    named = (
        {name: axis[name] for name in axis.keys() - {"unit"}} if isinstance(axis, dict) else axis
    )
    if is_named(named):
        name = str(named["variable"])
        frequency = np.ravel(_real(variables, name, "frequency_hz")).astype(float)
        values = _frf(variables, document["frf"], frequency.size, texts)
        stated_step = texts.get(LINE_STEP, "")
    elif isinstance(named, dict) and {"start", "step"} <= named.keys() <= {
        "start",
        "step",
        "count",
    }:
        name = next((str(given["variable"]) for given in named.values() if is_named(given)), "")
        numbers = {
            key: _number(variables, given, f"frequency_hz.{key}") for key, given in named.items()
        }
        values = _frf(variables, document["frf"], None, texts)
        count = values.shape[1]
        if numbers.get("count", count) != count:
            raise FormatError(
                "mapping.frequency_hz.count", f"is {numbers['count']:g}, and frf has {count} lines"
            )
        if not (numbers["step"] > 0 and numbers["start"] >= 0):
            raise FormatError(
                "mapping.frequency_hz", "has no step above 0 from a start of 0 or more"
            )
        frequency = numbers["start"] + numbers["step"] * np.arange(count)
    else:
        raise FormatError(
            "mapping.frequency_hz",
            f'is {axis!r}, expected {{"variable": name}} or {{"start": …, "step": …}}',
        )
    in_file = unit_beside(name, texts, "frequency")
    if not in_file and "unit" not in axis and (text := unread_unit(name)):
        raise FormatError(
            "mapping.frequency_hz.unit",
            f"is missing, and the file says {text!r}, which is no unit that is known here; state"
            " one, such as Hz",
        )
    stated = axis.get("unit", in_file) or ("Hz" if "unit" not in axis else "")
    factor = factor_of("frequency", stated) if isinstance(stated, str) else None
    if factor is None:
        raise FormatError(
            "mapping.frequency_hz.unit",
            f"is {stated!r}, expected a frequency's, such as Hz or rad/s",
        )
    if in_file and factor_of("frequency", in_file) not in (None, factor):
        raise FormatError(
            "mapping.frequency_hz.unit",
            f"is {stated!r}, and the file says {in_file!r}; which is right?",
        )
    frequency = frequency * factor
    _require_step(frequency, stated_step)
    _refuse_mirrored(values)
    return values, frequency


def _require_step(frequency: FloatArray, stated: str) -> None:
    """Refuse lines that are further apart, or nearer, than a line above the table states.

    Raises:
        FormatError: as it says.
    """
    expected, _, words = stated.partition(" Hz; ")
    step = float(np.median(np.abs(np.diff(frequency)))) if frequency.size > 1 else 0.0
    if expected and step and abs(step - float(expected)) > _SAME * step:
        raise FormatError(
            "mapping.frequency_hz",
            f"has lines {step:g} Hz apart, and {words}; which is right? State"
            ' {"start": …, "step": …}, or correct that line',
        )


def _refuse_mirrored(values: np.ndarray[Any, Any]) -> None:
    """Refuse spectra with lines of two sides, whose upper half repeats the lower one.

    Raises:
        FormatError: as it says.
    """
    lines = values[:, 1:]  # but the first, 0 Hz
    if not np.any(lines.imag):
        return
    size = np.abs(lines).max(initial=0.0)
    is_long = values.shape[1] >= _FEWEST_MIRRORED and np.isfinite(size)
    if is_long and np.allclose(lines, lines[:, ::-1].conj(), 0, _ROUNDED * size):
        raise FormatError(
            "mapping.frf",
            f"has two sides: its upper lines repeat the lower ones as conjugates; export the lower"
            f" {values.shape[1] // 2 + 1} of its {values.shape[1]} lines",
        )


def _number(variables: Variables, given: Any, field: str) -> float:
    values = (
        np.ravel(_real(variables, given["variable"], field))
        if is_named(given)
        else np.array([given])
    )
    if values.size != 1 or values.dtype.kind not in "fiu" or not np.isfinite(values[0]):
        raise FormatError(
            f"mapping.{field}", f'is {given!r}, expected a number or {{"variable": name}} of one'
        )
    return float(values[0])


def _real(variables: Variables, name: str, field: str) -> np.ndarray[Any, Any]:
    values = variable(variables, name)
    if values.dtype.kind == "c":
        raise FormatError(name, f"is complex, expected the real numbers of {field}")
    return values


def _frf(
    variables: Variables, given: Any, lines: int | None, texts: Texts
) -> np.ndarray[Any, np.dtype[np.complexfloating]]:
    if is_parts(given):
        first, second = next(pair for pair in PARTS if pair[0] in given)
        one, two = (_part(variables, given[part], lines) for part in (first, second))
        if one.shape != two.shape:
            raise FormatError(
                "mapping.frf", f"has {len(one)} FRFs of {first} and {len(two)} of {second}"
            )
        return np.asarray(combined(one, two, given, texts))
    if not is_named(given):
        ways = (
            '{"variable": name}, {"real": name, "imaginary": name} or {"magnitude": name, "phase":'
            " name}"
        )
        raise FormatError("mapping.frf", f"is {given!r}, expected {ways}")
    values = variable(variables, given["variable"])
    if values.dtype.kind != "c":
        raise FormatError(
            given["variable"],
            "is real: an FRF without phase is of no use; name real and imaginary parts, or"
            " magnitude and phase",
        )
    table = _rows(values, lines, "frf")
    table = table.conj() if is_conjugate(given["variable"]) else table
    return table if table.dtype == np.complex64 else table.astype(np.complex128)


def _part(
    variables: Variables, given: Any, lines: int | None, field: str = "frf"
) -> np.ndarray[Any, Any]:
    """(N, lines) of one array, or of one column for each FRF."""
    names = given if isinstance(given, list) else [given]
    if not names or not all(isinstance(name, str) for name in names):
        raise FormatError(
            f"mapping.{field}", f"has {given!r}, expected the name of a variable or a list of names"
        )
    return np.concatenate([_rows(_real(variables, name, field), lines, field) for name in names])


def _rows(array: np.ndarray[Any, Any], lines: int | None, field: str) -> np.ndarray[Any, Any]:
    """(N, lines); the side that is as long as the frequencies is the lines, the last such side
    where two are. Without a number of lines they are the longest side.
    """
    array = np.squeeze(array)
    lines = max(array.shape, default=1) if lines is None else lines
    if array.ndim not in (1, 2, 3) or lines not in array.shape:
        raise FormatError(
            f"mapping.{field}", f"has shape {list(array.shape)}, none of it the {lines} frequencies"
        )
    axis = max(i for i, size in enumerate(array.shape) if size == lines)
    return np.ascontiguousarray(np.moveaxis(array, axis, -1).reshape(-1, lines))


def _integers(variables: Variables, given: Any, count: int, field: str) -> list[int]:
    """One for each FRF, or one alone."""
    if isinstance(given, dict) and set(given) == {"variable"}:
        values = np.ravel(variable(variables, str(given["variable"])))
    else:
        try:
            values = np.ravel(np.array(given, dtype=float))
        except (TypeError, ValueError):  # texts, objects, lists of unequal length
            values = np.array([np.nan])
    if (
        values.size not in (1, count)
        or values.dtype.kind == "c"
        or not np.all(np.isfinite(values) & (values == np.round(values)))
    ):
        raise FormatError(
            f"mapping.{field}", f"is no whole number for each of the {count} FRFs, or one for all"
        )
    if field.endswith("direction") and not np.all((np.abs(values) >= 1) & (np.abs(values) <= 6)):
        raise FormatError(f"mapping.{field}", "is no direction, expected ±1 to ±6")
    return [int(v) for v in values]
