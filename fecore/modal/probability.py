"""One probability for each pole: that it is a mode of the structure.

    logit P = b₀ + Λ(r) + b₁ lg ρ + b₂ lg s - b₃ min(z, 3)² - b₄ t  [- b₅ min(u, 1)² - b₆ min(g, 1)²],    lg = log₁₀,

with the features of `evidence` and Λ = ln p₁(r)/p₀(r), the densities of the phase for modes and for others,

    p₁ = 0.98 e^{-(1-r)/σ}/√(πσ(1-r)) + 0.02/(π√(1-r²)),    p₀ = 0.3/(π√(1-r²)) + 0.7 N(r; 0, 0.4),

σ = 0.1, or 0.06 with p₀ = 1/(π√(1-r²)) for fewer than four FRFs. Both have the same root at r = 1, so Λ stays finite. The
weights b are a Bayesian fit (`python -m benchmarks calibrate`), with a covariance. A feature that a set cannot give
drops out: it takes its mean among poles, and its spread, like the weights' own, widens P towards ½ (MacKay 1992): P =
σ(a/√(1 + πv/8)).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray
from fecore.modal.arrangement import Arrangement
from fecore.modal.evidence import Evidence
from fecore.modal.weights import COVARIANCE, MEAN

_FEW = 4  # FRFs below which a phase is that of single values
_SIGMA, _SIGMA_OF_FEW = 0.1, 0.06
_STRAY = 0.02  # share of the modes whose phase is anything
_AT_ODDS = 0.4  # standard deviation of r for what is no mode
_ANY = 0.3  # share of these whose phase is anything
_EDGE = 1e-6  # of r at ±1
_MOST_DAMPING = 3.0  # of z
_OVERDAMPED = 0.6  # ζ from which a pole is a trend of the record
_NO_SHAPE = (0.2, 0.2)  # mean and standard deviation of t where there are no shapes


@dataclass(frozen=True)
class Feature:
    """One reason for or against a pole.

    Attributes:
        name: `phase`, `rise`, `share`, `damping`, `twin`, `repeat` or `growth`.
        value: the feature.
        weight: what it adds to the logit of P.
        words: what it says, in words of the field.
    """

    name: str
    value: float
    weight: float
    words: str


def phase_ratio(r: FloatArray, frfs: int) -> FloatArray:
    """Λ(r) = ln p₁(r)/p₀(r)."""
    r = np.clip(r, -1 + _EDGE, 1 - _EDGE)
    sigma = _SIGMA if frfs >= _FEW else _SIGMA_OF_FEW
    arcsine = 1 / (np.pi * np.sqrt(1 - r**2))
    of_modes = (1 - _STRAY) * np.exp(-(1 - r) / sigma) / np.sqrt(np.pi * sigma * (1 - r)) + _STRAY * arcsine
    spread = np.exp(-(r**2) / (2 * _AT_ODDS**2)) / (_AT_ODDS * np.sqrt(2 * np.pi))
    of_others = arcsine if frfs < _FEW else _ANY * arcsine + (1 - _ANY) * spread
    return np.asarray(np.log(of_modes / of_others))


def design(arrangement: Arrangement, evidence: Evidence) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(n,) Λ, (n, 7) what the weights multiply, and (n, 7) its standard deviation where it is not known."""
    n, frfs = evidence.phase.size, len(arrangement.pairs)
    x = np.stack(
        [
            np.ones(n),
            np.log10(evidence.rise),
            np.log10(evidence.share),
            -(np.minimum(evidence.damping, _MOST_DAMPING) ** 2),
            -evidence.twin,
            -(np.minimum(evidence.repeat, 1.0) ** 2),
            -(np.minimum(evidence.growth, 1.0) ** 2),
        ],
        axis=1,
    )
    spread = np.zeros_like(x)
    if frfs < 2:
        alone = np.exp(-(evidence.apart**2) / 2) * (evidence.neighbour >= 0)
        x[:, 4], spread[:, 4] = -_NO_SHAPE[0] * alone, _NO_SHAPE[1] * alone
    return phase_ratio(evidence.phase, frfs), np.where(np.isnan(x), 0.0, x), spread


def probability(arrangement: Arrangement, evidence: Evidence, damping_ratio: FloatArray) -> FloatArray:
    """(n,) P of each pole; 0 of one that does not swing, or is a tone."""
    ratio, x, spread = design(arrangement, evidence)
    p = predictive(ratio + x @ MEAN, np.einsum("ni,ij,nj->n", x, COVARIANCE, x) + (spread**2) @ MEAN**2)
    return np.where((damping_ratio > _OVERDAMPED) | evidence.tone, 0.0, p)


def predictive(logit: FloatArray, variance: FloatArray) -> FloatArray:
    """P for a logit that is known with a variance."""
    return np.asarray(1 / (1 + np.exp(-logit / np.sqrt(1 + np.pi * variance / 8))))


NAMES = ("phase", "rise", "share", "damping", "twin", "repeat", "growth")


def features(
    arrangement: Arrangement, evidence: Evidence, frequency_hz: FloatArray, damping_ratio: FloatArray
) -> list[tuple[Feature, ...]]:
    """The features of each pole, those that weigh most first."""
    ratio, x, _ = design(arrangement, evidence)
    added = np.concatenate([ratio[:, None], x[:, 1:] * MEAN[1:]], axis=1)
    out = []
    for k in range(len(x)):
        values = [getattr(evidence, name)[k] for name in NAMES]
        known = [i for i, value in enumerate(values) if np.isfinite(value)]
        known.sort(key=lambda i: -abs(added[k, i]))
        out.append(
            tuple(
                Feature(
                    NAMES[i],
                    float(values[i]),
                    float(added[k, i]),
                    _words(NAMES[i], evidence, k, frequency_hz, damping_ratio),
                )
                for i in known
            )
        )
    return out


def _words(name: str, evidence: Evidence, k: int, frequency_hz: FloatArray, damping_ratio: FloatArray) -> str:
    if name == "phase":
        r = evidence.phase[k]
        like = "a mode's" if r > 0.8 else "a quadratic distortion's" if r < -0.5 else "neither a mode's nor clear"
        return f"the phase of its residues is {like} (r = {r:.2f})"
    if name == "rise":
        return f"without it the local misfit is {evidence.rise[k]:.3g} times as large"
    if name == "share":
        return f"it is {100 * evidence.share[k]:.0f} % of the FRFs at its frequency"
    if name == "damping":
        times = damping_ratio[k] / evidence.trend[k]
        return f"its damping of {100 * damping_ratio[k]:.2g} % is {times:.2g} times the set's trend"
    if name == "twin":
        if evidence.neighbour[k] < 0:
            return "no larger pole is beside it"
        return (
            f"the larger pole at {frequency_hz[evidence.neighbour[k]]:.2f} Hz is {evidence.apart[k]:.1f} bandwidths away,"
            f" likeness of shapes {evidence.likeness[k]:.2f}"
        )
    if name == "repeat":
        return f"its residue scatters by {100 * evidence.repeat[k]:.0f} % between hits"
    return f"its residue grows with the height of the hit to the power of {evidence.growth[k]:.1f}"
