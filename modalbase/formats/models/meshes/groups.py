"""Groups of a Universal File: 2435, 2452, 2467 and 2477, and the older 2417, 2429, 2430 and 2432.

A group is a line of whole numbers, of which the last counts its members, a line with its name, and
members: type (7 a node, 8 an element) and number, with two more numbers in the newer sets. (SDRL,
Universal File Datasets; Siemens, I-deas.)
"""

from collections.abc import Iterator
from typing import NamedTuple

from modalbase.formats.uff.text import Cursor, decoded

_WIDTHS = {
    **dict.fromkeys(("2435", "2452", "2467", "2477"), 4),
    **dict.fromkeys(("2417", "2429", "2430", "2432"), 2),
}
"""Numbers of a member, by type of the dataset."""

GROUPS = frozenset(_WIDTHS)
_NODE, _ELEMENT = 7, 8
_FIELDS = 8  # of a line


class RawGroup(NamedTuple):
    """A group with the user's numbers."""

    number: int
    name: str  # as the file has it
    nodes: list[int]
    elements: list[int]
    line: int  # of the dataset, from 1 for the one after the type line


def read_groups(kind: str, body: bytes) -> Iterator[RawGroup]:
    """The groups of a dataset; members of other types, such as geometry, are left out.

    Raises:
        Refusal: a line is cut or no whole numbers.
    """
    cursor, width = Cursor(body), _WIDTHS[kind]
    while cursor:
        row = cursor.next("a group").rstrip()
        line = cursor.line
        count = -(-len(row) // 10)
        if not 2 <= count <= _FIELDS:
            raise cursor.refuse(
                f"holds {count} numbers, expected a group's: its number first, how many it has last"
            )
        number, *_, members = cursor.integers(
            row, ["group"] + [""] * (count - 2) + ["number of members"]
        )
        name = decoded(cursor.next("the group's name")).strip()
        by_type: dict[int, list[int]] = {_NODE: [], _ELEMENT: []}
        left = members
        while left > 0:
            row = cursor.next(f"members of the group {name}")
            here = min(left, _FIELDS // width)
            values = cursor.integers(row, (["type", "number"] + [""] * (width - 2)) * here)
            for type_, own in zip(values[::width], values[1::width], strict=True):
                by_type.get(type_, []).append(own)
            left -= here
        yield RawGroup(number, name, by_type[_NODE], by_type[_ELEMENT], line)
