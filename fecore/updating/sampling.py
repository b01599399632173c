"""The posterior sampled, and predictions of what the fits did not see.

Posterior sampling with emcee (Foreman-Mackey et al. 2013), to confirm or correct the Gaussian
posterior.

Stage 1's coordinates ξ are sampled from its posterior with the discrepancy marginalised, through a
small basis made for just this posterior; the inputs, whose errors are small and so act linearly,
are integrated out of it and drawn afterwards. The law's coefficients have a posterior in closed
form at given θ, the mixture over the scale of the modes' deviations that the Gaussian posterior has
too (`DampingResult`). They are drawn from it, and follow stage 1: a ← a + (∂a/∂θ)(θ - θ̂).
Excursions are draws of their own.

The chain can be kept and taken up again (`Checkpoint`): its last state holds the random
generator's, so the samples are the same to the bit as those of a chain that was never interrupted.

A chain counts only when it is converged: longer than 50 autocorrelation times, with the effective
samples that were asked for (Sokal 1997; Goodman and Weare 2010). Everything is seeded.

Validation on what the fits did not see: predicted FRFs with intervals, and how many measured
values lie in them.

A prediction is uncertain by the elastic constants θ, the law's coefficients a (which follow θ:
∂a/∂θ is known from stage 2), by each mode's own deviation from the model in frequency and in
damping, and by the noise of the new measurement. All of it is carried through the derivatives of
the FRF, for real and imaginary parts apart.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from fecore.arrays import ComplexArray, FloatArray
from fecore.correlation import Agreement, correlate
from fecore.dynamics.synthesis import ModalFrfModel
from fecore.errors import UpdatingError
from fecore.frf import Dof, FrfSet, convert
from fecore.normal import Z_95
from fecore.updating.damping_stage import DampingResult
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.forward import ForwardModel
from fecore.updating.parameters import Parametrisation, by_name
from fecore.updating.posterior import log_likelihood, root
from fecore.updating.result import HeldOut

if TYPE_CHECKING:
    import emcee


_WALKERS_PER_DIMENSION = 16  # of the ensemble
_FEWEST_WALKERS = 96  # they move together, and a step of fewer takes as long
_BLOCK = 200  # steps between looks at the autocorrelation time
_LONGEST = 40_000  # steps; a chain that is not converged by then is refused
_TIMES_AUTOCORRELATION = 50  # autocorrelation times that a chain must have (emcee's advice)
_BASIS_REACH = 3.0  # posterior standard deviations in which the small basis is made
_FLAT = 1e-6  # share of the variance along an axis that moves no frequency worth a basis vector
_BASIS_TOLERANCE = 1e-7  # relative error of its frequencies, checked against the forward model


class Checkpoint(Protocol):
    """Where the state of a chain outlives the process that samples it."""

    restored: bytes | None
    """The last state that an earlier run has kept, or None."""

    def checkpoint(self, data: bytes) -> None:
        """Keep a state in place of the one before."""
        ...


LogProbability = Callable[[FloatArray], FloatArray]
"""(w, p) points to (w,) logarithms of a density."""


@dataclass(frozen=True)
class Chain:
    """Converged samples."""

    samples: FloatArray  # (n, p) after burn-in, thinned to about half an autocorrelation time
    autocorrelation_time: FloatArray  # (p,) integrated, in steps
    effective_samples: FloatArray  # (p,) number of independent samples that the chain is worth
    acceptance: float  # mean acceptance fraction


@dataclass(frozen=True)
class Posterior:
    """Samples of all parameters, and what the chain of the elastic ones was like."""

    xi: FloatArray  # (n, q) samples of stage 1's coordinates, excursions apart
    everything: FloatArray  # (n, q + p) samples of θ and the coefficients, excursions included
    chain: Chain


def sample_posterior(
    elastic: ElasticResult,
    damping: DampingResult,
    seed: int,
    target: int = 5000,
    progress: Callable[[float], None] = lambda _: None,
    checkpoint: Checkpoint | None = None,
) -> Posterior:
    """Sample elastic constants and the law's coefficients; the chain is kept by `checkpoint`
    until every parameter has `target` effective samples.

    Raises:
        UpdatingError: the chain did not converge; nothing of it is returned.
    """
    seeds = np.random.SeedSequence(seed).spawn(2)
    prior, free = elastic.prior, len(elastic.prior.reported)
    chain = run_chain(
        density=_elastic_density(elastic),
        start=prior.xi(elastic.theta)[:free],
        covariance=elastic.conditional_posterior.total[:free, :free],
        seed=seeds[0],
        target=target,
        progress=progress,
        names=prior.reported,
        checkpoint=checkpoint,
    )
    random, count = np.random.default_rng(seeds[1]), len(chain.samples)
    xi = _with_inputs(elastic, chain.samples, random)
    if elastic.has_uncertain_modes:  # the chain is that of the modes with their weights
        doubt = root(
            elastic.mixture.total - elastic.conditional_posterior.total, elastic.mixture.total
        )
        xi = xi + random.standard_normal(xi.shape) @ doubt.T
    theta = prior.theta(xi)
    a = (
        damping.fit.coefficients
        + damping.draws(random, count)
        + (theta - elastic.theta) @ damping.by_elastic.T
    )
    draws = np.column_stack(
        [np.zeros((count, 0)), *(each.draws(random, count) for each in damping.systematic_effects)]
    )
    moved = prior.theta(
        xi + draws[:, : len(elastic.all_systematic_effects)] @ elastic.bias_sensitivity.T
    )
    return Posterior(xi, np.hstack([moved, a + draws @ damping.bias_sensitivity.T]), chain)


def run_chain(
    density: LogProbability,
    start: FloatArray,
    covariance: FloatArray,
    seed: np.random.SeedSequence,
    target: int,
    progress: Callable[[float], None],
    names: tuple[str, ...],
    checkpoint: Checkpoint | None = None,
) -> Chain:
    """Run walkers from around `start` until the chain is converged.

    Works in units of the Gaussian posterior's standard deviations, so that SI units do not matter.

    Raises:
        UpdatingError: the chain is not converged after 40,000 steps.
    """
    import emcee  # only where it samples: the import takes as long as a small update job

    scale = np.sqrt(np.diag(covariance))
    dimension = start.size
    walkers = max(_WALKERS_PER_DIMENSION * dimension, _FEWEST_WALKERS)
    restored = None if checkpoint is None else checkpoint.restored
    if restored is not None:  # perhaps by another version, with other walkers
        walkers = _walkers(restored)
    random = np.random.RandomState(seed.generate_state(4))  # what emcee takes
    moves = [(emcee.moves.DEMove(), 0.8), (emcee.moves.DESnookerMove(), 0.2)]
    sampler = emcee.EnsembleSampler(
        walkers, dimension, lambda x: density(start + x * scale), moves=moves, vectorize=True
    )
    state = emcee.State(
        random.standard_normal((walkers, dimension)), random_state=random.get_state()
    )
    if restored is not None:
        state = _unpack(restored, sampler.backend)
    steps, tau = sampler.iteration, np.full(dimension, np.inf)
    while steps < _LONGEST:
        state = sampler.run_mcmc(state, _BLOCK, skip_initial_state_check=steps > 0)
        steps += _BLOCK
        if checkpoint is not None:
            checkpoint.checkpoint(_pack(sampler.backend))
        tau = sampler.get_autocorr_time(tol=0)
        effective = walkers * (steps - 5 * tau.max()) / tau
        progress(min(1.0, float(effective.min()) / target))
        if steps > _TIMES_AUTOCORRELATION * tau.max() and effective.min() >= target:
            chain = sampler.get_chain(
                discard=int(5 * tau.max()), thin=max(1, int(tau.min() / 2)), flat=True
            )
            return Chain(
                start + chain * scale, tau, effective, float(np.mean(sampler.acceptance_fraction))
            )
    raise UpdatingError(
        f"the chain did not converge: {steps} steps are {steps / tau.max():.0f} autocorrelation"
        f" times, expected {_TIMES_AUTOCORRELATION}; the posterior may be degenerate: fix or tie a"
        " parameter that is not identifiable",
        best=by_name(names, start),
        history=(),
    )


def _pack(backend: emcee.backends.Backend) -> bytes:
    """A sampler's chain with the random generator's last state, as npz."""
    _, key, *rest = backend.random_state
    kept = {name: getattr(backend, name) for name in ("chain", "log_prob", "accepted")}
    buffer = io.BytesIO()
    np.savez(buffer, **kept, key=key, rest=np.array(rest, dtype=float))
    return buffer.getvalue()


def _walkers(data: bytes) -> int:
    with np.load(io.BytesIO(data)) as kept:
        return int(kept["chain"].shape[1])


def _unpack(data: bytes, backend: emcee.backends.Backend) -> emcee.State:
    """Put a kept chain back into a fresh sampler's backend; the state to go on from."""
    with np.load(io.BytesIO(data)) as kept:
        position, has_gauss, gauss = kept["rest"]
        backend.random_state = ("MT19937", kept["key"], int(position), int(has_gauss), float(gauss))
        backend.chain, backend.log_prob, backend.accepted = (
            kept["chain"],
            kept["log_prob"],
            kept["accepted"],
        )
    backend.iteration, backend.initialized = len(backend.chain), True
    return backend.get_last_sample()


