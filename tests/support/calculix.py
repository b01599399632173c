"""Models that CalculiX solves (the `ccx` process, where it is installed): bodies of solid
elements.
"""

import re
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import count, product
from pathlib import Path

import numpy as np


def ccx(lines: Sequence[str]) -> str:
    """The printed output of a run."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "beam.inp").write_text("\n".join([*lines, ""]))
        done = subprocess.run(
            ["ccx", "-i", "beam"], cwd=folder, check=True, capture_output=True, text=True
        )
        assert "*ERROR" not in done.stdout, done.stdout
        return Path(folder, "beam.dat").read_text()


def frequencies(table: str) -> np.ndarray:
    """(n,) natural frequencies in Hz of a printed output."""
    rows = re.findall(
        r"^\s+\d+\s+\S+\s+\S+\s+(\S+)\s+\S+\s*$", table.split("P A R T I C I P")[0], re.MULTILINE
    )
    return np.array([float(row) for row in rows])


def displacements(table: str, nodes: Sequence[int]) -> np.ndarray:
    """(blocks, nodes, 3) printed displacements; Fortran leaves the E out of an exponent of three
    digits.
    """
    found = []
    for block in table.split("displacements (vx,vy,vz)")[1:]:
        rows = [line.split() for line in block.splitlines()[2 : 2 + len(set(nodes))]]
        values = {
            int(row[0]): [float(re.sub(r"(?<=\d)([-+]\d{3})$", r"E\1", x)) for x in row[1:4]]
            for row in rows
        }
        found.append([values[node] for node in nodes])
    return np.array(found)


_CORNERS, _SIDES = ((0, 0), (2, 0), (2, 2), (0, 2)), ((1, 0), (2, 1), (1, 2), (0, 1))
_RINGS = ((_CORNERS, 0), (_CORNERS, 2), (_SIDES, 0), (_SIDES, 2), (_CORNERS, 1))
# of the nodes of C3D20R, in half elements
BRICK = [(x, y, z) for ring, z in _RINGS for x, y in ring]


@dataclass(frozen=True)
class Solid:
    """A body of 20-node bricks."""

    places: np.ndarray  # (n, 3) of its nodes
    bricks: int  # how many
    deck: list[str]  # lines with nodes, elements and constants

    def nearest(self, places: Sequence[Sequence[float]]) -> list[int]:
        """Numbers from 1 of the nodes that are nearest to (p, 3) places."""
        return [
            int(np.argmin(np.sum((self.places - place) ** 2, axis=1))) + 1
            for place in np.asarray(places)
        ]


def solid(
    cells: Sequence[Sequence[float]],
    part: Callable[[float, float, float], str | None],
    materials: Mapping[str, list[str]],
) -> Solid:
    """Bricks in the cells of a grid.

    Args:
        cells: where they begin and end along x, y and z.
        part: name of the part in which the cells at x, y, z lie, None where there is nothing.
        materials: lines of a deck by part, as of `orthotropic`.
    """
    halves = [np.interp(np.arange(2 * len(v) - 1) / 2, np.arange(len(v)), v) for v in cells]
    numbers: dict[tuple[int, ...], int] = {}
    bricks: dict[str, list[list[int]]] = {name: [] for name in materials}
    for i, j, k in product(*(range(len(v) - 1) for v in cells)):
        if name := part(*(v[2 * at + 1] for v, at in zip(halves, (i, j, k), strict=True))):
            at = [(2 * i + x, 2 * j + y, 2 * k + z) for x, y, z in BRICK]
            bricks[name].append([numbers.setdefault(each, len(numbers) + 1) for each in at])
    places = np.array([[v[i] for v, i in zip(halves, key, strict=True)] for key in numbers])
    deck = [
        "*NODE, NSET=ALL",
        *(f"{n},{x:.12g},{y:.12g},{z:.12g}" for n, (x, y, z) in enumerate(places, start=1)),
    ]
    number = count(1)
    for name, rows in bricks.items():
        deck.append(f"*ELEMENT, TYPE=C3D20R, ELSET={name}")
        for nodes in rows:
            deck += [
                ",".join(map(str, [next(number), *nodes[:15]])) + ",",
                ",".join(map(str, nodes[15:])),
            ]
        deck += materials[name]
    return Solid(places, sum(map(len, bricks.values())), deck)


def orthotropic(
    part: str, constants: Sequence[float], density: float, axes: str = "1,0,0,0,1,0"
) -> list[str]:
    """Lines of a part's material: E1, E2, E3, ν12, ν13, ν23, G12, G13, G23 along the first two
    axes, and the density.
    """
    *eight, last = (f"{value:.9g}" for value in constants)
    return [
        *(f"*ORIENTATION, NAME=O{part}, SYSTEM=RECTANGULAR", axes, f"*MATERIAL, NAME=M{part}"),
        *(
            "*ELASTIC, TYPE=ENGINEERING CONSTANTS",
            ",".join(eight) + ",",
            last,
            "*DENSITY",
            f"{density:.9g}",
        ),
        f"*SOLID SECTION, ELSET={part}, MATERIAL=M{part}, ORIENTATION=O{part}",
    ]


def plate(
    counts: tuple[int, int, int],
    size: tuple[float, float, float],
    constants: Mapping[str, float],
    angle: float = 0.0,
) -> Solid:
    """A strip or plate from x = 0, about y = z = 0.

    Args:
        counts: bricks along x, y and z.
        size: length, width and thickness in m.
        constants: Ex, Ey, Ez, nu_xy, nu_xz, nu_yz, Gxy, Gxz, Gyz in Pa and density in kg/m³.
        angle: of the material in the plane, rad.
    """
    begin = np.array([0, -size[1] / 2, -size[2] / 2])
    cells = [
        np.linspace(a, a + length, n + 1) for a, length, n in zip(begin, size, counts, strict=True)
    ]
    names = ("Ex", "Ey", "Ez", "nu_xy", "nu_xz", "nu_yz", "Gxy", "Gxz", "Gyz")
    cos, sin = np.cos(angle), np.sin(angle)
    axes = f"{cos:.12g},{sin:.12g},0.,{-sin:.12g},{cos:.12g},0."
    material = orthotropic("E", [constants[name] for name in names], constants["density"], axes)
    return solid(cells, lambda _x, _y, _z: "E", {"E": material})


def modes(
    body: Solid,
    most: int,
    seen: Sequence[int] = (1,),
    *,
    clamped: bool = False,
    mass: tuple[int, float] | None = None,
    springs: Sequence[tuple[Sequence[int], int, float]] = (),
) -> tuple[np.ndarray, np.ndarray]:
    """(n,) frequencies in Hz, rigid ones first, and (n, p, 3) mass-normalised motions of nodes.

    Args:
        body: free.
        most: modes that are solved for.
        seen: (p,) the nodes.
        clamped: at x = 0; where springs hold a direction there, in the others.
        springs: nodes, the direction (1, 2, 3) and N/m of a spring to the ground at each.
        mass: a node with a point mass, and its kg.
    """
    deck = [*body.deck, "*NSET, NSET=SEEN", ",\n".join(map(str, sorted(set(seen))))]
    if mass is not None:
        deck += ["*ELEMENT, TYPE=MASS, ELSET=SENSOR", f"{body.bricks + 1},{mass[0]}"]
        deck += ["*MASS, ELSET=SENSOR", f"{mass[1]:g}"]
    if clamped:
        root = np.flatnonzero(body.places[:, 0] == 0) + 1
        sprung = {direction for _, direction, _ in springs}
        held = [f"ROOT,{direction}" for direction in (1, 2, 3) if direction not in sprung]
        deck += ["*NSET, NSET=ROOT", ",\n".join(map(str, root)), "*BOUNDARY", *held]
    number = count(body.bricks + 2)
    for place, (nodes, direction, stiffness) in enumerate(springs):
        deck += [
            f"*ELEMENT, TYPE=SPRING1, ELSET=SPRINGS{place}",
            *(f"{next(number)},{node}" for node in nodes),
        ]
        deck += [f"*SPRING, ELSET=SPRINGS{place}", f"{direction}", f"{stiffness:.9g}"]
    table = ccx(
        [*deck, "*STEP", "*FREQUENCY", str(most), "*NODE PRINT, NSET=SEEN", "U", "*END STEP"]
    )
    return frequencies(table), displacements(table, seen)
