"""A model before it is measured: its FRFs against a direct solution, its points against all
others.
"""

from dataclasses import replace

import numpy as np
import pytest

from fecore.body.specimen import Specimen
from fecore.body.structure import Structure
from fecore.correlation import auto_mac
from fecore.updating.forecasts import CANDIDATES, ForecastOrder, ModelForecast, forecast
from service.nouns.structures.schemas import StructureIn
from service.nouns.updates.bodies import nominal_body
from tests.support.bodies import pencil
from tests.support.direct import direct_frf
from tests.support.lengths import long
from tests.support.profiles import ANGLE
from tests.support.strips import NOMINAL, STRIP

CANTILEVER = Specimen(*STRIP, NOMINAL, divisions=(8, 2))
ZETA = 0.01


def angle() -> Structure:
    return nominal_body(StructureIn.model_validate(ANGLE), "free")


@pytest.mark.parametrize("body", [CANTILEVER, replace(CANTILEVER, boundary="free")])
def test_frfs_are_those_of_a_direct_solution(body: Specimen) -> None:
    """Damped alike, by C = 2ζ √λ of each mode; off the resonances a rigid body's accelerance and
    the tails are the whole.
    """
    found = forecast(
        body, ForecastOrder(modes=5, points=4, references=2, damping_ratio=ZETA, spacing_hz=1.0)
    )
    assert found.frfs.shape == (8, int(found.frequency_hz[-1]))
    K, M = pencil(body)
    rows = body.model.observe(found.places, np.eye(3)[found.axes - 1])
    chosen = np.linspace(5, len(found.lines_hz) - 1, 5).astype(int)
    for number, reference in enumerate(found.references):
        load = rows[[reference]].toarray()[0]
        undamped = direct_frf(
            K, M, 0 * M, rows[list(found.measured)], load, found.lines_hz[chosen], "accelerance"
        )
        ours = found.frfs[4 * number : 4 * number + 4, chosen]
        away = np.abs(found.lines_hz[chosen][:, None] / found.frequency_hz - 1).min(axis=1) > 0.05
        assert away.sum() >= 3
        # Away from resonances damping of 1 % changes an FRF by (ζ/0.05)² of its modes at most.
        scale = np.abs(undamped[:, away]).max(axis=0)
        assert np.max(np.abs(ours[:, away].real - undamped[:, away].real) / scale) < 0.04


def test_at_a_resonance_an_frf_is_the_residue_by_twice_the_damping() -> None:
    found = forecast(
        CANTILEVER, ForecastOrder(modes=3, points=6, damping_ratio=0.001, spacing_hz=0.1)
    )
    k = 1
    line = int(np.argmin(np.abs(found.lines_hz - found.frequency_hz[k])))
    residue = found.shapes[k, list(found.measured)] * found.shapes[k, found.references[0]]
    lively = np.abs(residue) > 0.2 * np.abs(residue).max()
    lines = slice(line - 5, line + 6)
    peak = np.abs(found.frfs[:, lines]).max(axis=1)
    np.testing.assert_allclose(peak[lively], np.abs(residue)[lively] / 0.002, rtol=0.05)


@pytest.mark.parametrize("body", [CANTILEVER, long(angle())])
def test_no_other_point_shows_the_least_shown_mode_better(body: Specimen | Structure) -> None:
    """All candidates are asked, as points of the order."""
    found = forecast(body, ForecastOrder(modes=6))
    every = asked(body, ForecastOrder(modes=6, points=500))
    least = every.seen.min(axis=0)
    at = found.seen[:, found.references[0]].min()
    assert at >= least.max() - 0.01  # of points that are alike the one with more of the other modes
    assert np.all((found.seen >= 0) & (found.seen < 1.3))


def asked(body: Specimen | Structure, order: ForecastOrder) -> ModelForecast:
    """All of the candidates are chosen."""
    found = forecast(body, order)
    assert len(found.measured) == min(CANDIDATES, len(found.mesh.nodes))
    return found


def test_chosen_points_tell_modes_apart_better_than_evenly_spread_ones() -> None:
    found = forecast(CANTILEVER, ForecastOrder(modes=6, points=6))
    every = asked(CANTILEVER, ForecastOrder(modes=6, points=500))
    information = np.linalg.slogdet(scaled(found)[:, list(found.measured)])[1]
    random = np.random.default_rng(0)
    others = [random.choice(len(every.numbers), 6, replace=False) for _ in range(200)]
    assert information > max(np.linalg.slogdet(scaled(every)[:, chosen])[1] for chosen in others)
    np.testing.assert_allclose(
        found.mac, auto_mac(found.shapes[:, list(found.measured)]), atol=1e-12
    )


def scaled(found: ModelForecast) -> np.ndarray:
    """Shapes at the points by the modes' largest displacements."""
    return found.shapes / np.linalg.norm(found.everywhere, axis=2).max(axis=1)[:, None]


def test_two_references_show_what_one_does_not() -> None:
    """Sensors may stand at mid-span, where even modes are still, at a quarter, or between."""
    free = replace(CANTILEVER, boundary="simply_supported")
    places = np.array([[x * STRIP[0], STRIP[1] / 2, 0] for x in (0.5, 0.25, 0.45)])
    bending = ForecastOrder(
        modes=4, places=places, axes=np.zeros(3, dtype=np.int64), points=3, references=2
    )
    found = forecast(free, bending)
    shown = found.seen[:, list(found.references)].max(axis=1)
    assert shown.min() > found.seen[:, found.references[0]].min()
    assert set(found.numbers.tolist()) == {0, 1, 2}
    assert found.axes.tolist() == [3, 3, 3]


def test_a_band_has_the_modes_that_lie_in_it() -> None:
    ten = forecast(CANTILEVER, ForecastOrder(modes=10))
    band = forecast(CANTILEVER, ForecastOrder(highest_hz=float(ten.frequency_hz[4]) + 1))
    np.testing.assert_allclose(band.frequency_hz, ten.frequency_hz[:5], rtol=1e-8)
    assert band.rigid == 0
    assert band.frfs.shape[1] == 0
