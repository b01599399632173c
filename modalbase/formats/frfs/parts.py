"""FRFs in real columns, as analysers write them as text: real and imaginary parts, or magnitude and
phase.

    {"real": "Re", "imaginary": "Im"}
    {"magnitude": "Mag", "phase": "Phase"}                 with "scale": "dB" and "phase_unit": "rad"

Each may be a list of names, one for each FRF. The scale (`linear` or `dB`: 20 lg of the amplitude)
and the phase's unit are those that the file states, or as stated here; a phase without any is asked
for.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Literal

import numpy as np

from modalbase.formats.dof_names import dof_in_name
from modalbase.formats.errors import FormatError
from modalbase.formats.tables import TextTable
from modalbase.formats.units import (
    FORCE,
    RESPONSE,
    angle_of,
    decibels_in,
    factor_of,
    level_of,
    read_unit,
    unit_beside,
    unit_in_name,
)

Part = Literal["real", "imaginary", "magnitude", "phase"]
PARTS: tuple[tuple[Part, Part], ...] = (("real", "imaginary"), ("magnitude", "phase"))
_HOW = ("scale", "phase_unit")
_WORDS: dict[Part, tuple[str, ...]] = {
    "phase": ("phas", "fase", "angle", "winkel", "arg"),
    "imaginary": ("imag", "im"),
    "real": ("real", "réel", "re"),
    "magnitude": ("mag", "amp", "betrag", "modul", "abs", "gain"),
}
_FREQUENCY = ("freq", "fréq", "frequenz")
_LOGARITHM = re.compile(r"(?<![^\W\d_])(?:log|lg)(?![a-z])(?! *(?:#|no|nr|\d+$))", re.IGNORECASE)
_SQUARE = re.compile(
    r"(?<![^\W_])(?:squared?|quadr\w*|power|sq)(?![^\W_])|[|)](?:²|\^2)"
    r"|(?<!\d)10\s*[*·×]?\s*(?:log|lg)",
    re.IGNORECASE,
)
_NEGATIVE = re.compile(
    r"^\s*[-−–]\s*(?=[^\W\d_])|(?<![^\W_])(?:lag|neg(?:ative|ated)?|inverted)(?![^\W_])",
    re.IGNORECASE,
)
_CONJUGATE = re.compile(r"(?<![^\W_])(?:conj(?:ugated?)?|konjugiert)(?![^\W_])", re.IGNORECASE)
_LARGEST_STEP = 1.01 * 2 * np.pi  # between the phases of neighbouring lines, rad
_PAIR = re.compile(r"([\w.:+-]+)\s*/\s*([\w.:+-]+)")
Texts = Mapping[str, str]
WORDS, LINE_STEP, UNITS = "preamble", "preamble.line_step", "preamble.units"
"""What a table states above its data: its words, the step between its lines, units of whatever."""


def texts_of(table: TextTable) -> dict[str, str]:
    """The texts beside the columns of a table: their units, and points of response and reference
    where its headings name one pair, such as `2:+Z/1:+Z`, or the columns one for each FRF.
    """
    texts = {f"{name}_unit": unit for name, unit in table.units.items()}
    texts[WORDS] = "\n".join(table.layout.preamble)
    if table.layout.units_above:
        texts[UNITS] = table.layout.units_above[0]
    if table.layout.line_step_hz:
        step, stated = table.layout.line_step_hz
        texts[LINE_STEP] = f"{step!r} Hz; {stated.words}"
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
            columns[1] = _beside(*columns)
            mapping: dict[str, Any] = {
                part: listed[0] if len(listed) == 1 else listed
                for part, listed in zip(pair, columns, strict=True)
            }
            if pair[1] == "phase":
                scale = _stated_scale(columns[0][0], texts)
                mapping["scale"] = scale or (None if _LOGARITHM.search(columns[0][0]) else "linear")
                mapping["phase_unit"] = _stated_angle(columns[1][0], texts)
            return mapping
    return None


def _beside(first: list[str], second: list[str]) -> list[str]:
    """The second parts in the order of the first ones, where what else their names say pairs them."""
    others = {_without_part(name): name for name in second}
    own = [_without_part(name) for name in first]
    return [others[rest] for rest in own] if set(own) == others.keys() else second


def _without_part(name: str) -> tuple[str, ...]:
    """The words and numbers of a column's name but those that say which part it is."""
    words = re.findall(r"[^\W\d_]+|\d+|[+-]", unit_in_name(name)[0].lower())
    return tuple(word for word in words if _part_of_word(word) is None)


