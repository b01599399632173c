"""The paper's cantilever: nominal constants, measured modes, the grid of its tour."""

import numpy as np

from fecore.body.constants import Parameter
from fecore.body.laminate import OrthotropicMaterial
from fecore.frf import Dof

COUPONS = OrthotropicMaterial(
    Ex=33.05e9, Ey=31.80e9, Gxy=5.73e9, Gxz=4.5e9, Gyz=4.5e9, nu_xy=0.15, density=2012.0
)
TABLE_4 = {"Ex": 31.66e9, "Ey": 31.80e9, "Gxy": 6.30e9, "Gxz": 5.37e9, "Gyz": 5.37e9}
MEASURED_HZ = np.array([25.61, 160.85, 399.28, 442.65, 867.96])
MEASURED_DAMPING = np.array([0.1556, 0.0284, 0.0243, 0.0147, 0.0126])

PARAMETERS = (
    Parameter("Ex"),
    Parameter("Ey"),
    Parameter("Gxy"),
    Parameter("Gxz"),
    Parameter("Gyz", tied_to="Gxz"),
)


def grid() -> dict[int, tuple[float, float, float]]:
    """33 points, three across and eleven along, as the paper's Figure 5."""
    places = [
        (0.5 * row / 11, 0.02 * column, 0.005) for row in range(1, 12) for column in (-1, 0, 1)
    ]
    return dict(enumerate(places, start=1))


def hammer_tour(
    points: dict[int, tuple[float, float, float]], sensor: int = 33
) -> tuple[list[Dof], list[Dof]]:
    """Response and reference dofs of a roving hammer with the sensor at one point."""
    return [Dof(sensor, 3)] * len(points), [Dof(point, 3) for point in points]
