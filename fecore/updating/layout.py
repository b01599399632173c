"""Which unknowns a fit has, and how each campaign sees them.

| unknown | belongs to |
|---|---|
| moduli with coefficients of temperature, Poisson's ratio, in the material's axes | the material: all campaigns share them |
| width, thickness, density, angle of the fibres; deviations of the moduli by scatter | the specimen: its campaigns share them |
| length that vibrates, the clamp's compliance, a temperature that nobody stated | the campaign |

All unknowns are one vector x of deviations from their prior means in the coordinates of
`fecore.updating.parameters`, with independent Gaussian priors; the coordinates of campaign c are
ξ_c = m_c + P_c x, where P_c picks and adds. An update of one campaign is the same problem with P =
1.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.body.constants import OWN_SD, CommonPrior
from fecore.errors import InputError
from fecore.modes import MeasuredModes
from fecore.quantities import CLAMP
from fecore.updating.forward import ForwardModel, ForwardState
from fecore.updating.inputs import Inputs
from fecore.updating.pairing import has_shapes
from fecore.updating.parameters import Parametrisation, by_name
from fecore.updating.posterior import prior_of_scatter
from fecore.updating.temperature import TEMPERATURE

SPECIMENS_OWN = ("width", "thickness", "density", "fibre_angle")
"""Constants that belong to a specimen, whatever its boundary; Poisson's ratio is the material's."""

CAMPAIGNS_OWN = ("length", CLAMP, TEMPERATURE)
"""What belongs to one campaign: a clamp begins to hold somewhere else each time."""

UNKNOWN_FREQUENCY_SD = 0.0002
"""Relative standard deviation of a frequency that was typed in without one."""

_SCATTER = "scatter of "


@dataclass(frozen=True)
class Unknown:
    """One entry of x: its name, to which specimen or campaign it belongs (None: to all), and its
    prior's deviation.
    """

    name: str
    owner: str | None
    sd: float

    @classmethod
    def of_scatter(cls, name: str, specimen: str) -> Unknown:
        """A specimen's deviation from the material; its prior's deviation is the scatter, which is
        estimated.
        """
        return cls(_SCATTER + name, specimen, 0.0)

    @property
    def is_scatter(self) -> bool:
        """Whether this is a specimen's deviation from the material."""
        return self.name.startswith(_SCATTER)

    @property
    def constant(self) -> str:
        """Name of the constant, also where this is a specimen's deviation of it."""
        return self.name.removeprefix(_SCATTER)

    @property
    def label(self) -> str:
        """Such as `Ex`, or `thickness of strip 90`."""
        return self.name if not self.owner else f"{self.name} of {self.owner}"

    @property
    def source(self) -> str:
        """What it is called in a budget of uncertainty."""
        name = "scatter between specimens" if self.is_scatter else self.name
        return f"prior of {name}" if self.owner is None else name


@dataclass(frozen=True)
class CampaignModel:
    """A campaign as a fit sees it."""

    name: str  # of the campaign; empty where there is one
    # its model; the first points are those of the modes' shapes, in their order
    forward: ForwardModel
    modes: MeasuredModes  # measured modes; without shapes they are paired by frequency
    pick: FloatArray  # (p, X) matrix P
    # how well the laboratory knows what it hands in
    inputs: Inputs = field(default_factory=Inputs.exact)
    # at which a sensor stood through the test, if its mass was not stated
    fixed_points: tuple[int, ...] = ()

    @property
    def prior(self) -> Parametrisation:
        """The campaign's parameters θ, their coordinates and prior."""
        return self.forward.parametrisation

    def theta(self, x: FloatArray) -> FloatArray:
        """(p,) the campaign's parameters θ at x."""
        return self.prior.theta(self.prior.xi_mean + self.pick @ x)

    def is_believable(self, x: FloatArray) -> bool:
        """Whether the campaign's body could have the parameters at x."""
        return bool(self.prior.are_believable((self.prior.xi_mean + self.pick @ x)[None])[0])

    def noise(self, rows: list[int]) -> FloatArray:
        """(n, n) covariance of the logarithms of some measured frequencies, and of what the model
        is known to miss.
        """
        missed = self.model_error**2 * np.eye(len(rows))
        if self.modes.covariance is None:
            return np.eye(len(rows)) * UNKNOWN_FREQUENCY_SD**2 + missed
        hz = self.modes.frequency_hz[rows]
        covariance: FloatArray = (
            self.modes.covariance[np.ix_(rows, rows)] / np.outer(hz, hz) + missed
        )
        return covariance

    @property
    def model_error(self) -> float:
        """Known relative error of a frequency of the model, beside the discrepancy that the
        residuals show.
        """
        return self.forward.specimen.model_error

    def probability(self, rows: Sequence[int]) -> FloatArray:
        """(n,) probabilities that some measured modes are modes of the structure; 1 where nobody
        doubts it.
        """
        known = self.modes.probability
        return np.ones(len(rows)) if known is None else known[list(rows)]

    def width(self, rows: Sequence[int]) -> FloatArray:
        """(n,) W of some measured modes: one over the density of ln f that a pole has that is none
        (`mode_inclusion`).
        """
        hz = self.modes.frequency_hz
        return np.asarray(hz[-1] / hz[list(rows)])

    def named(self, row: int) -> str:
        """A measured mode in a message: its number and frequency, and its campaign where there are
        several.
        """
        text = f"{row + 1} ({self.modes.frequency_hz[row]:.2f} Hz)"
        return f"{text} of campaign {self.name}" if self.name else text