def _is_ratio(name: str, texts: Texts) -> bool:
    """Whether a column's unit is that of a response over a force."""
    unit = read_unit(_text_beside(name, texts) or unit_in_name(name)[1])
    return unit is not None and unit.dimension.times(FORCE, 1) in RESPONSE.values()


def names_of(given: Mapping[str, Any], *members: str) -> list[str]:
    """Columns that a mapping names; by default those that hold values of FRFs with their unit: real
    parts or magnitudes, or complex ones.
    """
    listed: list[Any] = [
        given[name] for name in members or ("variable", "real", "magnitude") if name in given
    ]
    return [str(name) for each in listed for name in (each if isinstance(each, list) else [each])]


def unit_in_file(given: Mapping[str, Any], texts: Texts) -> str:
    """The unit of the values that the file states, without its decibels; "" where it states none.

    Raises:
        FormatError: columns state two.
    """

    def stated(name: str) -> str:
        return unit_of_values(unit_beside(name, texts), name)

    columns = names_of(given, "variable", "real", "imaginary", "magnitude")
    return _one_of_all(columns, stated, lambda text: read_unit(text) or text) or ""


def _one_of_all(
    columns: list[str], stated: Callable[[str], str | None], meaning: Callable[[str], Any]
) -> str | None:
    """What columns state of which the FRFs have one; None where none states it.

    Raises:
        FormatError: two state what means different things; names both.
    """
    known: dict[Any, tuple[str, str]] = {}
    for column in columns:
        if text := stated(column):
            known.setdefault(meaning(text), (column, text))
    if len(known) > 1:
        (one, text), (other, another) = list(known.values())[:2]
        raise FormatError(
            "mapping.frf",
            f"has {one!r} in {text} and {other!r} in {another}: import what is alike by a mapping of"
            " its own, or correct the file",
        )
    return next((text for _, text in known.values()), None)


def unit_of_values(text: str, name: str = "") -> str:
    """The unit of amplitudes without its decibels, by the text beside a column or in brackets of
    its name.

    >>> unit_of_values("dB re 1 g/N"), unit_of_values("dB (m/s²/N)"), unit_of_values("g/N"), unit_of_values("dB")
    ('g/N', 'm/s²/N', 'g/N', '')
    >>> unit_of_values("", "H1 [dB re 1 g/N]"), unit_of_values("m/s²", "H1 dB//1 (m/s²)/N")
    ('g/N', '(m/s²)/N')
    """
    level = level_of(text or decibels_in(name))
    in_name = level_of(name) or ""
    if level is None and read_unit(in_name):
        return in_name
    return text if level is None else level


def is_parts(given: Any) -> bool:
    """Whether a mapping names parts of FRFs."""
    return isinstance(given, dict) and any(
        set(pair) <= given.keys() <= {*pair, *_HOW[: 2 * (pair[1] == "phase")]} for pair in PARTS
    )


def as_parts(given: Any) -> Any:
    """The columns that a mapping names, without how they are scaled."""
    return {n: v for n, v in given.items() if n not in _HOW} if isinstance(given, dict) else given


