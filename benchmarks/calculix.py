"""Models that CalculiX solves (the `ccx` process, where it is installed): bodies of solid elements, and a peer of shells."""

import re
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fecore.body.mesh import rectangle
from fecore.body.specimen import Specimen

MODES = 10


def ccx(lines: Sequence[str]) -> str:
    """The printed output of a run."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "beam.inp").write_text("\n".join([*lines, ""]))
        done = subprocess.run(["ccx", "-i", "beam"], cwd=folder, check=True, capture_output=True, text=True)
        assert "*ERROR" not in done.stdout, done.stdout
        return Path(folder, "beam.dat").read_text()


def frequencies(table: str) -> np.ndarray:
    """(n,) natural frequencies in Hz of a printed output."""
    rows = re.findall(r"^\s+\d+\s+\S+\s+\S+\s+(\S+)\s+\S+\s*$", table.split("P A R T I C I P")[0], re.MULTILINE)
    return np.array([float(row) for row in rows])


def displacements(table: str, nodes: Sequence[int]) -> np.ndarray:
    """(blocks, nodes, 3) printed displacements; Fortran leaves the E out of an exponent of three digits."""
    found = []
    for block in table.split("displacements (vx,vy,vz)")[1:]:
        rows = [line.split() for line in block.splitlines()[2 : 2 + len(set(nodes))]]
        values = {int(row[0]): [float(re.sub(r"(?<=\d)([-+]\d{3})$", r"E\1", x)) for x in row[1:4]] for row in rows}
        found.append([values[node] for node in nodes])
    return np.array(found)


def solid_modes(
    counts: tuple[int, int, int],
    size: tuple[float, float, float],
    seen: Sequence[tuple[int, int]],
    constants: dict[str, float],
    *,
    modes: int,
    clamped: bool = False,
    angle: float = 0.0,
    mass: tuple[int, float] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """(n,) frequencies in Hz and (n, p, 3) mass-normalised motions of a plate of 20-node solid elements.

    Args:
        counts: elements along x, y and z.
        size: length, width and thickness in m.
        seen: (p,) places in the middle plane, in half elements along x and y.
        constants: Ex, Ey, Ez, nu_xy, nu_xz, nu_yz, Gxy, Gxz, Gyz in Pa and density in kg/m³.
        modes: how many are solved for.
        clamped: at x = 0; else free.
        angle: of the material in the plane, rad.
        mass: the number in `seen` that a point mass is at, and its kg.
    """
    number, places, bricks = _grid(counts, size)
    nodes = [int(number[i, j, counts[2]]) for i, j in seen]
    c, (cos, sin) = constants, (np.cos(angle), np.sin(angle))
    lines = ["*NODE, NSET=ALL", *(f"{n},{x:.12g},{y:.12g},{z:.12g}" for n, (x, y, z) in enumerate(places, start=1))]
    lines.append("*ELEMENT, TYPE=C3D20R, ELSET=E")
    for element, corners in enumerate(bricks.tolist(), start=1):
        lines += [f"{element}," + ",".join(map(str, corners[:15])) + ",", ",".join(map(str, corners[15:]))]
    lines += ["*NSET, NSET=SEEN", ",\n".join(map(str, nodes))]
    lines += ["*ORIENTATION, NAME=TURNED, SYSTEM=RECTANGULAR", f"{cos:.12g},{sin:.12g},0.,{-sin:.12g},{cos:.12g},0."]
    lines += ["*MATERIAL, NAME=M", "*ELASTIC, TYPE=ENGINEERING CONSTANTS"]
    names = ("Ex", "Ey", "Ez", "nu_xy", "nu_xz", "nu_yz", "Gxy", "Gxz")
    lines += [",".join(f"{c[name]:g}" for name in names), f"{c['Gyz']:g}", "*DENSITY", f"{c['density']:.9g}"]
    lines.append("*SOLID SECTION, ELSET=E, MATERIAL=M, ORIENTATION=TURNED")
    if mass is not None:
        lines += ["*ELEMENT, TYPE=MASS, ELSET=SENSOR", f"{len(bricks) + 1},{nodes[mass[0]]}"]
        lines += ["*MASS, ELSET=SENSOR", f"{mass[1]:g}"]
    if clamped:
        root = np.flatnonzero(places[:, 0] == 0) + 1
        lines += ["*NSET, NSET=ROOT", ",\n".join(map(str, root)), "*BOUNDARY", "ROOT,1,3"]
    table = ccx([*lines, "*STEP", "*FREQUENCY", str(modes), "*NODE PRINT, NSET=SEEN", "U", "*END STEP"])
    return frequencies(table), displacements(table, nodes)


def _grid(counts: tuple[int, int, int], size: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Node numbers on a grid of half elements (0: none there), coordinates, and the 20 nodes of each element."""
    shape = tuple(2 * n + 1 for n in counts)
    i, j, k = np.indices(shape)
    real = (i % 2) + (j % 2) + (k % 2) < 2  # corners and mid-sides
    number = np.where(real, np.cumsum(real.ravel()).reshape(shape), 0)
    step = np.array(size) / (2 * np.array(counts))
    places = np.column_stack([i[real], j[real], k[real]]) * step - [0, size[1] / 2, size[2] / 2]
    corner = np.indices(counts).reshape(3, -1).T * 2
    below = ((0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0))
    above, upright = (tuple((x, y, z) for x, y, _ in below) for z in (2, 1))
    flat, top = (tuple((x, y, z) for x, y in ((1, 0), (2, 1), (1, 2), (0, 1))) for z in (0, 2))
    at = corner[:, None] + np.array((*below, *above, *flat, *top, *upright))
    return number, places, number[at[..., 0], at[..., 1], at[..., 2]]


