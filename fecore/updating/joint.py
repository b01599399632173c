"""Elastic constants and damping from the FRFs without modes (beyond the paper).

The two-stage update needs modes. Where FRFs do not let them be identified one by one, the model
itself can distinguish them: its own shapes say what each mode contributes to each FRF, and only
frequencies and damping are left to find. So two fits take turns until the constants stand still:

    1. frequency shifts δ_k and damping ratios ζ_k of the model's modes, from the FRFs with the
       model's shapes;
    2. constants θ from the shifted frequencies ω_k (1 + δ_k), as stage 1, modes kept apart by their
       shapes.

A shape of the model is good enough to distinguish modes but not to fit constants by: plate theory's
error in it would pass for data. The FRF misfit has one narrow valley for each way in which model
and measured resonances can be matched, so the search starts from the best of many draws from the
prior, compared by the logarithm of their magnitudes on few lines, where valleys are wide.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fecore.arrays import ComplexArray, FloatArray
from fecore.dynamics.damping_laws import DampingLaw
from fecore.errors import UpdatingError
from fecore.frf import FrfSet
from fecore.modes import MeasuredModes
from fecore.updating.elastic import fit_elastic, settled
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.elastic_starts import even_draws
from fecore.updating.forward import ForwardModel
from fecore.updating.inputs import Inputs
from fecore.updating.law_fit import DampingFit, fit_law
from fecore.updating.law_problem import Nuisance
from fecore.updating.layout import Layout
from fecore.updating.measured_ratios import nearest_positive
from fecore.updating.misfit import FrfMisfit, Weighting
from fecore.updating.parameters import by_name
from fecore.updating.residual_noise import residual_variance

_DRAWS = 512  # of the search
_DRAWN_SD = 1.0  # draws cover so many of the prior's standard deviations to either side
_COARSE_LINES = 150  # of an FRF that the search looks at
_RATIOS = (0.01, 0.03, 0.08)  # damping ratios that the search tries
_STARTS = 3  # that are gone on with
_TURNS = 12  # of the search for constants and law, at most
_STILL = 0.01  # posterior standard deviations that the constants may move in the last turn
_SHIFT_SD = 0.05  # prior standard deviation of a shift, while the model is not right yet
_OTHERS_SHIFT_SD = 0.02  # the same for modes above the band
# of the logarithm of a mode's damping over the law's, which here only has to be near
_DEVIATION = 1.0
_AS_STATED = (
    "the method joint takes height, sign and quantity of the FRFs as stated; two_stage says which"
    " is wrong"
)


@dataclass(frozen=True)
class JointResult:
    """What the turns ended with: the constants, and the modes that the FRFs show through the
    model's shapes.
    """

    elastic: ElasticResult
    modes: MeasuredModes


def update_jointly(
    forward: ForwardModel,
    frfs: FrfSet,
    law: DampingLaw,
    seed: int,
    progress: Callable[[float], None] = lambda _: None,
    inputs: Inputs | None = None,
    fixed_points: tuple[int, ...] = (),
) -> JointResult:
    """Estimate constants and damping from FRFs alone.

    Args:
        forward: the model.
        frfs: on the fitted lines.
        law: from which every mode's damping may deviate widely.
        seed: of the draws.
        progress: called with the share that is done.
        inputs: what the laboratory says of its inputs; None: they are known exactly.
        fixed_points: points at which a sensor stood through the test, if its mass was not stated.

    Raises:
        UpdatingError: no start led to constants that stand still; it carries the last.
    """
    update = _Update(forward, frfs, law, inputs or Inputs.exact(), fixed_points)
    starts = update.search(seed, lambda share: progress(0.5 * share))
    results: list[tuple[float, JointResult]] = []
    failure = UpdatingError(
        "no draw from the prior gives a physical specimen; widen or move the priors", {}, ()
    )
    for done, start in enumerate(starts):
        progress(0.5 + 0.5 * done / len(starts))
        try:
            results.append(update.in_turns(*start))
        except UpdatingError as error:
            failure = UpdatingError(f"{error.message}; {_AS_STATED}", error.best, error.history)
    if not results:
        raise failure
    return min(results, key=lambda row: row[0])[1]


@dataclass(frozen=True)
class _Update:
    """The model, the FRFs on the fitted lines, the law and the inputs of one update."""

    forward: ForwardModel
    frfs: FrfSet
    law: DampingLaw
    inputs: Inputs
    fixed_points: tuple[int, ...]

    def search(
        self, seed: int, progress: Callable[[float], None]
    ) -> list[tuple[FloatArray, float]]:
        """The best starts among draws from the prior: least mean difference of log magnitudes.

        The draws use the reduced basis unverified, as they only rank starts; the turns from these
        use `forward` as it is.
        """
        forward, frfs, law = self.forward, self.frfs, self.law
        prior = forward.parametrisation
        free = len(prior.reported)
        draws = even_draws(free, _DRAWS, seed)
        thetas = np.tile(prior.prior_mean, (_DRAWS, 1))
        thetas[:, :free] += _DRAWN_SD * (2 * draws - 1) * prior.prior_sd[:free]
        coarse = slice(None, None, max(1, frfs.frequency_hz.size // _COARSE_LINES))
        measured = _log_magnitude(frfs.values[:, coarse])
        known = frfs.measured[:, coarse]
        search_model = forward.on_basis().with_unverified_basis()
        by_strain = bool(law.groups)
        ranked: list[tuple[float, FloatArray, float]] = []
        for done, theta in enumerate(thetas):
            progress(done / len(thetas))
            if not prior.is_physical(theta):
                continue
            model = search_model.solve(theta).frf_model(
                frfs.responses, frfs.references, with_strain=by_strain
            )
            moving = model.omega > 0
            omega = model.omega[moving]
            strain = None if model.strain is None else model.strain[moving]
            # A law is linear in its coefficients, so these go with the ratio.
            unit = law.basis(model.omega, model.strain) @ nearest_positive(
                law, omega, np.ones(omega.size), strain=strain
            )
            if not np.all(unit[moving] > 0):
                continue
            for ratio in _RATIOS:
                predicted = model.synthesise(frfs.frequency_hz[coarse], ratio * unit, frfs.quantity)
                off = measured - _log_magnitude(predicted)
                ranked.append((float(np.mean(np.abs(off[known]))), theta, ratio))
        ranked.sort(key=lambda row: row[0])
        return _apart([(theta, ratio) for _, theta, ratio in ranked], prior.prior_sd)

    def in_turns(self, theta: FloatArray, ratio: float) -> tuple[float, JointResult]:
        """Fit modes through the model's shapes and constants to the modes, in turn; the misfit
        left, and the result.

        Raises:
            UpdatingError: the constants do not come to rest, or a fit fails.
        """
        frfs, measured = self.frfs, self.frfs.measured
        variance: FloatArray = np.ones(measured.shape)
        weighting: Weighting = "log" if np.all(frfs.values[measured] != 0) else "linear"
        start: FloatArray | None = None
        for _ in range(_TURNS):
            modes, fit, misfit = self._modes_through(theta, start, ratio, weighting, variance)
            layout = Layout.of_one(self.forward, modes, self.inputs, self.fixed_points)
            elastic = settled(fit_elastic(layout))
            predicted = misfit.predict(fit.eigenvalue, fit.rate)
            residual = np.where(measured, frfs.values - predicted, 0)
            variance = residual_variance(residual, predicted, measured)
            moved = np.abs(elastic.theta - theta) / np.sqrt(np.diag(elastic.covariance))
            at_rest = weighting == "noise" and moved.max() < _STILL
            theta, start, weighting = elastic.theta, fit.coefficients, "noise"
            if at_rest:
                left = float(
                    np.sum(np.abs(residual) ** 2) / np.sum(np.abs(frfs.values[measured]) ** 2)
                )
                return left, JointResult(elastic, modes)
        best = by_name(self.forward.parametrisation.names, theta)
        raise UpdatingError(f"the joint update did not come to rest in {_TURNS} turns", best, ())

    def _modes_through(
        self,
        theta: FloatArray,
        start: FloatArray | None,
        ratio: float,
        weighting: Weighting,
        variance: FloatArray,
    ) -> tuple[MeasuredModes, DampingFit, FrfMisfit]:
        """Shifts and damping ratios of the model's modes in the band, as measured modes with the
        model's shapes.
        """
        forward, frfs, law = self.forward, self.frfs, self.law
        state = forward.solve(theta)
        model = state.frf_model(frfs.responses, frfs.references)
        elastic = np.arange(state.modes.rigid, model.omega.size)
        inside = elastic[model.omega[elastic] < frfs.omega[-1]]
        others = np.setdiff1d(elastic, inside)
        if inside.size == 0:
            raise UpdatingError("the model has no mode in the band", {}, ())
        if start is None:
            strain = None if model.strain is None else model.strain[elastic]
            start = nearest_positive(
                law, model.omega[elastic], np.full(elastic.size, ratio), strain=strain
            )
        nuisance = Nuisance(
            modes=np.concatenate([inside, others]),
            first_shift=np.zeros(elastic.size),
            shift_sd=np.concatenate(
                [np.full(inside.size, _SHIFT_SD), np.full(others.size, _OTHERS_SHIFT_SD)]
            ),
            deviation_sd=np.full(elastic.size, _DEVIATION),
            suspension_modes=np.arange(state.modes.rigid),
            suspension_rate=np.full(state.modes.rigid, 2 * ratio * model.omega[inside[0]]),
        )
        misfit = FrfMisfit(frfs, model, weighting, variance)
        fit = fit_law(misfit, law, start, nuisance)
        omega = np.sqrt(fit.eigenvalue[inside])
        measured = fit.rate[inside] / (2 * omega)
        if measured.max() >= 1:
            best = by_name(forward.parametrisation.names, theta)
            raise UpdatingError(
                "the joint update damps a mode beyond the critical; check band, boundary and"
                " priors",
                best,
                (),
            )
        order = np.argsort(omega, kind="stable")
        shapes = state.all_shapes[inside][order]
        return (
            MeasuredModes(omega[order] / (2 * np.pi), measured[order], shapes + 0j, forward.dofs),
            fit,
            misfit,
        )


def _log_magnitude(values: ComplexArray) -> FloatArray:
    magnitude: FloatArray = np.log(np.maximum(np.abs(values), 1e-300))
    return magnitude


def _apart(
    starts: list[tuple[FloatArray, float]], sd: FloatArray
) -> list[tuple[FloatArray, float]]:
    """The first few starts that are not next to one another."""
    kept: list[tuple[FloatArray, float]] = []
    for theta, ratio in starts:
        if all(np.max(np.abs(theta - other) / sd) > 0.1 for other, _ in kept):
            kept.append((theta, ratio))
        if len(kept) == _STARTS:
            break
    return kept
