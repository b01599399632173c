"""Fit and judge the probability of a pole: `python -m benchmarks calibrate`.

Made sets (`made_frfs`, good and harsh laboratories alike) are identified, each pole's features are kept with whether
it is a mode, and the weights of `fecore.modal.weights` are fitted to half of the draws by Bayesian logistic
regression,

    ln p(b) = Σ_k ln P(y_k | b) - ½ (b - m)ᵀ S⁻¹ (b - m),

m and S those of the prior there; the covariance is the inverse of the Hessian at the best b (Laplace). The other half shows how
good they are: log loss, Brier score, and each feature's worth by leaving it out. Reliability, and what becomes of modes and of
others, are printed for the weights in use.

`python -m benchmarks calibrate agreement` compares bands and halves of one record (`agreement`).

`CALIBRATE_SEEDS` (default 10) draws of each kind; the printed table replaces the one in `fecore/modal/weights.py`.
"""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy

from benchmarks import agreement
from benchmarks.made_frfs import GOOD, KINDS, Draw, Harsh
from fecore.errors import IdentificationError
from fecore.modal.drift import in_band
from fecore.modal.evidence import evidence_of
from fecore.modal.fitting import fit_series
from fecore.modal.preparation import prepare
from fecore.modal.probability import design, predictive
from fecore.modal.weights import COVARIANCE, MEAN, PRIOR_MEAN, PRIOR_SD

SEEDS = int(os.environ.get("CALIBRATE_SEEDS", "10"))
FIRST = int(os.environ.get("CALIBRATE_FIRST_SEED", "5000"))
SURE, REFUSED = 0.9, 0.1
_NEAR = 0.004  # relative distance within which a pole is a mode's, or half a bandwidth where that is more
NAMES = ("constant", "rise", "share", "damping", "twin", "repeat", "growth")


@dataclass
class Poles:
    """Features of poles with the truth: Λ (n,), design (n, 7), its spread, whether each is a mode, and of which draw."""

    ratio: list[float] = field(default_factory=list)
    rows: list[np.ndarray] = field(default_factory=list)
    spread: list[np.ndarray] = field(default_factory=list)
    true: list[bool] = field(default_factory=list)
    draw: list[int] = field(default_factory=list)
    kind: list[str] = field(default_factory=list)
    distortion: list[bool] = field(default_factory=list)
    lost: dict[str, int] = field(default_factory=dict)
    inside: dict[str, list[bool]] = field(default_factory=dict)
    seconds: dict[str, list[float]] = field(default_factory=dict)


def collect(draw: Draw, kind: str, number: int, poles: Poles) -> None:
    """Identify a draw and keep its poles in band."""
    began = time.process_time()
    prepared = prepare(draw.frfs, None)
    try:
        fitted = fit_series(prepared.arrangement, prepared.noise, 40, 100, lambda _stage, _share: None)
    except IdentificationError as why:
        print(f"    {kind} {number}: {why}")
        poles.lost[kind] = poles.lost.get(kind, 0) + int(np.sum(~draw.optional))
        return
    ratio, rows, spread = design(fitted.arrangement, evidence_of(fitted.arrangement, fitted.fit))
    poles.seconds.setdefault(kind, []).append(time.process_time() - began)
    hz, zeta = fitted.fit.terms.frequency_hz, fitted.fit.terms.damping_ratio
    matched, optional = _matched(draw, hz, zeta, rows[:, 2])
    poles.lost[kind] = poles.lost.get(kind, 0) + int(np.sum(~draw.optional)) - len(matched)
    sd = np.sqrt(np.diag(fitted.covariance))
    for k in np.flatnonzero(in_band(fitted.arrangement, hz)):
        if k in optional or hz[k] < 1.3 * np.max(draw.frequency_hz[draw.optional], initial=0.0):
            continue
        poles.ratio.append(float(ratio[k]))
        poles.rows.append(rows[k])
        poles.spread.append(spread[k])
        poles.true.append(k in matched)
        poles.draw.append(number)
        poles.kind.append(kind)
        off = np.min(np.abs(draw.distortions - hz[k]), initial=np.inf)
        poles.distortion.append(bool(k not in matched and off < max(_NEAR * hz[k], 0.5 * zeta[k] * hz[k])))
        if k in matched:
            f, z = draw.frequency_hz[matched[k]], draw.zeta[matched[k]]
            inside = poles.inside.setdefault(kind, [])
            inside += [abs(np.log(hz[k] / f)) < 1.96 * sd[k], abs(zeta[k] - z) < 1.96 * sd[hz.size + k]]


def _matched(draw: Draw, hz: np.ndarray, zeta: np.ndarray, share: np.ndarray) -> tuple[dict[int, int], set[int]]:
    """Number of the mode that each pole is, the highest near each; and the poles of modes that may be lost."""
    matched: dict[int, int] = {}
    optional: set[int] = set()
    for mode in np.argsort(draw.zeta):
        f = draw.frequency_hz[mode]
        near = np.abs(hz - f) < np.maximum(_NEAR * f, 0.5 * draw.zeta[mode] * f)
        near &= np.abs(np.log(zeta / draw.zeta[mode])) < np.log(3)
        near[list(matched)] = False
        if not near.any():
            continue
        k = int(np.argmax(np.where(near, share - 10 * np.abs(hz / f - 1), -np.inf)))
        if draw.optional[mode]:
            optional.add(k)
        else:
            matched[k] = int(mode)
    return matched, optional


