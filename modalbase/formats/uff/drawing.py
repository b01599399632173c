"""Sets 82 (trace lines), 2412 (elements) and 151 (header): what a picture of the specimen and its provenance need."""

from __future__ import annotations

from modalbase.formats.uff.content import Element, FileHeader, TraceLine
from modalbase.formats.uff.geometry import Parsed
from modalbase.formats.uff.text import Cursor, Refusal, decoded, shown

BEAMS = (11, 21, 22, 23, 24)
_PER_ROW = 8


def read_82(body: bytes, dataset: int) -> Parsed:
    """Set 82: `count` grid points; rows may be filled up with zeros.

    Some programs count the strokes or leave the pen's lifts out of the count: then the set holds more entries than it declares,
    each of them a label or 0. All are kept, for they are the whole line.
    """
    cursor = Cursor(body)
    number, count, _ = cursor.integers(cursor.next("the trace line"), ["trace line", "number of points", ""])
    label = decoded(cursor.next("the ID line"))
    points: list[int] = []
    while cursor:
        for token in cursor.next("the points").split():
            if not token.isdigit():
                raise cursor.refuse(f"a point is {shown(token)}, expected a label or 0")
            points.append(int(token))
    held = len(points) - next((i for i, point in enumerate(reversed(points)) if point), len(points))
    if count < 1 or len(points) < count:
        raise Refusal(f"declares {count} points and holds {len(points)}", 0)
    if held > count:
        note = f"declares {count} points and holds {held}; all {held} were kept"
        return Parsed([TraceLine(dataset, number, label, tuple(points[:held]))], [note])
    claims: dict[str, object] = {"trace_num": number, "n_nodes": count, "nodes": points}
    return Parsed([TraceLine(dataset, number, label, tuple(points[:count]))], [], claims)


def read_2412(body: bytes) -> Parsed:
    """Set 2412: each element with the points it joins; beams have one line more."""
    cursor = Cursor(body)
    elements: list[Element] = []
    while cursor:
        row = cursor.next("an element")
        names = ["element", "descriptor", "", "", "", "number of points"]
        number, descriptor, properties, _, _, count = cursor.integers(row, names)
        line = cursor.line
        if not 1 <= count <= 1000:
            raise cursor.refuse(f"element {number} declares {count} points")
        if descriptor in BEAMS:
            cursor.integers(cursor.next("the beam's orientation"), ["", "", ""])
        points: list[int] = []
        while len(points) < count:
            row = cursor.next(f"points of element {number}")
            take = min(_PER_ROW, count - len(points))
            points += cursor.integers(row, ["point"] * take)
            if row[take * 10 :].strip():
                raise cursor.refuse(f"element {number} holds more than the {count} points it declares")
        elements.append(Element(number, descriptor, tuple(points), properties, line))
    if not elements:
        raise Refusal("holds no element")
    return Parsed(elements)


def read_151(body: bytes, dataset: int) -> Parsed:
    """Set 151: seven lines of names and dates."""
    cursor = Cursor(body + b"-")  # a last character keeps header lines that are blank
    lines = [decoded(cursor.next("the header lines")) for _ in range(7)]
    if len(cursor.rows) > 8:
        raise Refusal(f"holds {len(cursor.rows) - 1} lines, expected 7", 7)
    claims: dict[str, object] = {"model_name": lines[0], "description": lines[1]}
    return Parsed([FileHeader(dataset, lines[0], lines[1], lines[5], lines[6])], [], claims)
