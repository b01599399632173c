"""Cross sections of beams from their walls, and those that decks state by name and dimensions.

A section lies in the plane of y (axis 1) and z (axis 2). Those of rectangles are exact in area and
moments; torsion is Σ b t³/3 of thin walls, to which closed ones add Bredt's, and St-Venant's of the
bar. Shear factors of Nastran's sections are those of Timoshenko for solid ones, and of thin ones
the share of the walls along the force. Those of Abaqus's are its own (*Analysis User's Guide*,
"Choosing a beam element"), after Cowper (1966).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import pi

Wall = tuple[float, float, float, float]
"""A rectangle: from y to y, and from z to z."""


@dataclass(frozen=True)
class Shape:
    """A section."""

    area: float  # of it
    inertia: tuple[float, float, float]  # ∫z², ∫y² and ∫yz about its centroid
    torsion: float  # J
    shear: tuple[float, float]  # factors of the areas that resist shear along y and z
    centroid: tuple[float, float] = (0.0, 0.0)  # y and z from where the section is drawn from
    # along y and z, by which CalculiX multiplies its offsets
    extent: tuple[float, float] = (0.0, 0.0)


def of_walls(
    *walls: Wall, torsion: float | None = None, shear: tuple[float, float] | None = None
) -> Shape:
    """A section of rectangles that do not overlap.

    Args:
        walls: of it.
        torsion: J; without it that of thin open walls.
        shear: without it 5/6 where all walls lie one way, else the share of those along the force.

    Raises:
        ValueError: a rectangle has no extent, or two overlap.
    """
    if any(y1 <= y0 or z1 <= z0 for y0, y1, z0, z1 in walls):
        raise ValueError("a wall without extent")
    if any(_overlap(one, other) for one, other in combinations(walls, 2)):
        raise ValueError("walls that overlap")
    sides = [(y1 - y0, z1 - z0) for y0, y1, z0, z1 in walls]
    middles = [((y0 + y1) / 2, (z0 + z1) / 2) for y0, y1, z0, z1 in walls]
    areas = [height * width for height, width in sides]
    if not (A := sum(areas)) > 0:
        raise ValueError("walls too small for a number")
    y, z = (
        sum(a * middle[k] for a, middle in zip(areas, middles, strict=True)) / A for k in (0, 1)
    )
    yy = zz = yz = along_y = 0.0
    for a, (height, width), (y_own, z_own) in zip(areas, sides, middles, strict=True):
        yy += a * (height**2 / 12 + (y_own - y) ** 2)
        zz += a * (width**2 / 12 + (z_own - z) ** 2)
        yz += a * (y_own - y) * (z_own - z)
        along_y += a if height >= width else 0.0
    if torsion is None:
        torsion = sum(max(each) * min(each) ** 3 / 3 for each in sides)
    if shear is None:
        shear = (along_y / A, 1 - along_y / A) if 0 < along_y < A else (5 / 6, 5 / 6)
    return Shape(A, (zz, yy, yz), torsion, shear, (y, z))


def _overlap(one: Wall, other: Wall) -> bool:
    """Whether both share more than an edge."""
    margin = 1e-9 * max(one[1] - one[0], one[3] - one[2])
    return all(one[k + 1] - margin > other[k] and other[k + 1] - margin > one[k] for k in (0, 2))


def bar_torsion(a: float, b: float) -> float:
    """J of a solid rectangle (St-Venant; Roark, table 10.7)."""
    long, short = max(a, b), min(a, b)
    return long * short**3 * (1 / 3 - 0.21 * short / long * (1 - (short / long) ** 4 / 12))


def box_torsion(y: tuple[float, float, float], z: tuple[float, float, float]) -> float:
    """J of a thin box, Bredt's and Σ b t³/3: height and its two walls along z, width and its two
    walls along y.

    With one wall of next to nothing it is a channel.
    """
    up, across = y[0] - (y[1] + y[2]) / 2, z[0] - (z[1] + z[2]) / 2
    walls = ((across, y[1]), (across, y[2]), (up, z[1]), (up, z[2]))
    return (
        4 * (across * up) ** 2 / sum(b / t for b, t in walls) + sum(b * t**3 for b, t in walls) / 3
    )


def is_real(shape: Shape) -> bool:
    """Whether dimensions give a section with area, moments and torsion above zero."""
    first, second, mixed = shape.inertia
    return (
        shape.area > 0
        and first > 0
        and second > 0
        and mixed**2 < first * second
        and shape.torsion > 0
    )


def _centred(shape: Shape, centre: tuple[float, float]) -> Shape:
    """With its shear centre at (y, z) of the coordinates that it was drawn in."""
    y, z = shape.centroid
    return replace(shape, centroid=(y - centre[0], z - centre[1]))


def _symmetric(*walls: Wall, torsion: float | None = None) -> Shape:
    """A section whose shear centre is its centroid."""
    return replace(of_walls(*walls, torsion=torsion), centroid=(0.0, 0.0))


def _lying(shape: Shape) -> Shape:
    """With y and z exchanged."""
    first, second, mixed = shape.inertia
    return replace(
        shape,
        inertia=(second, first, mixed),
        shear=shape.shear[::-1],
        centroid=shape.centroid[::-1],
    )


def _upside_down(shape: Shape) -> Shape:
    """With y the other way round."""
    (first, second, mixed), (y, z) = shape.inertia, shape.centroid
    return replace(shape, inertia=(first, second, -mixed), centroid=(-y, z))


def _rod(radius: float) -> Shape:
    second = pi * radius**4 / 4
    return Shape(pi * radius**2, (second, second, 0.0), 2 * second, (0.9, 0.9))


def _tube(outer: float, inner: float) -> Shape:
    second = pi * (outer**4 - inner**4) / 4
    kappa = 0.5 if inner > 0.5 * outer else 0.9
    return Shape(pi * (outer**2 - inner**2), (second, second, 0.0), 2 * second, (kappa, kappa))


def _bar(width: float, height: float) -> Shape:
    return _symmetric((0, height, 0, width), torsion=bar_torsion(width, height))


def _box1(
    width: float, height: float, top: float, bottom: float, left: float, right: float
) -> Shape:
    return _symmetric(
        (0, height, 0, left),
        (0, height, width - right, width),
        (0, bottom, left, width - right),
        (height - top, height, left, width - right),
        torsion=box_torsion((height, top, bottom), (width, left, right)),
    )


def _i(height: float, low: float, top: float, web: float, t_low: float, t_top: float) -> Shape:
    shape = of_walls(
        (0, t_low, -low / 2, low / 2),
        (t_low, height - t_top, -web / 2, web / 2),
        (height - t_top, height, -top / 2, top / 2),
    )
    weak_low, weak_top = t_low * low**3, t_top * top**3
    y_low, y_top = t_low / 2, height - t_top / 2
    return _centred(shape, ((weak_low * y_low + weak_top * y_top) / (weak_low + weak_top), 0.0))


def _channel(width: float, height: float, web: float, flange: float) -> Shape:
    """Its web at z = 0."""
    shape = of_walls(
        (0, height, 0, web), (0, flange, web, width), (height - flange, height, web, width)
    )
    b, h = width - web / 2, height - flange
    e = 3 * b**2 * flange / (6 * b * flange + h * web)  # from the web's middle, outside
    return _centred(shape, (height / 2, web / 2 - e))


def _t(width: float, height: float, flange: float, web: float) -> Shape:
    """The flange above."""
    walls = (
        (0, height - flange, -web / 2, web / 2),
        (height - flange, height, -width / 2, width / 2),
    )
    return _centred(of_walls(*walls), (height - flange / 2, 0.0))


def _cross(arms: float, post: float, height: float, t: float) -> Shape:
    """Both arms' length together, the post's width and height, the arms' thickness."""
    arm, y = arms / 2, (height - t) / 2
    torsion = max(post, height) * min(post, height) ** 3 / 3 + max(arms, t) * min(arms, t) ** 3 / 3
    walls = (0, height, 0, post), (y, y + t, -arm, 0), (y, y + t, post, post + arm)
    return _symmetric(*walls, torsion=torsion)


