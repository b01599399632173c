"""Sets 55 and 2414: mode shapes. Their values are in global axes and of any scale, so no units
apply to them.
"""

import re
from collections.abc import Sequence
from typing import Literal

import numpy as np

from modalbase.formats.types import ComplexArray, IntArray
from modalbase.formats.uff.content import ORDINATE_TYPES, ModeShape
from modalbase.formats.uff.geometry import Parsed
from modalbase.formats.uff.text import Cursor, Refusal, SkippedDataset, decoded, shown

_NORMAL, _COMPLEX_FIRST, _COMPLEX_SECOND = 2, 3, 7
_KINDS: dict[int, Literal["normal", "complex"]] = {
    _NORMAL: "normal",
    _COMPLEX_FIRST: "complex",
    _COMPLEX_SECOND: "complex",
}
_ANALYSES = {
    0: "of unknown analysis", 1: "static", 4: "transient", 5: "a frequency response", 6: "buckling", 9: "static non-linear",
}  # fmt: skip
_REAL, _COMPLEX = (ORDINATE_TYPES[kind, False] for kind in "fc")
_PER_ROW = 6
_MUCH_DAMPED = 0.2  # a ratio above which per cent may have been written
_MODE_ROUNDED, _DAMPING_ROUNDED = 0.01, 0.06
"""By which a frequency or damping ratio in words may differ: rounded to a digit or two, damped or
undamped.
"""
_IN_HZ = re.compile(r"eigen(?:value|wert)s?[^;]{0,20}\bHz\b", re.IGNORECASE)
_IN_IDS = {
    "Hz": re.compile(r"(?:freq\w*\.?\s*[:=]?\s*|\bf\w*\s*=\s*)(\d+[.,]?\d*)\s*Hz", re.IGNORECASE),
    "%": re.compile(r"damp\w*\.?\s*(?:ratio)?\s*[:=]?\s*(\d+[.,]?\d*)\s*%", re.IGNORECASE),
}
"""How ID lines state a frequency and a damping ratio."""
_WIDTH = 13
_TRANSLATIONS, _WITH_ROTATIONS = 2, 3


def read_55(body: bytes, dataset: int) -> Parsed:
    """Set 55: data at nodes, of a normal mode or a complex eigenvalue.

    Raises:
        Ignored: it is no mode shape.
        Refusal: its lines are not what its header declares.
    """
    cursor = Cursor(body)
    ids = [decoded(cursor.next("the ID lines")) for _ in range(5)]
    analysis, components, values_are_complex = _definition(cursor, "55")
    row = cursor.next("the analysis parameters")
    integers, reals = cursor.integers(row, ["number of integers", "number of reals"])
    if not (1 <= integers <= 10 and 1 <= reals <= 12):
        raise cursor.refuse(
            f"declares {integers} integer and {reals} real parameters, expected 1 to 10 and 1 to 12"
        )
    parameters = cursor.integers(
        row, [f"parameter {i + 1}" for i in range(min(integers, 6))], start=20
    )
    mode = parameters[1] if integers > 1 else 0
    numbers = cursor.real_rows(reals, _WIDTH, _PER_ROW, "the analysis parameters")
    if len(numbers) < (1 if analysis == _NORMAL else 2):
        raise cursor.refuse("states no eigenvalue")
    if analysis == _NORMAL:
        viscous, hysteretic = [*numbers[2:4], 0.0, 0.0][:2]
        frequency, damping, notes = _normal_mode(numbers[0], viscous, hysteretic)
    else:
        frequency, damping, notes = _complex_mode(numbers[0], numbers[1])
    frequency, damping = _held_to_ids(ids, frequency, damping, notes)
    points, values = _nodes(cursor, components, values_are_complex)
    shape = ModeShape(
        dataset, ids[0], mode, frequency, damping, points, values=values, kind=_KINDS[analysis]
    )
    return Parsed([shape], notes)


