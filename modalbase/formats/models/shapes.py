"""Cross sections of beams from their walls.

A section lies in the plane of y (axis 1) and z (axis 2). Those of rectangles are exact in area and moments; torsion is
Σ b t³/3 of thin open walls, Bredt's of closed ones, and St-Venant's of the bar.
"""

from dataclasses import dataclass
from itertools import combinations

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
    extent: tuple[float, float] = (0.0, 0.0)  # along y and z, by which CalculiX multiplies its offsets


def of_walls(*walls: Wall, torsion: float | None = None, shear: tuple[float, float] | None = None) -> Shape:
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
    y, z = (sum(a * middle[k] for a, middle in zip(areas, middles, strict=True)) / A for k in (0, 1))
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
    """J of a thin box (Bredt): height and its two walls along z, width and its two walls along y."""
    up, across = y[0] - (y[1] + y[2]) / 2, z[0] - (z[1] + z[2]) / 2
    return 4 * (across * up) ** 2 / (across / y[1] + across / y[2] + up / z[1] + up / z[2])
