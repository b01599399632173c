"""The baseline: the first n campaigns, the regression on covariates, and scores of later campaigns
against it.

With centred covariates c the baseline says y = β₀ + Σ β_k (c_k − c̄_k). A later campaign at x = (1,
c − c̄) has the residual r = y − xᵀβ, whose variance is

    s² + τ² + h + m,   h = xᵀ V_β x,   m = Σ over missing covariates of (β_k² + V_kk) Var(c_k)

s its own standard deviation, τ the scatter between campaigns, h the baseline's uncertainty at that
covariate (its leverage), m what a covariate that was not measured could have done, had it been as
in the baseline. The score is the residual's quantile in a t distribution of ν degrees of freedom,
as a normal deviate: z = Φ⁻¹(T_ν(r / sd)).

Beyond the baseline's covariates the error of the slope is shared by all campaigns, so it looks like
a change. There the variance is raised to h + (s² + τ²) h/h_max, h_max the largest leverage in the
baseline, so that the share of the baseline's error in a score stays what it was when the chart's
limits were set.

Weighted regression of estimates that scatter by more than their own uncertainty.

    y = Xβ + ε,  Var ε_i = s_i² + τ²

s_i is each point's own standard deviation, τ the scatter between campaigns (clamping, instruments),
which is not known and comes from the residuals. With s̄ the harmonic mean of the s_i, the total
variance v = τ² + s̄² has the restricted likelihood of the residuals, with the s_i in proportion
smaller where v < s̄², and a prior uniform in log v: what Student's t stands for. A true v below s̄²
there cannot be, so what the posterior has there lies on s̄² (a confidence distribution with a
point mass at the bound: Schweder and Hjort 2016). The mean of the precision 1/v gives the total
variance and its spread the degrees of freedom of a t distribution (Satterthwaite's matching): ν = 2
E[1/v]² / Var[1/v].

Cutting only moves v up, so charts call no more often than with Student's t, whatever τ is. A prior
on τ ≥ 0, as one with some weight on τ = 0, calls more often where τ is near the s_i: 1.3 times as
often with half a decade of weight.

A slope of which something is known before has a Gaussian prior: it joins the normal equations, and
the likelihood of v is that with such slopes integrated out under it, the others under a flat one.

The two ends are the textbook's: where the s_i vanish, v = RSS/(n − p) and ν = n − p, Student's t;
where they explain all scatter, ν is large and intervals are normal.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray, IntArray
from fecore.errors import InputError
from fecore.trend.autocorrelation import Autocorrelation, diagnose, normal_score
from fecore.trend.series import TEMPERATURE, Series, days_since, listed, select

_GRID = 400  # points of log v; the posterior is smooth over a decade
# of v on the grid, in units of the smallest and the largest plausible variance
_LEAST, _WIDEST = 1e-2, 1e4
_NEGLIGIBLE = 1e-4  # scatter of residuals over s̄² from which less makes no difference
_NORMAL = 1000.0  # more degrees of freedom than this are taken as a normal distribution


@dataclass(frozen=True)
class RegressionFit:
    """A regression and what it does not know."""

    coefficients: FloatArray  # (p,) β
    covariance: FloatArray  # (p, p) of β, the scatter τ included
    between_sd: float  # τ, standard deviation between campaigns
    total_variance: float  # v = τ² + s̄²
    degrees_of_freedom: float  # ν of the t distribution that stands for the uncertainty of v
    # p-value of Σ (residual / s_i)² being as small as it is if the s_i were all the scatter there
    # is; near 0 where the stated standard deviations are larger than the scatter that is seen
    excess: float


def fit_with_scatter(
    X: FloatArray, y: FloatArray, s: FloatArray, prior: tuple[FloatArray, FloatArray] | None = None
) -> RegressionFit:
    """Fit β and τ.

    Args:
        X: (n, p) regressors.
        y: (n,) estimates.
        s: (n,) their own standard deviations, positive.
        prior: (p,) means and (p,) precisions of β, 0 of what nobody knows before; None of nothing.

    Raises:
        InputError: fewer than p + 2 points, or regressors that the points do not separate.
    """
    n, p = X.shape
    if n < p + 2:
        raise InputError(
            "points",
            f"{n} points for {p} coefficients and their scatter, expected at least {p + 2}",
        )
    if np.linalg.matrix_rank(X / np.maximum(np.abs(X).max(axis=0), 1e-300)) < p:
        raise InputError(
            "covariates",
            "the points do not separate the regressors (a constant or repeated covariate)",
        )
    harmonic = float(1 / np.mean(1 / s**2))
    ordinary = y - X @ np.linalg.lstsq(X, y, rcond=None)[0]
    seen = float(ordinary @ ordinary) / (n - p)
    v = np.geomspace(
        _LEAST * max(seen, _NEGLIGIBLE * harmonic), _WIDEST * max(seen, harmonic), _GRID
    )
    share, between_variance = np.minimum(v / harmonic, 1.0), np.maximum(v - harmonic, 0.0)
    mean, known = (np.zeros(p), np.zeros(p)) if prior is None else prior
    # Without a prior the likelihood is the same for any Xβ that is taken off; where there is one,
    # for its mean's alone.
    off = ordinary if prior is None else y - X @ mean - float(np.mean(y - X @ mean))
    variances = share[:, None] * s**2 + between_variance[:, None]
    log_likelihood = _restricted_likelihood(X, off, variances, np.diag(known))
    weight = np.exp(log_likelihood - log_likelihood.max())
    weight /= weight.sum()
    precision = 1 / np.maximum(v, harmonic)
    middle = float(weight @ precision)
    spread = float(weight @ (precision - middle) ** 2)
    total = 1 / middle
    between = max(total - harmonic, 0.0)
    beta, covariance = _generalised_least_squares(X, y, s**2 + between, mean, known)
    own = y - X @ _generalised_least_squares(X, y, s**2, mean, known)[0]
    return RegressionFit(
        beta,
        covariance,
        float(np.sqrt(between)),
        total,
        min(2 * middle**2 / spread, _NORMAL) if spread > 0 else _NORMAL,
        float(scipy.special.chdtr(n - p, np.sum((own / s) ** 2))),
    )


def _generalised_least_squares(
    X: FloatArray, y: FloatArray, variance: FloatArray, mean: FloatArray, known: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(p,) β and (p, p) its covariance, with a prior of (p,) means and precisions."""
    weighted = X / variance[:, None]
    covariance = np.linalg.inv(X.T @ weighted + np.diag(known))
    return covariance @ (weighted.T @ y + known * mean), covariance