def _elastic_density(elastic: ElasticResult) -> LogProbability:
    """Log posterior of ξ: frequencies of the paired modes through a basis of this posterior, and
    the prior.
    """
    state, prior, free = elastic.updated, elastic.prior, len(elastic.prior.reported)
    rows, columns = np.array(elastic.pairing.pairs).T
    measured_log = np.log(elastic.only.modes.frequency_hz[rows])
    highest = int(columns.max()) + 1 + state.modes.rigid
    covariance = np.zeros_like(elastic.conditional_posterior.total)
    covariance[:free, :free] = elastic.conditional_posterior.total[:free, :free]
    centre = np.concatenate([prior.xi(elastic.theta)[:free], prior.xi_mean[free:]])
    frequencies = _LocalFrequencies.about(
        state.forward.on_basis(), prior.theta(centre), covariance, highest
    )
    by_inputs = elastic.problem.sensitivity[:, free:] * prior.xi_sd[free:]
    likelihood = log_likelihood(
        elastic.problem.noise + by_inputs @ by_inputs.T,
        elastic.problem.weights,
        elastic.problem.scale,
    )
    log_prior = elastic.layout.log_prior()

    def density(xi: FloatArray) -> FloatArray:
        value = np.full(len(xi), -np.inf)
        whole = np.tile(centre, (len(xi), 1))
        whole[:, :free] = xi
        allowed = prior.are_believable(whole)
        if allowed.any():
            residual = measured_log - np.log(
                frequencies.at(prior.theta(whole[allowed]))[:, columns]
            )
            value[allowed] = likelihood(residual) + log_prior(
                (whole[allowed] - prior.xi_mean)[:, :free]
            )
        return value

    return density


