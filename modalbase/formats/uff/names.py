"""Degrees of freedom of a set 58 that stand in the names of its record 6 alone, where its numbers
are 0.
"""

from dataclasses import replace

from modalbase.formats.dof_names import dof_in_name
from modalbase.formats.uff.function import RawFunction
from modalbase.formats.uff.text import Refusal

_RECORD_6 = 5
_AXES = " XYZ"


def placed(raw: RawFunction) -> tuple[RawFunction, list[str]]:
    """The function with points and directions that its names say where its numbers say none, and
    notes on them.

    Where number and name both say one, the number counts.

    Raises:
        Refusal: a number of record 6 contradicts its name, and the other number is 0, so that
            neither alone is a place.
    """
    notes: list[str] = []
    dofs: list[int] = []
    for side, name, stated in zip(
        ("response", "reference"), raw.names, (raw.dofs[:2], raw.dofs[2:]), strict=True
    ):
        point, direction = stated
        named = dof_in_name(name)
        if named is None or stated == named:
            dofs += stated
            continue
        statement = (
            f"its {side} is {point} {_shown(direction)} by the numbers of record 6, and {name!r} by"
            " its name"
        )
        if point and direction:
            notes.append(f"{statement}; the numbers are used")
            dofs += stated
            continue
        if point not in (0, named[0]) or direction not in (0, named[1]):
            raise Refusal(f"{statement}; correct the one that is wrong", _RECORD_6)
        notes.append(
            f"its {side} is {named[0]} {_shown(named[1])} by its name {name!r}, as record 6 has no"
            " number for it"
        )
        dofs += named
    response, along, reference, reference_along = dofs
    moved = replace(
        raw,
        response_point=response,
        response_direction=along,
        reference_point=reference,
        reference_direction=reference_along,
    )
    return moved, notes


def unplaced(raw: RawFunction) -> list[str]:
    """Notes on what an FRF lacks: such ones are stored, and left out of every computation."""
    return [
        f"its {side} has no {' and no '.join(lacks)}: record 6 has 0, and its name {name!r} is none"
        " such as 12Z-; it is left out of computations until the file states it"
        for side, name, stated in zip(
            ("response", "reference"), raw.names, (raw.dofs[:2], raw.dofs[2:]), strict=True
        )
        if (
            lacks := [
                what
                for what, number in zip(("point", "direction"), stated, strict=True)
                if number == 0
            ]
        )
    ]


def _shown(direction: int) -> str:
    """Such as -Z; 0 where there is none."""
    if direction == 0:
        return "0"
    axis = (abs(direction) - 1) % 3 + 1
    return f"{'-' if direction < 0 else '+'}{'R' if abs(direction) > 3 else ''}{_AXES[axis]}"
