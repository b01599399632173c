"""Strips of solids on a soft root and on a foot, which nobody stated: solved by another code,
stored.

`solve` has them solved anew by CalculiX.
"""

from pathlib import Path

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import Specimen
from fecore.modes import MeasuredModes
from tests.support import calculix
from tests.support.draws import modes_at

SIZE = (0.3, 0.03, 0.004)
TRUTH = {
    "Ex": 33e9, "Ey": 12e9, "Ez": 11e9, "nu_xy": 0.25, "nu_xz": 0.28, "nu_yz": 0.38,
    "Gxy": 4.5e9, "Gxz": 4.2e9, "Gyz": 3.6e9, "density": 1950.0,
}  # fmt: skip
STIFFNESS = {"root": 100.0, "foot": 2e4}
"""Of the root in rotation, N·m/rad: EI/kL = 0.18; of the foot along the end x = 0, N/m."""

MODES = 9
STORED = Path(__file__).with_suffix(".npz")
PLACES = np.array(
    [
        (x, y)
        for x in np.linspace(0.06, 0.99, 11) * SIZE[0]
        for y in np.array([-0.45, 0, 0.45]) * SIZE[1]
    ]
)


def stated(kind: str) -> Specimen:
    """The strip as the laboratory states it: held firmly, or free, of moduli that are some per cent
    off.
    """
    names = ("Ex", "Ey", "Gxy", "Gxz", "Gyz")
    guess = {
        name: TRUTH[name] * factor
        for name, factor in zip(names, (1.1, 0.9, 0.92, 1.08, 1.0), strict=True)
    }
    material = OrthotropicMaterial(**guess, nu_xy=0.27, density=TRUTH["density"])
    return Specimen(*SIZE, material, "cantilever" if kind == "root" else "free", divisions=(16, 3))


def measured(kind: str) -> tuple[MeasuredModes, dict[int, tuple[float, float, float]]]:
    """Modes of the stored solid, scattered by 0.1 %, with shapes out of plane at points."""
    stored, random = np.load(STORED), np.random.default_rng(53)
    hz, shapes = stored[f"{kind} hz"], stored[f"{kind} shapes"]
    points = {number: (float(x), float(y), 0.0) for number, (x, y) in enumerate(PLACES, start=1)}
    return modes_at(points, hz * (1 + 1e-3 * random.standard_normal(hz.size)), shapes, 3e-4), points


def solve() -> dict[str, FloatArray]:
    """The solids' modes out of plane by CalculiX: frequencies in Hz, and shapes at the points."""
    body, found = calculix.plate((34, 4, 1), SIZE, TRUTH), {}
    seen = body.nearest([(x, y, SIZE[2] / 2) for x, y in PLACES])
    root = (np.flatnonzero(body.places[:, 0] == 0) + 1).tolist()
    height = float(np.sum(body.places[np.array(root) - 1, 2] ** 2))
    springs = {
        "root": (root, 1, STIFFNESS["root"] / height),
        "foot": (root, 3, STIFFNESS["foot"] / len(root)),
    }
    for kind, spring in springs.items():
        hz, shapes = calculix.modes(body, 26, seen, clamped=kind == "root", springs=[spring])
        flat = np.sum(shapes[..., 2] ** 2, axis=1) > np.sum(shapes[..., :2] ** 2, axis=(1, 2))
        kept = np.flatnonzero(flat & (hz > 20.0 if kind == "foot" else hz > 1.0))[:MODES]
        found |= {f"{kind} hz": hz[kept], f"{kind} shapes": np.float32(shapes[kept, :, 2])}
    return found