def read_2414(body: bytes, dataset: int) -> Parsed:
    """Set 2414: analysis data at nodes, of a normal mode or a complex eigenvalue.

    Raises:
        Ignored: it is no mode shape, or its data are not at nodes.
        Refusal: its lines are not what its header declares.
    """
    cursor = Cursor(body)
    cursor.integers(cursor.next("the label"), ["label"])
    label = decoded(cursor.next("the name"))
    (location,) = cursor.integers(cursor.next("the location of the data"), ["location of the data"])
    if location != 1:
        raise SkippedDataset(f"its data are not at nodes (location {location})")
    ids = [label, *(decoded(cursor.next("the ID lines")) for _ in range(5))]
    analysis, components, values_are_complex = _definition(cursor, "2414")
    row = cursor.next("the analysis parameters")
    mode = cursor.integers(row, ["", "", "", "", "", "mode number"])[5]
    cursor.next("the creation option")
    _, frequency, _, _, viscous, hysteretic = cursor.real_rows(
        6, _WIDTH, _PER_ROW, "the analysis parameters"
    )
    eigenvalue = cursor.real_rows(6, _WIDTH, _PER_ROW, "the complex eigenvalue")[:2]
    if analysis == _NORMAL or not any(eigenvalue):
        frequency, damping, notes = _normal_mode(frequency, viscous, hysteretic)
    else:
        stated = frequency, viscous
        frequency, damping, notes = _complex_mode(*eigenvalue)
        _require_same(frequency, damping, *stated)
    frequency, damping = _held_to_ids(ids, frequency, damping, notes)
    points, values = _nodes(cursor, components, values_are_complex)
    shape = ModeShape(
        dataset, label, mode, frequency, damping, points, values=values, kind=_KINDS[analysis]
    )
    return Parsed([shape], notes)


def _definition(cursor: Cursor, dataset_type: str) -> tuple[int, int, bool]:
    """Analysis type, values a node, and whether these are complex, of record 6 (set 55) or 9 (set
    2414).
    """
    names = [
        "model type",
        "analysis type",
        "data characteristic",
        "",
        "data type",
        "values per node",
    ]
    _, analysis, characteristic, _, data_type, components = cursor.integers(
        cursor.next("the data definition"), names
    )
    if analysis not in _KINDS:
        raise SkippedDataset(
            f"its data are {_ANALYSES.get(analysis, f'of analysis type {analysis}')}, no mode shape;"
            " a mode shape has analysis type 2 (normal mode) or 3 (complex eigenvalue)"
        )
    if characteristic not in (_TRANSLATIONS, _WITH_ROTATIONS):
        raise SkippedDataset(f"its data characteristic is {characteristic}, no displacement (2, 3)")
    if data_type not in (_REAL, _COMPLEX):
        raise cursor.refuse(
            f"the data type of this set {dataset_type} is {data_type}, expected 2 (real) or 5"
            " (complex)"
        )
    if components != (3 if characteristic == _TRANSLATIONS else 6):
        raise cursor.refuse(
            f"declares {components} values a node for data characteristic {characteristic}"
        )
    return analysis, components, data_type == _COMPLEX


def _normal_mode(
    frequency: float, viscous: float, hysteretic: float
) -> tuple[float, float, list[str]]:
    """Frequency, damping ratio and notes of a normal mode; no damping stated is NaN."""
    if frequency < 0:
        raise Refusal(f"its frequency is {frequency:g} Hz")
    if viscous < 0 or viscous >= 1:
        raise Refusal(
            f"its viscous damping ratio is {viscous:g}, expected 0 to 1 (a ratio, not per cent)"
        )
    notes = []
    damping = viscous if viscous > 0 else float("nan")
    if viscous > _MUCH_DAMPED:
        notes.append(
            f"its viscous damping ratio is {viscous:g}, {100 * viscous:g} %: were per cent written?"
        )
    if viscous == 0 and 0 < hysteretic < 2:
        damping = hysteretic / 2
        notes.append(
            f"hysteretic damping ratio {hysteretic:g} taken as the viscous ratio {damping:g} at"
            " resonance"
        )
    return frequency, damping, notes


