"""What else may have moved the frequencies? Explanations of an alarm, ranked by evidence.

The campaigns since the change deviate by d, in the mean, from the baseline's regression: the
logarithms of the natural frequencies, and of the FRFs' scale where there are FRFs, n numbers in
all. The baseline's residuals have the sums of products S on N degrees of freedom; h = 1/campaigns +
leverage. An explanation with sensitivities G says that with sizes a ~ N(0, σ²)

    d ~ N(Ga, hΣ + E),    Σ ~ inverse Wishart(S + (n + 2)D, N + 2n + 1),    E = diag(ρ² Σ_j (G_ij â_j)²)

D the residuals' variances alone, so that short baselines have a regular Σ (its correlations then
have a prior that is nearly uniform and somewhat favours none); ρ what a sensitivity misses, â the
likeliest sizes. Σ is integrated over as a scale mixture, hΣ/u with u ~ χ²_ν/ν, ν = N + n + 2 (a t
distribution), and a exactly. All explanations are equally probable beforehand, and so are the
candidates of one, such as the points where a mass may be.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.body.locate import place_in_words
from fecore.errors import InputError

SENSOR = 0.01
"""Standard deviation of a mass that was added or taken away, kg: accelerometers of hammer tests
weigh 0.5 to 30 g.
"""

LOSS = 0.05  # standard deviation of a relative change of a stiffness: what monitors are there for

# standard deviation of a relative change of the FRFs' scale: another sensor, gain or hammer tip
CALIBRATION = 0.1

MISSED = 0.05
"""ρ, relative standard deviation of a sensitivity: the updated model's, and what is beyond first
order in some per cent.
"""

# log evidence by which another explanation must be behind to be ruled out
RIVAL = float(np.log(20.0))
_QUANTILES = (np.arange(21) + 0.5) / 21  # of u
_NEIGHBOURS = 4  # of a site on a surface


@dataclass(frozen=True)
class _Candidate:
    """Causes that act together."""

    # by name, (f,) sensitivity and standard deviation of the size
    causes: Mapping[str, tuple[FloatArray, float]]
    # (q, f) independent errors of the sensitivities, by what size is
    unsure: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))


@dataclass(frozen=True)
class Effects:
    """What moves f natural frequencies."""

    # (f,) by name, change of the logarithms by the relative change of a stiffness
    stiffness: Mapping[str, FloatArray]
    # (f,) by name, change by one standard deviation of an input of the support
    support: Mapping[str, FloatArray]
    sites: FloatArray  # (P, 3) where a mass may be, m, as evenly spread as a mesh
    mass: FloatArray  # (f, P) change by a mass at each of them, 1/kg
    # (f,) by name, slopes by a covariate that is regressed out
    covariates: Mapping[str, FloatArray]
    # standard deviations of a relative change of all stiffness over a season by covariates that
    # were not given, by name
    not_given: Mapping[str, float]


@dataclass(frozen=True)
class ChangeExplanation:
    """One explanation of a change."""

    # `mass`, `calibration`, `support`, `climate`, `stiffness`, or `none`: neither frequencies nor
    # scale changed
    kind: str
    probability: float  # among all explanations
    evidence: float  # logarithm of how much likelier it makes what was measured than no change does
    # by name, estimate and standard deviation: a mass in kg by its point, relative changes, an
    # input of the support in standard deviations
    sizes: Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Change:
    """(n,) deviation d since a change, and the (u, n, n) covariances of which its distribution
    without one is made.
    """

    deviation: FloatArray
    covariances: FloatArray


def change_of(
    baseline: FloatArray, later: FloatArray, regressors: FloatArray, later_regressors: FloatArray
) -> tuple[Change, FloatArray]:
    """The change of some numbers since the baseline, and (p, n) coefficients of their regression.

    Args:
        baseline: (N + p, n) numbers of the baseline's campaigns.
        later: (m, n) of the campaigns since the change.
        regressors: (N + p, p) ones and covariates of the baseline's campaigns.
        later_regressors: (m, p) of the later ones.

    Raises:
        InputError: the baseline has no more campaigns than coefficients.
    """
    free, n = len(baseline) - regressors.shape[1], baseline.shape[1]
    if free < 1:
        raise InputError(
            "baseline",
            f"{len(baseline)} campaigns for {regressors.shape[1]} coefficients, expected more",
        )
    coefficients = np.linalg.lstsq(regressors, baseline, rcond=None)[0]
    residual, at = baseline - regressors @ coefficients, later_regressors.mean(axis=0)
    products, nu = residual.T @ residual, free + n + 2
    known = products + np.diag(np.diag(products)) * (n + 2) / free
    h = 1 / len(later) + float(at @ np.linalg.lstsq(regressors.T @ regressors, at, rcond=None)[0])
    u = scipy.special.chdtri(nu, 1 - _QUANTILES) / nu
    return (
        Change(
            (later - later_regressors @ coefficients).mean(axis=0),
            h * known / nu / u[:, None, None],
        ),
        coefficients,
    )


def explanations(change: Change, effects: Effects) -> tuple[ChangeExplanation, ...]:
    """All explanations, the likeliest first.

    Args:
        change: of the frequencies and, where there are FRFs, of their scale, the last number.
        effects: of the frequencies.
    """
    kinds = {
        "none": [_Candidate({})],
        "calibration": _calibration(change, effects),
        "mass": _masses(effects),
        "support": _single_and_joint(effects.support, 1.0),
        "climate": _climate(effects),
        "stiffness": _single_and_joint(effects.stiffness, LOSS),
    }
    evidence = {
        kind: np.array([_evidence(change, each) for each in candidates])
        for kind, candidates in kinds.items()
    }
    log = {
        kind: scipy.special.logsumexp(each) - np.log(each.size)
        for kind, each in evidence.items()
        if each.size
    }
    total = scipy.special.logsumexp(list(log.values()))
    return tuple(
        ChangeExplanation(
            kind=kind,
            probability=float(np.exp(log[kind] - total)),
            evidence=float(log[kind] - log["none"]),
            sizes=_sizes(change, kinds[kind][int(np.argmax(evidence[kind]))]),
        )
        for kind in sorted(log, key=lambda kind: -log[kind])
    )


def _calibration(change: Change, effects: Effects) -> list[_Candidate]:
    """A factor of all FRFs, which leaves the frequencies alone; nothing where the scale is not
    known.
    """
    frequencies = len(effects.mass)
    if change.deviation.size == frequencies:
        return []
    return [_Candidate({"FRFs": (np.append(np.zeros(frequencies), 1.0), CALIBRATION)})]


def _masses(effects: Effects) -> list[_Candidate]:
    """A mass near each site: uniformly within its cell, whose second moments the differences from
    its neighbours give.

    On a square grid of step s they are s²/12 along each axis, a 24th of the sum of the squared
    differences.
    """
    apart = np.sum((effects.sites[:, None] - effects.sites) ** 2, axis=2)
    nearest = np.argsort(apart, axis=1)[:, 1 : 1 + _NEIGHBOURS]
    return [
        _Candidate(
            {place_in_words(site): (g, SENSOR)},
            (effects.mass[:, beside] - g[:, None]).T / np.sqrt(24),
        )
        for site, g, beside in zip(effects.sites, effects.mass.T, nearest, strict=True)
    ]


def _climate(effects: Effects) -> list[_Candidate]:
    """All stiffness alike, or as a covariate does that was given, where another was not."""
    alike = sum(effects.stiffness.values(), np.zeros(1))
    if not effects.not_given or not np.any(alike):
        return []
    size = np.linalg.norm(alike)
    slopes = [
        slope * size / np.linalg.norm(slope)
        for slope in effects.covariates.values()
        if np.any(slope)
    ]
    sd = float(np.linalg.norm(list(effects.not_given.values())))
    return [_Candidate({"all stiffness": (each, sd)}) for each in (alike, *slopes)]


def _single_and_joint(effects: Mapping[str, FloatArray], sd: float) -> list[_Candidate]:
    """Each cause alone, and all at once."""
    causes = {name: (effect, sd) for name, effect in effects.items()}
    single = [_Candidate({name: cause}) for name, cause in causes.items()]
    return [*single, _Candidate(causes)] if len(single) > 1 else single


def _sensitivity(change: Change, candidate: _Candidate) -> tuple[FloatArray, FloatArray]:
    """(n, k) G of a candidate, which moves no scale unless it says so, and (k,) σ."""
    G = np.zeros((change.deviation.size, len(candidate.causes)))
    for column, (effect, _) in enumerate(candidate.causes.values()):
        G[: len(effect), column] = effect
    return G, np.array([sd for _, sd in candidate.causes.values()])


def _posterior(
    change: Change, covariance: FloatArray, G: FloatArray, sd: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(k,) likeliest sizes and their (k, k) covariance."""
    weighted = np.linalg.solve(covariance, G)
    spread = np.linalg.inv(G.T @ weighted + np.diag(sd**-2.0))
    return spread @ (weighted.T @ change.deviation), spread


