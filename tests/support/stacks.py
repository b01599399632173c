"""Strips of unlike layers: solids by another code, stored, and the stacks that a laboratory states.

`solve` has them solved anew by CalculiX, each ply a layer of bricks with its own density and axes.
"""

from itertools import pairwise
from pathlib import Path

import numpy as np

from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.modes import MeasuredModes
from tests.support.calculix import Solid, modes, orthotropic, solid
from tests.support.draws import modes_at

_NINE = ("E1", "E2", "E3", "nu12", "nu13", "nu23", "G12", "G13", "G23")
_VALUES = {
    "face": (26.5e9, 8.2e9, 8e9, 0.26, 0.3, 0.35, 3.6e9, 3.1e9, 2.3e9, 1850.0),
    "core": (0.25e9, 0.25e9, 0.3e9, 0.3, 0.3, 0.3, 0.09e9, 0.13e9, 0.1e9, 150.0),
    "carbon": (125e9, 8.5e9, 8.5e9, 0.3, 0.3, 0.4, 4.6e9, 4.6e9, 3.2e9, 1580.0),
}
MATERIALS = {
    name: dict(zip((*_NINE, "rho"), values, strict=True)) for name, values in _VALUES.items()
}
# length, width in m; plies from the bottom: material, thickness in m, angle in degrees
STACKS = {
    "sandwich": ((0.6, 0.07), (("face", 0.002, 0), ("core", 0.009, 0), ("face", 0.002, 0))),
    "unsymmetric": (
        (0.4, 0.06),
        (("carbon", 0.001, 0), ("carbon", 0.001, 45), ("carbon", 0.001, 90)),
    ),
}
BOUNDARIES = ("free", "cantilever")
NOISE = 3e-4  # of a frequency
STORED = Path(__file__).with_suffix(".npz")
# of points, by length and width
SHARES = [(x, y) for x in (0.2, 0.4, 0.6, 0.8, 1.0) for y in (-0.5, 0.0, 0.5)]
_MODES = 9


def plies(kind: str, factor: float = 1.0) -> tuple[Ply, ...]:
    """The stack with its true constants, or with moduli that are off by a factor."""
    found = []
    for name, thickness, angle in STACKS[kind][1]:
        m = MATERIALS[name]
        moduli = (factor * m[each] for each in ("E1", "E2", "G12", "G13", "G23"))
        found.append(Ply(OrthotropicMaterial(*moduli, m["nu12"], m["rho"]), thickness, angle))
    return tuple(found)


def density(kind: str) -> float:
    """Of the whole, kg/m³."""
    stack = plies(kind)
    return sum(ply.material.density * ply.thickness for ply in stack) / sum(
        ply.thickness for ply in stack
    )


def points(kind: str) -> dict[int, tuple[float, float, float]]:
    """Where the shapes were measured."""
    (length, width), _ = STACKS[kind]
    return {number: (length * x, width * y, 0.0) for number, (x, y) in enumerate(SHARES, start=1)}


def measured(kind: str, boundary: str, seed: int = 0) -> MeasuredModes:
    """The stored modes with noise."""
    with np.load(STORED) as stored:
        hz, shapes = (
            stored[f"{kind} {boundary} hz"],
            stored[f"{kind} {boundary} shapes"].astype(float),
        )
    noise = 1 + NOISE * np.random.default_rng(seed).standard_normal(hz.size)
    return modes_at(points(kind), hz * noise, shapes, NOISE)


def _solid(kind: str, along: int = 36, across: int = 4) -> Solid:
    (length, width), stack = STACKS[kind]
    parts = [f"P{number}" for number in range(len(stack))]
    faces = np.cumsum([0.0, *(thickness for _, thickness, _ in stack)])
    faces -= faces[-1] / 2
    z = [faces[0]]
    for low, high in pairwise(faces):
        z += np.linspace(low, high, 3 if high - low > faces[-1] else 2)[1:].tolist()
    materials = {}
    for part, (name, _, angle) in zip(parts, stack, strict=True):
        c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        m = MATERIALS[name]
        axes = f"{c:.12g},{s:.12g},0,{-s:.12g},{c:.12g},0"
        materials[part] = orthotropic(part, [m[each] for each in _NINE], m["rho"], axes)
    cells = np.linspace(0, length, along + 1), np.linspace(-width / 2, width / 2, across + 1), z
    return solid(cells, lambda _, at: parts[int(np.searchsorted(faces, at)) - 1], materials)


def solve() -> None:
    """Solve all strips anew and store them."""
    found = {}
    for kind, ((length, width), stack) in STACKS.items():
        body, top = _solid(kind), sum(thickness for _, thickness, _ in stack) / 2
        seen = body.nearest([(length * x, width * y, top) for x, y in SHARES])
        for boundary in BOUNDARIES:
            hz, motion = modes(body, _MODES + 12, seen, clamped=boundary == "cantilever")
            square = np.sum(motion**2, axis=1)
            bends = np.flatnonzero((hz > 1.0) & (square[:, 2] > square[:, 0] + square[:, 1]))
            kept = bends[6 if boundary == "free" and hz[5] > 1.0 else 0 :][:_MODES]
            found[f"{kind} {boundary} hz"] = hz[kept]
            found[f"{kind} {boundary} shapes"] = motion[kept, :, 2].astype(np.float32)
    np.savez_compressed(STORED, **found)


if __name__ == "__main__":
    solve()
