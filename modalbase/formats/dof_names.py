"""Degrees of freedom in names: point and signed direction, as programs write them in one text."""

import re

_AXES = ("x", "y", "z", "rx", "ry", "rz")
_NAME = re.compile(
    r"(?:p|pt|pnt|point|node|grid|dof)?[ .:_#-]*(\d{1,10})([ .:_]*)([+-]?)(r?[xyz])([+-]?)",
    re.IGNORECASE,
)


def dof_in_name(name: str) -> tuple[int, int] | None:
    """Point and direction (±1 to ±3 along x, y, z, ±4 to ±6 about them) in a name; None where it
    says them not clearly.

    A sign stands before the axis or behind it. A hyphen straight between number and axis may be
    either a sign or a hyphen, and says nothing; so do names with other words, which may be those of
    a component.

    >>> dof_in_name("1Z-"), dof_in_name(".56.Z"), dof_in_name("Point56:+Z"), dof_in_name("P12 -X"), dof_in_name("12-X")
    ((1, -3), (56, 3), (56, 3), (12, -1), None)
    """
    match = _NAME.fullmatch(name.strip(" .:_"))
    if match is None or int(match[1]) == 0:
        return None
    gap, before, behind = match[2], match[3], match[5]
    if (before and behind) or (before == "-" and not gap):
        return None
    axis = 1 + _AXES.index(match[4].lower())
    return int(match[1]), -axis if "-" in (before, behind) else axis
