"""A free strip of CalculiX's solids at 20 and 50 °C: Ex 3 % and every G 8 % lower at 50, damping 30
% higher.

`python -m tests.support.warm` solves it anew, and writes `warm.npz` beside this.
"""

from pathlib import Path

import numpy as np

from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import OrientedSpecimen
from fecore.frf import along_z
from fecore.modes import MeasuredModes
from fecore.updating.campaigns import Campaign
from fecore.updating.inputs import Inputs

SIZE = (0.30, 0.035, 0.006)
FALLS = {"Ex": 0.03, **dict.fromkeys(("Ey", "Ez", "Gxy", "Gxz", "Gyz"), 0.08)}
"""Share of each constant at 20 °C by which it is lower at 50 °C."""

_AT_20 = {
    "Ex": 35e9,
    "Ey": 9.5e9,
    "Ez": 9e9,
    "Gxy": 4.1e9,
    "Gxz": 3.6e9,
    "Gyz": 3.0e9,
    "nu_xy": 0.28,
    "nu_xz": 0.3,
    "nu_yz": 0.38,
    "density": 1900.0,
}
STATED = OrthotropicMaterial(
    Ex=38e9, Ey=9e9, Gxy=3.8e9, Gxz=3.8e9, Gyz=3.0e9, nu_xy=0.29, density=1900.0
)
"""What a laboratory has of a handbook."""
_MODES, _NOISE, _NOISE_OF_DAMPING = 6, 3e-4, 0.02
_STORED = Path(__file__).with_suffix(".npz")
_PLACES = [
    (float(x), y, 0.0)
    for x in np.linspace(SIZE[0] / 12, SIZE[0], 12)
    for y in (-SIZE[1] / 2, 0.0, SIZE[1] / 2)
]


def constants(temperature: float) -> dict[str, float]:
    """Of the solid."""
    return {
        name: value * (1 - FALLS.get(name, 0.0) * (temperature - 20) / 30)
        for name, value in _AT_20.items()
    }


def per_k(name: str, reference: float = 23.0) -> float:
    """The true coefficient of temperature of a constant."""
    return constants(reference + 1)[name] / constants(reference)[name] - 1


def campaign(
    temperature: float,
    random: np.random.Generator,
    stated: float | None = None,
    modes: int = _MODES,
) -> Campaign:
    """The strip measured at 20 or 50 °C, so many modes, with what the laboratory states of the
    temperature.
    """
    with np.load(_STORED) as kept:
        hz, shapes = (
            kept[f"{name}_{temperature:g}"][:modes].astype(float) for name in ("hz", "shapes")
        )
    omega, count = 2 * np.pi * hz, hz.size
    ratio = (1 + 0.3 * (temperature - 20) / 30) * (6 / omega + 1.2e-6 * omega) / 2
    sds = np.concatenate([_NOISE * hz, _NOISE_OF_DAMPING * ratio])
    off = sds * random.standard_normal(2 * count)
    dofs = along_z(range(1, len(_PLACES) + 1))
    measured = MeasuredModes(
        hz + off[:count], ratio + off[count:], shapes + 0j, dofs, np.diag(sds**2)
    )
    body = OrientedSpecimen(*SIZE, STATED, "free", divisions=(12, 2))
    points = dict(enumerate(_PLACES, start=1))
    return Campaign(
        f"{temperature:g}", "strip", body, measured, points, Inputs(), temperature_c=stated
    )


def main() -> None:
    """Solve and store."""
    from tests.support import calculix

    found = {}
    for temperature in (20, 50):
        body = calculix.plate((36, 4, 2), SIZE, constants(temperature))
        hz, shapes = calculix.modes(body, 16, body.nearest(_PLACES))
        across = np.sum(shapes[:, :, 2] ** 2, axis=1) > np.sum(shapes**2, axis=(1, 2)) / 2
        chosen = np.flatnonzero((hz > 5) & across)[:_MODES]  # of bending and torsion
        found |= {
            f"hz_{temperature}": hz[chosen],
            f"shapes_{temperature}": shapes[chosen, :, 2].astype(np.float32),
        }
    np.savez_compressed(_STORED, **found)


if __name__ == "__main__":
    main()