def combined(
    one: np.ndarray[Any, Any], two: np.ndarray[Any, Any], given: Mapping[str, Any], texts: Texts
) -> Any:
    """(N, L) complex values of their two parts. A column that its name says to be negative, such as
    `-Phase` or `Phase lag`, counts so.

    Raises:
        FormatError: a scale or phase unit is missing, unknown, or contradicts the file.
    """
    first, second = next(pair for pair in PARTS if pair[0] in given)
    one, two = one * _signs(given, first, len(one)), two * _signs(given, second, len(two))
    if first == "real":
        return one + 1j * two
    scale = given.get("scale")
    own = _one_of_all(names_of(given), lambda name: _stated_scale(name, texts), str)
    if scale not in (None, "linear", "dB"):
        raise FormatError("mapping.frf.scale", f"is {scale!r}, expected linear or dB")
    if square := [n for n in names_of(given) if _SQUARE.search(n)]:
        raise FormatError(
            "mapping.frf.magnitude",
            f"is {square[0]!r}, a square; export amplitudes, or take its root and name it so",
        )
    if not scale and not own and (log := [n for n in names_of(given) if _LOGARITHM.search(n)]):
        raise FormatError(
            "mapping.frf.scale", f"is empty, and {log[0]!r} names a logarithm; state linear or dB"
        )
    if scale and own and scale != own:
        raise FormatError(
            "mapping.frf.scale", f"is {scale}, and the file says {own}; which is right?"
        )
    stated, in_file = (
        given.get("phase_unit"),
        _one_of_all(names_of(given, "phase"), lambda name: _stated_angle(name, texts), angle_of),
    )
    step = float(np.max(np.abs(np.diff(two, axis=1)), initial=0.0))
    no_radians = step > _LARGEST_STEP
    if no_radians and angle_of(str(stated or in_file)) == 1.0:
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
    if (factor := angle_of(str(unit))) is None:
        raise FormatError(
            "mapping.frf.phase_unit",
            f"is {unit!r}, expected deg or rad (mrad, gon, cycles, π rad)",
        )
    if in_file and not no_radians and angle_of(in_file) != factor:
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


def _signs(given: Mapping[str, Any], part: Part, count: int) -> np.ndarray[Any, Any]:
    """(count, 1) of the columns of a part, or of one that holds them all."""
    signs = np.array([[sign_of(name, part)] for name in names_of(given, part)])
    return signs if len(signs) == count else np.repeat(signs[:1], count, axis=0)


def sign_of(name: str, part: Part) -> float:
    """−1 of a column that holds the negative of a part, by its name; else 1.

    >>> [sign_of(name, "phase") for name in ("-Phase (deg)", "Phase lag", "neg_phase_rad", "H1-Phase")]
    [-1.0, -1.0, -1.0, 1.0]
    >>> sign_of("Re conj(H)", "real"), sign_of("Im conj(H)", "imaginary"), sign_of("−Im", "imaginary")
    (1.0, -1.0, -1.0)
    """
    bare = unit_in_name(name)[0]
    negative = part != "magnitude" and _NEGATIVE.search(bare) is not None
    turned = part in ("imaginary", "phase") and is_conjugate(bare)
    return 1.0 if negative == turned else -1.0


def is_conjugate(name: str) -> bool:
    """Whether an array holds conjugates of FRFs, by its name."""
    return _CONJUGATE.search(name) is not None


def _text_beside(name: str, texts: Texts) -> str:
    return unit_beside(name, texts) or decibels_in(name)


def _stated_scale(name: str, texts: Texts) -> str | None:
    """DB or linear, as the file states; None where it states neither."""
    if level_of(f"{name} {_text_beside(name, texts)}") is not None:
        return "dB"
    known = not _LOGARITHM.search(name) and (_text_beside(name, texts) or unit_in_name(name)[1])
    return "linear" if known else None


def _stated_angle(name: str, texts: Texts) -> str | None:
    """The unit of a phase in the file's words."""
    words = re.findall(r"[a-zπ]+|°", f"{_text_beside(name, texts)} {name}".lower())
    if {"pi", "π"} & set(words):
        return "π rad"
    return next((word for word in words if angle_of(word) is not None), None)


def _part_of(name: str, texts: Texts) -> Part | None:
    if angle_of(_text_beside(name, texts) or unit_in_name(name)[1]) is not None:
        return "phase"
    if level_of(_text_beside(name, texts)) is not None:
        return "magnitude"
    words = re.findall(r"[^\W\d_]+", unit_in_name(name)[0].lower())
    known = {_part_of_word(word) for word in words}
    return next((part for part in _WORDS if part in known), None)


def _part_of_word(word: str) -> Part | None:
    return next(
        (
            part
            for part, starts in _WORDS.items()
            if any(word == s if len(s) == 2 else word.startswith(s) for s in starts)
        ),
        None,
    )
