"""Profiles and panels of unlike walls as solids by CalculiX, two bricks through each wall, against shells with joints.

One material, so that the errors are those of the joint model. Solids of this fineness are .1 to .3 % too stiff at corners.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np

from benchmarks import calculix
from benchmarks.structures import body, frequencies

WALL = {
    "E1": 28.8e9,
    "E2": 9.2e9,
    "E3": 8.3e9,
    "nu12": 0.245,
    "nu13": 0.3,
    "nu23": 0.35,
    "G12": 3.13e9,
    "G13": 2.82e9,
    "G23": 2.35e9,
    "rho": 1850.0,
}
# kind, length, height, width, flange or plate, web or rib, in mm
CASES = (
    *(("i", 800, 120, 60, 6, 6), ("i", 800, 120, 60, 10, 5), ("i", 800, 120, 60, 5, 10)),
    *(("panel", 800, 50, 400, 4, 10), ("panel", 800, 50, 400, 10, 4)),
    *(("angle", 600, 60, 60, 6, 6), ("angle", 600, 60, 60, 8, 4), ("angle", 600, 60, 60, 4, 8)),
    *(("channel", 700, 100, 50, 8, 4), ("channel", 700, 100, 50, 4, 8)),
)
_CORNERS = ((0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2))
_MIDDLES = (
    *((1, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0), (1, 0, 2), (2, 1, 2), (1, 2, 2), (0, 1, 2)),
    *((0, 0, 1), (2, 0, 1), (2, 2, 1), (0, 2, 1)),
)


class Solid(NamedTuple):
    """Places (n, 3) of nodes, and the lines of a deck with nodes, elements and constants."""

    places: np.ndarray
    deck: list[str]


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


def solid(kind: str, d: dict[str, float], walls: dict[str, dict[str, float]], along: float) -> Solid:
    """A profile or panel of quadratic bricks with their constants, of a length along x."""
    y_cuts, z_cuts, flange, web = section(kind, d)
    size = max(d["h"], d["b"]) / (20 if kind == "panel" else 6)
    x = np.linspace(0, d["L"], int(np.ceil(d["L"] / along)) + 1)
    cells = x, lines(y_cuts, size, d["tw"]), lines(z_cuts, size, d["tf"])
    fine = [np.interp(np.arange(2 * len(v) - 1) / 2, np.arange(len(v)), v) for v in cells]
    number: dict[tuple[int, int, int], int] = {}
    bricks: dict[str, list[list[int]]] = {"flange": [], "web": []}
    for j, k in product(*(range(len(v) - 1) for v in cells[1:])):
        place = fine[1][2 * j + 1], fine[2][2 * k + 1]
        wall = "flange" if flange(*place) else "web" if web(*place) else None
        for i in range(len(x) - 1) if wall else ():
            corner = np.array([2 * i, 2 * j, 2 * k])
            keys = [tuple((corner + step).tolist()) for step in (*_CORNERS, *_MIDDLES)]
            bricks[wall].append([number.setdefault(key, len(number) + 1) for key in keys])
    places = np.array([[v[i] for v, i in zip(fine, key, strict=True)] for key in number])
    deck = ["*NODE,NSET=ALL", *(f"{n}," + ",".join(f"{c:.9e}" for c in p) for n, p in enumerate(places, start=1))]
    first = 1
    for wall, axis in (("flange", "0.,1.,0."), ("web", "0.,0.,1.")):
        deck.append(f"*ELEMENT,TYPE=C3D20R,ELSET={wall}")
        for e, nodes in enumerate(bricks[wall], start=first):
            deck += [",".join(map(str, [e, *nodes[:15]])) + ",", ",".join(map(str, nodes[15:]))]
        first += len(bricks[wall])
        deck += [f"*ORIENTATION,NAME=O{wall},SYSTEM=RECTANGULAR", f"1.,0.,0.,{axis}"]
        deck += [f"*MATERIAL,NAME=M{wall}", "*ELASTIC,TYPE=ENGINEERING CONSTANTS"]
        names = ("E1", "E2", "E3", "nu12", "nu13", "nu23", "G12", "G13")
        deck += [",".join(f"{walls[wall][n]:.8g}" for n in names) + ",", f"{walls[wall]['G23']:.8g},293."]
        deck += ["*DENSITY", f"{walls[wall]['rho']:g}"]
        deck.append(f"*SOLID SECTION,ELSET={wall},MATERIAL=M{wall},ORIENTATION=O{wall}")
    return Solid(places, deck)


def modes(body: Solid, count: int, seen: Sequence[int] = (), *, clamped: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """(n,) frequencies in Hz, rigid ones first, and (n, p, 3) mass-normalised motions of the nodes that are seen."""
    held = np.flatnonzero(body.places[:, 0] == 0) + 1 if clamped else ()
    deck = [*body.deck, "*NSET,NSET=SEEN", ",\n".join(map(str, sorted({n + 1 for n in seen} or {1})))]
    deck += ["*NSET,NSET=ROOT", ",\n".join(map(str, held)), "*BOUNDARY", "ROOT,1,3"] if clamped else []
    table = calculix.ccx([*deck, "*STEP", "*FREQUENCY", str(count), "*NODE PRINT,NSET=SEEN", "U", "*END STEP"])
    return calculix.frequencies(table), calculix.displacements(table, [n + 1 for n in seen or (0,)])


def main(*kinds: str) -> None:
    """Print rms and worst error of 20 modes, shells alone and with joints."""
    if not shutil.which("ccx"):
        print("  (CalculiX is not installed)")
        return
    print("mm: kind, length, height, width, walls     shells alone    with joints   (rms / worst %, mean)")
    for kind, *sizes in CASES:
        if kinds and kind not in kinds:
            continue
        d = dict(zip(("L", "h", "b", "tf", "tw"), (size / 1000 for size in sizes), strict=True))
        truth = {"kind": kind, "true_dims": d, "walls": {"flange": WALL, "web": WALL}}
        exact, row = modes(solid(kind, d, {"flange": WALL, "web": WALL}, 0.018), 26)[0][6:], ""
        for on in (False, True):
            error = 100 * (frequencies(body(truth, 6, on), len(exact)) / exact - 1)
            row += f"   {np.sqrt(np.mean(error**2)):5.2f} /{np.abs(error).max():5.2f}"
        print(f"  {kind:8s}{sizes!s:32s}{row}   {error.mean():+.2f}", flush=True)
