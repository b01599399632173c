"""Sets of points, coordinate systems and lines: 15 and 2411, 18 and 2420, 82 and 2412; and the
header, 151.

Everything ends in the file's global system. A grid point names two systems. The first is the one
that its coordinates are given in (set 15), or were displayed in when the file was written (set
2411, whose coordinates are always in the part's global system). The second is the one that its
directions are measured along. System 0 is global. Where a system is not defined in the file nothing
is guessed, except that label 1 stands for the global system in files that define none, as the
programs that write it mean it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from modalbase.formats.coordinates import Kind, cartesian
from modalbase.formats.types import FloatArray
from modalbase.formats.uff.content import (
    Content,
    CoordinateSystem,
    Element,
    FileHeader,
    GridPoint,
    TraceLine,
    Units,
)
from modalbase.formats.uff.text import Cursor, Refusal, decoded, real, shown

_KINDS: dict[int, Kind] = {0: "cartesian", 1: "cylindrical", 2: "spherical"}
_SKEW_DEG = 0.5
_ORTHONORMAL = 1e-3


@dataclass
class Parsed:
    """What a dataset came to: its contents, and notes."""

    contents: Sequence[Content]
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class PointRow:
    """A grid point as the file states it."""

    label: int
    definition_system: int
    displacement_system: int
    coordinates: tuple[float, float, float]


@dataclass
class Geometry:
    """Coordinate systems of the file, and the grid points whose directions are not along the global
    axes.
    """

    systems: dict[int, CoordinateSystem] = field(default_factory=dict)
    displacement: dict[int, int] = field(default_factory=dict)
    systems_lost: bool = False
    points_lost: bool = False

    def system(self, label: int, what: str, notes: list[str]) -> CoordinateSystem | None:
        """The system of a label; None for the global one.

        Raises:
            Refusal: the file does not define it.
        """
        if label == 0:
            return None
        if label in self.systems:
            return self.systems[label]
        if label == 1 and not self.systems and not self.systems_lost:
            note = "coordinate system 1 is not defined in the file; taken as the global system"
            if note not in notes:
                notes.append(note)
            return None
        raise Refusal(f"{what} in coordinate system {label}, which the file does not define")

    def global_direction(self, point: int, direction: int, name: str, notes: list[str]) -> int:
        """Signed direction along the global axes of a direction at a grid point.

        Raises:
            Refusal: the point's own axes are not along the global ones.
        """
        if (
            self.points_lost
            and (note := "grid points were refused; directions taken as along global axes")
            not in notes
        ):
            notes.append(note)
        if direction == 0 or point not in self.displacement:
            return direction
        label = self.displacement[point]
        system = self.system(label, f"the directions of grid point {point} are", notes)
        if system is None:
            return direction
        if system.kind != "cartesian":
            raise Refusal(
                f"the {name} at grid point {point} is along axes of the {system.kind} system"
                f" {label}; export directions along the global axes"
            )
        axis = (abs(direction) - 1) % 3
        along = np.sign(direction) * system.axes[axis]
        nearest = int(np.argmax(np.abs(along)))
        skew = float(np.degrees(np.arccos(min(1.0, abs(float(along[nearest]))))))
        if skew > _SKEW_DEG:
            raise Refusal(
                f"the {name} at grid point {point} is along an axis of coordinate system {label},"
                f" {skew:.1f}° off the nearest global axis; only directions along the global axes"
                " are stored: export them so"
            )
        turned = int(np.sign(along[nearest])) * (nearest + 1 + (3 if abs(direction) > 3 else 0))
        if turned != direction:
            notes.append(
                f"{name} direction {direction:+d} of coordinate system {label} is {turned:+d} of the"
                " global system"
            )
        return turned


def rows_15(body: bytes) -> list[PointRow]:
    """Set 15: FORMAT(4I10,1P3E13.5), one line a point."""
    cursor = Cursor(body)
    points = []
    while cursor:
        row = cursor.next("a grid point")
        labels = cursor.integers(
            row, ["grid point", "definition system", "displacement system", ""]
        )
        x, y, z = cursor.reals(row, 3, 13, f"coordinates of grid point {labels[0]}", start=40)
        points.append(_point(cursor, labels, (x, y, z)))
    return points


def rows_2411(body: bytes) -> list[PointRow]:
    """Set 2411: FORMAT(4I10) and FORMAT(1P3D25.16), two lines a point; coordinates in the part's
    system.
    """
    cursor = Cursor(body)
    points = []
    while cursor:
        row = cursor.next("a grid point")
        label, _, displacement, _ = cursor.integers(
            row, ["grid point", "export system", "displacement system", ""]
        )
        if row[40:].strip():
            raise cursor.refuse("more than four numbers in the first line of a grid point")
        what = f"coordinates of grid point {label}"
        row = cursor.next(what)
        tokens = row.split()
        # Labels of two points look alike to a count of values; coordinates carry a decimal point.
        if len(tokens) == 3 and all(b"." in token for token in tokens):
            try:
                x, y, z = (real(token) for token in tokens)
            except ValueError as error:
                raise cursor.refuse(f"{what}: {error}") from None
        else:
            x, y, z = cursor.reals(row, 3, 25, what)
        points.append(_point(cursor, [label, 0, displacement], (x, y, z)))
    return points


def _point(cursor: Cursor, labels: list[int], coordinates: tuple[float, float, float]) -> PointRow:
    """A point whose labels are in their ranges."""
    if not 0 < labels[0] < 2**31:
        raise cursor.refuse(f"the grid point label is {labels[0]}, expected a positive number")
    if labels[1] < 0 or labels[2] < 0:
        raise cursor.refuse(
            f"grid point {labels[0]} names the coordinate systems {labels[1]} and {labels[2]}"
        )
    return PointRow(labels[0], labels[1], labels[2], coordinates)


def grid_points(
    rows: list[PointRow], units: Units | None, geometry: Geometry, known: dict[int, GridPoint]
) -> Parsed:
    """Grid points in metres and global coordinates.

    Args:
        rows: the dataset's points.
        units: units of the file, None for SI.
        geometry: coordinate systems of the file.
        known: points of earlier datasets, extended by these.

    Raises:
        Refusal: there are none, or a label is given twice with other coordinates, or its system is
            not defined.
    """
    if not rows:
        raise Refusal("holds no grid point")
    notes: list[str] = []
    scale = 1.0 if units is None else 1 / units.length
    if scale != 1.0:
        notes.append(f"coordinates multiplied by {scale:.9g} to metres")
    points: dict[int, GridPoint] = {}
    for row in rows:
        xyz = _global(row, geometry, scale, notes)
        point = GridPoint(row.label, xyz)
        earlier = points.get(row.label) or known.get(row.label)
        if earlier is not None and earlier != point:
            raise Refusal(
                f"grid point {row.label} is given twice, at {earlier.xyz_m} and at {xyz} m"
            )
        points[row.label] = point
    moved = sorted(
        {row.definition_system for row in rows if _is_local(row.definition_system, geometry)}
    )
    if moved:
        notes.append(
            f"coordinates in systems {', '.join(map(str, moved))} brought to the global system"
        )
    if len(points) < len(rows):
        notes.append(
            f"{len(rows) - len(points)} grid points are given twice with the same coordinates"
        )
    known.update(points)
    return Parsed(tuple(points.values()), notes)


def _is_local(label: int, geometry: Geometry) -> bool:
    """Whether a system is another than the global one."""
    system = geometry.systems.get(label)
    if system is None:
        return False
    return (
        system.kind != "cartesian"
        or bool(system.origin_m.any())
        or not np.allclose(system.axes, np.eye(3))
    )


def _global(
    row: PointRow, geometry: Geometry, scale: float, notes: list[str]
) -> tuple[float, float, float]:
    """Coordinates in metres in the global system."""
    system = geometry.system(row.definition_system, f"grid point {row.label} is given", notes)
    if system is None:
        a, b, c = row.coordinates
        return a * scale, b * scale, c * scale
    (local,) = cartesian(system.kind, np.array([row.coordinates]))
    x, y, z = (local * scale @ system.axes + system.origin_m).tolist()
    return x, y, z


def read_18(
    body: bytes, dataset: int, units: Units | None, systems: dict[int, CoordinateSystem]
) -> Parsed:
    """Set 18: origin, a point on +x and a point in the +xz plane of each system."""
    cursor = Cursor(body)
    defined: list[CoordinateSystem] = []
    while cursor:
        row = cursor.next("a coordinate system")
        label, kind, reference, _, method = cursor.integers(
            row, ["label", "type", "reference system", "", "method"]
        )
        name = decoded(cursor.next("the name of a coordinate system"))
        numbers = cursor.real_rows(9, 13, 6, f"coordinate system {label}")
        if method != 1 or kind not in _KINDS:
            raise cursor.refuse(
                f"coordinate system {label} has type {kind} and method {method}, expected 0-2 and 1"
            )
        origin, on_x, on_xz = np.array(numbers).reshape(3, 3)
        if reference:
            base = next((s for s in defined if s.label == reference), systems.get(reference))
            if base is None or base.kind != "cartesian":
                raise cursor.refuse(
                    f"coordinate system {label} refers to {reference}, which is no Cartesian one"
                    " before it"
                )
            scale = 1.0 if units is None else units.length
            origin, on_x, on_xz = (
                p @ base.axes + base.origin_m * scale for p in (origin, on_x, on_xz)
            )
        z_side = np.cross(on_x - origin, on_xz - origin)
        if not z_side.any():
            raise cursor.refuse(f"the three points of coordinate system {label} lie on one line")
        x = (on_x - origin) / np.linalg.norm(on_x - origin)
        y = -z_side / np.linalg.norm(z_side)
        axes = np.array([x, y, np.cross(x, y)])
        defined.append(
            CoordinateSystem(dataset, label, name, _KINDS[kind], _metres(origin, units), axes)
        )
    return _systems(defined)


def read_2420(body: bytes, dataset: int, units: Units | None) -> Parsed:
    """Set 2420: rows 1 to 3 of a system's matrix are its axes, row 4 its origin, in the global
    system.
    """
    cursor = Cursor(body)
    cursor.integers(cursor.next("the part number"), ["part number"])
    cursor.next("the part name")
    systems: list[CoordinateSystem] = []
    while cursor:
        label, kind, _ = cursor.integers(cursor.next("a coordinate system"), ["label", "type", ""])
        name = decoded(cursor.next("the name of a coordinate system"))
        matrix = np.array(
            [cursor.reals(cursor.next("its matrix"), 3, 25, "its matrix") for _ in range(4)]
        )
        if kind not in _KINDS:
            raise cursor.refuse(f"coordinate system {label} has type {kind}, expected 0, 1 or 2")
        axes = matrix[:3]
        if np.abs(axes @ axes.T - np.eye(3)).max() > _ORTHONORMAL:
            raise cursor.refuse(f"the axes of coordinate system {label} are not orthonormal")
        systems.append(
            CoordinateSystem(dataset, label, name, _KINDS[kind], _metres(matrix[3], units), axes)
        )
    return _systems(systems)


def _metres(origin: FloatArray, units: Units | None) -> FloatArray:
    """The origin in metres."""
    return origin if units is None else origin / units.length


def _systems(systems: list[CoordinateSystem]) -> Parsed:
    """The systems of a dataset, each label once."""
    labels = [system.label for system in systems]
    if not systems or len(set(labels)) < len(labels):
        raise Refusal(
            "holds no coordinate system" if not systems else "defines a coordinate system twice"
        )
    return Parsed(systems)


BEAMS = (11, 21, 22, 23, 24)
"""Rods and beams: 2 nodes or, whatever the descriptor, 3 of a quadratic mesh's edge."""

_PER_ROW = 8


def read_82(body: bytes, dataset: int) -> Parsed:
    """Set 82: `count` grid points; rows may be filled up with zeros.

    Some programs count the strokes or leave the pen's lifts out of the count: then the set holds
    more entries than it declares, each of them a label or 0. All are kept, for they are the whole
    line.
    """
    cursor = Cursor(body)
    number, count, _ = cursor.integers(
        cursor.next("the trace line"), ["trace line", "number of points", ""]
    )
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
    return Parsed([TraceLine(dataset, number, label, tuple(points[:count]))])


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
                raise cursor.refuse(
                    f"element {number} holds more than the {count} points it declares"
                )
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
    return Parsed([FileHeader(dataset, lines[0], lines[1], lines[5], lines[6])])
