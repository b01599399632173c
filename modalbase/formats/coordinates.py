"""Coordinates of points along curved axes."""

from typing import Literal

import numpy as np

from modalbase.formats.types import FloatArray

Kind = Literal["cartesian", "cylindrical", "spherical"]


def cartesian(kind: Kind, points: FloatArray) -> FloatArray:
    """(n, 3) Cartesian coordinates of (n, 3) points: r, θ, z of a cylinder; r, the angle from z and
    that about it of a sphere.

    Angles are in degrees.
    """
    if kind == "cartesian":
        return points
    first, second, third = points.T
    angle = np.radians(second)
    if kind == "cylindrical":
        return np.column_stack([first * np.cos(angle), first * np.sin(angle), third])
    ring, about = first * np.sin(angle), np.radians(third)
    return np.column_stack([ring * np.cos(about), ring * np.sin(about), first * np.cos(angle)])
