"""Free panels with a cut-out, curved, tapered: solids by another code, stored, and decks of shells
with meshes of their own.

`solve` has them solved anew by CalculiX.
"""

from itertools import pairwise, product
from pathlib import Path

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.mesh import CellBlock, Mesh
from fecore.body.sections import ShellSection
from fecore.body.structure import Structure
from fecore.frf import Dof
from fecore.modes import MeasuredModes
from tests.support.calculix import BRICK, Solid, modes, orthotropic

LENGTH, WIDTH, THICKNESS, RADIUS = 0.3, 0.2, 0.01, 0.18
TRUTH = {"E1": 26e9, "E2": 9.5e9, "G12": 3.4e9, "G13": 2.6e9, "G23": 2.2e9, "nu12": 0.27}
NOMINAL = {"E1": 23e9, "E2": 8.5e9, "G12": 3e9, "G13": 3e9, "G23": 2.4e9, "nu12": 0.27}
DENSITY = 1850.0
HOLE = (1 / 3, 2 / 3), (0.25, 0.75)  # shares of length and width
MODES = 14
KINDS = ("cut-out", "curved", "tapered")
STORED = Path(__file__).with_suffix(".npz")
POINTS = [(u, v) for u in (0.0, 1 / 6, 1 / 3, 2 / 3, 5 / 6, 1.0) for v in (0.0, 0.25, 0.75, 1.0)]


def place(kind: str, u: FloatArray, v: FloatArray, out: FloatArray | float = 0.0) -> FloatArray:
    """(n, 3) places at shares of length and width, so far out of the middle surface, m."""
    x, y, z = LENGTH * u, WIDTH * (v - 0.5), np.zeros_like(u) + out
    if kind == "curved":
        angle = WIDTH * 1.25 / RADIUS * (v - 0.5)
        y, z = (RADIUS + out) * np.sin(angle), (RADIUS + out) * np.cos(angle)
    if kind == "tapered":
        y = y * (1 - 0.5 * u)
    return np.column_stack([x, y, z])


def _cells(kind: str, along: int, across: int) -> list[tuple[int, int]]:
    """Cells of a grid that are there."""

    def is_hole(i: int, j: int) -> bool:
        middle = (i + 0.5) / along, (j + 0.5) / across
        return kind == "cut-out" and all(
            low < m < high for m, (low, high) in zip(middle, HOLE, strict=True)
        )

    return [(i, j) for i, j in product(range(along), range(across)) if not is_hole(i, j)]


