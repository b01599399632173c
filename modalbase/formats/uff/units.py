"""Set 164: the units of a UFF file, and the way from them to SI."""

from modalbase.formats.constants import FOOT, INCH, POUND_FORCE, STANDARD_GRAVITY
from modalbase.formats.uff.content import Units
from modalbase.formats.uff.text import Cursor, Refusal, decoded


def read_164(body: bytes, dataset: int) -> tuple[Units, list[str]]:
    """Set 164: units code, description, and the factors by which file values are divided for SI.

    Raises:
        Refusal: a factor is missing, not a number, or absurd.
    """
    cursor = Cursor(body)
    row = cursor.next("the units code")
    (code,) = cursor.integers(row, ["units code"])
    description = decoded(row[10:30])
    length, force, temperature = cursor.reals(
        cursor.next("the unit factors"), 3, 25, "unit factors"
    )
    (offset,) = cursor.reals(cursor.next("the temperature offset"), 1, 25, "temperature offset")
    if cursor:
        raise Refusal("holds more than the three lines of the format", cursor.line)
    for name, factor in (("length", length), ("force", force), ("temperature", temperature)):
        if not 1e-12 <= factor <= 1e12:
            raise Refusal(
                f"the {name} factor is {factor:g}, expected a positive conversion factor", 1
            )
    notes = []
    known = _FACTORS_OF_CODE.get(code)
    if known is not None and (
        abs(length / known[0] - 1) > 1e-3 or abs(force / known[1] - 1) > 1e-3
    ):
        notes.append(
            f"units code {code} stands for length and force factors {known[0]:g} and {known[1]:g},"
            f" but the set states {length:g} and {force:g}; the stated factors are used"
        )
    return (
        Units(dataset, code, description, length, force, temperature, temperature_offset=offset),
        notes,
    )


_FACTORS_OF_CODE = {
    1: (1.0, 1.0),
    2: (1 / FOOT, 1 / POUND_FORCE),
    3: (1.0, 1 / STANDARD_GRAVITY),
    4: (1 / FOOT, 1 / 0.138254954376),
    5: (1e3, 1e3),
    6: (1e2, 1e2),
    7: (1 / INCH, 1 / POUND_FORCE),
    8: (1e3, 1 / STANDARD_GRAVITY),
    10: (1e3, 1.0),
}
