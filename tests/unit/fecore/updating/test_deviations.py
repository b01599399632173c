"""How far damping ratios are off a law is learnt from them, and where FRFs and modes disagree it is added."""

from __future__ import annotations

import numpy as np
import pytest

from fecore.updating.measured_ratios import disagreement, scale_of_deviations

OMEGA = 2 * np.pi * np.array([25.0, 160.0, 400.0, 445.0, 866.0, 1210.0])
LAW = np.array([30.0, 1e-5])
RATES = np.column_stack([1 / OMEGA, OMEGA]) / 2
RATIO = RATES @ LAW
BASIS = RATES / RATIO[:, None]


@pytest.mark.parametrize(("scatter", "low", "high"), [(0.001, 0.0005, 0.004), (0.05, 0.03, 0.09)])
def test_the_scale_follows_the_modes(scatter: float, low: float, high: float) -> None:
    found = []
    for seed in range(20):
        off = scatter * np.random.default_rng(seed).standard_normal(OMEGA.size)
        left = off - BASIS @ np.linalg.lstsq(BASIS, off, rcond=None)[0]
        found.append(scale_of_deviations(left, 1e-8 * np.eye(OMEGA.size), BASIS, 0.02).rms)
    assert low < np.median(found) < high


def test_with_as_many_modes_as_coefficients_the_prior_is_all_that_is_known() -> None:
    scale = scale_of_deviations(np.zeros(2), 1e-8 * np.eye(2), BASIS[:2], 0.02)
    assert scale.rms == pytest.approx(0.02, rel=0.05)
    # A half Student t of three degrees of freedom has 95 % of its mass below 3.18 scales, of which its root mean square is √3.
    assert scale.scale[np.searchsorted(np.cumsum(scale.weight), 0.95)] == pytest.approx(0.0367, rel=0.15)


def test_intervals_are_those_of_the_mixture() -> None:
    scale = scale_of_deviations(np.zeros(2), 1e-8 * np.eye(2), BASIS[:2], 0.02)
    draws = np.random.default_rng(1).choice(scale.scale, 200_000, p=scale.weight) / scale.rms
    sample = np.random.default_rng(2).standard_normal(200_000) * np.sqrt(0.25 + draws**2)
    assert scale.reach(0.25, 1.0) == pytest.approx(float(np.quantile(np.abs(sample), 0.95)), rel=0.02)


def test_what_frfs_and_modes_disagree_by_is_added_beyond_noise() -> None:
    noise, own = 1e-6 * np.eye(OMEGA.size), np.diag((1e-3 * LAW) ** 2)
    assert disagreement(BASIS, noise, 0.001, LAW, own) == pytest.approx([0.0, 0.0])
    added = disagreement(BASIS, noise, 0.001, LAW * [1.0, 1.03], own)
    assert added[0] == 0
    assert added[1] == pytest.approx(0.03 * LAW[1], rel=0.02)