def _model_error(change: Change, candidate: _Candidate) -> FloatArray:
    """(n, n) E at the likeliest sizes; they depend on it, so it is made in two turns."""
    G, sd = _sensitivity(change, candidate)
    E, typical = np.zeros((len(G), len(G))), np.median(change.covariances, axis=0)
    for _ in range(2):
        size = _posterior(change, typical + E, G, sd)[0]
        E = np.diag(MISSED**2 * np.sum((G * size) ** 2, axis=1))
        f = candidate.unsure.shape[1]
        E[:f, :f] += float(size @ size) * candidate.unsure.T @ candidate.unsure
    return E


def _evidence(change: Change, candidate: _Candidate) -> float:
    """Logarithm of the density of the change."""
    G, sd = _sensitivity(change, candidate)
    V = change.covariances + _model_error(change, candidate) + (G * sd**2) @ G.T
    distance = np.linalg.solve(V, change.deviation[:, None])[..., 0] @ change.deviation
    return float(scipy.special.logsumexp(-(np.linalg.slogdet(V)[1] + distance) / 2))


def _sizes(change: Change, candidate: _Candidate) -> dict[str, tuple[float, float]]:
    G, sd = _sensitivity(change, candidate)
    size, spread = _posterior(
        change, np.median(change.covariances, axis=0) + _model_error(change, candidate), G, sd
    )
    return {
        name: (float(size[k]), float(np.sqrt(spread[k, k])))
        for k, name in enumerate(candidate.causes)
    }


