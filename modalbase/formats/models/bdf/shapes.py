"""Cross sections by their dimensions, as PBARL and PBEAML name them.

A section lies in the plane of the element's y (axis 1, drawn upwards) and z (axis 2). Those of rectangles are exact in
area and moments; torsion is Σ b t³/3 of thin open walls, Bredt's of closed ones, and St-Venant's of the bar. Shear factors
are those of Timoshenko for solid sections, and of thin ones the share of the walls along the force.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import pi

Dimensions = Sequence[float]


@dataclass(frozen=True)
class Rectangle:
    """From y0 to y1 and z0 to z1."""

    y0: float
    y1: float
    z0: float
    z1: float

    @property
    def sides(self) -> tuple[float, float]:
        """Its longer side and its shorter."""
        a, b = self.y1 - self.y0, self.z1 - self.z0
        return (a, b) if a >= b else (b, a)

    def overlaps(self, other: Rectangle) -> bool:
        """Whether both share more than an edge."""
        margin = 1e-9 * self.sides[0]
        apart = self.y1 - margin <= other.y0 or other.y1 - margin <= self.y0
        return not (apart or self.z1 - margin <= other.z0 or other.z1 - margin <= self.z0)


@dataclass(frozen=True)
class Shape:
    """A section.

    Attributes:
        area: of it.
        inertia: ∫y², ∫z², ∫yz about its centroid, which are Nastran's I1, I2, I12.
        torsion: J.
        shear: K1 and K2, along y and z.
        centroid: y and z from the shear centre.
    """

    area: float
    inertia: tuple[float, float, float]
    torsion: float
    shear: tuple[float, float]
    centroid: tuple[float, float] = (0.0, 0.0)


def _of(parts: Sequence[Rectangle], torsion: float | None = None) -> Shape:
    """A section of thin rectangles that do not overlap, drawn from where its shear centre is to be put.

    Raises:
        ValueError: a rectangle has no extent, or two overlap.
    """
    if any(part.y1 <= part.y0 or part.z1 <= part.z0 for part in parts):
        raise ValueError("a wall without extent")
    if any(one.overlaps(other) for one, other in combinations(parts, 2)):
        raise ValueError("walls that overlap")
    areas = [(part.y1 - part.y0) * (part.z1 - part.z0) for part in parts]
    A = sum(areas)
    y = sum(a * (part.y0 + part.y1) / 2 for a, part in zip(areas, parts, strict=True)) / A
    z = sum(a * (part.z0 + part.z1) / 2 for a, part in zip(areas, parts, strict=True)) / A
    yy = zz = yz = along_y = along_z = 0.0
    for a, part in zip(areas, parts, strict=True):
        height, width = part.y1 - part.y0, part.z1 - part.z0
        dy, dz = (part.y0 + part.y1) / 2 - y, (part.z0 + part.z1) / 2 - z
        yy += a * (height**2 / 12 + dy**2)
        zz += a * (width**2 / 12 + dz**2)
        yz += a * dy * dz
        along_y += a if height >= width else 0.0
        along_z += a if width > height else 0.0
    if torsion is None:
        torsion = sum(long * short**3 / 3 for long, short in (part.sides for part in parts))
    shear = (5 / 6, 5 / 6) if not along_y or not along_z else (along_y / A, along_z / A)
    return Shape(A, (yy, zz, yz), torsion, shear, (y, z))


def _centred(shape: Shape, centre: tuple[float, float]) -> Shape:
    """With its shear centre at (y, z) of the coordinates that it was drawn in."""
    y, z = shape.centroid
    return Shape(shape.area, shape.inertia, shape.torsion, shape.shear, (y - centre[0], z - centre[1]))


def _symmetric(shape: Shape) -> Shape:
    return _centred(shape, shape.centroid)


def _bar(d: Dimensions) -> Shape:
    long, short = max(d[:2]), min(d[:2])
    ratio = short / long
    torsion = long * short**3 * (1 / 3 - 0.21 * ratio * (1 - ratio**4 / 12))
    return _symmetric(_of([Rectangle(0, d[1], 0, d[0])], torsion))


def _rod(d: Dimensions) -> Shape:
    second = pi * d[0] ** 4 / 4
    return Shape(pi * d[0] ** 2, (second, second, 0.0), 2 * second, (0.9, 0.9))


def _tube(d: Dimensions) -> Shape:
    second = pi * (d[0] ** 4 - d[1] ** 4) / 4
    kappa = 0.5 if d[1] > 0.5 * d[0] else 0.9
    return Shape(pi * (d[0] ** 2 - d[1] ** 2), (second, second, 0.0), 2 * second, (kappa, kappa))


def _tube2(d: Dimensions) -> Shape:
    return _tube((d[0], d[0] - d[1]))


def _box1(d: Dimensions) -> Shape:
    width, height, top, bottom, left, right = d
    walls = [
        Rectangle(0, height, 0, left),
        Rectangle(0, height, width - right, width),
        Rectangle(0, bottom, left, width - right),
        Rectangle(height - top, height, left, width - right),
    ]
    across, up = width - (left + right) / 2, height - (top + bottom) / 2
    torsion = 4 * (across * up) ** 2 / (across / top + across / bottom + up / left + up / right)
    return _symmetric(_of(walls, torsion))


def _box(d: Dimensions) -> Shape:
    return _box1((d[0], d[1], d[2], d[2], d[3], d[3]))


def _i(d: Dimensions) -> Shape:
    height, low, top, web, t_low, t_top = d
    shape = _of(
        [
            Rectangle(0, t_low, -low / 2, low / 2),
            Rectangle(t_low, height - t_top, -web / 2, web / 2),
            Rectangle(height - t_top, height, -top / 2, top / 2),
        ]
    )
    weak_low, weak_top = t_low * low**3, t_top * top**3
    y_low, y_top = t_low / 2, height - t_top / 2
    return _centred(shape, ((weak_low * y_low + weak_top * y_top) / (weak_low + weak_top), 0.0))


def _i1(d: Dimensions) -> Shape:
    flange = (d[3] - d[2]) / 2
    return _i((d[3], d[0] + d[1], d[0] + d[1], d[1], flange, flange))


def _channel(d: Dimensions) -> Shape:
    """Flange width, height, web's thickness, flanges' thickness; its web at z = 0."""
    width, height, web, flange = d
    shape = _of(
        [
            Rectangle(0, height, 0, web),
            Rectangle(0, flange, web, width),
            Rectangle(height - flange, height, web, width),
        ]
    )
    b, h = width - web / 2, height - flange
    e = 3 * b**2 * flange / (6 * b * flange + h * web)  # from the web's middle, outside
    return _centred(shape, (height / 2, web / 2 - e))


def _chan1(d: Dimensions) -> Shape:
    return _channel((d[0] + d[1], d[3], d[1], (d[3] - d[2]) / 2))


def _chan2(d: Dimensions) -> Shape:
    """Legs' thickness, web's thickness, height, width: the channel lying, its web below."""
    return _turned(_channel((d[2], d[3], d[1], d[0])))


def _turned(shape: Shape) -> Shape:
    """With y and z exchanged."""
    yy, zz, yz = shape.inertia
    return Shape(shape.area, (zz, yy, yz), shape.torsion, shape.shear[::-1], shape.centroid[::-1])


def _t(d: Dimensions) -> Shape:
    """Flange's width, height, flange's thickness, web's thickness; the flange above."""
    width, height, flange, web = d
    shape = _of(
        [
            Rectangle(0, height - flange, -web / 2, web / 2),
            Rectangle(height - flange, height, -width / 2, width / 2),
        ]
    )
    return _centred(shape, (height - flange / 2, 0.0))


