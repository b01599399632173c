"""A free strip and a free angle's web that have lost stiffness in a stretch, and sound ones: solids
by another code, stored.

`solve` has them solved anew by CalculiX.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.generators import profile
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.sections import ShellSection
from fecore.body.specimen import Specimen
from fecore.body.structure import Structure
from fecore.frf import Dof
from fecore.modes import MeasuredModes
from fecore.updating.inputs import Inputs
from fecore.updating.measurement import Measurement
from tests.support.calculix import modes, orthotropic, solid

LENGTH, WIDTH, HEIGHT = {"strip": 0.4, "angle": 0.6}, {"strip": 0.05, "angle": 0.06}, 0.07
THICKNESS = {"strip": 0.008, "angle": 0.005}
TRUTH = (24e9, 9e9, 8.1e9, 0.26, 0.3, 0.35, 3.2e9, 2.9e9, 2.4e9)
NOMINAL = OrthotropicMaterial(23e9, 8.5e9, 3e9, 3e9, 2.4e9, 0.27, 1850.0)
PARTS, LOST, FACTOR = 20, {"strip": (9, 11), "angle": (8, 10)}, 0.7
"""Bricks along the length, the first and the last but one of those that have lost stiffness, and
what is left.
"""

MODES, NOISE = {"strip": 10, "angle": 16}, 5e-4
STORED = Path(__file__).with_suffix(".npz")


def points(kind: str) -> list[tuple[tuple[float, float, float], int]]:
    """Places of the measured points, on the surface, and their directions."""
    stations = np.linspace(0, LENGTH[kind], 2 * PARTS + 1)[1::4]
    side, top = WIDTH[kind] / 2, HEIGHT / 2
    if kind == "strip":
        return [((float(x), y, 0.0), 3) for x in stations for y in (-side, 0.0, side)]
    rows = [(0.0, -top, 3), (side, -top, 3), (-side, 0.0, 2), (-side, top, 2)]
    return [((float(x), y, z), axis) for x in stations for y, z, axis in rows]


def body(kind: str) -> Specimen | Structure:
    """What a user states."""
    size = LENGTH[kind], WIDTH[kind]
    if kind == "strip":
        return Specimen(*size, THICKNESS[kind], NOMINAL, "free")
    mesh = profile(kind, size[0], HEIGHT, size[1], THICKNESS[kind], THICKNESS[kind], 4)
    section = ShellSection((Ply(NOMINAL, THICKNESS[kind]),))
    return Structure(mesh, dict.fromkeys(("flange", "web"), section), size=(*size, HEIGHT))


def measured(kind: str, *, damaged: bool, seed: int = 0) -> Measurement:
    """Modes of a stored solid with noise, to `NOISE` of a frequency and 1 % of a shape's largest
    entry.
    """
    random, stored = np.random.default_rng(seed), np.load(STORED)
    name = f"{kind} damaged" if damaged else kind
    hz = stored[f"{name} hz"] * (1 + NOISE * random.standard_normal(MODES[kind]))
    shapes = np.float64(stored[f"{name} shapes"])
    shapes += (
        0.01 * np.abs(shapes).max(axis=1, keepdims=True) * random.standard_normal(shapes.shape)
    )
    places = dict(enumerate(points(kind), start=1))
    covariance = np.diag(np.concatenate([(NOISE * hz) ** 2, np.full(hz.size, 1e-8)]))
    dofs = tuple(Dof(number, axis) for number, (_, axis) in places.items())
    found = MeasuredModes(hz, np.full(hz.size, 0.01), shapes + 0j, dofs, covariance)
    inputs = replace(
        Inputs.exact(), length_sd=5e-4 * LENGTH[kind], thickness_sd=0.005 * THICKNESS[kind]
    )
    return Measurement(
        None, {number: place for number, (place, _) in places.items()}, found, inputs=inputs
    )


def solve() -> dict[str, FloatArray]:
    """The solids' modes by CalculiX: frequencies in Hz, and shapes at the points."""
    found: dict[str, FloatArray] = {}
    for kind in LENGTH:
        for name, factor in ((kind, 1.0), (f"{kind} damaged", FACTOR)):
            hz, shapes = _solved(kind, factor)
            found |= {f"{name} hz": hz, f"{name} shapes": np.float32(shapes)}
    return found


def _solved(kind: str, factor: float) -> tuple[FloatArray, FloatArray]:
    """Modes that the points see, of the strip or of the angle's web with this share of its
    stiffness left in a stretch.
    """
    t, side, top = THICKNESS[kind], WIDTH[kind] / 2, HEIGHT / 2
    x = np.linspace(0, LENGTH[kind], PARTS + 1)
    if kind == "strip":
        cells = x, np.linspace(-side, side, 7), np.linspace(-t / 2, t / 2, 3)
    else:
        y = np.concatenate([np.linspace(-side, -side + t, 3), np.linspace(-side + t, side, 6)[1:]])
        z = np.concatenate([np.linspace(-top, -top + t, 3), np.linspace(-top + t, top, 7)[1:]])
        cells = x, y, z
    lost = x[LOST[kind][0]], x[LOST[kind][1]]

    def part(at: float, y: float, z: float) -> str | None:
        if kind == "angle" and z < -top + t:
            return "flange"
        web = kind == "strip" or y < -side + t
        return None if not web else "lost" if lost[0] < at < lost[1] else "web"

    materials = {}
    for name in ("flange", "web", "lost") if kind == "angle" else ("web", "lost"):
        axes = "1,0,0,0,0,1" if kind == "angle" and name != "flange" else "1,0,0,0,1,0"
        left = [factor if name == "lost" and not 3 <= k < 6 else 1.0 for k in range(9)]
        materials[name] = orthotropic(
            name, np.multiply(TRUTH, left).tolist(), NOMINAL.density, axes
        )
    bricks = solid(cells, part, materials)
    seen = points(kind)
    hz, motions = modes(bricks, MODES[kind] + 14, bricks.nearest([place for place, _ in seen]))
    shapes = np.array([motions[:, k, axis - 1] for k, (_, axis) in enumerate(seen)]).T
    moving = np.flatnonzero(np.abs(shapes).max(axis=1) > 0.2 * np.abs(shapes[6:]).max())
    kept = moving[moving >= 6][: MODES[kind]]
    return hz[kept], shapes[kept]
