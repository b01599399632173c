"""Which unknowns a fit has, and how each campaign sees them.

Which unknowns a fit has, and how each campaign sees them.

| unknown | belongs to |
|---|---|
| moduli with coefficients of temperature, Poisson's ratio, in the material's axes | the material: all campaigns share them |
| width, thickness, density, angle of the fibres; deviations of the moduli by scatter | the specimen: its campaigns share them |
| length that vibrates, the clamp's compliance, a temperature that nobody stated | the campaign |

All unknowns are one vector x of deviations from their prior means in the coordinates of
`fecore.updating.parameters`, with independent Gaussian priors; the coordinates of campaign c are
ξ_c = m_c + P_c x, where P_c picks and adds. An update of one campaign is the same problem with P =
1.

Campaigns of one material or body, and how their unknowns are laid out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy

from fecore.arrays import ROUND_OFF, FloatArray
from fecore.body.clamps import Bed, on_bed
from fecore.body.constants import OWN_SD, Body, CommonPrior, Parameter
from fecore.body.structure import Structure
from fecore.dynamics.bodies import body_modes
from fecore.errors import InputError
from fecore.frf import along_z
from fecore.modes import MeasuredModes
from fecore.quantities import CLAMP, kind_of
from fecore.updating.forward import ForwardModel, ForwardState, has_shapes
from fecore.updating.inputs import Inputs, reference_of, with_temperature
from fecore.updating.mesh import meshed
from fecore.updating.parameters import (
    TEMPERATURE,
    Parametrisation,
    by_name,
    constant_of,
    is_of_damping,
    parametrise,
)
from fecore.updating.posterior import prior_of_scatter

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
        of_model = self.model_error**2 * np.eye(len(rows))
        if self.modes.covariance is None:
            return np.eye(len(rows)) * UNKNOWN_FREQUENCY_SD**2 + of_model
        hz = self.modes.frequency_hz[rows]
        covariance: FloatArray = (
            self.modes.covariance[np.ix_(rows, rows)] / np.outer(hz, hz) + of_model
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
        (`posterior`).
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


MATERIAL = ("Ex", "Ey", "Gxy", "Gxz", "Gyz", "nu_xy")
"""Constants that belong to the material."""

MATERIAL_PARAMETERS = (
    *(Parameter(name) for name in MATERIAL[:-1]),
    Parameter("nu_xy", prior_sd=0.1),
)
"""What several campaigns update together by default: all constants of the material, each by
itself.
"""


def usual_parameters(body: Body) -> tuple[Parameter, ...]:
    """What several campaigns of a body, or of its material, update together by default."""
    return MATERIAL_PARAMETERS if body.shares_material else body.default_parameters()


# of a clamp's compliance: its logarithm covers a half-normal's mass from a tenth to five scales
_CLAMP_LOG_SD = 1.2
_HALF_NORMAL_MEDIAN = 0.6745  # of |z|, z ~ N(0, 1)


@dataclass(frozen=True)
class Campaign:
    """One test of one specimen of the material."""

    name: str  # of the campaign, in results
    specimen: str  # name of the specimen; campaigns of one specimen share its dimensions
    # as it stood in this campaign: a specimen of the shared material in the material's axes, or a
    # body in space, whose sets' constants all campaigns share
    body: Body
    modes: MeasuredModes  # measured modes, with shapes at `dofs` where there are any
    # coordinates (x, y, z) in m of the shapes' points
    points: Mapping[int, tuple[float, float, float]] = field(default_factory=dict)
    inputs: Inputs = field(default_factory=Inputs)  # how well the laboratory knows what it hands in
    # points at which a sensor stood through the test, if its mass was not stated
    fixed_points: tuple[int, ...] = ()
    # (3, 3) directions 1, 2 and 3, as rows, of points where they are not the body's axes
    axes: Mapping[int, FloatArray] = field(default_factory=dict)
    temperature_c: float | None = None  # of the body in the test; None where nobody stated it


def lay_out(
    campaigns: Sequence[Campaign],
    parameters: Sequence[Parameter],
    scatter: float,
    coupons: Sequence[Coupon] = (),
    reference_c: float | None = None,
) -> Layout:
    """Lay out the unknowns of some campaigns.

    Args:
        campaigns: at least one; names are all different.
        parameters: the material's, with their priors.
        scatter: scale of the deviations of its own that every specimen has in each free modulus,
            where there is more than one specimen; 0 for none. A batch of coupons is one more
            specimen.
        coupons: what static tests say of the material's constants.
        reference_c: temperature at which the constants are asked for; by default as of
            `reference_of`.

    Raises:
        InputError: two campaigns have one name, a parameter is not the material's, the parameters
            contradict themselves, campaigns begin with different values of one, or a coefficient of
            temperature is stated where there is one temperature.
    """
    _check(campaigns, parameters)
    reference = reference_of([campaign.temperature_c for campaign in campaigns], reference_c)
    forwards = [_forward(campaign, parameters, reference) for campaign in campaigns]
    first = forwards[0].parametrisation
    shared = first.reported
    _check_priors(campaigns, forwards)
    places: dict[tuple[str, str | None], Unknown] = {
        (name, None): Unknown(name, None, float(sd))
        for name, sd in zip(shared, first.xi_sd, strict=False)
    }
    specimens = tuple(dict.fromkeys(campaign.specimen for campaign in campaigns))
    scatter = scatter if len(specimens) > 1 else 0.0
    if scatter:
        moduli = [name for name in shared if kind_of(name) not in ("nu_xy", "nu12", "per_K")]
        places |= {
            (n, specimen): Unknown.of_scatter(n, specimen) for specimen in specimens for n in moduli
        }
        of_batches = ((coupon.name, coupon.batch) for coupon in coupons if coupon.name in moduli)
        places |= {key: Unknown.of_scatter(*key) for key in of_batches}
    keys = []
    for campaign, forward in zip(campaigns, forwards, strict=True):
        prior = forward.parametrisation
        keys.append([_key(name, campaign, shared) for name in prior.names])
        for key, name, deviation in zip(keys[-1], prior.names, prior.xi_sd, strict=True):
            places.setdefault(key, Unknown(name, key[1], float(deviation)))
    number = {key: place for place, key in enumerate(places)}
    models = []
    for campaign, forward, own_keys in zip(campaigns, forwards, keys, strict=True):
        pick = np.zeros((len(own_keys), len(places)))
        for row, (name, owner) in enumerate(own_keys):
            pick[row, number[name, owner]] = 1.0
            # the specimen's own deviation
            if owner is None and (name, campaign.specimen) in number:
                pick[row, number[name, campaign.specimen]] = 1.0
        known = campaign.inputs, campaign.fixed_points
        models.append(CampaignModel(campaign.name, forward, campaign.modes, pick, *known))
    scale = OWN_SD if first.common and not scatter else scatter
    return Layout(tuple(models), tuple(places.values()), first.common, scale, tuple(coupons))


def _check_priors(campaigns: Sequence[Campaign], forwards: Sequence[ForwardModel]) -> None:
    """All campaigns deviate from the same values of what they share."""
    first = forwards[0].parametrisation
    for campaign, forward in zip(campaigns, forwards, strict=True):
        for name, here, there in zip(
            first.reported, forward.parametrisation.prior_mean, first.prior_mean, strict=False
        ):
            if not np.isclose(here, there, rtol=ROUND_OFF, atol=0.0):
                raise InputError(
                    "parameters",
                    f"{name} is {here:.6g} in campaign {campaign.name} and {there:.6g} in"
                    f" {campaigns[0].name}; state its prior_mean in the recipe",
                )


def as_updated(campaigns: Sequence[Campaign]) -> list[Campaign]:
    """The campaigns with bodies as an update has them: clamps that may yield, meshes as fine as
    their modes need.
    """
    return [
        replace(
            each,
            body=meshed(
                yielding(each.body, each.inputs), 1.05 * float(each.modes.frequency_hz[-1])
            )[0],
        )
        for each in campaigns
    ]


def yielding(body: Body, inputs: Inputs) -> Body:
    """The body with a clamp that may yield as far as the inputs say; as it is where none is
    modelled.
    """
    compliance = _HALF_NORMAL_MEDIAN * inputs.standard_deviation(CLAMP)
    if not compliance:
        return body
    held, bed = body.in_space, body.bed
    if held is None or bed is None:
        return body.yielding(compliance)
    # beams alone: nothing says how wide the clamp is
    return body if np.linalg.matrix_rank(bed.inertia) < 3 else _on_bed(held, bed, compliance)


def _on_bed(body: Structure, bed: Bed, compliance: float) -> Structure:
    """A body in space whose clamp yields so that a compliance of C lowers its first frequency by 2
    C, as a strip's does.
    """
    model, constants = body.model, np.array(list(body.nominal.values()))
    mass = model.mass.at(body.mass_coefficients(constants))
    first = body_modes(model, model.stiffness.at(body.stiffness_coefficients(constants)), mass, 1)
    pushes = first.eigenvalue * ((mass @ model.motions).T @ first.shapes)
    stiffness = bed.yields(pushes) / (4 * first.eigenvalue)
    return on_bed(body, bed, compliance, float(stiffness[0]))


def _check(campaigns: Sequence[Campaign], parameters: Sequence[Parameter]) -> None:
    names = [campaign.name for campaign in campaigns]
    if not names:
        raise InputError("campaigns", "is empty, expected at least one")
    if len(set(names)) < len(names):
        raise InputError("campaigns", "two have the same name; the result needs names that differ")
    check_material(campaigns[0].body, parameters)
    known: dict[tuple[str, str], Campaign] = {}
    for campaign in campaigns:
        for name in SPECIMENS_OWN if campaign.body.shares_material else ():
            first = known.setdefault((campaign.specimen, name), campaign)
            here, there = campaign.body.nominal[name], first.body.nominal[name]
            if not np.isclose(here, there, rtol=ROUND_OFF, atol=ROUND_OFF):
                raise InputError(
                    "campaigns",
                    f"{name} is {there:.6g} in {first.name} and {here:.6g} in {campaign.name}, both"
                    f" of specimen {campaign.specimen}: state it alike, or name two specimens",
                )


def check_material(body: Body, parameters: Sequence[Parameter]) -> None:
    """Make sure that parameters of specimens are their material's; bodies in space have constants
    of their own.

    Raises:
        InputError: one is not.
    """
    if not body.shares_material:
        return
    for index, parameter in enumerate(parameters):
        if (constant_of(parameter.name) or parameter.name) not in MATERIAL and not is_of_damping(
            parameter.name
        ):
            expected = (
                f"is {parameter.name!r}, expected one of the material's: {', '.join(MATERIAL)}"
            )
            raise InputError(f"parameters.{index}.name", expected)


def _key(name: str, campaign: Campaign, shared: tuple[str, ...]) -> tuple[str, str | None]:
    """The key of an unknown: its name, and to whom it belongs."""
    if name in shared:
        return name, None
    return (
        name,
        f"campaign {campaign.name}" if name in CAMPAIGNS_OWN else f"specimen {campaign.specimen}",
    )


def _forward(
    campaign: Campaign, parameters: Sequence[Parameter], reference: float | None
) -> ForwardModel:
    shared = with_temperature(
        parametrise(campaign.body, parameters), reference, campaign.temperature_c, reported=True
    )
    parametrisation, modes = _with_own(shared, campaign), campaign.modes
    dofs = modes.dofs if modes.shapes is not None else ()
    rows = tuple(dict.fromkeys([*dofs, *along_z(campaign.fixed_points)]))
    highest = float(modes.frequency_hz[-1])
    return ForwardModel.of_dofs(
        parametrisation, rows, campaign.points, highest, len(modes), axes=campaign.axes
    )


def _with_own(parametrisation: Parametrisation, campaign: Campaign) -> Parametrisation:
    """The parameters, and the body's own constants as far as they are not known exactly."""
    body, nominal = campaign.body, campaign.body.nominal
    own = (*SPECIMENS_OWN, CAMPAIGNS_OWN[0]) if body.shares_material else nominal
    sds = campaign.inputs.standard_deviations({name: nominal[name] for name in own})
    if CLAMP in nominal:
        sds[CLAMP] = nominal[CLAMP] * float(np.sqrt(np.expm1(_CLAMP_LOG_SD**2)))
    return parametrisation.with_inputs(sds)
