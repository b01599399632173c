"""What a term is worth: the evidence for it under an error model whose scale is known but roughly.

A term that lowers χ² by G, over the n data of its own support whose misfit without it is M, gains

    ln-likelihood ratio ×2 = (2n/τ) ln((n + M)/(n + M - G)),

Student's law of errors whose variance has a prior as strong as the data themselves: for M ≈ n it is G/τ, as with known
errors; where the model fails for other reasons (M ≫ n) only the share of the misfit counts that the term explains. It must pay
ln(data) per unknown (Bayesian criterion) for a mode, 2 (Akaike) for what only stands for things outside the band.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fecore.arrays import BoolArray, FloatArray
from fecore.identification.arrangement import Arrangement
from fecore.identification.basis import Terms, columns, pair_power
from fecore.identification.linear import alike
from fecore.identification.refinement import Fit
from fecore.identification.residues import weights

RESIDUAL_TERMS = (-2, -1, 0, 1, 2)  # powers of iω that may stand for the modes outside the band
_SURE = 5.0  # data of prior on the scale of the errors for each datum
_PRIOR = 100.0  # ... and at least
_ALONE = 1e-6  # share of a candidate's power that the model's own terms leave: below it nothing new is in it
_BLOCK = 256  # lines whose products stay in the cache


@dataclass(frozen=True)
class Gains:
    """Evidence for each possible term less its price.

    Attributes:
        pole: (K,) of the candidate poles.
        exponent: of the residual terms not in the model.
        decay: of floating bodies with the rates of `_rates`.
    """

    pole: FloatArray
    exponent: dict[int, float]
    decay: dict[float, float]


@dataclass(frozen=True)
class Worth:
    """How much the data are worth: the number of FRFs behind the fitted rows, and the lines that are worth one."""

    records: int
    memory: float


def price(fit: Fit, records: int, columns_added: int, parameters_added: int) -> tuple[float, float]:
    """Least evidence that pays for new unknowns by Akaike's and by the Bayesian criterion."""
    unknowns = columns_added * records + parameters_added
    return 2.0 * unknowns, float(np.log(2 * records * fit.residual.shape[1])) * unknowns


def pole_price(arrangement: Arrangement, fit: Fit, records: int, hz: FloatArray) -> FloatArray:
    """Akaike's price for a pole out of band, which is but a better residual term; the Bayesian one for a mode."""
    akaike, bayes = price(fit, records, 2, 2)
    return np.where(in_band(arrangement, hz), bayes, akaike)


def in_band(arrangement: Arrangement, hz: FloatArray) -> BoolArray:
    """(n,) True for frequencies within the measured lines."""
    return np.asarray((hz >= arrangement.frequency_hz[0]) & (hz <= arrangement.frequency_hz[-1]))


def evidence(
    gain: FloatArray, arrangement: Arrangement, fit: Fit, power: FloatArray, scale: Worth, *, gained: bool
) -> FloatArray:
    """(K,) twice the logarithm of the likelihood ratio for terms with power (L, K) on the lines.

    `gained` says whether the fit has the terms already.
    """
    share = power / np.maximum(power.sum(axis=0), 1e-300)
    lines = 1 / np.maximum(np.sum(share**2, axis=0), 1e-300)
    misfit = np.sum(np.abs(fit.residual) ** 2 * weights(arrangement, fit.variance), axis=0)
    data = 2 * scale.records * lines
    prior = np.maximum(_SURE * data, _PRIOR)
    before = np.maximum(prior + lines * (misfit @ share) + (gain if gained else 0.0), prior)
    after = np.maximum(before - gain, prior)
    return np.asarray((data + prior) / np.minimum(scale.memory, lines) * np.log(before / after))


def pole_power(arrangement: Arrangement, hz: FloatArray, zeta: FloatArray) -> FloatArray:
    """(L, K) square of the columns of poles on the lines."""
    return pair_power(arrangement.omega, Terms(hz, zeta, ()), arrangement.power)