def _with_inputs(elastic: ElasticResult, xi: FloatArray, random: np.random.Generator) -> FloatArray:
    """(n, p) all coordinates: (n, q) samples of the parameters, and the inputs drawn from their
    Gaussian given these.
    """
    free = xi.shape[1]
    joint = elastic.conditional_posterior.total
    centre = elastic.prior.xi(elastic.theta)
    if free == len(joint):  # all inputs are known exactly
        return xi
    slope = np.linalg.solve(joint[:free, :free], joint[:free, free:])
    left = joint[free:, free:] - joint[free:, :free] @ slope
    drawn = random.multivariate_normal(np.zeros(len(left)), left, len(xi), method="svd")
    return np.hstack([xi, centre[free:] + (xi - centre[:free]) @ slope + drawn])


@dataclass(frozen=True)
class _LocalFrequencies:
    """Natural frequencies in a small basis, for many θ at once.

    The basis holds the modes at the estimate and at points around it, three posterior standard
    deviations away along every principal axis, so it is exact at these and nearly so between them.
    """

    parametrisation: Parametrisation
    stiffness: FloatArray
    mass: FloatArray
    rigid: int

    @classmethod
    def about(
        cls, forward: ForwardModel, theta: FloatArray, covariance: FloatArray, highest: int
    ) -> _LocalFrequencies:
        """Make the basis about an estimate, for the `highest` lowest modes.

        Raises:
            UpdatingError: its frequencies miss the forward model's.
        """
        prior, scale = forward.parametrisation, np.sqrt(np.diag(covariance))
        safe = np.where(scale > 0, scale, 1.0)
        share, axes = np.linalg.eigh(covariance / np.outer(safe, safe))
        arms = _BASIS_REACH * scale[:, None] * axes * np.sqrt(np.maximum(share, 0))
        xi = prior.xi(theta)
        arms = arms[:, share > _FLAT]
        places = [theta, *(prior.theta(xi + sign * arm) for arm in arms.T for sign in (1, -1))]
        states = [forward.solve(place) for place in places if prior.is_physical(place)]
        # all on the basis that has grown by now
        states = [forward.solve(state.theta) for state in states]
        shapes = np.hstack([state.modes.shapes[:, :highest] for state in states])
        system = forward.basis.system
        left, singular, _ = np.linalg.svd(
            shapes / np.linalg.norm(shapes, axis=0), full_matrices=False
        )
        V = left[:, singular > 1e-6 * singular[0]]
        local = cls(
            prior,
            np.einsum("ri,krs,sj->kij", V, system.stiffness, V, optimize=True),
            np.einsum("ri,krs,sj->kij", V, system.mass, V, optimize=True),
            states[0].modes.rigid,
        )
        even = np.full(arms.shape[1], 1 / np.sqrt(arms.shape[1]))
        probes = prior.theta(np.array([xi + sign * arms @ even for sign in (-0.7, 0.7)]))
        probes = probes[prior.are_physical(probes)]
        exact = np.array([forward.solve(row).frequency_hz for row in probes])
        elastic = slice(0, highest - local.rigid)
        miss = (
            np.abs(local.at(probes)[:, elastic] / exact[:, elastic] - 1).max(initial=0)
            if probes.size
            else 0.0
        )
        if miss > 100 * _BASIS_TOLERANCE:
            raise UpdatingError(
                f"the sampling basis misses the frequencies by {miss:.1e} in the reach of the"
                " priors; narrow those of what the data do not determine, or take the posterior"
                " `laplace`",
                best={},
                history=(),
            )
        return local

    def at(self, theta: FloatArray) -> FloatArray:
        """(w, n) natural frequencies of the elastic modes, Hz, at (w, q) parameters."""
        stiffness, mass = self.parametrisation.coefficient_values(theta)
        K, M = np.tensordot(stiffness, self.stiffness, 1), np.tensordot(mass, self.mass, 1)
        # Where θ does not touch the mass, one factor serves all.
        inverse = np.linalg.inv(np.linalg.cholesky(M[:1] if np.all(mass == mass[0]) else M))
        value = np.linalg.eigvalsh(inverse @ K @ inverse.transpose(0, 2, 1))
        frequencies: FloatArray = np.sqrt(np.maximum(value[:, self.rigid :], 0)) / (2 * np.pi)
        return frequencies