def fitted_weights(ratio: np.ndarray, x: np.ndarray, true: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The most probable weights and their covariance."""
    precision, b = np.diag(1 / PRIOR_SD**2), PRIOR_MEAN.copy()
    for _ in range(100):
        p = scipy.special.expit(ratio + x @ b)
        gradient = x.T @ (true - p) - precision @ (b - PRIOR_MEAN)
        hessian = (x.T * (p * (1 - p))) @ x + precision
        step = np.linalg.solve(hessian, gradient)
        b = b + step
        if np.max(np.abs(step)) < 1e-9:
            break
    return b, np.linalg.inv(hessian)


def judged(poles: Poles, which: np.ndarray, b: np.ndarray, C: np.ndarray) -> np.ndarray:
    """P of some poles under weights."""
    x, spread = np.array(poles.rows)[which], np.array(poles.spread)[which]
    variance = np.einsum("ni,ij,nj->n", x, C, x) + spread**2 @ b**2
    return predictive(np.array(poles.ratio)[which] + x @ b, variance)


def scores(p: np.ndarray, true: np.ndarray) -> tuple[float, float]:
    """Log loss and Brier score."""
    p = np.clip(p, 1e-9, 1 - 1e-9)
    return float(-np.mean(np.where(true, np.log(p), np.log(1 - p)))), float(np.mean((p - true) ** 2))


def drawn(kinds: Sequence[str], seeds: Sequence[int]) -> Poles:
    """The poles of draws, every other one of a harsh laboratory."""
    poles = Poles()
    for kind in kinds:
        for seed in seeds:
            collect(KINDS[kind](seed, Harsh.drawn(seed) if seed % 2 else GOOD), kind, seed, poles)
    return poles


def print_kinds(poles: Poles, p: np.ndarray) -> None:
    """What became of the modes and of all else, by kind."""
    true, kind, distortion = (np.array(each) for each in (poles.true, poles.kind, poles.distortion))
    sure, open_ = p >= SURE, (p >= REFUSED) & (p < SURE)
    print(
        "of modes: all, kept, uncertain, refused; of others: kept, uncertain; modes not in the fit; false kept, expected;"
    )
    print("% of truths in 95 % intervals; CPU seconds, mean and most")
    for name in dict.fromkeys(poles.kind):
        own = kind == name
        modes, false = own & true, own & ~true
        counts = [modes, modes & sure, modes & open_, modes & (p < REFUSED), false & sure, false & open_]
        inside, seconds = poles.inside.get(name, [np.nan]), poles.seconds[name]
        print(
            f"{name:10}"
            + "".join(f"{each.sum():6}" for each in counts)
            + f"{poles.lost[name]:6} {np.sum(1 - p[own & sure]):9.1f} {100 * np.mean(inside):8.1f}"
            + f" {np.mean(seconds):6.2f} {np.max(seconds):6.2f}"
        )
    for name in ("squared", "cubed"):
        own = (kind == name) & distortion
        print(f"distortions of {name}: {own.sum()}, kept {np.sum(own & sure)}, uncertain {np.sum(own & open_)}")


def print_reliability(p: np.ndarray, true: np.ndarray) -> None:
    """How often poles of like P are modes."""
    print("P from    to    poles   mean P   share of modes")
    for low, high in itertools.pairwise((0, 0.01, 0.1, 0.5, 0.9, 0.99, 1.0000001)):
        own = (p >= low) & (p < high)
        if own.any():
            share = true[own].mean()
            error = np.sqrt(max(share * (1 - share), 1 / own.sum()) / own.sum())
            print(f"{low:6.2f} {high:5.2f} {own.sum():8} {p[own].mean():8.4f} {share:10.4f} ± {error:.4f}")


def main(part: str = "weights", *words: str) -> None:
    """Print the weights and how good they are; or, for `agreement`, whether one record has one answer."""
    if part == "agreement":
        agreement.main(*words)
        return
    kinds = os.environ.get("CALIBRATE_KINDS", ",".join(KINDS)).split(",")
    poles = drawn(kinds, range(FIRST, FIRST + SEEDS))
    ratio, x, true = np.array(poles.ratio), np.array(poles.rows), np.array(poles.true)
    learn = np.array(poles.draw) % 4 < 2
    b, C = fitted_weights(ratio[learn], x[learn], true[learn])
    print(f"{true.size} poles, {np.sum(~true)} of them no modes; fitted to {learn.sum()}, judged on {np.sum(~learn)}")
    for name, prior, sd, mean, own in zip(NAMES, PRIOR_MEAN, PRIOR_SD, b, np.sqrt(np.diag(C)), strict=True):
        print(f"{name:9} prior {prior:6.2f} ± {sd:.2f}   fitted {mean:6.2f} ± {own:.2f}")
    test = ~learn
    for name, weights in (("prior", (PRIOR_MEAN, np.diag(PRIOR_SD**2) * 0.04)), ("fitted", (b, C))):
        print(f"{name:8} log loss %.4f, Brier %.4f" % scores(judged(poles, test, *weights), true[test]))
    for number, name in enumerate(("phase", *NAMES[1:5])):
        without_ratio, without = ratio.copy(), x.copy()
        if number:
            without[:, number] = 0.0
        else:
            without_ratio[:] = 0.0
        own, _ = fitted_weights(without_ratio[learn], without[learn], true[learn])
        p = scipy.special.expit(without_ratio[test] + without[test] @ own)
        print(f"without {name:8} log loss %.4f, Brier %.4f" % scores(p, true[test]))
    used = judged(poles, np.ones(true.size, dtype=bool), MEAN, COVARIANCE)  # what a user gets
    print_reliability(used, true)
    print_kinds(poles, used)
    b, C = fitted_weights(ratio, x, true)
    print("MEAN = np.array([" + ", ".join(f"{each:.3f}" for each in b) + "])")
    print("COVARIANCE = np.array([")
    print("\n".join("    [" + ", ".join(f"{each:.4f}" for each in row) + "]," for row in C) + "\n])")


if __name__ == "__main__":
    main()