def deck(
    kind: str, along: int, across: int, element: str, constants: dict[str, float] = NOMINAL
) -> Structure:
    """The panel as a user's deck has it, of `quad4` or `quad8`."""
    step = 2 if element == "quad8" else 1
    ring = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1)][: 4 if step == 1 else 8]
    numbers: dict[tuple[int, int], int] = {}
    rows = [
        [
            numbers.setdefault((step * i + step * a // 2, step * j + step * b // 2), len(numbers))
            for a, b in ring
        ]
        for i, j in _cells(kind, along, across)
    ]
    at = np.array(list(numbers)) / [step * along, step * across]
    mesh = Mesh(place(kind, at[:, 0], at[:, 1]), (CellBlock(element, np.array(rows), "skin"),))
    c = constants
    material = OrthotropicMaterial(
        c["E1"], c["E2"], c["G12"], c["G13"], c["G23"], c["nu12"], DENSITY
    )
    return Structure(mesh, {"skin": ShellSection((Ply(material, THICKNESS),))})


def _nearer(share: FloatArray, cells: int, hole: tuple[float, float]) -> FloatArray:
    """Shares of a length, of nodes of even cells, moved to the ends of a hole: about its corners
    stresses are singular.

    Even grids of solids or shells have frequencies up to 0.8 % too high.
    """
    even = np.arange(cells + 1) / cells
    lines = np.zeros_like(even)
    for low, high in pairwise((0.0, *hole, 1.0)):
        inside = (even >= low - 1e-9) & (even <= high + 1e-9)
        t = (even[inside] - low) / (high - low)
        if low == 0:
            t = 1 - (1 - t) ** 2
        elif high == 1:
            t = t**2
        else:
            t = np.where(t < 0.5, 2 * t**2, 1 - 2 * (1 - t) ** 2)
        lines[inside] = low + (high - low) * t
    return np.interp(share, even, lines)


def _solid(kind: str, along: int = 30, across: int = 20, layers: int = 4) -> Solid:
    """Of four layers: two have the shear of a parabola 1 % too stiff, and frequencies up to 0.05 %
    too high.
    """
    numbers: dict[tuple[int, int, int], int] = {}
    bricks = []
    for (i, j), k in product(_cells(kind, along, across), range(layers)):
        at = [(2 * i + x, 2 * j + y, 2 * k + z) for x, y, z in BRICK]
        bricks.append([numbers.setdefault(each, len(numbers) + 1) for each in at])
    u, v, w = (np.array(list(numbers)) / [2 * along, 2 * across, 2 * layers]).T
    if kind == "cut-out":
        u, v = (_nearer(*each) for each in zip((u, v), (along, across), HOLE, strict=True))
    places = place(kind, u, v, THICKNESS * (w - 0.5))
    lines = [
        "*NODE, NSET=ALL",
        *(f"{n},{x:.12g},{y:.12g},{z:.12g}" for n, (x, y, z) in enumerate(places, start=1)),
    ]
    lines.append("*ELEMENT, TYPE=C3D20R, ELSET=E")
    for number, nodes in enumerate(bricks, start=1):
        lines += [",".join(map(str, [number, *nodes[:15]])) + ",", ",".join(map(str, nodes[15:]))]
    c, through = TRUTH, TRUTH["E2"]
    nu21 = c["nu12"] * c["E2"] / c["E1"]
    flat = (c["E1"], c["E2"], through, c["nu12"], c["nu12"], 0.4, c["G12"], c["G13"], c["G23"])
    # About the axis x: radial, tangential, axial.
    turned = (through, c["E2"], c["E1"], 0.4, nu21, nu21, c["G23"], c["G13"], c["G12"])
    material = orthotropic(
        "E",
        turned if kind == "curved" else flat,
        DENSITY,
        "0,0,0,1,0,0" if kind == "curved" else "1,0,0,0,1,0",
    )
    if kind == "curved":
        material[0] = material[0].replace("RECTANGULAR", "CYLINDRICAL")
    return Solid(places, len(bricks), lines + material)


def measured(kind: str) -> tuple[MeasuredModes, dict[int, tuple[float, float, float]]]:
    """Modes of the stored solid, to 0.02 %, with shapes along three axes at points of its middle
    surface.
    """
    stored = np.load(STORED)
    hz, shapes = stored[f"{kind} hz"], stored[f"{kind} shapes"]
    places = place(kind, *np.array(POINTS).T)
    points = {n: tuple(map(float, xyz)) for n, xyz in enumerate(places, start=1)}
    dofs = tuple(Dof(n, axis) for n in points for axis in (1, 2, 3))
    covariance = np.diag(np.concatenate([(2e-4 * hz) ** 2, np.full(hz.size, 1e-8)]))
    return (
        MeasuredModes(
            hz, np.full(hz.size, 0.01), shapes.reshape(len(hz), -1) + 0j, dofs, covariance
        ),
        points,
    )


def solve() -> dict[str, FloatArray]:
    """The solids' modes by CalculiX: frequencies in Hz, and shapes at the points."""
    found = {}
    for kind in KINDS:
        body = _solid(kind, 36, 32) if kind == "cut-out" else _solid(kind)
        hz, shapes = modes(body, MODES + 6, body.nearest(place(kind, *np.array(POINTS).T)))
        found |= {f"{kind} hz": hz[6:], f"{kind} shapes": np.float32(shapes[6:])}
    return found
