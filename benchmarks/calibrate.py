"""Fit and judge the probability of a pole: `python -m benchmarks calibrate`.

Made sets (`made_frfs`, good and harsh laboratories alike) are identified, each pole's features are
kept with whether it is a mode (`truth`), and the weights of `fecore.modal.judge` are fitted by
Bayesian logistic regression,

    ln p(b) = Σ_k ln P(y_k | b) - ½ (b - m)ᵀ S⁻¹ (b - m),

m and S those of the prior there; the covariance is the inverse of the Hessian at the best b
(Laplace). Each fifth of the draws is judged with weights fitted to the others: log loss, Brier
score, and each feature's worth by leaving it out. Reliability, and what becomes of modes and of
others, are printed for the weights in use. Poles that cannot be modes whatever their features
(tones, overdamped ones) are in neither fit nor scores.

`python -m benchmarks calibrate agreement` compares bands and halves of one record (`agreement`).

`CALIBRATE_SEEDS` (default 10) draws of each kind; the printed table replaces the one in
`fecore/modal/judge.py`.
"""

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy

from benchmarks import agreement
from benchmarks.calibration import print_reliability, scores
from benchmarks.made_frfs import GOOD, KINDS, Draw, Harsh
from benchmarks.tables import Table
from benchmarks.truth import OPTIONAL, OTHER, SPLIT, modes_of_poles
from fecore.errors import IdentificationError
from fecore.modal import identify
from fecore.modal.judge import (
    COVARIANCE,
    MEAN,
    PRIOR_MEAN,
    PRIOR_SD,
    design,
    evidence_of,
    judged,
    no_mode,
)
from fecore.modal.judge import NAMES as FEATURES
from fecore.modal.result import FittedSeries
from fecore.normal import Z_95

SEEDS = int(os.environ.get("CALIBRATE_SEEDS", "10"))
FIRST = int(os.environ.get("CALIBRATE_FIRST_SEED", "5000"))
SURE, REFUSED = 0.9, 0.1
_FOLDS = 5
# relative distance within which a pole is a distortion, or half a bandwidth where that is more
_NEAR = 0.004
NAMES = ("constant", *FEATURES[1:])


@dataclass
class Poles:
    """Features of poles with the truth: Λ (n,), design (n, 8), the mode of each or why it is none,
    kind and seed of its draw.

    Of each kind: modes that no pole is; whether truths lie in their 95 % intervals, of f and of ζ,
    given the modes before; CPU seconds.
    """

    ratio: list[float] = field(default_factory=list)
    rows: list[np.ndarray] = field(default_factory=list)
    of: list[int] = field(default_factory=list)
    draw: list[int] = field(default_factory=list)
    kind: list[str] = field(default_factory=list)
    distortion: list[bool] = field(default_factory=list)
    lost: dict[str, int] = field(default_factory=dict)
    inside: dict[str, list[tuple[bool, bool]]] = field(default_factory=dict)
    seconds: dict[str, list[float]] = field(default_factory=dict)


def collect(draw: Draw, kind: str, number: int, poles: Poles) -> None:
    """Identify a draw and keep its poles in band."""
    began = time.process_time()
    try:
        fitted = identify(draw.frfs).fitted
    except IdentificationError as why:
        print(f"    {kind} {number}: {why}")
        poles.lost[kind] = poles.lost.get(kind, 0) + int(np.sum(~draw.optional))
        return
    poles.seconds.setdefault(kind, []).append(time.process_time() - began)
    keep(draw, kind, number, fitted, poles)


def keep(draw: Draw, kind: str, number: int, fitted: FittedSeries, poles: Poles) -> None:
    """Add the poles of a fit with the truth about them."""
    hz, zeta = fitted.fit.terms.frequency_hz, fitted.fit.terms.damping_ratio
    fit, arrangement = fitted.fit, fitted.arrangement
    evidence = evidence_of(arrangement, fit, fit.growth(arrangement))
    ratio, rows = design(evidence)
    of = modes_of_poles(draw, fitted.arrangement, fitted.fit)
    use = fitted.arrangement.in_band(hz) & (of != OPTIONAL) & ~no_mode(evidence, zeta)
    use &= hz >= 1.3 * np.max(draw.frequency_hz[draw.optional], initial=0.0)
    poles.lost[kind] = (
        poles.lost.get(kind, 0) + int(np.sum(~draw.optional)) - int(np.sum(of[use] >= 0))
    )
    for k in np.flatnonzero(use):
        poles.ratio.append(float(ratio[k]))
        poles.rows.append(rows[k])
        poles.of.append(int(of[k]))
        poles.draw.append(number)
        poles.kind.append(kind)
        off = np.min(np.abs(draw.distortions - hz[k]), initial=np.inf)
        poles.distortion.append(bool(of[k] < 0 and off < max(_NEAR * hz[k], 0.5 * zeta[k] * hz[k])))
    modes = np.flatnonzero(use & (of >= 0))
    errors = np.log(hz[modes] / draw.frequency_hz[of[modes]]), zeta[modes] - draw.zeta[of[modes]]
    each = [
        whitened(off, fitted.covariance, modes + part * hz.size) for part, off in enumerate(errors)
    ]
    poles.inside.setdefault(kind, []).extend(zip(*(np.abs(z) < Z_95 for z in each), strict=True))


