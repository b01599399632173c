"""Profiles and panels of unlike walls as solids by CalculiX, two bricks through each wall, against shells with joints.

One material, so that the errors are those of the joint model. Solids of this fineness are .1 to .3 % too stiff at corners.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from benchmarks import calculix
from benchmarks.structures import body, frequencies, rms_and_worst
from benchmarks.tables import Table

WALL = {
    "E1": 28.8e9, "E2": 9.2e9, "E3": 8.3e9, "nu12": 0.245, "nu13": 0.3, "nu23": 0.35,
    "G12": 3.13e9, "G13": 2.82e9, "G23": 2.35e9, "rho": 1850.0,
}  # fmt: skip
# kind, length, height, width, flange or plate, web or rib, in mm
CASES = (
    *(("i", 800, 120, 60, 6, 6), ("i", 800, 120, 60, 10, 5), ("i", 800, 120, 60, 5, 10)),
    *(("panel", 800, 50, 400, 4, 10), ("panel", 800, 50, 400, 10, 4)),
    *(("angle", 600, 60, 60, 6, 6), ("angle", 600, 60, 60, 8, 4), ("angle", 600, 60, 60, 4, 8)),
    *(("channel", 700, 100, 50, 8, 4), ("channel", 700, 100, 50, 4, 8)),
)
_NINE = ("E1", "E2", "E3", "nu12", "nu13", "nu23", "G12", "G13", "G23")


def section(
    kind: str, d: dict[str, float]
) -> tuple[list[float], list[float], Callable[..., bool], Callable[..., bool]]:
    """Lines at which cells begin along y and z, and whether a point is in the flange, and else in the web."""
    side, top, tf, tw = d["b"] / 2, d["h"] / 2, d["tf"], d["tw"]
    y, z = [-side, -tw / 2, tw / 2, side], [-top, -top + tf, top - tf, top]
    if kind == "panel":
        rib = d["b"] / 4
        y = [-side, *(at + half for at in (-rib, rib) for half in (-tw / 2, tw / 2)), side]
        return y, [-top, top - tf, top], lambda _, z: z > top - tf, lambda y, _: abs(abs(y) - rib) < tw / 2
    if kind == "box":
        y = [-side, -side + tw, side - tw, side]
        return y, z, lambda _, z: abs(z) > top - tf, lambda y, _: abs(y) > side - tw
    if kind == "tee":
        return y, [-top, top - tf, top], lambda _, z: z > top - tf, lambda y, _: abs(y) < tw / 2
    if kind == "i":
        return y, z, lambda _, z: abs(z) > top - tf, lambda y, _: abs(y) < tw / 2
    y = [-side, -side + tw, side]
    if kind == "angle":
        return y, [-top, -top + tf, top], lambda _, z: z < -top + tf, lambda y, _: y < -side + tw
    return y, z, lambda _, z: abs(z) > top - tf, lambda y, _: y < -side + tw


def lines(cuts: list[float], size: float, thin: float) -> np.ndarray:
    """Cells between cuts: two through a wall, else of about a size."""
    parts = [
        np.linspace(a, b, (2 if abs(b - a - thin) < 1e-9 else max(1, int(np.ceil((b - a) / size)))) + 1)[:-1]
        for a, b in pairwise(cuts)
    ]
    return np.concatenate([*parts, cuts[-1:]])


def solid(kind: str, d: dict[str, float], walls: dict[str, dict[str, float]], along: float = 0.018) -> calculix.Solid:
    """A profile or panel of quadratic bricks of a length along x, whose materials lie along x and across each wall."""
    y_cuts, z_cuts, flange, web = section(kind, d)
    size = max(d["h"], d["b"]) / (20 if kind == "panel" else 6)
    x = np.linspace(0, d["L"], int(np.ceil(d["L"] / along)) + 1)
    materials = {
        wall: calculix.orthotropic(wall, [of[name] for name in _NINE], of["rho"], axes)
        for (wall, of), axes in zip(walls.items(), ("1,0,0,0,1,0", "1,0,0,0,0,1"), strict=True)
    }
    return calculix.solid(
        (x, lines(y_cuts, size, d["tw"]), lines(z_cuts, size, d["tf"])),
        lambda y, z: "flange" if flange(y, z) else "web" if web(y, z) else None,
        materials,
    )


def structures_solids(*kinds: str) -> None:
    """Joints of walls of unlike thickness against CalculiX's solids: 20 modes by shells alone and with joints."""
    columns = ("shells rms:.2f", "worst:.2f", "with joints rms:.2f", "worst:.2f", "mean:+.2f")
    table = Table("20 modes against solids, %", "body:8", "mm, length, height, width, walls:32", *columns)
    for kind, *sizes in CASES:
        if kinds and kind not in kinds:
            continue
        d = dict(zip(("L", "h", "b", "tf", "tw"), (size / 1000 for size in sizes), strict=True))
        truth = {"kind": kind, "true_dims": d, "walls": {"flange": WALL, "web": WALL}}
        exact = calculix.modes(solid(kind, d, truth["walls"]), 26)[0][6:]
        alone, joined = (100 * (frequencies(body(truth, 6, on), len(exact)) / exact - 1) for on in (False, True))
        table.row(kind, sizes, *rms_and_worst(alone), *rms_and_worst(joined), joined.mean())
