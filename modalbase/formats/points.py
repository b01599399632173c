"""Tables of grid points: labels, and coordinates with their unit in the heading (`x_mm`, `x (m)`)
or in a line below it.
"""

import itertools
from collections.abc import Iterator
from pathlib import Path

from modalbase.formats.errors import FormatError
from modalbase.formats.tables import is_number, read_rows
from modalbase.formats.units import factor_of, unit_in_name

AXES = ("x", "y", "z")
HEADER = "label,x_mm,y_mm,z_mm, or with _m for metres; z may be left out"
_LABELS = ("label", "point")


def read_points(source: Path | bytes) -> Iterator[tuple[int, dict[str, str]]]:
    r"""Lines of a table of points, and the texts of their members `label`, `x_m`, `y_m` and `z_m`,
    in metres.

    >>> list(read_points(b"point;x_mm;y_m\n7;112,5;-0,02\n"))
    [(2, {'label': '7', 'x_m': '0.1125', 'y_m': '-0.02', 'z_m': '0'})]

    Args:
        source: the file.

    Raises:
        FormatError: it is no such table; names the line. A cell that is no number stays as it is.
    """
    header, rows = read_rows(source, {"label", "x", "y"}, _name, HEADER)
    names = [_name(cell) for cell in header]
    units = [unit_in_name(cell, "length")[1] for cell in header]
    first = next(rows, None)
    if (
        first is not None
        and not any(map(is_number, first[1]))
        and any(factor_of("length", c) for c in first[1])
    ):
        units = [
            own or cell for own, cell in zip(units, [*first[1], *[""] * len(units)], strict=False)
        ]
        first = None
    factors = [
        1.0 if name == "label" else factor_of("length", unit)
        for name, unit in zip(names, units, strict=True)
    ]
    if "" in names or len(set(names)) < len(names) or None in factors:
        raise FormatError("the header", f"is {','.join(header)[:200]!r}, expected {HEADER}")
    for line, cells in itertools.chain([first] if first else [], rows):
        if len(cells) != len(header):
            raise FormatError(
                f"line {line}", f"has {len(cells)} cells, the header has {len(header)}"
            )
        point = {"z_m": "0"}
        for name, factor, cell in zip(names, factors, cells, strict=True):
            scaled = factor not in (None, 1.0) and is_number(cell)
            point["label" if name == "label" else f"{name}_m"] = (
                f"{float(cell) * (factor or 1.0):.15g}" if scaled else cell
            )
        yield line, {name: point[name] for name in ("label", "x_m", "y_m", "z_m")}


def _name(cell: str) -> str:
    bare = unit_in_name(cell, "length")[0].strip().lower()
    return "label" if bare in _LABELS else bare if bare in AXES else ""