def _restricted_likelihood(
    X: FloatArray, y: FloatArray, variance: FloatArray, known: FloatArray
) -> FloatArray:
    """(G,) logarithm of the likelihood of the residuals with β integrated out, for (G, n)
    variances.

    `known` is the (p, p) precision of a prior of β about 0.
    """
    weighted = X.T[None] / variance[:, None, :]
    information = weighted @ X + known
    right = weighted @ y
    explained = np.einsum("gi,gi->g", right, np.linalg.solve(information, right[..., None])[..., 0])
    log_determinant = np.linalg.slogdet(information)[1]
    misfit = (1 / variance) @ y**2 - explained
    return np.asarray(-0.5 * (log_determinant + np.log(variance).sum(axis=1) + misfit))


_CONSISTENT = 0.01  # p-value below which the stated standard deviations are called too large


@dataclass(frozen=True)
class Baseline:
    """What is known of a parameter before it is watched."""

    labels: tuple[str, ...]  # campaigns that make the baseline
    covariates: tuple[str, ...]  # names of the covariates that are regressed out
    # centre, low, high, variance: (k,) mean, range and variance of each covariate in the baseline
    centre: FloatArray
    low: FloatArray
    high: FloatArray
    variance: FloatArray
    fit: RegressionFit  # β (value at the mean covariates, then the slopes), its covariance, τ and ν
    # leverage_mean, leverage_max: of the baseline's own campaigns, xᵀ V_β x
    leverage_mean: float
    leverage_max: float
    autocorrelation: Autocorrelation  # how much its campaigns resemble their neighbours

    @property
    def mean(self) -> float:
        """Parameter at the baseline's mean covariates."""
        return float(self.fit.coefficients[0])

    @property
    def mean_sd(self) -> float:
        """Standard deviation of `mean`."""
        return float(np.sqrt(self.fit.covariance[0, 0]))

    @property
    def shared(self) -> float:
        """Variance of the baseline's own error in units of a campaign's variance: the g of the
        chart's limits.
        """
        return self.leverage_mean / self.fit.total_variance


@dataclass(frozen=True)
class Scores:
    """Campaigns judged against a baseline."""

    corrected: FloatArray  # (n,) estimates brought to the baseline's mean covariates
    # (n,) estimate less what the baseline expects at the campaign's covariates
    residual: FloatArray
    # (n,) its standard deviation, extrapolation and missing covariates included
    residual_sd: FloatArray
    score: FloatArray  # (n,) normal deviate of the residual
    extrapolated: BoolArray  # (n,) whether a covariate lies beyond the baseline's
    missing: BoolArray  # (n,) whether a covariate was not measured
    regressors: FloatArray  # (n, p) x of each campaign

    def covariance(self, baseline: Baseline) -> FloatArray:
        """(n, n) of the residuals; off the diagonal, the baseline's error that campaigns share."""
        shared: FloatArray = self.regressors @ baseline.fit.covariance @ self.regressors.T
        np.fill_diagonal(shared, self.residual_sd**2)
        return shared


def complete_campaigns(series: Series, covariates: Sequence[str]) -> IntArray:
    """Indices of the campaigns of which every covariate is known."""
    return np.flatnonzero(np.isfinite(series.measured(covariates)).all(axis=1))


