"""One probability for each pole: that it is a mode of the structure.

    logit P = b₀ + Λ(r) + b₁ lg ρ + b₂ lg s - b₃ ln(1 + (z/0.3)²) - b₄ ln(1 + (0.15/d)²) + b₅ lg q +
    b₆ lg n,

lg = log₁₀, with the features of `evidence` and Λ = ln p₁(r)/p₀(r), the densities of the phase for
modes and for others,

    p₁ = 0.8 e^{-(1-r)/σ}/√(πσ(1-r)) + 0.2 (1+r)/(2π√(1-r²)),    p₀ = 0.2/(π√(1-r²)) + 0.8/2,    σ = 0.1.

A mode's phase θ is off by up to 90° where another pole overlaps it or a spring is not linear, but
not in proportion: (1+r)/2 =
cos²θ. What is no mode has any phase: one for all FRFs, or each its own, whose median r spreads
evenly. The weights b are a Bayesian fit (`python -m benchmarks calibrate`), with a covariance. A
feature that a set cannot give drops out. The weights' own variance v of the logit a widens P
towards ½ (MacKay 1992): P = σ(a/√(1 + πv/8)).
"""

from dataclasses import dataclass

import numpy as np

from fecore.arrays import BoolArray, FloatArray
from fecore.modal.evidence import USUAL, Evidence
from fecore.modal.weights import COVARIANCE, MEAN

_SIGMA = 0.1  # of 1 - r of modes
_RARE = (
    # share of the modes whose phase is anything up to 90°, and of what is no mode that has one
    # phase for all FRFs
    0.2
)
_OVERDAMPED = 0.6  # ζ from which a pole is a trend of the record
_DOUBLE = 0.15  # distance below which two poles are rather one mode


@dataclass(frozen=True)
class Feature:
    """One reason for or against a pole."""

    name: str  # `phase`, `rise`, `share`, `damping`, `apart`, `shape` or `reach`
    value: float  # the feature
    weight: float  # what it adds to the logit of P
    words: str  # what it says, in words of the field


def phase_ratio(r: FloatArray) -> FloatArray:
    """Λ(r) = ln p₁(r)/p₀(r), both densities times π√(1-r²)."""
    r = np.clip(r, 1e-6 - 1, 1)  # Λ stays finite
    usual = np.sqrt(np.pi * (1 + r) / _SIGMA) * np.exp(-(1 - r) / _SIGMA)
    of_modes = (1 - _RARE) * usual + _RARE * (1 + r) / 2
    of_others = _RARE + (1 - _RARE) * np.pi * np.sqrt(1 - r**2) / 2
    return np.asarray(np.log(of_modes / of_others))


def design(evidence: Evidence) -> tuple[FloatArray, FloatArray]:
    """(n,) Λ, and (n, 7) what the weights multiply."""
    x = np.stack(
        [
            np.ones(evidence.phase.size),
            np.log10(evidence.rise),
            np.log10(evidence.share),
            -np.log1p((evidence.damping / USUAL) ** 2),
            -np.log1p((_DOUBLE / evidence.apart) ** 2),
            np.log10(evidence.shape),
            np.log10(evidence.reach),
        ],
        axis=1,
    )
    return phase_ratio(evidence.phase), np.where(np.isnan(x), 0.0, x)


def probability(evidence: Evidence, damping_ratio: FloatArray) -> FloatArray:
    """(n,) P of each pole; 0 of one that cannot be a mode."""
    ratio, x = design(evidence)
    return np.where(no_mode(evidence, damping_ratio), 0.0, judged(ratio, x, MEAN, COVARIANCE))


def no_mode(evidence: Evidence, damping_ratio: FloatArray) -> BoolArray:
    """(n,) poles that do not swing, or are tones."""
    return np.asarray((damping_ratio > _OVERDAMPED) | evidence.tone)


def judged(
    ratio: FloatArray, x: FloatArray, mean: FloatArray, covariance: FloatArray
) -> FloatArray:
    """P of poles with a design, under weights with a covariance."""
    return predictive(ratio + x @ mean, np.einsum("ni,ij,nj->n", x, covariance, x))


def predictive(logit: FloatArray, variance: FloatArray) -> FloatArray:
    """P for a logit that is known with a variance."""
    return np.asarray(1 / (1 + np.exp(-logit / np.sqrt(1 + np.pi * variance / 8))))


NAMES = ("phase", "rise", "share", "damping", "apart", "shape", "reach")


def features(
    evidence: Evidence, frequency_hz: FloatArray, damping_ratio: FloatArray
) -> list[tuple[Feature, ...]]:
    """The features of each pole, those that weigh most first."""
    ratio, x = design(evidence)
    added = np.concatenate([ratio[:, None], x[:, 1:] * MEAN[1:]], axis=1)
    out = []
    for k in range(len(x)):
        each = [
            Feature(
                name,
                float(value),
                float(weight),
                _words(name, evidence, k, frequency_hz, damping_ratio),
            )
            for name, weight in zip(NAMES, added[k], strict=True)
            if np.isfinite(value := getattr(evidence, name)[k])
        ]
        out.append(tuple(sorted(each, key=lambda feature: -abs(feature.weight))))
    return out


def _words(
    name: str, evidence: Evidence, k: int, frequency_hz: FloatArray, damping_ratio: FloatArray
) -> str:
    if name == "phase":
        r = evidence.phase[k]
        like = (
            "a mode's"
            if r > 0.8
            else "a quadratic distortion's"
            if r < -0.5
            else "neither a mode's nor clear"
        )
        return f"the phase of its residues is {like} (r = {r:.2f})"
    if name == "rise":
        return f"without it the local misfit is {evidence.rise[k]:.3g} times as large"
    if name == "share":
        return f"it is {100 * evidence.share[k]:.0f} % of the FRFs at its frequency"
    if name == "damping":
        times = damping_ratio[k] / evidence.trend[k]
        return f"its damping of {100 * damping_ratio[k]:.2g} % is {times:.2g} times the set's trend"
    if name == "apart":
        other = evidence.neighbour[k]
        width = frequency_hz[k] * damping_ratio[k] + frequency_hz[other] * damping_ratio[other]
        if evidence.apart[k] > 0.99:
            return "no larger pole is beside it"
        return (
            f"the larger pole at {frequency_hz[other]:.2f} Hz is"
            f" {abs(frequency_hz[k] - frequency_hz[other]) / width:.2g} bandwidths away; the"
            " nearer, the likelier both are one mode that moves from test to test"
        )
    if name == "shape":
        other = evidence.twin[k]
        return (
            f"shape and curve part it from the larger pole at {frequency_hz[other]:.2f} Hz by"
            f" {evidence.shape[k]:.2f} of 1; one mode seen twice has one shape"
        )
    return f"the FRF that shows it best has {100 - 100 * evidence.reach[k]:.0f} % of it"
