from dataclasses import dataclass, replace

import numpy as np
import pytest

from fecore.arrays import FloatArray
from fecore.body.specimen import Specimen
from fecore.dynamics.damping_laws import RAYLEIGH, CaugheySeries, damping_rate
from fecore.errors import InputError
from fecore.frf import FrfSet
from fecore.updating import frf_fits
from fecore.updating.elastic import Unsettled
from fecore.updating.forward import ForwardState
from fecore.updating.frf_fits import LawProblem, Nuisance, fit_law
from fecore.updating.misfit import FrfMisfit, Weighting
from tests.support.cantilever import grid, hammer_tour
from tests.support.fits import at_prior, forward_model

# Initial values of Table 2 (five) and Table 5 (six), a0 in 1/s and a1 in s, as printed.
PAPER = np.array([42.25, 1.10e-5])
LINES = np.arange(1.0, 1001.0)
FREE = Nuisance.of_exact_law(np.arange(5), np.zeros(5))


@pytest.fixture(scope="module")
def state(updated_by_paper: Specimen) -> ForwardState:
    return at_prior(forward_model(updated_by_paper, 12, points=grid()))


def measured(state: ForwardState, noise: float, shift: float = 0.0, seed: int = 1) -> FrfSet:
    """Accelerances of a Rayleigh body whose five lowest frequencies are off by `shift`, with noise
    on each record.
    """
    responses, references = hammer_tour(grid())
    model = state.frf_model(responses, references)
    omega = model.omega.copy()
    omega[:5] *= 1 + shift * np.array([1, -1, 1, -1, 1])
    values = model.with_eigenvalue(omega**2).synthesise(LINES, damping_rate(RAYLEIGH, PAPER, omega))
    random = np.random.default_rng(seed)
    floor = noise * np.sqrt(np.mean(np.abs(values) ** 2, axis=1, keepdims=True) / 2)
    values = values + floor * (
        random.standard_normal(values.shape) + 1j * random.standard_normal(values.shape)
    )
    variance = np.broadcast_to(2 * floor**2, values.shape) if noise else None
    return FrfSet(LINES, values, tuple(responses), tuple(references), variance=variance)


def misfit(state: ForwardState, frfs: FrfSet, weighting: Weighting = "linear") -> FrfMisfit:
    variance = np.ones(frfs.values.shape) if frfs.variance is None else frfs.variance
    return FrfMisfit(frfs, state.frf_model(frfs.responses, frfs.references), weighting, variance)


@pytest.mark.parametrize("weighting", ["linear", "relative", "log", "noise"])
def test_clean_data_give_the_coefficients_back(state: ForwardState, weighting: Weighting) -> None:
    problem = misfit(state, measured(state, 0.0, shift=0.001), weighting)
    fit = fit_law(problem, RAYLEIGH, np.array([20.0, 2e-5]), FREE)
    np.testing.assert_allclose(fit.coefficients, PAPER, rtol=1e-6)
    np.testing.assert_allclose(fit.shift, 0.001 * np.array([1, -1, 1, -1, 1]), atol=1e-8)


def test_derivatives_with_gains_agree_with_differences(state: ForwardState) -> None:
    """The gradient of E by eigenvalues and rates against central differences of E."""
    problem = misfit(state, measured(state, 0.05), "noise")
    problem = replace(
        problem,
        gain_sd=np.where(np.arange(problem.model.omega.size) < 5, 0.01, 0.0),
        driving=(3, 7),
    )
    model = problem.model
    rate = damping_rate(RAYLEIGH, np.array([30.0, 2e-5]), model.omega)
    normal = problem.normal(model.eigenvalue, rate)
    for k in range(5):
        for offset, values in ((0, model.eigenvalue), (model.omega.size, rate)):
            step = 1e-5 * values[k]
            up, down = values.copy(), values.copy()
            up[k] += step
            down[k] -= step
            pair = [(v, rate) if offset == 0 else (model.eigenvalue, v) for v in (up, down)]
            difference = (problem.normal(*pair[0]).cost - problem.normal(*pair[1]).cost) / (
                2 * step
            )
            # Central differences err by O(step²) plus round-off/step: together some 1e-7 of the
            # largest derivative. In units of the noise E is larger, and its round-off with it.
            assert -normal.gradient[offset + k] == pytest.approx(difference, rel=1e-5)


def test_a_column_of_the_hessian_is_what_a_residual_like_it_pulls(state: ForwardState) -> None:
    problem = replace(misfit(state, measured(state, 0.05), "noise"), driving=(3, 7), delay_sd=3e-5)
    eigenvalue, rate = problem.model.eigenvalue, damping_rate(RAYLEIGH, PAPER, problem.model.omega)
    predicted = problem.predict(eigenvalue, rate)
    _, weight = problem.residual(predicted)
    jacobian = problem.jacobian(eigenvalue, rate, predicted)
    hessian = jacobian.hessian(weight)
    assert len(jacobian.others) == 3
    for column, (rows, by) in zip(hessian.T[-3:], jacobian.others, strict=True):
        like = np.zeros_like(predicted)
        like[rows] = by
        np.testing.assert_allclose(
            column, jacobian.gradient(weight * like), rtol=1e-9, atol=1e-12 * column.max()
        )