def gains(arrangement: Arrangement, fit: Fit, hz: FloatArray, zeta: FloatArray, scale: Worth) -> Gains:
    """Gain of each candidate when it is added alone and all coefficients are fitted anew, poles held."""
    terms = fit.terms
    absent = [e for e in RESIDUAL_TERMS if e not in terms.exponents]
    rates = _rates(arrangement) if not terms.decay.size else np.empty(0)
    extra = columns(arrangement.omega, Terms(hz, zeta, tuple(absent), rates), arrangement.power)
    weight = weights(arrangement, fit.variance)
    right = ((weight * fit.residual) @ extra.conj()).real
    cross = _cross_products(fit.linear.frame, extra, weight)
    projected = np.matmul(fit.linear.root, cross)
    count = 2 * hz.size
    one, two = extra[:, 0:count:2], extra[:, 1:count:2]
    entries = []
    for a, b, i, j in ((one, one, 0, 0), (one, two, 0, 1), (two, two, 1, 1)):
        raw = weight @ (a.real * b.real + a.imag * b.imag)
        kept = raw - np.einsum("nqk,nqk->nk", projected[:, :, i:count:2], projected[:, :, j:count:2])
        entries.append((raw, kept))
    (raw11, s11), (_, s12), (raw22, s22) = entries
    g1, g2 = right[:, 0:count:2], right[:, 1:count:2]
    determinant = s11 * s22 - s12**2
    alone = (s11 > _ALONE * raw11) & (s22 > _ALONE * raw22) & (determinant > _ALONE * s11 * s22)
    with np.errstate(invalid="ignore", divide="ignore"):
        gain = np.where(alone, (s22 * g1**2 - 2 * s12 * g1 * g2 + s11 * g2**2) / determinant, 0.0).sum(axis=0)
    single = []
    for place in range(count, extra.shape[1]):
        raw = weight @ np.abs(extra[:, place]) ** 2
        kept = raw - np.einsum("nq,nq->n", projected[:, :, place], projected[:, :, place])
        with np.errstate(invalid="ignore", divide="ignore"):
            single.append(float(np.where(kept > _ALONE * raw, right[:, place] ** 2 / kept, 0.0).sum()) / scale.memory)
    exponent = {
        e: value - price(fit, scale.records, 1, 0)[0] for e, value in zip(absent, single[: len(absent)], strict=True)
    }
    decay = {
        float(a): v - price(fit, scale.records, 1, 1)[0] for a, v in zip(rates, single[len(absent) :], strict=True)
    }
    worth_of = evidence(gain, arrangement, fit, pole_power(arrangement, hz, zeta), scale, gained=False)
    return Gains(worth_of - pole_price(arrangement, fit, scale.records, hz), exponent, decay)


def worth(arrangement: Arrangement, fit: Fit, scale: Worth) -> tuple[FloatArray, FloatArray]:
    """Evidence for each pole pair (n,) and for each other term of the fit (other poles held)."""
    pole, other = loss(fit)
    power = pole_power(arrangement, fit.terms.frequency_hz, fit.terms.damping_ratio)
    return evidence(pole, arrangement, fit, power, scale, gained=True), other / scale.memory


def loss(fit: Fit) -> tuple[FloatArray, FloatArray]:
    """What χ² would rise by without each pole pair (n,) and without each other term (other poles held)."""
    n = fit.terms.pairs
    c, V = fit.linear.coefficients, fit.linear.covariance
    part = 2 * np.arange(n)[:, None] + np.arange(2)
    pairs = c[:, part]
    inverse = np.linalg.pinv(V[:, part[:, :, None], part[:, None, :]], hermitian=True)
    pole = np.einsum("nki,nkij,nkj->k", pairs, inverse, pairs)
    spread = np.einsum("nii->ni", V)[:, 2 * n :]
    return pole, np.asarray(np.sum(c[:, 2 * n :] ** 2 / np.maximum(spread, 1e-300), axis=0))


def _rates(arrangement: Arrangement) -> FloatArray:
    """Rates of floating bodies to try, 1/s: those that bend the lowest tenth of the band."""
    low, high = arrangement.omega[0], arrangement.omega[-1]
    return np.asarray(np.geomspace(max(low, 1e-3 * high), 0.1 * high, 6)) if low < 0.1 * high else np.empty(0)


def _cross_products(basis: np.ndarray, extra: np.ndarray, weight: FloatArray) -> FloatArray:
    """(N, q, k) Re Φᴴ W Ψ of every FRF, in blocks of lines that bound the memory."""
    q, k = basis.shape[1], extra.shape[1]
    if alike(weight):
        once = ((basis.conj() * weight[0][:, None]).T @ extra).real
        return np.asarray(np.broadcast_to(once, (len(weight), q, k)))
    across = np.ascontiguousarray(weight.T)
    products = np.zeros((q, k, weight.shape[0]))
    for start in range(0, basis.shape[0], _BLOCK):
        part = slice(start, start + _BLOCK)
        real, imag = np.ascontiguousarray(extra[part].real.T), np.ascontiguousarray(extra[part].imag.T)
        for i in range(q):
            products[i] += (real * basis[part, i].real + imag * basis[part, i].imag) @ across[part]
    return np.ascontiguousarray(products.transpose(2, 0, 1))
