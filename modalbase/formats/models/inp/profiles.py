"""Profiles of beams from dimensions; the origin is where the deck's nodes lie.

Shear factors are those of Abaqus (*Analysis User's Guide*, "Choosing a beam element"), after Cowper (1966).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import pi

from modalbase.formats.models.shapes import Shape, bar_torsion, box_torsion, of_walls

_THIN = (0.44, 0.44)


def rectangle(a: float, b: float) -> Shape:
    """`a` along axis 1, `b` along axis 2."""
    shape = of_walls((-a / 2, a / 2, -b / 2, b / 2), torsion=bar_torsion(a, b), shear=(0.85, 0.85))
    return replace(shape, extent=(a, b))


def ellipse(a: float, b: float) -> Shape:
    """Diameters along both axes, as CalculiX states a CIRC section."""
    torsion = pi * a**3 * b**3 / (16 * (a * a + b * b))
    inertia = (pi * a * b**3 / 64, pi * b * a**3 / 64, 0.0)
    return Shape(pi * a * b / 4, inertia, torsion, (0.89, 0.89), extent=(a, b))


def circle(r: float) -> Shape:
    """A radius, as Abaqus states a CIRC section."""
    return ellipse(2 * r, 2 * r)


def pipe(r: float, t: float) -> Shape:
    """Outer radius and wall."""
    inner = r - t
    second = pi * (r**4 - inner**4) / 4
    area = pi * (r**2 - inner**2)
    return Shape(area, (second, second, 0.0), 2 * second, (0.53, 0.53), extent=(2 * r, 2 * r))


def box(a: float, b: float, t1: float, t2: float, t3: float, t4: float) -> Shape:
    """Outer width and height; walls on the sides +1, +2, −1 and −2."""
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


def i_section(l: float, h: float, b1: float, b2: float, t1: float, t2: float, t3: float) -> Shape:  # noqa: E741
    """Origin above the bottom, height, widths of the bottom and top flange, their thicknesses, and the web's."""
    walls = [
        (-b1 / 2, b1 / 2, -l, t1 - l),
        (-b2 / 2, b2 / 2, h - t2 - l, h - l),
        (-t3 / 2, t3 / 2, t1 - l, h - t2 - l),
    ]
    middle = h - (t1 + t2) / 2
    return of_walls(*walls, torsion=(b1 * t1**3 + b2 * t2**3 + middle * t3**3) / 3, shear=_THIN)


def t_section(b: float, h: float, l: float, tf: float, tw: float) -> Shape:  # noqa: E741
    """Width, height, origin above the bottom, flange and web."""
    walls = [(-b / 2, b / 2, h - tf - l, h - l), (-tw / 2, tw / 2, -l, h - tf - l)]
    return of_walls(*walls, torsion=(b * tf**3 + (h - tf / 2) * tw**3) / 3, shear=_THIN)


def l_section(a: float, b: float, t1: float, t2: float) -> Shape:
    """Legs along axes 1 and 2 and their thicknesses; the origin is where their middle lines meet."""
    walls = [(-t2 / 2, a - t2 / 2, -t1 / 2, t1 / 2), (-t2 / 2, t2 / 2, t1 / 2, b - t1 / 2)]
    return of_walls(*walls, torsion=((a - t2 / 2) * t1**3 + (b - t1 / 2) * t2**3) / 3, shear=(1.0, 1.0))


PROFILES: dict[str, tuple[int, str, Callable[..., bool], Callable[..., Shape]]] = {
    "RECT": (2, "a, b", lambda *_: True, rectangle),
    "PIPE": (2, "radius, wall", lambda r, t: t < r, pipe),
    "BOX": (6, "a, b, t1, t2, t3, t4", lambda a, b, t1, t2, t3, t4: t1 + t3 < a and t2 + t4 < b, box),
    "I": (7, "l, h, b1, b2, t1, t2, t3", lambda _, h, b1, b2, t1, t2, t3: t1 + t2 < h and t3 <= min(b1, b2), i_section),
    "T": (5, "b, h, l, tf, tw", lambda b, h, _, tf, tw: tf < h and tw <= b, t_section),
    "L": (4, "a, b, t1, t2", lambda a, b, t1, t2: t1 < b and t2 < a, l_section),
}
"""By the deck's name: number of dimensions, their names, what they must satisfy, and the profile."""


def profile(kind: str, sizes: Sequence[float]) -> Shape:
    """A profile by the deck's name.

    Raises:
        ValueError: the dimensions are not those of such a profile; says what is expected.
    """
    if kind == "CIRC":
        if len(sizes) not in (1, 2) or min(sizes) <= 0:
            raise ValueError("expected a radius, or two diameters as CalculiX has them, above 0")
        return circle(*sizes) if len(sizes) == 1 else ellipse(*sizes)
    if kind == "RECT" and len(sizes) == 1:
        sizes = [sizes[0], sizes[0]]
    if kind not in PROFILES:
        raise ValueError(
            f"SECTION={kind} is unknown, expected CIRC, {', '.join(PROFILES)}, or GENERAL with its constants"
        )
    count, names, holds, function = PROFILES[kind]
    positive = [size for name, size in zip(names.split(", "), sizes, strict=False) if name != "l"]
    if len(sizes) != count or min(positive) <= 0 or not holds(*sizes):
        raise ValueError(f"expected {names}: {count} lengths above 0 of which the walls fit into the section")
    return function(*sizes)