def _complex_mode(real_part: float, imaginary_part: float) -> tuple[float, float, list[str]]:
    """Undamped frequency and damping ratio of an eigenvalue λ, rad/s: |λ|/2π and -Re λ/|λ|.

    Raises:
        Refusal: it is 0.
        SkippedDataset: it is the conjugate of a mode's.
    """
    size = float(np.hypot(real_part, imaginary_part))
    if size == 0:
        raise Refusal("its eigenvalue is 0")
    if imaginary_part < 0:
        raise SkippedDataset(
            f"its eigenvalue has the imaginary part {imaginary_part:g} rad/s: it is the conjugate of"
            " a mode, which has it above 0"
        )
    notes = (
        [] if real_part <= 0 else [f"its eigenvalue has a positive real part, {real_part:g} rad/s"]
    )
    return size / (2 * np.pi), -real_part / size, notes


def _require_same(frequency: float, damping: float, stated: float, viscous: float) -> None:
    """Refuse an eigenvalue beside which a set states another frequency or damping ratio.

    Raises:
        Refusal: as it says.
    """
    if stated > 0 and abs(frequency / stated - 1) > _MODE_ROUNDED:
        raise Refusal(
            f"its eigenvalue makes {frequency:.6g} Hz, and its frequency is {stated:.6g} Hz; an"
            " eigenvalue is in rad/s"
        )
    if viscous > 0 and abs(damping - viscous) > _DAMPING_ROUNDED * viscous:
        raise Refusal(
            f"its eigenvalue makes a damping ratio of {damping:.4g}, and its viscous one is"
            f" {viscous:.4g}; which is right?"
        )


def _held_to_ids(
    ids: Sequence[str], frequency: float, damping: float, notes: list[str]
) -> tuple[float, float]:
    """Frequency and damping ratio where the ID lines do not contradict them; a damping ratio that
    these alone state is taken.

    Raises:
        Refusal: they state others, or an eigenvalue in Hz.
    """
    text = "; ".join(ids)
    if _IN_HZ.search(text):
        raise Refusal("its ID lines say that its eigenvalue is in Hz; the format has it in rad/s")
    stated = {"Hz": frequency, "%": 100 * damping}
    for unit, value in stated.items():
        matches = {float(match[1].replace(",", ".")) for match in _IN_IDS[unit].finditer(text)}
        if len(matches) != 1:
            continue
        own = matches.pop()
        if np.isnan(value):
            notes.append(f"its damping ratio is taken from its ID lines: {own:g} %")
            damping = own / 100
        elif abs(value - own) > (_MODE_ROUNDED if unit == "Hz" else _DAMPING_ROUNDED) * own:
            raise Refusal(
                f"its parameters make {value:.5g} {unit}, and its ID lines say {own:g} {unit};"
                " frequencies are in Hz, eigenvalues in rad/s, damping ratios no per cent: correct"
                " the one that is wrong"
            )
    return frequency, damping


def _nodes(
    cursor: Cursor, components: int, values_are_complex: bool
) -> tuple[IntArray, ComplexArray]:
    """Node labels, and complex values (p, components)."""
    count = components * (2 if values_are_complex else 1)
    points: list[int] = []
    numbers: list[list[float]] = []
    while cursor:
        row = cursor.next("a node")
        if not row.strip().isdigit() or (label := int(row)) == 0:
            raise cursor.refuse(
                f"{shown(row.strip())} stands where the label of a node is expected, alone in its"
                " line"
            )
        points.append(label)
        numbers.append(cursor.real_rows(count, _WIDTH, _PER_ROW, f"values of node {points[-1]}"))
    if not points:
        raise Refusal("holds no node")
    if len(set(points)) < len(points):
        raise Refusal("gives a node twice")
    flat = np.array(numbers)
    values = flat.view(np.complex128) if values_are_complex else flat.astype(np.complex128)
    return np.array(points, np.int64), values
