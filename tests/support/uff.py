"""What the UFF tests share: reading to the end, and datasets made line by line as other programs
write them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from modalbase.formats.uff import DatasetReport, Limits, read_file


@dataclass
class Reading:
    contents: list[object] = field(default_factory=list)
    reports: list[DatasetReport] = field(default_factory=list)

    def of(self, kind: type) -> list:
        return [content for content in self.contents if isinstance(content, kind)]

    @property
    def notes(self) -> str:
        return "; ".join(note for report in self.reports for note in report.notes)

    @property
    def outcomes(self) -> list[str]:
        return [report.outcome for report in self.reports]

    @property
    def reasons(self) -> str:
        return "; ".join(report.reason or "" for report in self.reports)


Read = Callable[..., Reading]
"""Reads bytes as a file: the fixture `read`."""


def load(path: Path, limits: Limits | None = None) -> Reading:
    reading = Reading()
    for item in read_file(path, limits or Limits()):
        (reading.reports if isinstance(item, DatasetReport) else reading.contents).append(item)
    return reading


def dataset(kind: str, *lines: str | bytes) -> bytes:
    """A dataset between its delimiters, line by line."""
    raw = [line if isinstance(line, bytes) else line.encode() for line in (f"{kind:>6}", *lines)]
    return b"    -1\n" + b"".join(line + b"\n" for line in raw) + b"    -1\n"


def axis(
    kind: int, unit: str | bytes = "NONE", exponents: Sequence[int] = (0, 0, 0), name: str = "NONE"
) -> bytes:
    """Records 8 to 11."""
    raw = unit if isinstance(unit, bytes) else unit.encode()
    return f"{kind:10d}{''.join(f'{e:5d}' for e in exponents)} {name:<20} ".encode() + raw.ljust(20)


def header_58(
    *,
    kind: int = 6,
    points: int = 2,
    even: int = 1,
    start: str = "0.00000e+00",
    step: str = "1.00000e+00",
    function: int = 4,
    response: tuple[int, int] = (7, 3),
    reference: tuple[int, int] = (1, -3),
    abscissa: bytes | None = None,
    ordinate: bytes | None = None,
    denominator: bytes | None = None,
    first: str | bytes = "FRF",
) -> list[str | bytes]:
    """The eleven header lines of a set 58: an accelerance in SI unless stated otherwise."""
    return [
        first,
        "NONE",
        "21-Nov-15 09:00:00",
        "NONE",
        "NONE",
        (
            f"{function:5d}{0:10d}{0:5d}{0:10d} {'NONE':<10}{response[0]:10d}{response[1]:4d}"
            f" {'NONE':<10}{reference[0]:10d}{reference[1]:4d}"
        ),
        f"{kind:10d}{points:10d}{even:10d}{start:>13}{step:>13}{'0.00000e+00':>13}",
        abscissa or axis(18, "Hz"),
        ordinate or axis(12, "m/s^2", (1, 0, 0)),
        denominator or axis(13, "N", (0, 1, 0)),
        axis(0),
    ]


def set_58(*rows: str, **header: object) -> bytes:
    """A set 58 with the given rows of data."""
    return dataset("58", *header_58(**header), *rows)


def set_164(length: float = 1.0, force: float = 1.0, code: int = 9) -> bytes:
    """Units."""
    factors = "".join(f"{x:25.16e}".replace("e", "D") for x in (length, force, 1.0))
    return dataset("164", f"{code:10d}{'USER_DEFINED':<20}{2:10d}", factors, f"{273.15:25.16e}")


def rows(values: np.ndarray) -> list[str]:
    """Lines of 4E20.12."""
    flat = np.ravel(
        np.column_stack((values.real, values.imag)) if np.iscomplexobj(values) else values
    )
    return ["".join(f"{v:20.12e}" for v in flat[i : i + 4]) for i in range(0, flat.size, 4)]


def function(number: int, values: np.ndarray, **header: object) -> bytes:
    """A set 58 of a type of function, with doubles as text."""
    kind = 6 if np.iscomplexobj(values) else 4
    return set_58(*rows(values), kind=kind, points=values.size, function=number, **header)


PLAIN = "   1.00000000000e+00   2.00000000000e+00   3.00000000000e+00   4.00000000000e+00"
FRF = set_58(PLAIN)
"""Of 1 + 2i and 3 + 4i."""

POINT = "         1         0         0         1  1.00000E+00  2.00000E+00  3.00000E+00"
POINTS = dataset("15", POINT)