def test_the_gain_of_a_sensor_is_not_taken_for_damping(state: ForwardState) -> None:
    frfs = measured(state, 0.005)
    loud = replace(frfs, values=1.02 * frfs.values)
    plain = misfit(state, loud, "noise")
    gained = replace(plain, gain_sd=np.where(np.arange(plain.model.omega.size) < 5, 0.01, 0.0))
    without, found = (
        fit_law(problem, RAYLEIGH, np.array([20.0, 2e-5]), FREE) for problem in (plain, gained)
    )
    assert np.max(np.abs(without.coefficients / PAPER - 1)) > 0.01
    np.testing.assert_allclose(found.coefficients, PAPER, rtol=1.5e-3)  # known to some 0.05 %
    silent = replace(plain, gain_sd=np.zeros(plain.model.omega.size))
    again = fit_law(silent, RAYLEIGH, np.array([20.0, 2e-5]), FREE)
    np.testing.assert_array_equal(again.coefficients, without.coefficients)


def test_a_dent_at_the_driving_point_is_not_taken_for_damping(state: ForwardState) -> None:
    frfs = measured(state, 0.005)
    pairs = zip(frfs.responses, frfs.references, strict=True)
    row = next(i for i, (a, b) in enumerate(pairs) if (a.point, a.axis) == (b.point, b.axis))
    dented = frfs.values.copy()
    size = state.frf_model(frfs.responses, frfs.references).residual[row, 0]
    dented[row] -= size * frfs.omega**2  # of an accelerance
    plain = misfit(state, replace(frfs, values=dented), "noise")
    plain = replace(
        plain,
        gain_sd=np.where(np.arange(plain.model.omega.size) < 5, 0.01, 0.0),
        common_gain_sd=0.05,
    )
    free = replace(plain, driving=(row,))
    without, found = (
        fit_law(problem, RAYLEIGH, np.array([20.0, 2e-5]), FREE) for problem in (plain, free)
    )
    assert np.max(np.abs(without.coefficients / PAPER - 1)) > 2.5e-3
    np.testing.assert_allclose(found.coefficients, PAPER, rtol=1.5e-3)
    assert found.noise_covariance[0, 0] < 1.1 * without.noise_covariance[0, 0], (
        "it costs next to nothing"
    )
    left = free.without_driving(found.eigenvalue, found.rate).values
    assert np.abs(left - frfs.values)[row].max() < 0.05 * size * frfs.omega[-1] ** 2
    np.testing.assert_array_equal(np.delete(left, row, axis=0), np.delete(dented, row, axis=0))


@dataclass(frozen=True)
class Twice(CaugheySeries):
    """A law whose first coefficient stands twice."""

    def basis(self, omega: FloatArray, _strain: FloatArray | None = None, /) -> FloatArray:
        return super().basis(omega)[:, [0, 0]]

    def slope(self, omega: FloatArray, _strain: FloatArray | None = None, /) -> FloatArray:
        return super().slope(omega)[:, [0, 0]]


def test_coefficients_that_do_the_same_are_not_told_apart(state: ForwardState) -> None:
    law = Twice("rayleigh", (0, 1))
    ended = fit_law(misfit(state, measured(state, 0.0)), law, np.array([10.0, 30.0]), FREE)
    assert isinstance(ended, Unsettled)
    assert "do not distinguish the coefficients of the rayleigh law" in ended.message


@pytest.mark.long
def test_noise_covariance_matches_scatter(state: ForwardState) -> None:
    """In short that of stage 1 does, in `test_elastic.py`."""
    fits = []
    for seed in range(40):
        frfs = measured(state, 0.05, seed=seed)
        fits.append(fit_law(misfit(state, frfs, "noise"), RAYLEIGH, PAPER, FREE))
    scatter = np.std([fit.coefficients for fit in fits], axis=0, ddof=1)
    stated = np.mean([np.sqrt(np.diag(fit.noise_covariance)) for fit in fits], axis=0)
    # 40 draws fix a standard deviation to ±11 % (1 sd).
    assert np.all(np.abs(scatter / stated - 1) < 0.35)


def test_unusable_weightings_are_refused(state: ForwardState) -> None:
    frfs = measured(state, 0.0)
    values = frfs.values.copy()
    values[0, 0] = 0
    zero = FrfSet(frfs.frequency_hz, values, frfs.responses, frfs.references)
    with pytest.raises(InputError, match="zeros"):
        misfit(state, zero, "log")
    with pytest.raises(InputError, match="expected one of"):
        misfit(state, frfs, "best")  # type: ignore[arg-type]


