"""Two modes under one pole, parted by the references that see them differently.

The residues of one mode, roving by fixed dofs, are a matrix of rank one, ψ lᵀ: l is how well each
reference sees it. Modes so near to each other that the series has one pole for them leave a matrix
of rank two. With several references l distinguishes them even where their frequencies agree. In
place of the pole

    H_ij(s) = Σ_q ψ_qi l_qj/(s - s_q) + conj.  + all other terms of the series,     q = 1, 2,

and to first order in the shifts δ_q = s_q - s_0 the sum is P/(s - s_0) + Q/(s - s_0)², P = Σ ψ_q
l_qᵀ, Q = Σ δ_q ψ_q l_qᵀ. In the two leading singular directions of P, Q P⁻¹ = A diag(δ) A⁻¹: its
eigenvalues are the shifts, the rows of A⁻¹P are the l_q. From there the poles and l are refined by
least squares over all lines. The shapes ψ and the coefficients of the other terms are eliminated
(variable projection): the skirts of neighbours are as large as what parts the two modes.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from fecore.arrays import ComplexArray, FloatArray, IntArray
from fecore.findings import Finding
from fecore.modal.arrangement import Arrangement
from fecore.modal.basis import columns
from fecore.modal.findings import finding
from fecore.modal.local_pair import Site
from fecore.modal.refinement import Fit, level_at
from fecore.modal.shapes import of_rank_two

_NEAR = 2.0  # half bandwidths of the pole within which both modes must lie


@dataclass(frozen=True)
class Parted:
    """Two modes in place of pole k."""

    pole: int  # k, its number in the terms
    frequency_hz: FloatArray  # (2,) ascending
    damping_ratio: FloatArray  # (2,)
    covariance: FloatArray  # (4, 4) of (ln f₁, ln f₂, ζ₁, ζ₂)
    residues: ComplexArray  # (N, 2) of rank one each
    variance: FloatArray  # (N, 2) E|error|² of the residues


@dataclass(frozen=True)
class PartedFit(Fit):
    """A fit in which some poles stand for two modes each, whose residues are of rank one."""

    base: Fit = field(kw_only=True)  # the fit with one pole for both
    parted: tuple[Parted, ...] = field(kw_only=True)  # the pairs, in ascending number of their pole

    @cached_property
    def residues(self) -> ComplexArray:
        """(N, n) residues of the receptance; those beside a pair are of the fit with one pole for
        it.
        """
        values = self.base.residues[:, _places(self.base.terms.pairs, self.parted)]
        for first, pair in _first_of(self.parted):
            values[:, first : first + 2] = pair.residues
        return values

    @cached_property
    def residue_variance(self) -> FloatArray:
        """(N, n) E|error|² of the residues."""
        spread = self.base.residue_variance[:, _places(self.base.terms.pairs, self.parted)]
        for first, pair in _first_of(self.parted):
            spread[:, first : first + 2] = pair.variance
        return spread

    @cached_property
    def parameter_covariance(self) -> FloatArray:
        """Covariance of the non-linear parameters; that of a pair stands alone."""
        n, base = self.base.terms.pairs, self.base.parameter_covariance
        at = _places(n, self.parted)
        which = np.concatenate([at, n + at, np.arange(2 * n, len(base))])
        covariance = base[np.ix_(which, which)]
        for first, pair in _first_of(self.parted):
            own = np.array([first, first + 1, at.size + first, at.size + first + 1])
            covariance[own, :] = covariance[:, own] = 0.0
            covariance[np.ix_(own, own)] = pair.covariance
        return np.asarray(covariance)


def part(
    arrangement: Arrangement, fit: Fit, among: IntArray
) -> tuple[Fit, IntArray, list[Finding]]:
    """The fit with two modes for each pole, of those numbered, whose residues are of rank two.

    Returns:
        the fit; the number of the old pole of each new one; and what was done.
    """
    f, width = fit.terms.frequency_hz, fit.terms.half_bandwidth_hz
    # a pole beside it is the other mode
    alone = np.sum(np.abs(f[among] - f[:, None]) < width[:, None], axis=1) <= 1
    two = np.intersect1d(
        among, np.flatnonzero(of_rank_two(arrangement, fit.residues, fit.residue_variance) & alone)
    )
    parted = tuple(pair for k in two if (pair := _pair(arrangement, fit, int(k))) is not None)
    at = _places(fit.terms.pairs, parted)
    if not parted:
        return fit, at, []
    notes = [
        finding("parted", first=pair.frequency_hz[0], second=pair.frequency_hz[1])
        for pair in parted
    ]
    return _with(arrangement, fit, parted), at, notes


def _places(count: int, parted: tuple[Parted, ...]) -> IntArray:
    """Number of the old pole of each new one, of `count` old ones: a parted pole stands twice."""
    return np.repeat(
        np.arange(count), [1 + any(pair.pole == k for pair in parted) for k in range(count)]
    )


def _first_of(parted: tuple[Parted, ...]) -> list[tuple[int, Parted]]:
    """Each pair with the number of its first mode among the new poles."""
    return [(pair.pole + number, pair) for number, pair in enumerate(parted)]


def _with(arrangement: Arrangement, fit: Fit, parted: tuple[Parted, ...]) -> PartedFit:
    """The series with the pairs in place of their poles; its other coefficients are fitted to what
    the pairs leave.
    """
    terms, n = fit.terms, fit.terms.pairs
    at = _places(n, parted)
    f, zeta = terms.frequency_hz[at], terms.damping_ratio[at]
    c = fit.linear.coefficients
    c = c[
        :,
        np.concatenate(
            [np.stack([2 * at, 2 * at + 1], axis=1).ravel(), np.arange(2 * n, c.shape[1])]
        ),
    ]
    own = np.zeros(c.shape[1], dtype=bool)
    for first, pair in _first_of(parted):
        f[first : first + 2], zeta[first : first + 2] = pair.frequency_hz, pair.damping_ratio
        c[:, 2 * first : 2 * first + 4] = np.stack(
            [pair.residues.real, pair.residues.imag], axis=2
        ).reshape(-1, 4)
        own[2 * first : 2 * first + 4] = True
    terms = replace(terms, frequency_hz=f, damping_ratio=zeta)
    basis = columns(arrangement.omega, terms, arrangement.power)
    measured = arrangement.values - fit.background
    values = measured - c[:, own] @ basis[:, own].T
    others = terms.some(~own[: 2 * terms.pairs : 2])
    c[:, ~own] = level_at(
        replace(arrangement, values=values), others, fit.variance
    ).linear.coefficients
    kept = {name: getattr(fit, name) for name in Fit.__dataclass_fields__}
    kept |= {
        "terms": terms,
        "linear": replace(fit.linear, coefficients=c, basis=basis),
        "residual": np.where(arrangement.measured, measured - c @ basis.T, 0),
    }
    return PartedFit(**kept, base=fit, parted=parted)


def _pair(arrangement: Arrangement, fit: Fit, k: int) -> Parted | None:
    """The two modes under pole k; None where they are not about it. The errors of the poles reach
    the residues, by one standard deviation along each of their axes.
    """
    site = Site.about(arrangement, fit, k)
    if site is None:
        return None
    two, covariance = site.fitted(site.start(), fit.inflation)
    if not np.all(
        np.abs(two.frequency_hz - site.frequency_hz)
        < _NEAR * site.damping_ratio * site.frequency_hz
    ):
        return None
    residues, variance = site.residues(two)
    variance = variance * fit.inflation
    value, vector = np.linalg.eigh(covariance[:4, :4])
    for size, axis in zip(np.sqrt(np.maximum(value, 0)), vector.T, strict=True):
        theta = two.theta
        theta[:4] += size * axis
        variance = variance + np.abs(site.residues(two.at(theta))[0] - residues) ** 2
    order = np.argsort(two.frequency_hz)
    both = np.concatenate([order, 2 + order])
    return Parted(
        pole=k,
        frequency_hz=two.frequency_hz[order],
        damping_ratio=two.damping_ratio[order],
        covariance=covariance[np.ix_(both, both)],
        residues=residues[:, order],
        variance=variance[:, order],
    )
