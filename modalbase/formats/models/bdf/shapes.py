"""Cross sections by their dimensions, as PBARL and PBEAML name them; y is drawn upwards.

Shear factors are those of Timoshenko for solid sections, and of thin ones the share of the walls along the force.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import pi

from modalbase.formats.models.shapes import Shape, Wall, bar_torsion, box_torsion, of_walls

Dimensions = Sequence[float]


def _centred(shape: Shape, centre: tuple[float, float]) -> Shape:
    """With its shear centre at (y, z) of the coordinates that it was drawn in."""
    y, z = shape.centroid
    return replace(shape, centroid=(y - centre[0], z - centre[1]))


def _symmetric(*walls: Wall, torsion: float | None = None) -> Shape:
    """A section whose shear centre is its centroid."""
    return replace(of_walls(*walls, torsion=torsion), centroid=(0.0, 0.0))


def _bar(d: Dimensions) -> Shape:
    return _symmetric((0, d[1], 0, d[0]), torsion=bar_torsion(d[0], d[1]))


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
    return _symmetric(
        (0, height, 0, left),
        (0, height, width - right, width),
        (0, bottom, left, width - right),
        (height - top, height, left, width - right),
        torsion=box_torsion((height, top, bottom), (width, left, right)),
    )


def _box(d: Dimensions) -> Shape:
    return _box1((d[0], d[1], d[2], d[2], d[3], d[3]))


def _i(d: Dimensions) -> Shape:
    height, low, top, web, t_low, t_top = d
    shape = of_walls(
        (0, t_low, -low / 2, low / 2),
        (t_low, height - t_top, -web / 2, web / 2),
        (height - t_top, height, -top / 2, top / 2),
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
    shape = of_walls(
        (0, height, 0, web),
        (0, flange, web, width),
        (height - flange, height, web, width),
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
    first, second, mixed = shape.inertia
    inertia = second, first, mixed
    return replace(shape, inertia=inertia, shear=shape.shear[::-1], centroid=shape.centroid[::-1])


def _t(d: Dimensions) -> Shape:
    """Flange's width, height, flange's thickness, web's thickness; the flange above."""
    width, height, flange, web = d
    shape = of_walls(
        (0, height - flange, -web / 2, web / 2),
        (height - flange, height, -width / 2, width / 2),
    )
    return _centred(shape, (height - flange / 2, 0.0))


def _mirrored(shape: Shape) -> Shape:
    """With y the other way round."""
    first, second, mixed = shape.inertia
    centroid = (-shape.centroid[0], shape.centroid[1])
    return replace(shape, inertia=(first, second, -mixed), centroid=centroid)


def _t2(d: Dimensions) -> Shape:
    return _mirrored(_t(d))


def _t1(d: Dimensions) -> Shape:
    """Flange's height, web's length, flange's thickness, web's thickness: a T lying, its web towards −z."""
    return _turned(_t((d[0], d[1] + d[2], d[2], d[3])))


def _cross(d: Dimensions) -> Shape:
    """Both arms' length together, the post's width, its height, the arms' thickness."""
    arm = d[0] / 2
    y = (d[2] - d[3]) / 2
    torsion = max(d[1:3]) * min(d[1:3]) ** 3 / 3 + max(d[0], d[3]) * min(d[0], d[3]) ** 3 / 3
    return _symmetric(
        (0, d[2], 0, d[1]),
        (y, y + d[3], -arm, 0),
        (y, y + d[3], d[1], d[1] + arm),
        torsion=torsion,
    )


def _h(d: Dimensions) -> Shape:
    """The bar between the legs, both legs' thickness together, their height, the bar's thickness."""
    leg = d[1] / 2
    y = (d[2] - d[3]) / 2
    return _symmetric(
        (0, d[2], 0, leg),
        (0, d[2], leg + d[0], 2 * leg + d[0]),
        (y, y + d[3], leg, leg + d[0]),
    )


def _z(d: Dimensions) -> Shape:
    """A flange's length beyond the web, the web's thickness, clear height, height; the upper flange towards +z."""
    flange = (d[3] - d[2]) / 2
    return _symmetric(
        (0, d[3], 0, d[1]),
        (0, flange, -d[0], 0),
        (d[3] - flange, d[3], d[1], d[1] + d[0]),
    )


def _l(d: Dimensions) -> Shape:
    """Width, height, the horizontal leg's thickness, the vertical one's."""
    width, height, flat, upright = d
    shape = of_walls((0, flat, 0, width), (flat, height, 0, upright))
    return _centred(shape, (flat / 2, upright / 2))


def _hat(d: Dimensions) -> Shape:
    """Height, thickness, the top's width, a brim's width."""
    height, t, top, brim = d
    return _symmetric(
        (height - t, height, -top / 2, top / 2),
        (0, height - t, -top / 2, t - top / 2),
        (0, height - t, top / 2 - t, top / 2),
        (0, t, -top / 2 - brim, -top / 2),
        (0, t, top / 2, top / 2 + brim),
    )


def _hexagon(d: Dimensions) -> Shape:
    """A corner's width, the whole width, the height."""
    side, width, height = d
    middle = width - 2 * side
    A = height * (width - side)
    yy = middle * height**3 / 12 + 4 * side * (height / 2) ** 3 / 12
    zz = height * middle**3 / 12 + 2 * (height * side**3 / 36 + height * side / 2 * (middle / 2 + side / 3) ** 2)
    return Shape(A, (zz, yy, 0.0), A**4 / (40 * (yy + zz)), (5 / 6, 5 / 6))


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
