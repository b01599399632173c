"""The three-part failure code of ASTM D3039: type, area, location; such as LGM, lateral in the gauge length, middle."""

from __future__ import annotations

import re

TYPE = {
    "A": "angled",
    "D": "edge delamination",
    "G": "grip or tab",
    "L": "lateral",
    "M": "multi-mode",
    "S": "long splitting",
    "X": "explosive",
    "O": "other",
}
AREA = {
    "I": "inside grip or tab",
    "A": "at grip or tab",
    "W": "less than one width from grip or tab",
    "G": "gauge length",
    "M": "multiple areas",
    "V": "various",
    "U": "unknown",
}
LOCATION = {
    "B": "bottom",
    "T": "top",
    "L": "left",
    "R": "right",
    "M": "middle",
    "V": "various",
    "U": "unknown",
}

_CODE = re.compile(r"([A-Z])(?:\(([A-Z]+)\))?([A-Z])([A-Z])(?:\((\d)\))?")


def check_failure_code(code: str) -> str:
    """The code in capitals.

    The standard's own spellings `M(xyz)` for the types that make up a multi-mode failure and `AGM(1)`, `AGM(2)` for its
    variants are accepted.

    Raises:
        ValueError: it is not a code of the standard; says which of the three parts is wrong and what it may be.
    """
    match = _CODE.fullmatch(code.strip().upper())
    if match is None:
        raise ValueError(f"{code!r} is not a three-part code (type, area, location) such as LGM")
    kind, modes, area, location, _ = match.groups()
    if modes is not None and (kind != "M" or not set(modes) <= TYPE.keys() - {"M"}):
        raise ValueError(f"{code!r}: only a multi-mode failure lists types, such as M(DL)GM")
    for part, letter, known in (("type", kind, TYPE), ("area", area, AREA), ("location", location, LOCATION)):
        if letter not in known:
            raise ValueError(f"{code!r}: {letter} is no {part}, expected one of {', '.join(known)}")
    return match.group(0)