def _mirrored(shape: Shape, y: int = 1, z: int = 1) -> Shape:
    """With y, or z, the other way round."""
    yy, zz, yz = shape.inertia
    centroid = (y * shape.centroid[0], z * shape.centroid[1])
    return Shape(shape.area, (yy, zz, y * z * yz), shape.torsion, shape.shear, centroid)


def _t2(d: Dimensions) -> Shape:
    return _mirrored(_t(d), y=-1)


def _t1(d: Dimensions) -> Shape:
    """Flange's height, web's length, flange's thickness, web's thickness: a T lying, its web towards −z."""
    return _turned(_t((d[0], d[1] + d[2], d[2], d[3])))


def _cross(d: Dimensions) -> Shape:
    """Both arms' length together, the post's width, its height, the arms' thickness."""
    arm = d[0] / 2
    y = (d[2] - d[3]) / 2
    parts = [
        Rectangle(0, d[2], 0, d[1]),
        Rectangle(y, y + d[3], -arm, 0),
        Rectangle(y, y + d[3], d[1], d[1] + arm),
    ]
    torsion = max(d[1:3]) * min(d[1:3]) ** 3 / 3 + max(d[0], d[3]) * min(d[0], d[3]) ** 3 / 3
    return _symmetric(_of(parts, torsion))


