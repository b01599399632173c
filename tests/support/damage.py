"""Text files as they are damaged on their way, for readers that read or refuse whatever comes."""

import string
from collections.abc import Sequence

from hypothesis import strategies as st

LETTERS = st.sampled_from(list(string.digits + string.ascii_uppercase + " .,+-*$=\t\n\r'\0ß"))
COLUMNS, WIDTH = 9, 8  # of a line without commas


@st.composite
def damaged(draw: st.DrawFn, files: Sequence[str], fields: Sequence[str]) -> str:
    """One of the files with lines that are lost, doubled, swapped or of commas alone, other fields
    or letters, or cut off.
    """
    rows = draw(st.sampled_from(files)).splitlines()
    for _ in range(draw(st.integers(1, 6))):
        at = draw(st.integers(0, len(rows) - 1))
        other = draw(st.integers(0, len(rows) - 1))
        match draw(
            st.sampled_from(
                [
                    "lost",
                    "doubled",
                    "swapped",
                    "field",
                    "field",
                    "letters",
                    "letters",
                    "commas",
                    "end",
                ]
            )
        ):
            case "lost":
                rows = rows[:at] + rows[at + 1 :] or [""]
            case "doubled":
                rows.insert(at, rows[other])
            case "swapped":
                rows[at], rows[other] = rows[other], rows[at]
            case "field":
                rows[at] = _with_field(
                    rows[at], draw(st.integers(0, COLUMNS - 1)), draw(st.sampled_from(fields))
                )
            case "letters":
                column = draw(st.integers(0, len(rows[at])))
                rest = rows[at][column + draw(st.integers(0, 9)) :]
                rows[at] = rows[at][:column] + draw(st.text(LETTERS, max_size=4)) + rest
            case "commas":
                rows[at] = "," * draw(st.integers(1, 3))
            case "end":
                rows = [*rows[:at], rows[at][: draw(st.integers(0, len(rows[at])))]]
    return "\n".join(rows)


def _with_field(row: str, column: int, value: str) -> str:
    if "," in row:
        fields = row.split(",")
        fields[column % len(fields)] = value
        return ",".join(fields)
    start = WIDTH * column
    return row[:start].ljust(start) + value[:WIDTH].ljust(WIDTH) + row[start + WIDTH :]
