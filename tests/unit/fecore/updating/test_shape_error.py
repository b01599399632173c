"""Errors of mode shapes: their scatter is estimated, close modes may be mixed, and an update by
shapes improves the model.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fecore.correlation import Pairing
from fecore.frf import along_z
from fecore.modes import MeasuredModes
from fecore.updating import elastic_starts
from fecore.updating.measurement import Recipe
from fecore.updating.pipeline import update
from fecore.updating.result import UpdateResult
from fecore.updating.state import ShapeErrors
from tests.support.frames import bridge, measured
from tests.support.lengths import long

TRUTH = {"chords": 1.12, "diagonals": 0.85, "deck": 0.75, "bearings": 0.6}


def model(hz: list[float], points: int = 40) -> Any:
    """A solved model of sine shapes at some points."""
    x = np.linspace(0, 1, points + 2)[1:-1]
    shapes = np.array([np.sin((k + 1) * np.pi * x) for k in range(len(hz))])
    return SimpleNamespace(frequency_hz=np.array(hz), shapes=shapes)


def errors_of(
    shapes: np.ndarray, state: Any, row: int, discrepancy: float = 0.002
) -> tuple[ShapeErrors, MeasuredModes]:
    modes = MeasuredModes(
        state.frequency_hz,
        np.full(len(shapes), 0.01),
        shapes.astype(complex),
        along_z(range(1, shapes.shape[1] + 1)),
    )
    pairing = Pairing(((row, row),), None, (), (), ())
    return ShapeErrors.of(modes, state, pairing, discrepancy), modes


@pytest.mark.parametrize("noise", [0.002, 0.02, 0.1])
def test_the_scatter_at_the_points_is_estimated(noise: float) -> None:
    state, rng = model([10, 40, 90]), np.random.default_rng(3)
    errors, _ = errors_of(state.shapes + noise * rng.standard_normal(state.shapes.shape), state, 1)
    # 40 points: ± 11 % of a standard deviation, here 2.7 of it; below the prior's 1 % its two
    # degrees of freedom count
    assert errors.scatter[1] == pytest.approx(np.sqrt((2 * 0.01**2 + 39 * noise**2) / 41), rel=0.3)


def test_close_modes_may_be_mixed_and_distant_ones_not() -> None:
    for hz, free in (([10, 90, 90.2], True), ([10, 40, 90], False)):
        state = model(hz)
        turned = state.shapes.copy()
        turned[1] += 0.3 * state.shapes[2]
        errors, modes = errors_of(turned, state, 1)
        state.modes, state.shape_jacobian = (
            SimpleNamespace(rigid=0),
            np.zeros((1, *state.shapes.shape)),
        )
        off, _ = errors.residual(modes, state, Pairing(((1, 1),), None, (), (), ()), np.ones(1))
        if free:  # the mixing explains all, and is no evidence of anything else
            assert errors.scatter[1] < 0.01
            assert off @ off < 2
        else:  # 0.3 of a sine is 0.21 rms, less what the scale to the largest entry takes
            assert errors.scatter[1] == pytest.approx(0.19, rel=0.15)
            assert off @ off == pytest.approx(len(off), rel=0.1)


def test_the_whitening_is_a_root_of_the_inverse_covariance() -> None:
    state, rng, s = model([10, 40, 42]), np.random.default_rng(5), 0.003
    errors, modes = errors_of(
        state.shapes + 0.01 * rng.standard_normal(state.shapes.shape), state, 2, s
    )
    measured_shape = modes.shapes[2].real / np.abs(modes.shapes[2].real).max()  # type: ignore[index]
    size = measured_shape @ state.shapes[2] / (state.shapes[2] @ state.shapes[2])
    value = (2 * np.pi * state.frequency_hz) ** 2
    h2 = 2 * s**2 * value * value[2]
    variance = np.where(np.arange(3) == 2, 0, h2 / ((value - value[2]) ** 2 + h2))
    covariance = (
        errors.scatter[2] ** 2 * np.eye(40) + size**2 * (state.shapes.T * variance) @ state.shapes
    )
    W = errors.whitening[2]
    np.testing.assert_allclose(W.T @ W @ covariance, np.eye(40), atol=1e-9)


@pytest.fixture(autouse=True)
def _few_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(elastic_starts, "_STARTS", 1)


@cache
def updated(seed: int, spread: float, noise: float, shapes: bool) -> UpdateResult:
    test = measured(bridge(TRUTH, spread, seed), 8, noise, seed)
    return update(test, bridge({}), Recipe(use_shapes=shapes, damping_models=("rayleigh",)))


@pytest.mark.parametrize(("seed", "spread", "noise"), [long(1, 0.0, 0.02), (2, 0.1, 0.05)])
def test_shapes_improve_a_model_whose_turns_have_no_mass(
    seed: int, spread: float, noise: float
) -> None:
    by_shapes = updated(seed, spread, noise, True)
    for row in by_shapes.parameters:
        if (part := row.name.removesuffix(".factor")) in TRUTH:
            assert abs(row.estimate - TRUTH[part]) < 3.5 * row.standard_deviation, row
    rows = [
        row for row in by_shapes.modes if row.updated_hz is not None and row.measured_hz is not None
    ]
    before, after = (
        np.sqrt(
            np.mean([(hz / row.measured_hz - 1) ** 2 for row, hz in zip(rows, values, strict=True)])
        )
        for values in ([row.initial_hz for row in rows], [row.updated_hz for row in rows])
    )
    assert after < 0.006 < 0.05 < before


@pytest.mark.long
def test_shapes_widen_no_interval() -> None:
    """In short the truth lies within them, above."""
    by_shapes, without = (updated(2, 0.1, 0.05, shapes) for shapes in (True, False))
    for row, other in zip(by_shapes.parameters, without.parameters, strict=True):
        if row.name.removesuffix(".factor") in TRUTH:
            assert row.standard_deviation < 1.2 * other.standard_deviation
