"""Factors that a file states of an array besides its unit: a gain, a scale, an offset.

A file that says `gain = 10` beside a force in N does not say whether its numbers have been divided
by it. So what is stated becomes a part of the unit, `N (gain = 10)`, which is no unit that can be
read: whoever sends the file states the unit of the numbers as they stand, `N` or `0.1*N`.
"""

import re
from collections.abc import Mapping
from typing import Any

_WORD = (
    r"(?:scal(?:e|ing)|gain|ampli(?:fication|fier)|(?:re)?cal(?:ibration)?|conv(?:ersion)?"
    r"|corr(?:ection)?|skalierung|verstärkung|kalibrier(?:ung)?)[ _-]*(?:fa[ck]tor)?"
    r"|fa[ck]tor|facteur|multiplier"
)
_OFFSET = r"(?:add[ _-]*)?offset|nullpunkt|zero[ _-]*(?:offset|shift)"
REFERENCE = re.compile(
    r"(?:0 *)?(?:dB|level|pegel)[ _-]*(?:ref(?:erence|erenz)?)(?:[ _-]*(?:level|value))?"
    r"|ref(?:erence|erenz)?[ _-]*(?:dB|level|value)|bezugswert|referenzwert",
    re.IGNORECASE,
)
"""Names of what decibels are referred to."""
_FACTOR = re.compile(rf"{_WORD}|{_OFFSET}|{REFERENCE.pattern}", re.IGNORECASE)
_LAST = re.compile(rf"(?:^|[_.@])(?:{_FACTOR.pattern})$", re.IGNORECASE)
_FACTORS = "factors of arrays"
_NUMBER = re.compile(r"[+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:e[+-]?\d+)?", re.IGNORECASE)
_POWER = r"10{1,9}|1e[+-]?\d+|10\s*\^\s*[+-]?\d+|10[⁺⁻]?[⁰¹²³⁴-⁹]+|0[.,]0*1|1/10+"
_IN_NAME = re.compile(
    rf"[(\[]\s*[x×*]\s*(?:{_POWER})\s*[)\]]|(?<!\S)[x×*]\s*(?!10(?!\s*\^|[\d⁺⁻⁰¹²³⁴-⁹]))(?:{_POWER})(?![\w.,])",
    re.IGNORECASE,
)
_WITH_FACTOR = re.compile(r"(.*?) ?\(([^()]*=[^()]*|[x×*][^()]*|inverted)\)")
_USED = ("@scale_factor", "@add_offset")  # of a packed dataset, see `records.hdf5`


def changes(name: str, value: str) -> bool:
    """Whether a file that states this says that numbers are multiplied or shifted.

    >>> changes("Gain", "10"), changes("Gain", "1,0"), changes("offset", "0"), changes("Scale", "log")
    (True, False, False, False)
    """
    if not _FACTOR.fullmatch(name) or not _NUMBER.fullmatch(value.strip()):
        return False
    neutral = 0.0 if re.fullmatch(_OFFSET, name, re.IGNORECASE) else 1.0
    return float(value.replace(",", ".")) != neutral


def factors_among(numbers: Mapping[str, Any]) -> dict[str, str]:
    """Those of a file's single numbers that are factors by their names, as one text of its own
    name, a line each.

    >>> import numpy as np
    >>> list(factors_among({"acc@gain": np.array(10.0), "fs": np.array(2048.0)}).values())
    ['acc@gain = 10']
    """
    stated = [
        f"{name} = {array.item():.12g}"
        for name, array in numbers.items()
        if array.size == 1 and array.dtype.kind in "fiu" and _LAST.search(name)
    ]
    return {_FACTORS: "\n".join(stated)} if stated else {}


def factor_beside(name: str, texts: Mapping[str, str], *, own: bool = False) -> str:
    """A factor that a file states of an array, in its own words; "" where it states none.

    >>> import numpy as np
    >>> factor_beside("acc.y", factors_among({"acc.gain": np.array(10)}))
    'gain = 10'
    >>> factor_beside("Re x1000 [g/N]", {}), factor_beside("Acc x12 (g)", {})
    ('x1000', '')

    Args:
        name: of the array.
        texts: texts of the file by name, and its factors, see `factors_among`.
        own: what a whole structure or file states does not count, as of its axes.
    """
    parent = name.rpartition(".")[0]
    shared = (f"{parent}." if parent else "", f"{parent}@", "@")
    starts = (f"{name}@", f"{name}_", f"{name}.", *(() if own else shared))
    parts = (line.rpartition(" = ") for line in texts.get(_FACTORS, "").split("\n"))
    stated = (
        f"{key.removeprefix(start)} = {text}"
        for key, _, text in parts
        for start in starts
        if key.startswith(start) and key not in (f"{name}{end}" for end in _USED)
        if changes(key.removeprefix(start), text)
    )
    in_name = _IN_NAME.search(name)
    return next(stated, "") or (in_name[0].strip("()[] ") if in_name else "")


def with_factor(unit: str, factor: str) -> str:
    """A unit with the factor that is stated beside it.

    >>> with_factor("N", "gain = 10"), with_factor("N", ""), with_factor("", "x1000")
    ('N (gain = 10)', 'N', '(x1000)')
    """
    return f"{unit} ({factor})".strip() if factor else unit


def split_factor(unit: str) -> tuple[str, str]:
    """A unit, and the factor that is stated beside it.

    >>> split_factor("N (gain = 10)"), split_factor("(x1000)"), split_factor("m/(s²)")
    (('N', 'gain = 10'), ('', 'x1000'), ('m/(s²)', ''))
    """
    match = _WITH_FACTOR.fullmatch(unit)
    return (match[1], match[2]) if match else (unit, "")


def question(unit: str, example: str = "g/N") -> str:
    """What to say behind a unit that has a factor; "" where it has none.

    >>> question("N (gain = 10)").partition("; ")[2]
    "state the unit of the numbers as they stand, such as 'N', '10*N', '0.1*N'"
    """
    bare, factor = split_factor(unit)
    bare, (name, _, value) = bare or example, factor.rpartition("= ")
    number = _NUMBER.fullmatch(value.strip("x×* "))
    shifts = re.fullmatch(_OFFSET, name.strip(), re.IGNORECASE)
    times = 1.0 if shifts else float(number[0].replace(",", ".")) if number else 0.1
    ways = [bare, *(f"{each:.6g}*{bare}" for each in (times, 1 / (times or 1)) if each != 1)]
    return factor and (
        ": whether the numbers have this already is not known; state the unit of the numbers as they"
        f" stand, such as {', '.join(map(repr, ways))}"
    )