def slope_prior(
    covariates: Sequence[str], level: float, per_kelvin: tuple[float, float] | None, more: int = 0
) -> tuple[FloatArray, FloatArray] | None:
    """Means and precisions of a level, of the slopes by covariates, and of so many more
    coefficients; None of nothing.

    Args:
        covariates: names.
        level: of the parameter, to which the change per kelvin is relative.
        per_kelvin: mean and standard deviation of that.
        more: coefficients after the slopes.
    """
    if per_kelvin is None or TEMPERATURE not in covariates or level == 0:
        return None
    mean, known = np.zeros((2, 1 + len(covariates) + more))
    place = 1 + list(covariates).index(TEMPERATURE)
    mean[place], known[place] = per_kelvin[0] * level, (per_kelvin[1] * level) ** -2
    return mean, known


def fit_baseline(
    series: Series,
    n: int,
    covariates: Sequence[str] = (),
    per_kelvin: tuple[float, float] | None = None,
) -> tuple[Baseline, Series | None, tuple[str, ...]]:
    """Baseline of the first n campaigns whose covariates are all known; the later campaigns, if
    any; and notes.

    Args:
        series: in time order.
        n: campaigns in the baseline; at least the number of coefficients (1 + covariates) and three
            more.
        covariates: to regress out.
        per_kelvin: mean and standard deviation of the relative change by temperature, as known
            before; None: nothing is.

    Raises:
        InputError: too few campaigns with all covariates, or a covariate that does not vary.
    """
    names = tuple(covariates)
    if n < len(names) + 4:
        raise InputError(
            "baseline",
            f"{n} campaigns, expected at least {len(names) + 4} for {len(names)} covariates",
        )
    complete = complete_campaigns(series, names)
    if complete.size < n:
        raise InputError(
            "baseline",
            f"needs {n} campaigns with all covariates, {series.name} has {complete.size} of"
            f" {len(series)}",
        )
    used, last = complete[:n], int(complete[n - 1])
    left_out = [series.labels[i] for i in range(last) if i not in used]
    notes = (
        [f"left out of the baseline, a covariate is missing: {listed(left_out)}"]
        if left_out
        else []
    )
    base = select(series, used.tolist())
    c = base.measured(names)
    for k, name in enumerate(names):
        if np.ptp(c[:, k]) == 0:
            raise InputError(
                f"covariates.{name}", "does not vary in the baseline, so its effect is not known"
            )
    X = np.column_stack([np.ones(n), c - c.mean(axis=0)])
    prior = slope_prior(names, float(np.mean(base.estimate)), per_kelvin)
    fit = fit_with_scatter(X, base.estimate, base.standard_deviation, prior)
    if fit.excess < _CONSISTENT:
        notes.append(
            "the stated standard deviations are larger than the scatter; changes are found later"
            " than need be"
        )
    leverage = np.einsum("ij,jk,ik->i", X, fit.covariance, X)
    baseline = Baseline(
        labels=tuple(base.labels),
        covariates=names,
        centre=c.mean(axis=0),
        low=c.min(axis=0),
        high=c.max(axis=0),
        variance=c.var(axis=0, ddof=1),
        fit=fit,
        leverage_mean=float(leverage.mean()),
        leverage_max=float(leverage.max()),
        autocorrelation=diagnose(
            X,
            base.estimate,
            np.sqrt(base.standard_deviation**2 + fit.between_sd**2),
            days_since(base.dates[0], base.dates),
        ),
    )
    watched = select(series, range(last + 1, len(series))) if last + 1 < len(series) else None
    return baseline, watched, tuple(notes)


def score(baseline: Baseline, series: Series) -> Scores:
    """Scores of campaigns against a baseline; see the module's docstring for the equations."""
    n = len(series)
    c = series.measured(baseline.covariates)
    absent = np.isnan(c)
    centred = np.where(absent, 0.0, c - baseline.centre)
    X = np.column_stack([np.ones(n), centred])
    fit = baseline.fit
    slopes = fit.coefficients[1:]
    residual = series.estimate - X @ fit.coefficients
    leverage = np.einsum("ij,jk,ik->i", X, fit.covariance, X)
    unmeasured = absent @ ((slopes**2 + np.diag(fit.covariance)[1:]) * baseline.variance)
    own = series.standard_deviation**2 + fit.between_sd**2 + unmeasured
    sd = np.sqrt(leverage + own * np.maximum(1.0, leverage / baseline.leverage_max))
    outside = np.any(~absent & ((c < baseline.low) | (c > baseline.high)), axis=1)
    return Scores(
        corrected=series.estimate - centred @ slopes,
        residual=residual,
        residual_sd=sd,
        score=normal_score(residual / sd, fit.degrees_of_freedom),
        extrapolated=outside,
        missing=np.any(absent, axis=1),
        regressors=X,
    )