@dataclass(frozen=True)
class Coupon:
    """What static tests of a batch say of one of the material's constants.

    Where specimens scatter a batch is of one more specimen, of which its own mean is known better:
    σ/√(n + 1).
    """

    name: str  # of the constant
    mean: float  # SI
    # σ, with which the mean says what one more piece is (`fecore.coupons.batch.prior`), SI
    standard_deviation: float
    batch: str = "coupons"  # name of the batch
    pieces: int = 0  # n; 0 where σ is that of the mean itself


@dataclass(frozen=True)
class Layout:
    """All unknowns, and the campaigns that see them."""

    # models whose parametrisations have the shared parameters first and the same
    campaigns: tuple[CampaignModel, ...]
    unknowns: tuple[Unknown, ...]  # entries of x, those that all campaigns share first
    # constants, among the shared ones, of sets that are made of one material
    common: tuple[CommonPrior, ...] = ()
    # prior scale of the scatter τ: of a modulus between specimens where some unknowns are theirs,
    # else of a constant between sets of one material; 0 where nothing scatters
    scatter: float = 0.0
    coupons: tuple[Coupon, ...] = ()  # what static tests say of the shared parameters

    @classmethod
    def of_one(
        cls,
        forward: ForwardModel,
        modes: MeasuredModes,
        inputs: Inputs | None = None,
        fixed: tuple[int, ...] = (),
    ) -> Layout:
        """The unknowns of one campaign: its parameters and inputs."""
        prior = forward.parametrisation
        owners = [None if name in prior.reported else "" for name in prior.names]
        unknowns = tuple(
            Unknown(*each)
            for each in zip(prior.names, owners, map(float, prior.xi_sd), strict=True)
        )
        campaigns = (
            CampaignModel(
                "", forward, modes, np.eye(len(prior.names)), inputs or Inputs.exact(), fixed
            ),
        )
        return cls(campaigns, unknowns, prior.common, OWN_SD if prior.common else 0.0)

    @property
    def shared(self) -> tuple[str, ...]:
        """Names of the parameters that are asked for, the first entries of x."""
        return self.prior.reported

    @property
    def prior(self) -> Parametrisation:
        """The first campaign's parameters, the shared ones first."""
        return self.campaigns[0].prior

    @property
    def labels(self) -> tuple[str, ...]:
        """Of all unknowns."""
        return tuple(unknown.label for unknown in self.unknowns)

    @property
    def by_shapes(self) -> bool:
        """Whether every campaign has shapes that distinguish its modes."""
        return all(has_shapes(campaign.modes) for campaign in self.campaigns)

    @property
    def is_large(self) -> bool:
        """Whether a model is so large that its basis holds only the modes which the measurement
        needs.
        """
        return any(np.isfinite(campaign.forward.held_hz) for campaign in self.campaigns)

    def solved(self, x: FloatArray) -> tuple[ForwardState, ...]:
        """Each campaign's model at x."""
        return tuple(campaign.forward.solve(campaign.theta(x)) for campaign in self.campaigns)

    def are_believable(self, x: FloatArray) -> bool:
        """Whether the bodies of all campaigns could have the parameters at x."""
        return all(campaign.is_believable(x) for campaign in self.campaigns)

    @property
    def specimens_scatter(self) -> bool:
        """Whether specimens have deviations of their own from the material."""
        return any(unknown.is_scatter for unknown in self.unknowns)

    def sd(self, scatter: float) -> FloatArray:
        """(X,) prior standard deviations of the unknowns by themselves at a scatter τ, see
        `coupling`.
        """
        sd = np.array([scatter if unknown.is_scatter else unknown.sd for unknown in self.unknowns])
        for rows, shared, own in self._of_sets(scatter):
            sd[rows] = np.sqrt(own + len(rows) * shared)
        return sd

    def coupling(self, scatter: float) -> FloatArray:
        """(X, X) prior precision beside that: of what sets of one material have in common.

        n constants that share a deviation of variance c² and have o² each of their own have the
        covariance c²11ᵀ + o²I. Its inverse is that of independent ones of variance o² + nc², and
        k/o² (nI - 11ᵀ) with k = c²/(o² + nc²).
        """
        coupling = np.zeros((len(self.unknowns),) * 2)
        for rows, shared, own in self._of_sets(scatter):
            n = len(rows)
            coupling[np.ix_(rows, rows)] = shared / (own + n * shared) / own * (n * np.eye(n) - 1)
        return coupling

    def _of_sets(self, scatter: float) -> Iterator[tuple[list[int], float, float]]:
        """Places of constants with a common prior, with the variances of ξ that they share and of
        each by itself.
        """
        for each in self.common:
            spread = each.own if self.specimens_scatter else each.own * scatter / self.scatter
            shared = np.log1p(each.common**2)
            yield [self.shared.index(name) for name in each.constants], shared, np.log1p(spread**2)

    def precision(self, scatter: float) -> FloatArray:
        """(X, X) prior precision P(τ)."""
        precision: FloatArray = np.diag(self.sd(scatter) ** -2) + self.coupling(scatter)
        return precision

    def log_prior(self) -> Callable[[FloatArray], FloatArray]:
        """The (n,) logarithm of the prior density of (n, q) shared unknowns, whatever the scatter
        is, up to a constant.
        """
        q, (scatters, probability) = len(self.shared), prior_of_scatter(self.scatter)
        inverse = [
            np.linalg.inv(np.linalg.inv(self.precision(float(each)))[:q, :q]) for each in scatters
        ]
        constant = np.log(probability) + np.linalg.slogdet(inverse)[1] / 2

        def value(x: FloatArray) -> FloatArray:
            distance = np.einsum("ni,tij,nj->tn", x, inverse, x)
            return np.asarray(scipy.special.logsumexp(constant[:, None] - distance / 2, axis=0))

        return value

    def marginal_sd(self, scatter: float) -> FloatArray:
        """(X,) prior standard deviations of the unknowns, whatever the others are."""
        return np.asarray(np.sqrt(np.diag(np.linalg.inv(self.precision(scatter)))))

    def material(self, x: FloatArray) -> FloatArray:
        """(q,) the shared parameters at x, without any specimen's scatter."""
        q, xi = len(self.shared), self.prior.xi_mean.copy()
        xi[:q] += x[:q]
        return self.prior.theta(xi)[:q]

    def parameters(self, x: FloatArray) -> dict[str, float]:
        """The shared parameters by name; of one campaign its inputs too. SI."""
        if len(self.campaigns) > 1:
            return by_name(self.shared, self.material(x))
        return by_name(self.prior.names, self.campaigns[0].theta(x))

    @cached_property
    def of_coupons(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(c, X) combinations of x that the coupons say, with (c,) values and standard deviations
        there.

        Raises:
            InputError: a coupon's constant is not updated.
        """
        rows, values, sds = np.zeros((len(self.coupons), len(self.unknowns))), [], []
        for index, coupon in enumerate(self.coupons):
            if coupon.name not in self.shared:
                known = ", ".join(self.shared)
                raise InputError(
                    f"coupons.{index}", f"{coupon.name} is not updated; expected one of {known}"
                )
            place, mean, sd = self.shared.index(coupon.name), coupon.mean, coupon.standard_deviation
            sd /= np.sqrt(coupon.pieces + 1) if self.specimens_scatter else 1.0
            own = Unknown.of_scatter(coupon.name, coupon.batch).label
            rows[index] = [at == place or label == own for at, label in enumerate(self.labels)]
            if self.prior.logarithmic[place]:
                mean, sd = float(np.log(mean)), sd / mean
            values.append(mean - float(self.prior.xi_mean[place]))
            sds.append(sd)
        return rows, np.array(values), np.array(sds)

    def with_unverified_basis(self) -> Layout:
        """The same on bases as they are now, for a search that is verified afterwards."""
        return replace(
            self,
            campaigns=tuple(
                replace(c, forward=c.forward.with_unverified_basis()) for c in self.campaigns
            ),
        )

    def with_mesh_errors_at(self, x: FloatArray) -> Layout:
        """The same with the error of each body's own mesh as it is at x."""
        moved = [
            replace(c, forward=c.forward.with_mesh_error_about(c.theta(x))) for c in self.campaigns
        ]
        return replace(self, campaigns=tuple(moved))

    def with_prior(self, prior: Parametrisation, **of_model: Any) -> Layout:
        """The layout of one campaign with other parameters and their body, its model changed in
        these attributes.
        """
        (only,) = self.campaigns
        known = {"about": None, "like": only.forward, **of_model}
        forward = replace(only.forward, specimen=prior.body, parametrisation=prior, **known)
        return Layout.of_one(forward, only.modes, only.inputs, only.fixed_points)
