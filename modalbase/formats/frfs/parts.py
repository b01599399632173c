"""FRFs in real columns, as analysers write them as text: real and imaginary parts, or magnitude and
phase.

    {"real": "Re", "imaginary": "Im"}
    {"magnitude": "Mag", "phase": "Phase"}                 with "scale": "dB" and "phase_unit": "rad"

Each may be a list of names, one for each FRF. The scale (`linear` or `dB`: 20 lg of the amplitude)
and the phase's unit are those that the file states, or as stated here; a phase without any is asked
for.
"""

import re
from collections.abc import Iterable, Mapping
from typing import Any, Literal

import numpy as np

from modalbase.formats.dof_names import dof_in_name
from modalbase.formats.errors import FormatError
from modalbase.formats.tables import TextTable
from modalbase.formats.units import FORCE, RESPONSE, factor_of, plain, read_unit, unit_in_name

Part = Literal["real", "imaginary", "magnitude", "phase"]
PARTS: tuple[tuple[Part, Part], ...] = (("real", "imaginary"), ("magnitude", "phase"))
_HOW = ("scale", "phase_unit")
_WORDS: dict[Part, tuple[str, ...]] = {
    "phase": ("phase", "phas", "angle", "winkel", "arg"),
    "imaginary": ("imag", "im"),
    "real": ("real", "réel", "re"),
    "magnitude": ("mag", "amp", "betrag", "modul", "abs", "gain"),
}
_FREQUENCY = ("freq", "fréq", "frequenz")
_ANGLES = {
    **dict.fromkeys(("rad", "radian", "radians"), 1.0),
    **dict.fromkeys(("deg", "°", "degree", "degrees", "grad"), np.pi / 180),
}
_LARGEST_STEP = 1.01 * 2 * np.pi  # between the phases of neighbouring lines, rad
_DECIBEL = re.compile(r"\bdB\b\s*(?:re\.?)?\s*(?:1(?:\.0*)?(?![\d.e]))?\s*(.*)", re.IGNORECASE)
_PAIR = re.compile(r"([\w.:+-]+)\s*/\s*([\w.:+-]+)")
Texts = Mapping[str, str]


def texts_of(table: TextTable) -> dict[str, str]:
    """The texts beside the columns of a table: their units, and points of response and reference
    where its headings name one pair, such as `2:+Z/1:+Z`, or the columns one for each FRF.
    """
    texts = {f"{name}_unit": unit for name, unit in table.units.items()}
    pairs = _pairs_in(table.names) or _pairs_in(table.layout.preamble)
    if pairs and (len(pairs) == 1 or _pairs_in(table.names)):
        texts["heading.response"], texts["heading.reference"] = (
            "\n".join(side) for side in zip(*pairs, strict=True)
        )
    return texts


def _pairs_in(cells: Iterable[str]) -> list[tuple[str, str]]:
    """Response and reference that texts name, each pair once."""
    matches = (match.group(1, 2) for cell in cells for match in _PAIR.finditer(cell))
    return list(
        dict.fromkeys((one, two) for one, two in matches if dof_in_name(one) and dof_in_name(two))
    )


def is_frequency(name: str, units: Mapping[str, str]) -> bool:
    """Whether a column holds frequencies, by its name or unit.

    >>> is_frequency("Frequenz", {}), is_frequency("column 1", {"column 1": "Hz"}), is_frequency("Force", {})
    (True, True, False)
    """
    bare, unit = unit_in_name(name, "frequency")
    unit = unit or units.get(name, "") or bare  # a column may be called Hz
    return (bool(unit) and factor_of("frequency", unit) is not None) or bare.lower().startswith(
        _FREQUENCY
    )


def propose_parts(names: list[str], texts: Texts) -> dict[str, Any] | None:
    """Which columns are parts of FRFs, by their names and units; None where they do not say it."""
    by_part: dict[Part, list[str]] = {part: [] for pair in PARTS for part in pair}
    for name in names:
        if (part := _part_of(name, texts)) is not None:
            by_part[part].append(name)
    if by_part["phase"] and not by_part["magnitude"]:  # units alone say what the columns are
        by_part["magnitude"] = [
            name for name in names if not _part_of(name, texts) and _is_ratio(name, texts)
        ]
    for pair in PARTS:
        columns = [by_part[part] for part in pair]
        if columns[0] and len(columns[0]) == len(columns[1]):
            mapping: dict[str, Any] = {
                part: listed[0] if len(listed) == 1 else listed
                for part, listed in zip(pair, columns, strict=True)
            }
            if pair[1] == "phase":
                mapping["scale"] = "dB" if _stated_scale(columns[0][0], texts) == "dB" else "linear"
                mapping["phase_unit"] = _stated_angle(columns[1][0], texts)
            return mapping
    return None


def _is_ratio(name: str, texts: Texts) -> bool:
    """Whether a column's unit is that of a response over a force."""
    unit = read_unit(_text_beside(name, texts) or unit_in_name(name)[1])
    return unit is not None and unit.dimension.times(FORCE, 1) in RESPONSE.values()