def _h(clear: float, legs: float, height: float, t: float) -> Shape:
    """The bar between the legs, both legs' thickness together, their height, the bar's
    thickness.
    """
    leg, y = legs / 2, (height - t) / 2
    return _symmetric(
        (0, height, 0, leg), (0, height, leg + clear, 2 * leg + clear), (y, y + t, leg, leg + clear)
    )


def _z(beyond: float, web: float, clear: float, height: float) -> Shape:
    """A flange's length beyond the web, the web's thickness, clear height, height; the upper flange
    towards +z.
    """
    flange = (height - clear) / 2
    walls = (
        (0, height, 0, web),
        (0, flange, -beyond, 0),
        (height - flange, height, web, web + beyond),
    )
    return _symmetric(*walls)


def _l(width: float, height: float, flat: float, upright: float) -> Shape:
    return _centred(
        of_walls((0, flat, 0, width), (flat, height, 0, upright)), (flat / 2, upright / 2)
    )


def _hat(height: float, t: float, top: float, brim: float) -> Shape:
    return _symmetric(
        (height - t, height, -top / 2, top / 2),
        (0, height - t, -top / 2, t - top / 2),
        (0, height - t, top / 2 - t, top / 2),
        (0, t, -top / 2 - brim, -top / 2),
        (0, t, top / 2, top / 2 + brim),
    )


