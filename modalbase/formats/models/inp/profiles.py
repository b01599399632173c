"""Profiles of beams: area, second moments, torsion and centroid from dimensions.

Axes 1 and 2 are y and z here; the origin is where the deck's nodes lie. Shear factors are those of Abaqus (*Analysis User's
Guide*, "Choosing a beam element"), after Cowper (1966).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Profile:
    """A profile.

    Attributes:
        area: A.
        inertia: ∫z² dA, ∫y² dA and ∫yz dA about the centroid.
        torsion: J.
        shear: the shear factor of both directions.
        centroid: y and z of the centroid.
        extent: along y and z, by which CalculiX multiplies its offsets.
    """

    area: float
    inertia: tuple[float, float, float]
    torsion: float
    shear: float
    centroid: tuple[float, float] = (0.0, 0.0)
    extent: tuple[float, float] = (0.0, 0.0)


Rectangles = list[tuple[float, float, float, float]]


def _composed(rectangles: Rectangles, torsion: float, shear: float) -> Profile:
    """A profile of rectangles: y and z of each one's middle, its width and its height."""
    y, z, b, h = np.array(rectangles).T
    A = b * h
    area = A.sum()
    yc, zc = float(A @ y / area), float(A @ z / area)
    first = float(np.sum(A * (h**2 / 12 + (z - zc) ** 2)))
    second = float(np.sum(A * (b**2 / 12 + (y - yc) ** 2)))
    mixed = float(np.sum(A * (y - yc) * (z - zc)))
    return Profile(float(area), (first, second, mixed), torsion, shear, (yc, zc))


def rectangle(a: float, b: float) -> Profile:
    """`a` along axis 1, `b` along axis 2; St-Venant's torsion (Roark, table 10.7)."""
    wide, thin = max(a, b), min(a, b)
    torsion = wide * thin**3 * (1 / 3 - 0.21 * thin / wide * (1 - (thin / wide) ** 4 / 12))
    return Profile(a * b, (a * b**3 / 12, b * a**3 / 12, 0.0), torsion, 0.85, extent=(a, b))


def ellipse(a: float, b: float) -> Profile:
    """Diameters along both axes, as CalculiX states a CIRC section."""
    torsion = np.pi * a**3 * b**3 / (16 * (a * a + b * b))
    inertia = (np.pi * a * b**3 / 64, np.pi * b * a**3 / 64, 0.0)
    return Profile(np.pi * a * b / 4, inertia, torsion, 0.89, extent=(a, b))


def circle(r: float) -> Profile:
    """A radius, as Abaqus states a CIRC section."""
    return ellipse(2 * r, 2 * r)


def pipe(r: float, t: float) -> Profile:
    """Outer radius and wall."""
    inner = r - t
    second = np.pi * (r**4 - inner**4) / 4
    return Profile(np.pi * (r**2 - inner**2), (second, second, 0.0), 2 * second, 0.53, extent=(2 * r, 2 * r))


def box(a: float, b: float, t1: float, t2: float, t3: float, t4: float) -> Profile:
    """Outer width and height; walls on the sides +1, +2, −1 and −2; Bredt's torsion."""
    inner = b - t2 - t4
    walls = [
        ((a - t1) / 2, (t4 - t2) / 2, t1, inner),
        ((t3 - a) / 2, (t4 - t2) / 2, t3, inner),
        (0.0, (b - t2) / 2, a, t2),
        (0.0, (t4 - b) / 2, a, t4),
    ]
    width, height = a - (t1 + t3) / 2, b - (t2 + t4) / 2
    torsion = 4 * (width * height) ** 2 / (height / t1 + height / t3 + width / t2 + width / t4)
    return replace(_composed(walls, torsion, 0.44), extent=(a, b))


def i_section(l: float, h: float, b1: float, b2: float, t1: float, t2: float, t3: float) -> Profile:  # noqa: E741
    """Origin above the bottom, height, widths of the bottom and top flange, their thicknesses, and the web's."""
    web = h - t1 - t2
    walls = [(0.0, t1 / 2 - l, b1, t1), (0.0, h - t2 / 2 - l, b2, t2), (0.0, t1 + web / 2 - l, t3, web)]
    middle = h - (t1 + t2) / 2
    return _composed(walls, (b1 * t1**3 + b2 * t2**3 + middle * t3**3) / 3, 0.44)


def t_section(b: float, h: float, l: float, tf: float, tw: float) -> Profile:  # noqa: E741
    """Width, height, origin above the bottom, flange and web."""
    walls = [(0.0, h - tf / 2 - l, b, tf), (0.0, (h - tf) / 2 - l, tw, h - tf)]
    return _composed(walls, (b * tf**3 + (h - tf / 2) * tw**3) / 3, 0.44)


def l_section(a: float, b: float, t1: float, t2: float) -> Profile:
    """Legs along axes 1 and 2 and their thicknesses; the origin is where their middle lines meet."""
    walls = [((a - t2) / 2, 0.0, a, t1), (0.0, b / 2, t2, b - t1)]
    return _composed(walls, ((a - t2 / 2) * t1**3 + (b - t1 / 2) * t2**3) / 3, 1.0)


PROFILES: dict[str, tuple[int, str, Callable[..., bool], Callable[..., Profile]]] = {
    "RECT": (2, "a, b", lambda *_: True, rectangle),
    "PIPE": (2, "radius, wall", lambda r, t: t < r, pipe),
    "BOX": (6, "a, b, t1, t2, t3, t4", lambda a, b, t1, t2, t3, t4: t1 + t3 < a and t2 + t4 < b, box),
    "I": (7, "l, h, b1, b2, t1, t2, t3", lambda _, h, b1, b2, t1, t2, t3: t1 + t2 < h and t3 <= min(b1, b2), i_section),
    "T": (5, "b, h, l, tf, tw", lambda b, h, _, tf, tw: tf < h and tw <= b, t_section),
    "L": (4, "a, b, t1, t2", lambda a, b, t1, t2: t1 < b and t2 < a, l_section),
}
"""By the deck's name: number of dimensions, their names, what they must satisfy, and the profile."""


def profile(kind: str, sizes: Sequence[float]) -> Profile:
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