def names_of(given: Mapping[str, Any]) -> list[str]:
    """Columns that hold values of FRFs with their unit: real parts or magnitudes, or complex
    ones.
    """
    listed: Any = next(
        (given[name] for name in ("variable", "real", "magnitude") if name in given), []
    )
    return [str(name) for name in (listed if isinstance(listed, list) else [listed])]


def unit_of_values(text: str, name: str = "") -> str:
    """The unit of amplitudes without its decibels, by the text beside a column or in brackets of
    its name.

    >>> unit_of_values("dB re 1 g/N"), unit_of_values("dB (m/s²/N)"), unit_of_values("g/N"), unit_of_values("dB")
    ('g/N', 'm/s²/N', 'g/N', '')
    >>> unit_of_values("", "H1 [dB re 1 g/N]")
    'g/N'
    >>> unit_of_values("", "H1 [dB re 1 (m/s²)/N]")
    '(m/s²)/N'
    """
    match = _DECIBEL.search(text or _brackets_with_decibels(name))
    return plain(match[1]) if match else text


def is_parts(given: Any) -> bool:
    """Whether a mapping names parts of FRFs."""
    return isinstance(given, dict) and any(
        set(pair) <= given.keys() <= {*pair, *_HOW[: 2 * (pair[1] == "phase")]} for pair in PARTS
    )


def combined(
    one: np.ndarray[Any, Any], two: np.ndarray[Any, Any], given: Mapping[str, Any], texts: Texts
) -> Any:
    """(N, L) complex values of their two parts.

    Raises:
        FormatError: a scale or phase unit is missing, unknown, or contradicts the file.
    """
    if "real" in given:
        return one + 1j * two
    scale = given.get("scale")
    own = _stated_scale(names_of(given)[0], texts)
    if scale not in (None, "linear", "dB"):
        raise FormatError("mapping.frf.scale", f"is {scale!r}, expected linear or dB")
    if scale and own and scale != own:
        raise FormatError(
            "mapping.frf.scale", f"is {scale}, and the file says {own}; which is right?"
        )
    phase = given["phase"][0] if isinstance(given["phase"], list) else given["phase"]
    stated, in_file = given.get("phase_unit"), _stated_angle(phase, texts)
    step = float(np.max(np.abs(np.diff(two, axis=1)), initial=0.0))
    no_radians = step > _LARGEST_STEP
    if no_radians and _ANGLES.get(str(stated or in_file).lower()) == 1.0:
        raise FormatError(
            "mapping.frf.phase_unit",
            f"is {stated or in_file}, and neighbouring lines differ by {step:.3g}, more than the"
            " turn of 2π; state deg if they are degrees",
        )
    unit = stated or in_file
    if unit is None:
        raise FormatError(
            "mapping.frf.phase_unit", "is empty, and the file states none; state deg or rad"
        )
    if (factor := _ANGLES.get(str(unit).lower())) is None:
        raise FormatError("mapping.frf.phase_unit", f"is {unit!r}, expected deg or rad")
    if in_file and not no_radians and _ANGLES[in_file.lower()] != factor:
        raise FormatError(
            "mapping.frf.phase_unit", f"is {unit}, and the file says {in_file}; which is right?"
        )
    magnitude = 10 ** (one / 20) if (scale or own) == "dB" else one
    if np.any(magnitude < 0):
        raise FormatError(
            "mapping.frf.magnitude",
            f'is below 0 (to {magnitude.min():.3g}); state "scale": "dB" where it is in dB',
        )
    return magnitude * np.exp(1j * factor * two)


def _text_beside(name: str, texts: Texts) -> str:
    return texts.get(f"{name}_unit", "") or _brackets_with_decibels(name)


def _brackets_with_decibels(name: str) -> str:
    match = re.search(r"[(\[](\s*dB\b.*)[)\]]", name, re.IGNORECASE)
    return match[1] if match else ""


def _stated_scale(name: str, texts: Texts) -> str | None:
    """DB or linear, as the file states; None where it states neither."""
    if re.search(r"(?<![a-z])dB(?![a-z])", f"{name} {_text_beside(name, texts)}", re.IGNORECASE):
        return "dB"
    return "linear" if _text_beside(name, texts) or unit_in_name(name)[1] else None


def _stated_angle(name: str, texts: Texts) -> str | None:
    """The unit of a phase in the file's words."""
    words = re.findall(r"[a-zπ]+|°", f"{_text_beside(name, texts)} {name}".lower())
    if {"pi", "π"} & set(words):  # of a phase in half turns, which is asked for
        return None
    return next((word for word in words if word in _ANGLES), None)


def _part_of(name: str, texts: Texts) -> Part | None:
    if _text_beside(name, texts).lower() in _ANGLES:
        return "phase"
    if re.search(r"\bdB\b", _text_beside(name, texts), re.IGNORECASE):
        return "magnitude"
    words = re.findall(r"[^\W\d_]+", unit_in_name(name)[0].lower())
    for part, starts in _WORDS.items():
        if any(
            word == start if len(start) == 2 else word.startswith(start)
            for word in words
            for start in starts
        ):
            return part
    return None
