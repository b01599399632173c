"""What a deck's own mesh misses does not become constants: solids of another code on coarse decks
of their panels.
"""

import numpy as np
import pytest

from fecore.body.constants import Parameter
from fecore.body.structure import Structure
from fecore.frf import Dof
from fecore.modes import MeasuredModes
from fecore.updating import mesh
from fecore.updating.forecasts import ForecastOrder, forecast
from fecore.updating.forward import ForwardModel
from fecore.updating.inputs import Inputs
from fecore.updating.measurement import Measurement, Recipe
from fecore.updating.parameters import parametrise
from fecore.updating.pipeline import update
from tests.support.panels import TRUTH, deck, measured
from tests.support.stored_solids import frequencies


def _forward(body: Structure, highest_hz: float) -> ForwardModel:
    prior = parametrise(body, body.default_parameters())
    return ForwardModel.of_dofs(prior, [Dof(1, 3)], {1: tuple(body.mesh.nodes[0])}, highest_hz)


@pytest.mark.long
@pytest.mark.parametrize("element", ["quad4", "quad8"])
def test_the_model_has_the_frequencies_of_the_finest_mesh(element: str) -> None:
    """In short the forecast has them, below."""
    body = deck("tapered", 6, 4, element) if element == "quad4" else deck("tapered", 3, 2, element)
    own = frequencies(body, 6)
    forward = _forward(body, float(own[-1]))
    state = forward.solve(forward.parametrisation.prior_mean)
    error = forward.mesh_error
    assert error is not None
    assert error.finest < error.size
    assert forward.finer is not None
    finest = frequencies(
        forward.finer.level(round(np.log2(error.size / error.finest)) + (element == "quad4")).body,
        6,
    )
    assert np.abs(own / finest - 1).max() > 0.01
    assert state.frequency_hz[:6] == pytest.approx(finest, rel=2e-5)
    assert state.by_mesh is not None
    moved, left, flat = state.by_mesh
    # to the first order
    assert state.frequency_hz[:6] * (1 + moved[:6]) == pytest.approx(own, rel=0.03)
    assert np.abs(left[:6]).max() < 0.1 * np.abs(moved[:6]).max()
    assert not flat.any()


def test_corners_of_a_cut_out_are_met_beyond_the_finest_mesh() -> None:
    body = deck("cut-out", 6, 4, "quad4", TRUTH)
    solid = measured("cut-out")[0].frequency_hz
    forward = _forward(body, float(solid[-1]))
    state = forward.solve(forward.parametrisation.prior_mean)
    assert state.by_mesh is not None
    left = np.abs(state.by_mesh[1][:12])
    off = np.abs(state.frequency_hz[:12] / solid[:12] - 1)
    assert np.all(off < 2 * left + 0.002)  # of plate theory
    assert left.max() > 0.002  # a mode in the plane that pulls at the corners
    assert left[3] < left.max() / 20  # one that does not


@pytest.mark.long
def test_a_change_of_constants_is_followed_and_exact_where_the_error_is_known_anew() -> None:
    """In short the constants that an update finds are those of the solids, below."""
    body = deck("curved", 6, 4, "quad4")
    forward = _forward(body, float(frequencies(body, 6)[-1]))
    names, mean = forward.parametrisation.names, forward.parametrisation.prior_mean
    theta = (
        mean
        * np.where(np.array(names) == "skin.G13", 0.75, 1.0)
        * np.where(np.array(names) == "skin.E1", 1.2, 1.0)
    )
    anew = forward.with_mesh_error_about(theta).solve(theta).frequency_hz[:6]
    assert forward.solve(theta).frequency_hz[:6] == pytest.approx(anew, rel=0.005)
    assert np.any(np.abs(forward.solve(mean).frequency_hz[:6] / anew - 1) > 0.02)


def test_constants_on_a_coarse_curved_deck_are_the_solids() -> None:
    modes, points = measured("curved")
    data = Measurement(None, points, modes, inputs=Inputs.exact())
    found = update(data, deck("curved", 12, 8, "quad4"), Recipe(damping_models=("rayleigh",)))
    for parameter in found.parameters:
        constant = parameter.name.rpartition(".")[2]
        if constant in TRUTH:
            z = (parameter.estimate - TRUTH[constant]) / parameter.standard_deviation
            assert abs(z) < 3.5, (parameter.name, z)
            assert parameter.identifiable == (parameter.tied_to is None)
    budget = {
        parameter.name: {entry.source for entry in parameter.budget}
        for parameter in found.parameters
    }
    assert {"mesh", "shear correction"} <= budget["skin.G13"]
    (said,) = [each.text for each in found.findings if each.kind == "mesh_moves"]
    assert "elements of 28 mm" in said
    assert "G13" in said
    last = found.modes[-1]
    assert last.updated_hz is not None
    assert last.own_mesh_hz is not None
    assert last.own_mesh_hz > 1.03 * last.updated_hz  # what the deck's own solver is to expect


def test_a_forecast_shows_both_meshes() -> None:
    body = deck("tapered", 6, 4, "quad4")
    found = forecast(body, ForecastOrder(modes=6))
    assert found.frequency_hz == pytest.approx(frequencies(body, 6), rel=1e-9)
    assert found.finer_hz == pytest.approx(
        frequencies(deck("tapered", 18, 12, "quad8"), 6), rel=0.001
    )


def test_a_mesh_beyond_the_limit_is_taken_on_trust(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mesh, "MOST_DOFS", 100)
    modes, points = measured("tapered")
    found = update(
        Measurement(
            None,
            points,
            MeasuredModes(modes.frequency_hz[:4], np.full(4, 0.01)),
            inputs=Inputs.exact(),
        ),
        deck("tapered", 3, 2, "quad8"),
        Recipe(parameters=(Parameter("skin.E1"),), damping_models=("rayleigh",)),
    )
    assert "mesh_on_trust" in {each.kind for each in found.findings}
    assert "mesh" not in {
        entry.source for parameter in found.parameters for entry in parameter.budget
    }