DECIDED_BY = {
    "mass": (
        "look near there for a sensor, cable or wax that the campaigns do not state, take it off or"
        " state it"
    ),
    "support": "release the support, fasten it anew and measure again",
    "climate": "record it, and measure again in a climate that the baseline has seen",
    "calibration": "calibrate hammer and sensor with a mass of known weight",
    "stiffness": "once the others are excluded, inspect the structure",
    "none": "measure again: the frequencies are as they were",
}
"""What sets an explanation apart from the others."""


def in_words(ranked: Sequence[ChangeExplanation], not_given: Sequence[str] = ()) -> str:
    """The explanations that are not ruled out, how probable each is, and what would decide between
    them.

    Args:
        ranked: as of `explanations`.
        not_given: covariates that were not.
    """
    kept = [each for each in ranked if each.evidence > ranked[0].evidence - RIVAL]
    out = [_KINDS[each.kind] for each in ranked if each not in kept]
    statements = "; ".join(
        f"{_statement(each, not_given)} ({100 * each.probability:.0f} %)" for each in kept
    )
    ruled = f"; ruled out: {', '.join(out)}" if out else ""
    decide = "; ".join(f"{_KINDS[each.kind]}: {DECIDED_BY[each.kind]}" for each in kept)
    return f"explained by {statements}{ruled}. What decides: {decide}"


_KINDS = {
    "mass": "a mass",
    "support": "the support",
    "climate": "the climate",
    "calibration": "the calibration",
    "stiffness": "stiffness",
    "none": "no change",
}


def _statement(each: ChangeExplanation, not_given: Sequence[str]) -> str:
    if each.kind == "mass":
        ((place, (size, sd)),) = each.sizes.items()
        return (
            f"a mass of {1e3 * abs(size):.1f} ± {1e3 * sd:.1f} g {'more' if size > 0 else 'less'}"
            f" near {place}"
        )
    if each.kind == "none":
        return "no change of the frequencies"
    percent, unit = (1.0, "of its standard deviations") if each.kind == "support" else (100.0, "%")
    sizes = ", ".join(
        f"{name} by {percent * a:+.1f} ± {percent * sd:.1f}" for name, (a, sd) in each.sizes.items()
    )
    known = f" ({', '.join(not_given)} not given)" if each.kind == "climate" else ""
    return f"{_KINDS[each.kind]}{known}: {sizes} {unit}"