def _h(d: Dimensions) -> Shape:
    """The bar between the legs, both legs' thickness together, their height, the bar's thickness."""
    leg = d[1] / 2
    y = (d[2] - d[3]) / 2
    return _symmetric(
        _of(
            [
                Rectangle(0, d[2], 0, leg),
                Rectangle(0, d[2], leg + d[0], 2 * leg + d[0]),
                Rectangle(y, y + d[3], leg, leg + d[0]),
            ]
        )
    )


def _z(d: Dimensions) -> Shape:
    """A flange's length beyond the web, the web's thickness, clear height, height; the upper flange towards +z."""
    flange = (d[3] - d[2]) / 2
    return _symmetric(
        _of(
            [
                Rectangle(0, d[3], 0, d[1]),
                Rectangle(0, flange, -d[0], 0),
                Rectangle(d[3] - flange, d[3], d[1], d[1] + d[0]),
            ]
        )
    )


def _l(d: Dimensions) -> Shape:
    """Width, height, the horizontal leg's thickness, the vertical one's."""
    width, height, flat, upright = d
    shape = _of([Rectangle(0, flat, 0, width), Rectangle(flat, height, 0, upright)])
    return _centred(shape, (flat / 2, upright / 2))


def _hat(d: Dimensions) -> Shape:
    """Height, thickness, the top's width, a brim's width."""
    height, t, top, brim = d
    shape = _of(
        [
            Rectangle(height - t, height, -top / 2, top / 2),
            Rectangle(0, height - t, -top / 2, t - top / 2),
            Rectangle(0, height - t, top / 2 - t, top / 2),
            Rectangle(0, t, -top / 2 - brim, -top / 2),
            Rectangle(0, t, top / 2, top / 2 + brim),
        ]
    )
    return _symmetric(shape)


def _hexagon(d: Dimensions) -> Shape:
    """A corner's width, the whole width, the height."""
    side, width, height = d
    middle = width - 2 * side
    A = height * (width - side)
    yy = middle * height**3 / 12 + 4 * side * (height / 2) ** 3 / 12
    zz = height * middle**3 / 12 + 2 * (height * side**3 / 36 + height * side / 2 * (middle / 2 + side / 3) ** 2)
    return Shape(A, (yy, zz, 0.0), A**4 / (40 * (yy + zz)), (5 / 6, 5 / 6))


SHAPES: dict[str, tuple[int, Callable[[Dimensions], Shape]]] = {
    "ROD": (1, _rod),
    "TUBE": (2, _tube),
    "TUBE2": (2, _tube2),
    "BAR": (2, _bar),
    "BOX": (4, _box),
    "BOX1": (6, _box1),
    "I": (6, _i),
    "I1": (4, _i1),
    "CHAN": (4, _channel),
    "CHAN1": (4, _chan1),
    "CHAN2": (4, _chan2),
    "T": (4, _t),
    "T1": (4, _t1),
    "T2": (4, _t2),
    "CROSS": (4, _cross),
    "H": (4, _h),
    "Z": (4, _z),
    "L": (4, _l),
    "HAT": (4, _hat),
    "HEXA": (3, _hexagon),
}
"""Number of dimensions, and the section of these."""


def is_real(shape: Shape) -> bool:
    """Whether dimensions give a section with area, moments and torsion above zero."""
    first, second, mixed = shape.inertia
    return shape.area > 0 and first > 0 and second > 0 and mixed**2 < first * second and shape.torsion > 0
