"""What is said of FRFs near a clamp, of modes that lie closer than their bandwidths, and of modes
beyond the last line.
"""

from dataclasses import replace

import numpy as np
import pytest

from fecore.body.constants import Parameter
from fecore.body.specimen import Specimen
from fecore.frf import Dof, FrfSet, along_z
from fecore.modes import MeasuredModes
from fecore.updating.forward import ForwardModel, ForwardState
from fecore.updating.measurement import Measurement, Recipe
from fecore.updating.parameters import parametrise
from fecore.updating.pipeline import update
from fecore.updating.result import UpdateResult
from tests.support.lengths import long
from tests.support.strips import NOMINAL

BODY = Specimen(0.5, 0.05, 0.01, NOMINAL, "cantilever", divisions=(24, 3))
ALONG = (0.012, 0.08, 0.16, 0.24, 0.31, 0.38, 0.44, 0.5)
PLACES = np.array([(x, side * 0.02) for x in ALONG for side in (-1, 1)])
NEAR, FAR = 0.03, 0.38  # from the clamp, m


def forward(body: Specimen, places: np.ndarray) -> ForwardModel:
    prior = parametrise(body, [Parameter("Ex"), Parameter("Gxy")])
    return ForwardModel(body, prior, along_z(range(1, len(places) + 1)), places, 10, reduced=False)


def made(
    sensor_m: float, off_m: float = 0.0, factor: float = 1.0, top_hz: float = 900.0
) -> Measurement:
    """FRFs of a roving hammer and a sensor that is off its point along x, times a factor."""
    own = np.array([[sensor_m, 0.02]])
    model = forward(BODY, np.concatenate([PLACES, own + np.array([off_m, 0.0])]))
    state = model.solve(model.parametrisation.prior_mean)
    hz = np.arange(5.0, top_hz)
    omega, modes = 2 * np.pi * hz, 2 * np.pi * state.frequency_hz
    bells = -(omega**2) / (modes[:, None] ** 2 - omega**2 + 2j * 0.01 * modes[:, None] * omega)
    values = factor * (state.shapes[:, :-1].T * state.shapes[:, -1]) @ bells
    rng = np.random.default_rng(4)
    values = values * (
        1 + 0.005 * (rng.standard_normal(values.shape) + 1j * rng.standard_normal(values.shape))
    )
    count = len(PLACES)
    roving = tuple(Dof(point, 3) for point in range(1, count + 1))
    frfs = FrfSet(hz, values, (Dof(count + 1, 3),) * count, roving, "accelerance")
    places = np.concatenate([PLACES, own])
    within = state.frequency_hz < top_hz
    return Measurement(
        frfs,
        {point: (float(x), float(y), 0.0) for point, (x, y) in enumerate(places, start=1)},
        seen(state.frequency_hz[within], state.shapes[within, :-1], roving),
    )


def seen(hz: np.ndarray, shapes: np.ndarray, dofs: tuple[Dof, ...]) -> MeasuredModes:
    """Modes, known to a thousandth."""
    covariance = np.diag(np.concatenate([(1e-3 * hz) ** 2, np.full(hz.size, 1e-6)]))
    return MeasuredModes(hz, np.full(hz.size, 0.01), shapes.astype(complex), dofs, covariance)


def result(*situation: float) -> UpdateResult:
    return update(made(*situation), BODY, Recipe(damping_models=("rayleigh",)))


def test_slopes_are_those_of_the_surface() -> None:
    body, step, z = replace(BODY, divisions=(48, 6)), 1e-4, np.array([[0.0, 0.0, 1.0]])
    model = forward(body, PLACES)
    state = model.solve(model.parametrisation.prior_mean)
    inside = np.column_stack([PLACES[2:10], np.zeros(8)]) + 1e-3
    slopes = state.shapes_by(body.model.slopes(inside, np.repeat(z, 8, axis=0))).reshape(10, 8, 3)
    for axis in range(2):
        there, here = (
            state.shapes_by(
                body.model.observe(inside + sign * step * np.eye(3)[axis], np.repeat(z, 8, axis=0))
            )
            for sign in (1, -1)
        )
        # the surface turns as its normal but for transverse shear, 1 % in these modes
        expected = (there - here) / (2 * step)
        np.testing.assert_allclose(
            slopes[:4, :, axis], expected[:4], atol=0.05 * np.abs(expected[:4]).max()
        )


@pytest.mark.parametrize(
    ("sensor_m", "off_m", "factor", "kind"),
    [
        (NEAR, 0.0025, 1.0, "frfs_scaled_by_place"),
        long(NEAR, 0.0, 2.0, "frfs_scaled"),
        long(FAR, 0.0, 1.25, "frfs_scaled"),  # 2.2 mm of place make up to 1.22 there
        long(FAR, 0.0025, 1.0, None),
    ],
)
def test_a_sensor_near_a_clamp_has_no_wrong_sensitivity(
    sensor_m: float, off_m: float, factor: float, kind: str | None
) -> None:
    # 2.5 mm of 30 make (32.5/30)² = 1.17 of a height in bending
    updated = result(sensor_m, off_m, factor)
    assert [each.kind for each in updated.findings if each.kind.startswith("frfs_scaled")] == [
        kind
    ] * bool(kind)


@pytest.mark.long
def test_a_mode_beyond_the_last_line_was_not_missed() -> None:
    """In short neither was the other of two in one, below."""
    model = forward(BODY, PLACES)
    hz = model.solve(model.parametrisation.prior_mean).frequency_hz
    measured, missing = hz[4:6]
    assert missing < 1.2 * measured  # within the range of which the search for partners asks
    short = result(FAR, 0.0, 1.0, float((measured + missing) / 2))
    assert sum(row.measured_hz is not None for row in short.modes) == 5
    assert [warning for warning in short.warnings if "was not measured" in warning] == []


def test_a_measured_mode_is_two_where_the_body_has_two() -> None:
    def solved(stiffer: float) -> ForwardState:
        model = forward(replace(BODY, material=replace(NOMINAL, Gxy=NOMINAL.Gxy * stiffer)), PLACES)
        return model.solve(model.parametrisation.prior_mean)

    meeting = (184.7 / 277.9) ** 2  # torsion falls to the second bending
    stiffer = min(
        np.linspace(0.9, 1.1, 21) * meeting,
        key=lambda at: np.diff(solved(float(at)).frequency_hz)[1],
    )
    state = solved(float(stiffer))
    assert state.frequency_hz[2] / state.frequency_hz[1] < 1.01
    kept = [0, 1, 3, 4]
    hz = state.frequency_hz[kept]
    modes = seen(hz, state.shapes[kept], along_z(range(1, len(PLACES) + 1)))
    points = {point: (float(x), float(y), 0.0) for point, (x, y) in enumerate(PLACES, start=1)}
    body = replace(BODY, material=replace(NOMINAL, Gxy=NOMINAL.Gxy * float(stiffer)))
    updated = update(Measurement(None, points, modes), body, Recipe(damping_models=("rayleigh",)))
    (said,) = [each.text for each in updated.findings if each.kind == "two_in_one"]
    assert f"measured mode 2 ({hz[1]:.2f} Hz) is probably two" in said
    assert not any("was not measured" in warning for warning in updated.warnings)
