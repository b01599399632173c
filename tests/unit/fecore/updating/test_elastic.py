from dataclasses import replace

import numpy as np
import pytest

from fecore.body.constants import Parameter
from fecore.body.specimen import Specimen
from fecore.errors import UpdatingError
from fecore.frf import Dof
from fecore.modes import MeasuredModes
from fecore.updating.elastic_result import NOISE
from fecore.updating.forward import ForwardModel
from fecore.updating.parameters import parametrise
from tests.support.cantilever import MEASURED_HZ
from tests.support.fits import update_elastic


def modes_of(forward: ForwardModel, theta: np.ndarray, count: int = 5) -> MeasuredModes:
    state = forward.solve(theta)
    dofs = tuple(Dof(point, 3) for point in forward.points)
    return MeasuredModes(
        state.frequency_hz[:count], np.full(count, 0.02), state.shapes[:count].astype(complex), dofs
    )


def test_exact_data_and_wide_priors_recover_constants_to_the_digit(
    nominal: Specimen, forward: ForwardModel
) -> None:
    recipe = (Parameter("Ex", prior_sd=1e12), Parameter("Gxy", prior_sd=1e12))
    free = replace(forward, parametrisation=parametrise(nominal, recipe))
    truth = np.array([25e9, 7.5e9])
    result = update_elastic(free, modes_of(free, truth))
    # Eigenvalues are good to 1e-9, sensitivities are ½ or less.
    np.testing.assert_allclose(result.theta, truth, rtol=1e-6)


def test_modes_are_followed_through_a_crossing(forward: ForwardModel) -> None:
    """With Gxy up by half the torsion mode (3) passes the bending mode (4): MAC shows it, order
    does not.
    """
    truth = np.array([31e9, 31.8e9, 8.6e9, 4.5e9])
    measured = modes_of(forward, truth)
    start = forward.solve(forward.parametrisation.prior_mean)
    assert start.frequency_hz[2] < start.frequency_hz[3]
    result = update_elastic(forward, measured)
    # measured mode 3 is bending: the model's fourth at first
    assert dict(result.initial_pairings[0].pairs)[2] == 3
    assert dict(result.pairing.pairs)[2] == 2
    assert result.theta[2] == pytest.approx(truth[2], rel=0.01)


def test_noise_covariance_matches_scatter(forward: ForwardModel) -> None:
    """Repeated measurements with a known noise scatter as the noise-only covariance says."""
    truth = np.array([31e9, 31.8e9, 6.0e9, 5.0e9])
    clean = modes_of(forward, truth)
    sd = 3e-4 * clean.frequency_hz
    covariance = np.diag(np.concatenate([sd**2, np.full(5, 1e-6)]))
    random = np.random.default_rng(7)
    noisy = [clean.frequency_hz + sd * random.standard_normal(5) for _ in range(20)]
    results = [
        update_elastic(forward, replace(clean, frequency_hz=f, covariance=covariance))
        for f in noisy
    ]
    scatter = np.std([result.theta for result in results], axis=0, ddof=1)
    noise = [
        np.linalg.norm(each.sources[NOISE], axis=1) * each.prior.slope(each.theta)
        for each in results
    ]
    stated = np.mean(noise, axis=0)
    # 20 draws fix a standard deviation to ±16 % (1 sd); Ey, which the data do not determine, is
    # left out.
    determined = [0, 2, 3]
    assert np.all(np.abs(scatter[determined] / stated[determined] - 1) < 0.4)


def test_modes_unlike_the_model_are_refused(forward: ForwardModel) -> None:
    dofs = tuple(Dof(point, 3) for point in forward.points)
    random = np.random.default_rng(3)
    shapes = random.standard_normal((2, len(dofs))) + 0j
    with pytest.raises(UpdatingError, match="no measured mode is like any mode") as caught:
        update_elastic(
            forward, MeasuredModes(np.array([50.0, 90.0]), np.array([0.01, 0.01]), shapes, dofs)
        )
    assert set(caught.value.best) == set(forward.parametrisation.names)
    assert caught.value.details == {"best": caught.value.best, "history": []}


def test_progress_is_told_and_can_stop(forward: ForwardModel) -> None:
    class StopError(Exception):
        pass

    shares: list[float] = []

    def progress(share: float) -> None:
        shares.append(share)
        if len(shares) == 2:
            raise StopError

    with pytest.raises(StopError):
        update_elastic(forward, MeasuredModes(MEASURED_HZ, np.full(5, np.nan)), progress)
    assert shares == sorted(shares)
