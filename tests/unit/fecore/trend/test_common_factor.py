"""Baselines whose parameters move together: said where a covariate is missing, at the stated rate
where none is.
"""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from fecore.trend import Series, Watch, assess, fit_baseline
from fecore.trend.common_factor import FALSE_ALARMS, common_factor
from tests.support.lengths import long

DATES = tuple(datetime(2024, 1, 1, tzinfo=UTC) + timedelta(days=30 * i) for i in range(12))
WATCH = Watch({"Ex": "fall", "Gxy": "fall", "a0": "rise"}, covariates=("temperature_c",))


def baseline(
    seed: int, humidity: float = 0.0, noise_correlation: float = 0.0, scatter: float = 0.004
) -> dict[str, Series]:
    """Series of a baseline; humidity moves each parameter by so many of its sds, and was not
    recorded.
    """
    rng = np.random.default_rng(seed)
    temperature, unrecorded = rng.normal(20, 5, 12), rng.standard_normal(12)
    noise_covariance = (1 - noise_correlation) * np.eye(3) + noise_correlation
    noise = 0.002 * rng.multivariate_normal(np.zeros(3), noise_covariance, 12)
    own = scatter * rng.standard_normal((12, 3))
    values = 1 - 0.001 * (temperature[:, None] - 20) + noise + own
    values += (
        humidity * np.hypot(0.002, scatter) * unrecorded[:, None] * np.array([-1.0, -1.0, 0.8])
    )
    return {
        name: Series(name, DATES, values[:, j], np.full(12, 0.002), {"temperature_c": temperature})
        for j, name in enumerate(WATCH.directions)
    }


def moves_together(made: dict[str, Series]) -> bool:
    return (
        common_factor([(one, fit_baseline(one, 12, WATCH.covariates)[0]) for one in made.values()])
        is not None
    )


def test_humidity_that_was_not_recorded_is_said_at_the_baseline() -> None:
    made = [baseline(seed, humidity=3) for seed in range(20)]
    assert np.mean([moves_together(one) for one in made]) >= 0.8
    (example,) = assess(next(one for one in made if moves_together(one)), WATCH).notes
    assert "that temperature_c does not explain" in example
    assert "humidity" in example


@pytest.mark.parametrize(("correlation", "scatter"), [long(0.0, 0.004), (0.9, 0.0)])
def test_own_scatter_or_shared_noise_is_called_no_oftener_than_stated(
    correlation: float, scatter: float
) -> None:
    false = np.mean(
        [
            moves_together(baseline(seed, noise_correlation=correlation, scatter=scatter))
            for seed in range(50)
        ]
    )
    assert false <= FALSE_ALARMS + 2 * np.sqrt(FALSE_ALARMS * (1 - FALSE_ALARMS) / 50)


def test_one_watched_parameter_has_nothing_to_move_with() -> None:
    series = Series("Ex", DATES, 1 + 0.001 * np.arange(12.0), np.full(12, 0.002))
    assert assess({"Ex": series}, Watch({"Ex": "fall"})).notes == ()