def test_a_shift_at_its_bound_does_not_hold_up_the_others(state: ForwardState) -> None:
    """The highest mode is 14 % off, and none may be off by more than 10 %: the rest must fit as if
    it stood there.
    """
    frfs = measured(state, 0.01)
    model = state.frf_model(frfs.responses, frfs.references)
    mode_off, mode_held = (
        model.omega * np.where(np.arange(model.omega.size) == 4, 1 + off, 1) for off in (0.14, 0.1)
    )
    values = model.with_eigenvalue(mode_off**2).synthesise(
        LINES, damping_rate(RAYLEIGH, PAPER, mode_off)
    )
    problem = misfit(state, replace(frfs, values=values), "noise")
    fit = fit_law(problem, RAYLEIGH, np.array([20.0, 2e-5]), FREE)
    assert fit.shift[4] == 0.1
    there = replace(problem, model=model.with_eigenvalue(mode_held**2))
    rest = fit_law(
        there, RAYLEIGH, np.array([20.0, 2e-5]), Nuisance.of_exact_law(np.arange(4), np.zeros(4))
    )
    np.testing.assert_allclose(fit.coefficients, rest.coefficients, rtol=1e-3)


EVERY = Nuisance(
    modes=np.arange(5),
    first_shift=np.zeros(5),
    shift_sd=np.array([0.01, np.inf, 0.02, 0.01, 0.4]),
    deviation_sd=np.array([0.2, 0, 0.1, 0.3, 0]),
    suspension_modes=np.array([6]),
    suspension_rate=np.array([50.0]),
    window_rate=3.0,
    ratio_data=np.array([1, 2]),
    ratio_data_rate=np.array([60.0, 90.0]),
    ratio_data_sd=np.array([0.1, 0.3]),
)
"""Every kind of prior at once."""


def test_descent_is_that_of_the_misfit_with_every_prior(state: ForwardState) -> None:
    problem = LawProblem(misfit(state, measured(state, 0.05), "noise"), RAYLEIGH, EVERY, 1.7)
    rng = np.random.default_rng(3)
    x = problem.first(1.2 * PAPER)
    x[2:7] += 0.002 * rng.standard_normal(5)
    x[7:] += 0.5 * rng.standard_normal(4)
    descent = problem.at(x).descent
    for number, size in enumerate(np.append(PAPER, np.ones(x.size - 2))):
        step = 1e-6 * size * (np.arange(x.size) == number)
        slope = (problem.at(x + step).cost - problem.at(x - step).cost) / 2e-6
        # Central differences over 1e-6 of a cost of 1e5, which is good to 1e-11.
        assert descent[number] * size == pytest.approx(-slope, rel=1e-5, abs=0.5)


def test_shifts_and_rates_are_held_to_what_is_believable(state: ForwardState) -> None:
    problem = LawProblem(misfit(state, measured(state, 0.05), "noise"), RAYLEIGH, EVERY, 1.0)
    far = problem.first(PAPER)
    far[2:] = 100.0
    # Three standard deviations, but at least a tenth and at most a half; e^25 1/s.
    np.testing.assert_array_equal(
        problem.within(far)[2:], [0.1, 0.1, 0.1, 0.1, 0.5, 25, 25, 25, 25]
    )


@pytest.mark.parametrize("weighting", ["noise", "linear"])
def test_noise_grows_with_what_a_value_is_worth(state: ForwardState, weighting: Weighting) -> None:
    """`scale` is the misfit over what noise explains: of noise weights the covariance is `scale`
    times that of the noise stated, of other weights `scale` is only a unit. A rate known beside it
    counts as data do.
    """
    data = misfit(state, measured(state, 0.05), weighting)
    one, four = (
        fit_law(data, RAYLEIGH, PAPER, FREE, scale).noise_covariance for scale in (1.0, 4.0)
    )
    np.testing.assert_allclose(four, (4 if weighting == "noise" else 1) * one, rtol=1e-6)
    if weighting == "noise":
        known = replace(
            FREE,
            ratio_data=np.array([1]),
            ratio_data_rate=np.array([60.0]),
            ratio_data_sd=np.array([0.01]),
        )
        fit = fit_law(data, RAYLEIGH, PAPER, known, 4.0)
        x = np.concatenate([fit.coefficients, fit.shift])
        hessian = LawProblem(data, RAYLEIGH, known, 4.0).system(x, fit.normal)[0]
        np.testing.assert_allclose(
            fit.noise_covariance, 4 * np.linalg.inv(hessian)[:2, :2], rtol=1e-6
        )


def test_a_fit_that_is_cut_off_carries_its_best(
    state: ForwardState, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(frf_fits, "_STEPS", 1)
    data = misfit(state, measured(state, 0.05), "noise")
    outcome = fit_law(data, RAYLEIGH, np.array([400.0, 2e-4]), FREE)
    assert isinstance(outcome, Unsettled)
    assert "the rayleigh fit did not converge" in outcome.message
    assert set(outcome.best) == {"a0", "a1"}
