"""A body that hangs freely or stands on soft springs is damped in its rigid motion by these,
whatever its own law is.
"""

import re
from dataclasses import replace

import numpy as np
import pytest

from fecore.body.specimen import Specimen
from fecore.body.supports import Spring
from fecore.dynamics.damping_laws import RAYLEIGH, damping_rate
from fecore.frf import Dof, FrfSet
from fecore.modes import MeasuredModes
from fecore.updating.forward import ForwardState
from fecore.updating.measurement import Measurement
from fecore.updating.pipeline import update
from fecore.updating.result import UpdateResult
from tests.support.cantilever import grid, hammer_tour
from tests.support.fits import at_prior, forward_model

LAW = np.array([30.0, 8e-6])
LINES = np.arange(2.0, 1200.0, 2.0)
HUNG = ("start", "end")


@pytest.fixture(scope="module")
def hanging(updated_by_paper: Specimen) -> Specimen:
    """On a mesh that is coarse, as what is measured comes from it too."""
    return replace(updated_by_paper, boundary="free", divisions=(20, 2))


def solved(specimen: Specimen) -> ForwardState:
    return at_prior(forward_model(specimen, 14, points=grid()))


def measured(state: ForwardState, rate: np.ndarray, lines: np.ndarray = LINES) -> Measurement:
    """Accelerances under given rates, with 1 % noise."""
    responses, references = hammer_tour(grid())
    values = state.frf_model(responses, references).synthesise(lines, rate)
    random = np.random.default_rng(1)
    floor = 0.01 * np.sqrt(np.mean(np.abs(values) ** 2, axis=1, keepdims=True) / 2)
    noise = random.standard_normal(values.shape) + 1j * random.standard_normal(values.shape)
    return Measurement(
        FrfSet(lines, values + floor * noise, tuple(responses), tuple(references)), grid()
    )


def coefficients(result: UpdateResult) -> np.ndarray:
    rows = {row.name: row for row in result.parameters}
    for name, value in zip(("a0", "a1"), LAW, strict=True):
        assert rows[name].interval_95[0] < value < rows[name].interval_95[1]
    return np.array([rows["a0"].estimate, rows["a1"].estimate])


@pytest.mark.long
def test_rigid_modes_of_a_free_body_tell_nothing_of_its_law(hanging: Specimen) -> None:
    """Rates of three times a0: taken for the law's they moved a0 by 2 %. In short modes on springs
    do not, and a free body has its law, below.
    """
    state = solved(hanging)
    rate = damping_rate(RAYLEIGH, LAW, state.modes.omega)
    rate[: state.modes.rigid] *= 3
    result = update(measured(state, rate), hanging)
    # The noise leaves 0.05 % of a0.
    np.testing.assert_allclose(coefficients(result), LAW, rtol=3e-3)
    held = result.correlation.held_out_frfs
    assert held is not None
    assert held.coverage_95 > 0.98  # with the rigid modes' own rates, which the prediction uses


def test_modes_on_the_supports_springs_tell_nothing_of_the_law(hanging: Specimen) -> None:
    springs = tuple(Spring(f"foam_{end}", 1.5e4, 3, edge=end) for end in HUNG)  # type: ignore[arg-type]
    body = replace(hanging, springs=springs)
    state = solved(body)
    assert state.modes.rigid == 0
    # roll, bounce, pitch
    assert state.on_springs.tolist() == [True] * 3 + [False] * (state.frequency_hz.size - 3)
    omega = state.modes.omega
    rate = damping_rate(RAYLEIGH, LAW, omega)
    own = rate[:3] / (2 * omega[:3])
    rate[:3] = 2 * 0.08 * omega[:3]
    assert np.all(own > 0.15)  # the law would have damped them twice as much and more
    dofs = tuple(Dof(point, 3) for point in state.forward.points)
    modes = MeasuredModes(
        omega[:7] / (2 * np.pi), rate[:7] / (2 * omega[:7]), state.shapes[:7] + 0j, dofs
    )
    result = update(replace(measured(state, rate, np.arange(1.0, 1000.0)), modes=modes), body)
    np.testing.assert_allclose(coefficients(result), LAW, rtol=3e-3)
    assert not any("inadequate" in warning for warning in result.warnings)
    assert [mode.predicted_damping is None for mode in result.modes] == [True] * 3 + [False] * 4
    # `modal` has one for each mode that is the body's own
    assert len(result.damping_models[-1].coefficients) == 4


def test_a_law_that_is_negative_below_the_modes_is_said_to_be(hanging: Specimen) -> None:
    """Ratios that rise with frequency ask for a0 < 0: at the modes it damps, below 130 Hz it would
    feed energy in.
    """
    state, law = solved(hanging), np.array([-20.0, 3e-5])
    rate = damping_rate(RAYLEIGH, law, state.modes.omega)
    rate[: state.modes.rigid] = 1.0
    result = update(measured(state, rate), hanging)
    rows = {row.name: row.estimate for row in result.parameters}
    assert rows["a0"] == pytest.approx(law[0], rel=0.01)
    warned = [
        re.search(r"rayleigh law has negative damping from 2 to ([\d.]+) Hz", text)
        for text in result.warnings
    ]
    zero = [float(found[1]) for found in warned if found]
    assert zero == pytest.approx([np.sqrt(20 / 3e-5) / (2 * np.pi)], rel=0.01)
