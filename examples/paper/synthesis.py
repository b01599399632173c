"""FRFs that the paper does not print, made from the natural frequencies and damping ratios that it
does.

Mode shapes and the modes above the measured ones come from this project's model with the paper's
updated constants; the higher modes have the damping that the caller says. So everything that
follows from frequencies and damping is the paper's, and what depends on shapes is ours.
"""

import numpy as np

from fecore.body.beam_specimen import BeamSpecimen
from fecore.body.constants import Parameter
from fecore.body.specimen import Specimen
from fecore.dynamics.damping_laws import RAYLEIGH, ModalDamping, beyond, damping_rate
from fecore.frf import Dof, FrfSet, along_z
from fecore.updating.forward import ForwardModel, ForwardState
from fecore.updating.parameters import parametrise

Points = dict[int, tuple[float, float, float]]

# a corner: the middle of the width, where the paper's sensor sat, is a node of the torsion modes
SENSOR = 33
MODES = 18
NOISE = 0.01  # of each record's rms
LINES_HZ = np.arange(2.0, 1601.0, 2.0)


def grid(specimen: Specimen | BeamSpecimen) -> Points:
    """33 points, three across and eleven along, numbered across the width from x = 0 as in Figure
    5.
    """
    first = 0 if specimen.boundary == "free" else 1
    along = specimen.length * np.arange(first, first + 11) / (10 + first)
    places = [(x, specimen.width * (column / 2 - 0.5), 0.0) for x in along for column in range(3)]
    return dict(enumerate(places, start=1))


def solve(specimen: Specimen | BeamSpecimen, points: Points | None = None) -> ForwardState:
    """The specimen's modes at given points, or at a strip's 33."""
    points = points or grid(specimen)
    nominal = parametrise(specimen, [Parameter(name) for name in specimen.nominal])
    forward = ForwardModel(
        specimen, nominal, along_z(points), np.array(list(points.values()))[:, :2], MODES
    )
    return forward.solve(nominal.prior_mean)


def measured_body(
    specimen: Specimen,
    frequency_hz: np.ndarray,
    damping: np.ndarray,
    seed: int,
    rigid_rate: float = 0.0,
    lines_hz: np.ndarray = LINES_HZ,
) -> FrfSet:
    """Accelerances of a body with measured frequencies and ratios; higher modes are the model's,
    with the last ratio.

    Rigid-body motion of a free body has no ratio; it decays at `rigid_rate`, 1/s.
    """
    state = solve(specimen)
    rigid, omega = state.modes.rigid, state.modes.omega.copy()
    measured = slice(rigid, rigid + frequency_hz.size)
    omega[measured] = 2 * np.pi * frequency_hz
    ratio = np.full(omega.size, damping[-1])
    ratio[measured] = damping
    rate = np.where(np.arange(omega.size) < rigid, rigid_rate, 2 * ratio * omega)
    tail = beyond(ModalDamping((float(omega[-1]),)), damping[-1:], float(omega[-1]))
    return _frfs(state, omega, rate, tail, seed, lines_hz, SENSOR)


def rayleigh_body(
    specimen: Specimen | BeamSpecimen,
    coefficients: np.ndarray,
    seed: int,
    lines_hz: np.ndarray = LINES_HZ,
    points: Points | None = None,
    sensor: int = SENSOR,
) -> FrfSet:
    """Accelerances of the specimen under exact Rayleigh damping, at given points or at a strip's
    33.
    """
    state = solve(specimen, points)
    omega = state.modes.omega
    rate, tail = (
        damping_rate(RAYLEIGH, coefficients, omega),
        beyond(RAYLEIGH, coefficients, float(omega[-1])),
    )
    return _frfs(state, omega, rate, tail, seed, lines_hz, sensor)


def _frfs(
    state: ForwardState,
    omega: np.ndarray,
    rate: np.ndarray,
    tail: tuple[float, float],
    seed: int,
    lines_hz: np.ndarray,
    sensor: int,
) -> FrfSet:
    """Modes at ω with given rates, those that the model leaves out with `tail`'s, and noise."""
    hammer = tuple(Dof(point, 3) for point in state.forward.points)
    response = (Dof(sensor, 3),) * len(hammer)
    values = (
        state.frf_model(response, hammer)
        .with_eigenvalue(omega**2)
        .synthesise(lines_hz, rate, beyond=tail)
    )
    random = np.random.default_rng(seed)
    noise = random.standard_normal(values.shape) + 1j * random.standard_normal(values.shape)
    rms = np.sqrt(np.mean(np.abs(values) ** 2, axis=1, keepdims=True))
    return FrfSet(lines_hz, values + NOISE * rms * noise / np.sqrt(2), response, hammer)
