"""The three-part failure code of ASTM D3039: type, area, location; LGM is lateral, in the gauge length, middle."""

from __future__ import annotations

import re

from fecore.errors import InputError

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

AT_GRIP = frozenset("IAW")
"""Areas that put the way in which force enters the specimen in doubt."""

_CODE = re.compile(r"([A-Z])(?:\(([A-Z]+)\))?([A-Z])([A-Z])(?:\((\d)\))?")


def check_failure_code(code: str) -> str:
    """The code in capitals.

    The standard's spellings `M(xyz)` for the types of a multi-mode failure and `AGM(1)`, `AGM(2)` for its variants are
    accepted.

    Raises:
        InputError: it is not a code of the standard; says which of the three parts is wrong and what it may be.
    """
    kind, modes, area, location = _parts(code)
    if modes is not None and (kind != "M" or not set(modes) <= TYPE.keys() - {"M"}):
        raise InputError("failure_code", f"{code!r}: only a multi-mode failure lists types, such as M(DL)GM")
    for part, letter, known in (("type", kind, TYPE), ("area", area, AREA), ("location", location, LOCATION)):
        if letter not in known:
            raise InputError("failure_code", f"{code!r}: {letter} is no {part}, expected one of {', '.join(known)}")
    return code.strip().upper()


def failed_at_grip(code: str) -> bool:
    """Whether a valid code says that the specimen failed in, at or next to a grip or tab."""
    return _parts(code)[2] in AT_GRIP


def _parts(code: str) -> tuple[str, str | None, str, str]:
    match = _CODE.fullmatch(code.strip().upper())
    if match is None:
        raise InputError("failure_code", f"{code!r} is not a three-part code (type, area, location) such as LGM")
    kind, modes, area, location, _ = match.groups()
    return kind, modes, area, location
