"""What may have moved the frequencies of a structure that has no model? Patterns of a change,
ranked by evidence.

The m modes deviate from their baselines since the change by d_i, relative, with variances V_i. A
pattern says which of them moved together: d ~ N(0, V + σ² G Gᵀ), σ the usual size of a change, the
columns of G what moves independently. All patterns are equally probable beforehand, and so are the
modes of which one moved alone.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.trend.assessment import ParameterTrend
from fecore.trend.explanations import RIVAL, ChangeExplanation

CHANGE = 0.02
"""Standard deviation of a relative change of a frequency; of a stiffness it is twice that."""

FEWEST_MODES = 2  # of which a change has a pattern


def deviations(
    trends: Sequence[ParameterTrend], since: Sequence[str]
) -> tuple[list[str], FloatArray, FloatArray, dict[str, FloatArray]]:
    """Names of the modes that some runs have, (m,) mean relative deviations from their baselines
    then, their (m,) variances, and (m,) relative slopes by each covariate.

    Args:
        trends: of frequencies, judged.
        since: labels of the runs since the change.
    """
    names, mean, variance = [], [], []
    slopes: dict[str, list[float]] = {}
    for trend in trends:
        if trend.watched is None or trend.scores is None or trend.baseline is None:
            continue
        at = [i for i, label in enumerate(trend.watched.labels) if label in set(since)]
        if not at or not trend.baseline.mean:
            continue
        level = trend.baseline.mean
        names.append(trend.name)
        mean.append(float(np.mean(trend.scores.residual[at])) / level)
        variance.append(
            float(np.mean(trend.scores.covariance(trend.baseline)[np.ix_(at, at)])) / level**2
        )
        for k, covariate in enumerate(trend.baseline.covariates):
            slope = float(trend.baseline.fit.coefficients[k + 1]) / level
            slopes.setdefault(covariate, []).append(slope)
    return names, np.array(mean), np.array(variance), {k: np.array(v) for k, v in slopes.items()}


def patterns(
    names: Sequence[str],
    deviation: FloatArray,
    variance: FloatArray,
    slopes: Mapping[str, FloatArray],
) -> tuple[ChangeExplanation, ...]:
    """Patterns of a change, the likeliest first.

    Args:
        names: of the m modes.
        deviation: (m,) relative change of each.
        variance: (m,) of these.
        slopes: (m,) relative change of each by a covariate that was taken out, by its name.
    """
    m = len(names)
    alike = np.ones((m, 1))
    kinds: dict[str, dict[str, FloatArray]] = {
        "none": {"": np.zeros((m, 1))},
        "alike": {"all modes": alike},
        "one": {name: np.eye(m)[:, [i]] for i, name in enumerate(names)},
        "several": {"": np.eye(m)},
        "covariate": {
            name: (slope / np.sqrt(np.mean(slope**2)))[:, None]
            for name, slope in slopes.items()
            if np.any(slope)
        },
    }
    evidence = {
        kind: {name: _evidence(deviation, variance, G) for name, G in candidates.items()}
        for kind, candidates in kinds.items()
        if candidates
    }
    log = {
        kind: scipy.special.logsumexp(list(each.values())) - np.log(len(each))
        for kind, each in evidence.items()
    }
    total = scipy.special.logsumexp(list(log.values()))
    ranked = []
    for kind in sorted(log, key=lambda kind: -log[kind]):
        best = max(evidence[kind], key=lambda name: evidence[kind][name])
        G = kinds[kind][best]
        spread = 1 / (np.sum(G**2 / variance[:, None], axis=0) + CHANGE**-2)
        size = spread * (G.T @ (deviation / variance))
        sizes = {
            name: (float(size[k]), float(np.sqrt(spread[k])))
            for k, name in enumerate(names if kind == "several" else [best])
            if kind != "none"
        }
        ranked.append(
            ChangeExplanation(
                kind=kind,
                probability=float(np.exp(log[kind] - total)),
                evidence=float(log[kind] - log["none"]),
                sizes=sizes,
            )
        )
    return tuple(ranked)


def _evidence(deviation: FloatArray, variance: FloatArray, G: FloatArray) -> float:
    """Logarithm of the density of the deviations, but for a constant."""
    V = np.diag(variance) + CHANGE**2 * G @ G.T
    return float(-(np.linalg.slogdet(V)[1] + deviation @ np.linalg.solve(V, deviation)) / 2)


_MEANS = {
    "none": ("no change of the frequencies", "measure again"),
    "alike": (
        "all frequencies alike",
        "a temperature or mass that is no covariate, or the sampling rate; record it",
    ),
    "one": (
        "one mode alone",
        "look at its shape: another mode may be taken for it, or a part in which it moves most has"
        " changed",
    ),
    "several": (
        "several modes, each by its own amount",
        "inspect the structure, its supports and what it carries",
    ),
    "covariate": (
        "as a covariate moves them that was taken out",
        "its sensor, or values beyond those of the baseline",
    ),
}


def patterns_in_words(ranked: Sequence[ChangeExplanation]) -> str:
    """The patterns that are not ruled out, how probable each is, and what to look at."""
    kept = [each for each in ranked if each.evidence > ranked[0].evidence - RIVAL]
    statements = []
    for each in kept:
        sizes = ", ".join(
            f"{name} {100 * size:+.2f} ± {100 * sd:.2f} %"
            for name, (size, sd) in each.sizes.items()
        )
        statement = f"{_MEANS[each.kind][0]}{': ' if sizes else ''}{sizes}"
        statements.append(f"{statement} ({100 * each.probability:.0f} %)")
    advice = "; ".join(f"{_MEANS[each.kind][0]}: {_MEANS[each.kind][1]}" for each in kept)
    return f"what moved: {'; '.join(statements)}. What to look at: {advice}"
