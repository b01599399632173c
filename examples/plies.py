"""Ply constants of a laminate as it was made: a free plate of [45/-45/45/-45], whose bending
couples with its membrane.

The plate's modes are simulated with other constants than the handbook's, on a finer mesh, with 0.01
% noise, and the constants of one ply come back from them.

    python -m examples.plies
"""

from dataclasses import replace

import numpy as np

from fecore.body.constants import PLY_PARAMETERS, Parameter
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.specimen import LayeredSpecimen
from fecore.frf import Dof, along_z
from fecore.modes import MeasuredModes
from fecore.updating.forward import ForwardModel
from fecore.updating.inputs import Inputs
from fecore.updating.measurement import Measurement
from fecore.updating.parameters import parametrise
from fecore.updating.pipeline import update
from fecore.updating.recipe import Recipe
from fecore.updating.result import UpdateResult

CARBON = OrthotropicMaterial(
    Ex=130e9, Ey=9e9, Gxy=5e9, Gxz=5e9, Gyz=3.5e9, nu_xy=0.3, density=1600.0
)
"""A carbon fibre ply, as a handbook has it."""

TRUTH = {"E1": 122e9, "E2": 9.8e9, "G12": 4.5e9, "G13": 4.4e9, "G23": 3.08e9}
"""What the simulated plate is made of, Pa."""

Points = dict[int, tuple[float, float, float]]


def plate(*angles: float, size: tuple[float, float, float] = (0.3, 0.2, 0.004)) -> LayeredSpecimen:
    """A free plate of plies alike at some angles in degrees, bottom to top."""
    plies = tuple(Ply(CARBON, size[2] / len(angles), angle) for angle in angles)
    return LayeredSpecimen(*size, plies, CARBON.density, "free", divisions=(16, 10))


def simulated(
    body: LayeredSpecimen, random: np.random.Generator, *, noise: float = 1e-4, modes: int = 12
) -> tuple[MeasuredModes, Points]:
    """The first out-of-plane modes of a plate whose constants are the truth's, with noise relative
    to the frequencies.
    """
    nx, ny = body.divisions or (16, 10)
    fine = replace(body, divisions=(3 * nx // 2, 3 * ny // 2))
    along, across = np.meshgrid(
        np.linspace(0.03, 0.97, 8) * body.length, np.linspace(-0.47, 0.47, 5) * body.width
    )
    places = np.column_stack([along.ravel(), across.ravel()])
    prior = parametrise(
        fine,
        [Parameter(name, prior_mean=value) for name, value in {**fine.nominal, **TRUTH}.items()],
    )
    forward = ForwardModel(
        fine, prior, along_z(range(1, len(places) + 1)), places, modes + 14, reduced=False
    )
    state = forward.solve(prior.prior_mean)
    seen = [k for k in range(state.frequency_hz.size) if k not in state.hidden][:modes]
    hz = state.frequency_hz[seen] * (1 + noise * random.standard_normal(modes))
    covariance = np.diag(np.concatenate([(noise * hz) ** 2, np.full(modes, 1e-8)]))
    points = {number: (float(x), float(y), 0.0) for number, (x, y) in enumerate(places, start=1)}
    dofs = tuple(Dof(number, 3) for number in points)
    return (
        MeasuredModes(hz, np.full(modes, 0.01), state.shapes[seen] + 0j, dofs, covariance),
        points,
    )


def recovered(*angles: float) -> UpdateResult:
    """What an update makes of a simulated plate, everything but the constants known."""
    body = plate(*angles)
    modes, points = simulated(body, np.random.default_rng(1))
    measurement = Measurement(None, points, modes, 0.0, Inputs.exact())
    return update(
        measurement,
        body,
        Recipe(parameters=PLY_PARAMETERS, damping_models=("rayleigh", "mechanism")),
    )


if __name__ == "__main__":
    for parameter in recovered(45, -45, 45, -45).parameters:
        if parameter.name in TRUTH:
            off = 100 * (parameter.estimate / TRUTH[parameter.name] - 1)
            sd = parameter.standard_deviation / 1e9
            print(
                f"{parameter.name:4s} {parameter.estimate / 1e9:7.2f} ± {sd:.2f} GPa, {off:+.1f} %"
                " off the truth"
            )