_VALUES_AT_ONCE = 200_000  # of FRFs whose changes are held in memory, some twenty for each value


@dataclass(frozen=True)
class Predictor:
    """The updated model with its uncertainty."""

    elastic: ElasticResult
    damping: DampingResult

    def predict(self, frfs: FrfSet) -> tuple[ComplexArray, FloatArray]:
        """(N, L) predicted FRFs, and (2, N, L) variances of their real and imaginary parts, noise
        not included.
        """
        predicted, changes = self._with_changes(frfs)
        return predicted, _squares(changes)

    def spread(self, frfs: FrfSet) -> tuple[FloatArray, FloatArray]:
        """(N, L) standard deviations of ln|H| and of the phase in radians of predicted FRFs, noise
        not included.

        To first order a small change of H is a change of ln|H| by the real part of δH/H and of the
        phase by the imaginary one.
        """
        few = max(1, _VALUES_AT_ONCE // frfs.frequency_hz.size)
        parts = []
        for first in range(0, len(frfs.responses), few):
            some = frfs.select(list(range(first, min(first + few, len(frfs.responses)))))
            predicted, changes = self._with_changes(some)
            # at a zero of H nothing is known of its logarithm
            with np.errstate(divide="ignore", invalid="ignore"):
                changes *= 1 / predicted
            parts.append(np.sqrt(_squares(changes)))
        log_magnitude, phase = (
            np.nan_to_num(np.vstack(part), nan=np.inf) for part in zip(*parts, strict=True)
        )
        return log_magnitude, phase

    def _with_changes(self, frfs: FrfSet) -> tuple[ComplexArray, ComplexArray]:
        """(N, L) predicted FRFs, and (q, N, L) their change by one standard deviation of each of q
        independent causes.
        """
        model = self.elastic.updated.frf_model(frfs.responses, frfs.references)
        fit = self.damping.fit
        return fit.synthesise(model, frfs.frequency_hz, frfs.quantity), self._changes(
            frfs, model, fit.rates(model)
        )

    def _changes(self, frfs: FrfSet, model: ModalFrfModel, rate: FloatArray) -> ComplexArray:
        """(q, N, L) those changes, of a roving mass too."""
        change = self._plain_changes(frfs, frfs.references, model, rate)
        factors = model.load_factors(frfs.frequency_hz, rate, frfs.quantity)
        if factors is None or model.roving is None:
            return change
        loaded: ComplexArray = factors[0] * change
        loaded += factors[1] * self._plain_changes(
            frfs, frfs.responses, model.roving.drive(model), rate
        )
        return loaded

    def _plain_changes(
        self, frfs: FrfSet, references: tuple[Dof, ...], model: ModalFrfModel, rate: FloatArray
    ) -> ComplexArray:
        """(q, N, L) the same of FRFs to other references, without a roving mass."""
        omega, state = frfs.omega, self.elastic.updated
        factor = convert(omega, frfs.quantity)
        flexibility = 1 / (model.eigenvalue[:, None] - omega**2 + 1j * omega * rate[:, None])
        by_eigenvalue = -factor * flexibility**2
        lines = np.vstack([factor * flexibility, by_eigenvalue, 1j * omega * by_eigenvalue])
        A, m = model.residues, model.eigenvalue.size
        basis = self.damping.fit.law.basis(model.omega, model.strain)
        basis[self.damping.fit.nuisance.suspension_modes] = 0
        shifted = self.damping.fit.nuisance.modes
        covariance = self.damping.joint(self.elastic.covariance, self.damping.fit.noise_covariance)
        p, e = len(covariance), shifted.size
        # Of the lines' functions, in the change of each FRF by each constant and coefficient.
        weights = np.zeros((p, len(A), 3 * m))
        weights[: self.elastic.theta.size, :, :m] = state.residue_jacobian(
            frfs.responses, references
        )
        weights[: self.elastic.theta.size, :, m : 2 * m] = (
            A * state.eigenvalue_jacobian.T[:, None, :]
        )
        weights[self.elastic.theta.size :, :, 2 * m :] = A * basis.T[:, None, :]
        weights = np.tensordot(root(covariance).T, weights, 1)
        # The weights are real: real and imaginary parts go side by side through products of real
        # numbers.
        parts = np.ascontiguousarray(lines).view(np.float64)
        change = np.empty((p + 2 * e, len(A), parts.shape[1]))
        change[:p] = (weights.reshape(-1, 3 * m) @ parts).reshape(p, len(A), -1)
        shift = 2 * model.eigenvalue[shifted] * self.elastic.discrepancy
        deviation = rate[shifted] * self.damping.discrepancy
        for own, size, first in (
            (change[p : p + e], shift, m),
            (change[p + e :], deviation, 2 * m),
        ):
            np.multiply(
                (size * A[:, shifted]).T[:, :, None], parts[first + shifted][:, None], out=own
            )
        return change.view(np.complex128)

    def hold_against(
        self, frfs: FrfSet, points: tuple[int, ...], band_hz: tuple[float, float]
    ) -> HeldOut:
        """Compare held-out FRFs with their prediction; the noise level is that of the fitted
        data.
        """
        predicted, variance = self.predict(frfs)
        measured = frfs.measured
        stated = np.nan if frfs.variance is None else frfs.variance
        noise = np.where(np.isnan(stated), self._noise(predicted), stated)
        error = frfs.values - predicted
        inside = [
            (np.abs(part) <= Z_95 * np.sqrt(spread + noise / 2))[measured]
            for part, spread in zip((error.real, error.imag), variance, strict=True)
        ]
        return HeldOut(
            points=points,
            band_hz=band_hz,
            agreement=agreement(frfs, predicted),
            coverage_95=float(np.mean(inside)),
        )

    def _noise(self, predicted: ComplexArray) -> FloatArray:
        """(N, L) noise variance of unseen FRFs: the fitted ones' v = a² + b²|H|², with the median
        a² and b².
        """
        seen, modal = self.damping.reference.misfit, self.damping.reference.fit
        level = np.abs(seen.predict(modal.eigenvalue, modal.rate)) ** 2
        rows = zip(level, seen.variance, seen.counted, strict=True)
        pairs = np.array([_line(row[known], floor[known]) for row, floor, known in rows])
        slope, constant = np.median(pairs, axis=0)
        variance: FloatArray = constant + slope * np.abs(predicted) ** 2
        return variance


def _squares(changes: ComplexArray) -> FloatArray:
    """(2, N, L) sums of the squares of real and imaginary parts of (q, N, L) changes."""
    parts = changes.view(np.float64).reshape(*changes.shape, 2)
    return np.moveaxis(np.einsum("qnlc,qnlc->nlc", parts, parts), -1, 0)


def agreement(frfs: FrfSet, predicted: ComplexArray) -> Agreement:
    """All criteria of some FRFs, over the values that were measured."""
    values, there = (np.where(frfs.measured, each, 0) for each in (frfs.values, predicted))
    return correlate("FRFs", values, there)


def _line(level: FloatArray, variance: FloatArray) -> FloatArray:
    """Slope and constant of v = a² + b² level, neither below zero."""
    slope = float(np.polyfit(level, variance, 1)[0]) if np.ptp(level) > 0 else 0.0
    slope = max(slope, 0.0)
    return np.array([slope, max(float(np.mean(variance - slope * level)), float(variance.min()))])
