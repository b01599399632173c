"""Beams of solids by another code, stored: cantilevers and free ones whose constants and sizes are
drawn at random.

`draw` has one solved by CalculiX; `store` keeps their first modes out of plane beside this file.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fecore.body.specimen import Specimen
from fecore.modes import MeasuredModes
from fecore.updating.inputs import Inputs
from fecore.updating.measurement import Measurement
from tests.support import calculix
from tests.support.draws import COUPONS, modes_at

STORED = Path(__file__).with_suffix(".npz")
BEAMS, MODES = 8, 6
_USUAL = {"Ex": 30e9, "Ey": 28e9, "Gxy": 5.5e9, "Gxz": 5e9, "Gyz": 5e9}
_SHARES = np.linspace(0, 1, 11)


@dataclass(frozen=True)
class Beam:
    """A solid: m modes at 33 points."""

    free: bool
    size: tuple[float, float, float]  # length, width, thickness, m
    true: dict[str, float]  # constants, SI
    hz: np.ndarray  # (m,)
    shapes: np.ndarray  # (m, 33) out of plane

    @property
    def points(self) -> dict[int, tuple[float, float, float]]:
        """Three across and eleven along, of a cantilever without its root."""
        along = self.size[0] * (_SHARES if self.free else np.arange(1, 12) / 11)
        return dict(
            enumerate(
                ((float(x), self.size[1] * y / 2, 0.0) for x in along for y in (-1, 0, 1)), start=1
            )
        )

    @property
    def stated(self) -> Specimen:
        """As a laboratory knows it: nominal constants."""
        material = replace(COUPONS, nu_xy=self.true["nu_xy"])
        return Specimen(*self.size, material, "free" if self.free else "cantilever")

    @property
    def as_it_is(self) -> Specimen:
        """With its true constants, on a mesh that misses 1e-5."""
        return replace(
            self.stated, material=replace(self.stated.material, **self.true), divisions=(40, 6)
        )

    def modes(self, share: float = 1e-5) -> MeasuredModes:
        """As measured, with a share of each frequency as standard deviation."""
        return modes_at(self.points, self.hz, self.shapes, share)

    def measurement(self, inputs: Inputs) -> Measurement:
        """Its modes and nothing else."""
        return Measurement(None, self.points, self.modes(), inputs=inputs)


def draw(seed: int) -> Beam:
    """Constants within ± 20 % of usual ones, every second beam free, every second pair of other
    sizes than usual.
    """
    rng = np.random.default_rng([53, seed])
    true = {name: float(value * rng.uniform(0.8, 1.2)) for name, value in _USUAL.items()}
    free, size = bool(seed % 2), np.array([0.501 if seed % 2 else 0.5, 0.04, 0.01012])
    if seed % 4 >= 2:
        size *= [rng.uniform(0.75, 1.2), rng.uniform(0.75, 1.5), rng.uniform(0.7, 1.3)]
    true["nu_xy"] = float(rng.uniform(0.12, 0.2))
    beam = Beam(free, tuple(map(float, size)), true, np.zeros(0), np.zeros((0, 33)))  # type: ignore[arg-type]
    constants = true | {"Ez": 1e10, "nu_xz": 0.15, "nu_yz": 0.15, "density": COUPONS.density}
    body = calculix.plate((50 if free else 55, 6, 2), beam.size, constants)
    hz, motion = calculix.modes(
        body, 46, body.nearest(list(beam.points.values())), clamped=not free
    )
    square = np.sum(motion**2, axis=1)
    kept = np.flatnonzero((hz > 1.0) & (square[:, 2] > square[:, 0] + square[:, 1]))[:MODES]
    return replace(beam, hz=hz[kept], shapes=motion[kept, :, 2])


def store() -> None:
    """Draw the beams anew and keep them."""
    beams = [draw(seed) for seed in range(BEAMS)]
    np.savez_compressed(
        STORED,
        free=[beam.free for beam in beams],
        size=[beam.size for beam in beams],
        true=[list(beam.true.values()) for beam in beams],
        hz=[beam.hz for beam in beams],
        shapes=np.array(
            [beam.shapes / np.abs(beam.shapes).max() for beam in beams], dtype=np.float16
        ),
    )


def stored() -> list[Beam]:
    """The kept ones."""
    names = (*_USUAL, "nu_xy")
    with np.load(STORED) as kept:
        rows = zip(*(kept[name] for name in ("free", "size", "true", "hz", "shapes")), strict=True)
        return [
            Beam(
                bool(free),
                tuple(map(float, size)),  # type: ignore[arg-type]
                dict(zip(names, map(float, true), strict=True)),
                hz,
                shapes.astype(float),
            )
            for free, size, true, hz, shapes in rows
        ]