def _hexagon(side: float, width: float, height: float) -> Shape:
    """A corner's width, the whole width, the height."""
    middle = width - 2 * side
    A = height * (width - side)
    yy = middle * height**3 / 12 + 4 * side * (height / 2) ** 3 / 12
    zz = height * middle**3 / 12 + 2 * (
        height * side**3 / 36 + height * side / 2 * (middle / 2 + side / 3) ** 2
    )
    return Shape(A, (zz, yy, 0.0), A**4 / (40 * (yy + zz)), (5 / 6, 5 / 6))


NASTRAN: dict[str, Callable[..., Shape]] = {
    "ROD": _rod,
    "TUBE": _tube,
    "TUBE2": lambda outer, wall: _tube(outer, outer - wall),
    "BAR": _bar,
    "BOX": lambda width, height, flat, upright: _box1(width, height, flat, flat, upright, upright),
    "BOX1": _box1,
    "I": _i,
    "I1": lambda beyond, web, clear, height: _i(
        height, beyond + web, beyond + web, web, (height - clear) / 2, (height - clear) / 2
    ),
    "CHAN": _channel,
    "CHAN1": lambda beyond, web, clear, height: _channel(
        beyond + web, height, web, (height - clear) / 2
    ),
    "CHAN2": lambda leg, web, height, width: _lying(_channel(height, width, web, leg)),
    "T": _t,
    "T1": lambda height, length, flange, web: _lying(_t(height, length + flange, flange, web)),
    "T2": lambda width, height, flange, web: _upside_down(_t(width, height, flange, web)),
    "CROSS": _cross,
    "H": _h,
    "Z": _z,
    "L": _l,
    "HAT": _hat,
    "HEXA": _hexagon,
}
"""Sections of PBARL and PBEAML by their dimensions in order; y is drawn upwards."""

_THIN = (0.44, 0.44)


def _rectangle(a: float, b: float) -> Shape:
    walls = (-a / 2, a / 2, -b / 2, b / 2)
    return replace(of_walls(walls, torsion=bar_torsion(a, b), shear=(0.85, 0.85)), extent=(a, b))


def _ellipse(a: float, b: float) -> Shape:
    """Diameters, as CalculiX states a CIRC section."""
    torsion = pi * a**3 * b**3 / (16 * (a * a + b * b))
    inertia = (pi * a * b**3 / 64, pi * b * a**3 / 64, 0.0)
    return Shape(pi * a * b / 4, inertia, torsion, (0.89, 0.89), extent=(a, b))


def _pipe(r: float, t: float) -> Shape:
    return replace(_tube(r, r - t), shear=(0.53, 0.53), extent=(2 * r, 2 * r))


def _box(a: float, b: float, t1: float, t2: float, t3: float, t4: float) -> Shape:
    """Walls on the sides +1, +2, −1 and −2."""
    y, z = a / 2, b / 2
    shape = of_walls(
        (y - t1, y, t4 - z, z - t2),
        (-y, t3 - y, t4 - z, z - t2),
        (-y, y, z - t2, z),
        (-y, y, -z, t4 - z),
        torsion=box_torsion((a, t1, t3), (b, t2, t4)),
        shear=_THIN,
    )
    return replace(shape, extent=(a, b))