def shell(specimen: Specimen) -> np.ndarray:
    """Ten frequencies of a cantilever of 40 × 4 S8R shells; it has in-plane modes too."""
    return frequencies(ccx([*_shells(specimen), "*STEP", "*FREQUENCY", str(MODES), "*END STEP"]))


def shell_frfs(specimen: Specimen, a0: float, a1: float, highest_hz: float, between: int) -> np.ndarray:
    """(lines, 33) receptances by steady state dynamics, which places so many lines between two natural frequencies."""
    nodes = rectangle(specimen.length, specimen.width, 40, 4).nodes
    places = [(x, y) for x in np.linspace(0.05, specimen.length, 11) for y in (-0.02, 0.0, 0.02)]
    seen = [int(np.argmin(np.linalg.norm(nodes - place, axis=1))) + 1 for place in places]
    table = ccx(
        [
            *_shells(specimen),
            *("*NSET, NSET=SEEN", ",\n".join(map(str, seen))),
            *("*STEP", "*FREQUENCY, STORAGE=YES", str(MODES), "*CLOAD", f"{seen[-1]},3,0.", "*END STEP"),
            *("*STEP", "*STEADY STATE DYNAMICS", f"0.3125,{highest_hz:g},{between},1."),
            *("*MODAL DAMPING, RAYLEIGH", f",,{a0:g},{a1:g}", "*CLOAD", f"{seen[-1]},3,1."),
            *("*NODE PRINT, NSET=SEEN", "U", "*END STEP"),
        ]
    )
    w = displacements(table, seen)[..., 2]
    return np.asarray(w[0::2] + 1j * w[1::2])  # for each line first the real parts, then the imaginary ones


def _shells(specimen: Specimen) -> list[str]:
    """Mesh, material and clamp."""
    mesh, m = rectangle(specimen.length, specimen.width, 40, 4), specimen.material
    lines = ["*NODE, NSET=ALL", *(f"{i + 1},{x:.12g},{y:.12g},0" for i, (x, y) in enumerate(mesh.nodes))]
    lines.append("*ELEMENT, TYPE=S8R, ELSET=E")
    lines += [",".join(map(str, [i + 1, *(e + 1)])) for i, e in enumerate(mesh.elements)]
    root = ",\n".join(str(node + 1) for node in mesh.nodes_at_x(0))
    lines += ["*NSET, NSET=ROOT", root, "*MATERIAL, NAME=M", "*ELASTIC, TYPE=ENGINEERING CONSTANTS"]
    nu = m.nu_xy
    lines += [f"{m.Ex:g},{m.Ey:g},{m.Ey:g},{nu:g},{nu:g},{nu:g},{m.Gxy:g},{m.Gxz:g}", f"{m.Gyz:g}"]
    lines += ["*DENSITY", f"{m.density:g}", "*SHELL SECTION, ELSET=E, MATERIAL=M", f"{specimen.thickness:g}"]
    return [*lines, "*BOUNDARY", "ROOT,1,6"]