def whitened(off: np.ndarray, covariance: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Errors over their standard deviations, each given those before it: modes of one draw share
    its drift, and count once.
    """
    return np.asarray(
        scipy.linalg.solve_triangular(
            np.linalg.cholesky(covariance[np.ix_(which, which)]), off, lower=True
        )
    )


def fitted_weights(
    ratio: np.ndarray, x: np.ndarray, true: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The most probable weights and their covariance."""

    def cost(b: np.ndarray) -> tuple[float, np.ndarray]:
        a, off = ratio + x @ b, (b - PRIOR_MEAN) / PRIOR_SD
        loss = float(np.sum(np.logaddexp(0, a) - true * a) + np.sum(off**2) / 2)
        return loss, x.T @ (scipy.special.expit(a) - true) + off / PRIOR_SD

    b = scipy.optimize.minimize(cost, PRIOR_MEAN, jac=True, method="BFGS").x
    p = scipy.special.expit(ratio + x @ b)
    return b, np.linalg.inv((x.T * (p * (1 - p))) @ x + np.diag(1 / PRIOR_SD**2))


def held_out(ratio: np.ndarray, x: np.ndarray, true: np.ndarray, draw: np.ndarray) -> np.ndarray:
    """P of each pole with weights fitted to the draws of the other folds."""
    p = np.empty(true.size)
    for fold in range(_FOLDS):
        own = draw % _FOLDS == fold
        p[own] = judged(ratio[own], x[own], *fitted_weights(ratio[~own], x[~own], true[~own]))
    return p


def drawn(kinds: Sequence[str], seeds: Sequence[int]) -> Poles:
    """The poles of draws, every other one of a harsh laboratory."""
    poles = Poles()
    for kind in kinds:
        for seed in seeds:
            collect(KINDS[kind](seed, Harsh.drawn(seed) if seed % 2 else GOOD), kind, seed, poles)
    return poles


def print_kinds(poles: Poles, p: np.ndarray) -> None:
    """What became of the modes and of all else, by kind."""
    of, kind, distortion = (np.array(each) for each in (poles.of, poles.kind, poles.distortion))
    sure, open_ = p >= SURE, (p >= REFUSED) & (p < SURE)
    print(
        f"modes are kept from P = {SURE:g} on and refused below {REFUSED:g}; `expected`: of both"
        " kinds of others kept"
    )
    of_modes = ("modes:d", "kept:d", "uncertain:d", "refused:d", "no pole:d")
    others = ("second, kept:d", "uncertain:d", "others, kept:d", "uncertain:d", "expected:.1f")
    table = Table(
        "", "kind:10", *of_modes, *others, "held, f %:.1f", "ζ %:.1f", "CPU s:.2f", "most:.2f"
    )
    for name, seconds in poles.seconds.items():
        own = kind == name
        modes, splits, others = own & (of >= 0), own & (of == SPLIT), own & (of == OTHER)
        counts = [modes, modes & sure, modes & open_, modes & (p < REFUSED)]
        wrong = [splits & sure, splits & open_, others & sure, others & open_]
        inside = 100 * np.mean(poles.inside[name] or [(np.nan, np.nan)], axis=0)
        sums, expected = (
            [[each.sum() for each in some] for some in (counts, wrong)],
            np.sum(1 - p[own & sure]),
        )
        table.row(
            name,
            *sums[0],
            poles.lost[name],
            *sums[1],
            expected,
            *inside,
            np.mean(seconds),
            np.max(seconds),
        )
    for name in ("squared", "cubed", "loose"):
        own = (kind == name) & distortion
        print(
            f"distortions of {name}: {own.sum()}, kept {np.sum(own & sure)}, uncertain"
            f" {np.sum(own & open_)}"
        )


def calibrate(part: str = "weights", *words: str) -> None:
    """The probability of a pole on made FRFs: its weights, reliability, modes lost; `agreement`:
    has one record one answer?
    """
    if part == "agreement":
        agreement.main(*words)
        return
    kinds = os.environ.get("CALIBRATE_KINDS", ",".join(KINDS)).split(",")
    poles = drawn(kinds, range(FIRST, FIRST + SEEDS))
    ratio, x, draw = np.array(poles.ratio), np.array(poles.rows), np.array(poles.draw)
    true = np.array(poles.of) >= 0
    b, C = fitted_weights(ratio, x, true)
    print(f"{true.size} poles, {np.sum(~true)} of them no modes")
    table = Table("", "weight:9", "prior:.2f", "±:.2f", "fitted:.2f", "±:.2f")
    for row in zip(NAMES, PRIOR_MEAN, PRIOR_SD, b, np.sqrt(np.diag(C)), strict=True):
        table.row(*row)
    used = judged(ratio, x, MEAN, COVARIANCE)  # what a user gets
    prior = judged(ratio, x, PRIOR_MEAN, np.diag(PRIOR_SD**2) * 0.04)
    found = {"in use": used, "prior": prior, "held out": held_out(ratio, x, true, draw)}
    for number, name in enumerate(("phase", *NAMES[1:])):
        less = np.where(np.arange(x.shape[1]) == number, 0.0, x) if number else x
        found[f"without {name}"] = held_out(ratio * bool(number), less, true, draw)
    table = Table("", "weights:18", "log loss:.4f", "Brier:.4f")
    for name, p in found.items():
        table.row(name, *scores(p, true))
    print_reliability(used, true, "poles", "of modes", (0, 0.01, 0.1, 0.5, 0.9, 0.99))
    print_kinds(poles, used)
    print("MEAN = np.array([" + ", ".join(f"{each:.3f}" for each in b) + "])")
    print("COVARIANCE = np.array([")
    print(
        "\n".join("    [" + ", ".join(f"{each:.4f}" for each in row) + "]," for row in C) + "\n])"
    )