def _i_section(l: float, h: float, b1: float, b2: float, t1: float, t2: float, t3: float) -> Shape:  # noqa: E741
    """Origin above the bottom, height, widths of the bottom and top flange, their thicknesses, and
    the web's.
    """
    walls = [
        (-b1 / 2, b1 / 2, -l, t1 - l),
        (-b2 / 2, b2 / 2, h - t2 - l, h - l),
        (-t3 / 2, t3 / 2, t1 - l, h - t2 - l),
    ]
    middle = h - (t1 + t2) / 2
    return of_walls(*walls, torsion=(b1 * t1**3 + b2 * t2**3 + middle * t3**3) / 3, shear=_THIN)


def _t_section(b: float, h: float, l: float, tf: float, tw: float) -> Shape:  # noqa: E741
    """Width, height, origin above the bottom, flange and web."""
    walls = [(-b / 2, b / 2, h - tf - l, h - l), (-tw / 2, tw / 2, -l, h - tf - l)]
    return of_walls(*walls, torsion=(b * tf**3 + (h - tf / 2) * tw**3) / 3, shear=_THIN)


def _l_section(a: float, b: float, t1: float, t2: float) -> Shape:
    """Legs along axes 1 and 2; the origin is where their middle lines meet."""
    walls = [(-t2 / 2, a - t2 / 2, -t1 / 2, t1 / 2), (-t2 / 2, t2 / 2, t1 / 2, b - t1 / 2)]
    return of_walls(
        *walls, torsion=((a - t2 / 2) * t1**3 + (b - t1 / 2) * t2**3) / 3, shear=(1.0, 1.0)
    )


_ABAQUS: dict[str, tuple[str, Callable[..., bool], Callable[..., Shape]]] = {
    "RECT": ("a, b", lambda *_: True, _rectangle),
    "PIPE": ("radius, wall", lambda r, t: t < r, _pipe),
    "BOX": ("a, b, t1, t2, t3, t4", lambda a, b, t1, t2, t3, t4: t1 + t3 < a and t2 + t4 < b, _box),
    "I": (
        "l, h, b1, b2, t1, t2, t3",
        lambda _, h, b1, b2, t1, t2, t3: t1 + t2 < h and t3 <= min(b1, b2),
        _i_section,
    ),
    "T": ("b, h, l, tf, tw", lambda b, h, _, tf, tw: tf < h and tw <= b, _t_section),
    "L": ("a, b, t1, t2", lambda a, b, t1, t2: t1 < b and t2 < a, _l_section),
}
"""By the deck's name: names of the dimensions, what these must satisfy, and the section."""


def abaqus(kind: str, sizes: Sequence[float]) -> Shape:
    """A section of *BEAM SECTION by its name; the origin is where the nodes lie.

    Raises:
        ValueError: the dimensions are not those of such a section; says what is expected.
    """
    if kind == "CIRC":
        if len(sizes) not in (1, 2) or min(sizes) <= 0:
            raise ValueError("expected a radius, or two diameters as CalculiX has them, above 0")
        return _ellipse(*(sizes if len(sizes) == 2 else (2 * sizes[0], 2 * sizes[0])))
    if kind == "RECT" and len(sizes) == 1:
        sizes = [sizes[0], sizes[0]]
    if kind not in _ABAQUS:
        raise ValueError(
            f"SECTION={kind} is unknown, expected CIRC, {', '.join(_ABAQUS)}, or GENERAL with its"
            " constants"
        )
    names, holds, function = _ABAQUS[kind]
    dimensions = names.split(", ")
    positive = [size for name, size in zip(dimensions, sizes, strict=False) if name != "l"]
    if len(sizes) != len(dimensions) or min(positive) <= 0 or not holds(*sizes):
        raise ValueError(
            f"expected {names}: {len(dimensions)} lengths above 0 of which the walls fit into the"
            " section"
        )
    return function(*sizes)
