"""Which unknowns campaigns share, and which are their own: one rule.

| unknown | belongs to |
|---|---|
| moduli and Poisson's ratio, in the material's axes | the material: all campaigns share them |
| width, thickness, density, angle of the fibres; deviations of the moduli by scatter | the specimen: its campaigns share them |
| length that vibrates, the clamp's compliance | the campaign |

All unknowns are one vector x of deviations from their prior means in the coordinates of `fecore.updating.coordinates`, with
independent Gaussian priors; the coordinates of campaign c are ξ_c = m_c + P_c x, where P_c picks and adds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.oriented import OrientedSpecimen
from fecore.errors import InputError
from fecore.modes import MeasuredModes
from fecore.updating.coordinates import Coordinates
from fecore.updating.forward import EXTRA_MODES, ForwardModel, modes_to_cover
from fecore.updating.inputs import Inputs
from fecore.updating.parameters import Parameter, parametrise

SPECIMENS_OWN = ("width", "thickness", "density", "fibre_angle")
"""Constants that belong to a specimen, whatever its boundary."""

CAMPAIGNS_OWN = ("length", "clamp_compliance")
"""Constants that belong to one campaign: a clamp begins to hold somewhere else each time."""

MATERIAL = ("Ex", "Ey", "Gxy", "Gxz", "Gyz", "nu_xy")
"""Constants that belong to the material."""

MATERIAL_PARAMETERS = (*(Parameter(name) for name in MATERIAL[:-1]), Parameter("nu_xy", prior_sd=0.1))
"""What several campaigns update together by default: all constants of the material, each by itself."""

_CLAMP_LOG_SD = 1.2  # of a clamp's compliance: its logarithm covers a half-normal's mass from a tenth to five scales
_HALF_NORMAL_MEDIAN = 0.6745  # of |z|, z ~ N(0, 1)


@dataclass(frozen=True)
class Campaign:
    """One test of one specimen of the material.

    Attributes:
        name: of the campaign, in results.
        specimen: name of the specimen; campaigns of one specimen share its dimensions.
        body: as it stood in this campaign; its material is the shared one, in the material's axes.
        modes: measured modes, with shapes at `dofs` where there are any.
        points: coordinates (x, y, z) in m of the shapes' points.
        inputs: how well the laboratory knows what it hands in.
        fixed_points: points at which a sensor stood through the test, if its mass was not stated.
    """

    name: str
    specimen: str
    body: OrientedSpecimen
    modes: MeasuredModes
    points: Mapping[int, tuple[float, float, float]] = field(default_factory=dict)
    inputs: Inputs = field(default_factory=Inputs)
    fixed_points: tuple[int, ...] = ()


def clamped(body: OrientedSpecimen, inputs: Inputs) -> OrientedSpecimen:
    """The body with a clamp that may yield as far as the inputs say; as it is where it is not clamped."""
    scale = inputs.standard_deviation("clamp_compliance")
    if body.boundary != "cantilever" or not scale:
        return body
    return replace(body, clamp_compliance=_HALF_NORMAL_MEDIAN * scale)


@dataclass(frozen=True)
class Unknown:
    """One entry of x: its name, to which specimen or campaign it belongs (None: to all), and its prior's deviation."""

    name: str
    owner: str | None
    sd: float

    @property
    def label(self) -> str:
        """Such as `Ex`, or `thickness of strip 90`."""
        return self.name if self.owner is None else f"{self.name} of {self.owner}"


@dataclass(frozen=True)
class Layout:
    """All unknowns, and how each campaign sees them.

    Attributes:
        campaigns: the campaigns.
        forwards: their models, whose parametrisations have the material's parameters first and the same.
        unknowns: entries of x.
        picks: for each campaign the (p, X) matrix P.
    """

    campaigns: tuple[Campaign, ...]
    forwards: tuple[ForwardModel, ...]
    unknowns: tuple[Unknown, ...]
    picks: tuple[FloatArray, ...]

    @property
    def shared(self) -> tuple[str, ...]:
        """Names of the material's parameters, the first entries of x."""
        return self.forwards[0].parametrisation.reported

    @property
    def labels(self) -> tuple[str, ...]:
        """Of all unknowns."""
        return tuple(unknown.label for unknown in self.unknowns)

    @cached_property
    def coordinates(self) -> tuple[Coordinates, ...]:
        """Of each campaign."""
        return tuple(Coordinates(forward.parametrisation) for forward in self.forwards)

    def sd(self, scatter: float) -> FloatArray:
        """(X,) prior standard deviations, where specimens scatter by so much."""
        return np.array([scatter if is_scatter(unknown) else unknown.sd for unknown in self.unknowns])

    def theta(self, campaign: int, x: FloatArray) -> FloatArray:
        """(p,) a campaign's parameters θ at x."""
        coordinates = self.coordinates[campaign]
        return coordinates.values(coordinates.mean + self.picks[campaign] @ x)

    def material(self, x: FloatArray) -> FloatArray:
        """(q,) the material's parameters at x, without any specimen's scatter."""
        q, coordinates = len(self.shared), self.coordinates[0]
        xi = coordinates.mean.copy()
        xi[:q] += x[:q]
        return coordinates.values(xi)[:q]


_SCATTER = "scatter of "


def is_scatter(unknown: Unknown) -> bool:
    """Whether an unknown is a specimen's deviation from the material."""
    return unknown.name.startswith(_SCATTER)


def lay_out(campaigns: Sequence[Campaign], parameters: Sequence[Parameter], *, scatter: bool) -> Layout:
    """Lay out the unknowns of some campaigns.

    Args:
        campaigns: at least one; names are all different.
        parameters: the material's, with their priors.
        scatter: give every specimen deviations of its own in each free modulus, where there is more than one specimen.

    Raises:
        InputError: two campaigns have one name, a parameter is not the material's, or the parameters contradict themselves.
    """
    names = [campaign.name for campaign in campaigns]
    if not names:
        raise InputError("campaigns", "is empty, expected at least one")
    if len(set(names)) < len(names):
        raise InputError("campaigns", "two have the same name; the result needs names that differ")
    for index, parameter in enumerate(parameters):
        if parameter.name not in MATERIAL:
            raise InputError(
                f"parameters.{index}.name",
                f"is {parameter.name!r}, expected one of the material's: {', '.join(MATERIAL)}",
            )
    forwards = tuple(_forward(campaign, parameters) for campaign in campaigns)
    shared = forwards[0].parametrisation.reported
    sd = Coordinates(forwards[0].parametrisation).sd
    unknowns: dict[tuple[str, str | None], Unknown] = {
        (name, None): Unknown(name, None, float(sd[i])) for i, name in enumerate(shared)
    }
    specimens = tuple(dict.fromkeys(campaign.specimen for campaign in campaigns))
    if scatter and len(specimens) > 1:
        for specimen in specimens:
            for name in shared:
                if name != "nu_xy":
                    unknowns[name, specimen] = Unknown(_SCATTER + name, specimen, 0.0)
    keys = []
    for campaign, forward in zip(campaigns, forwards, strict=True):
        prior, own = forward.parametrisation, Coordinates(forward.parametrisation).sd
        keys.append([_key(name, campaign, shared) for name in prior.names])
        for key, name, deviation in zip(keys[-1], prior.names, own, strict=True):
            owner = f"campaign {key[1]}" if name in CAMPAIGNS_OWN else key[1]
            unknowns.setdefault(key, Unknown(name, owner, float(deviation)))
    places = {key: place for place, key in enumerate(unknowns)}
    picks = []
    for campaign, own_keys in zip(campaigns, keys, strict=True):
        pick = np.zeros((len(own_keys), len(unknowns)))
        for row, key in enumerate(own_keys):
            pick[row, places[key]] = 1.0
            if key[1] is None and (key[0], campaign.specimen) in places:
                pick[row, places[key[0], campaign.specimen]] = 1.0
        picks.append(pick)
    return Layout(tuple(campaigns), forwards, tuple(unknowns.values()), tuple(picks))


def _key(name: str, campaign: Campaign, shared: tuple[str, ...]) -> tuple[str, str | None]:
    """The key of an unknown: its name, and to whom it belongs."""
    if name in shared:
        return name, None
    return name, campaign.name if name in CAMPAIGNS_OWN else f"specimen {campaign.specimen}"


def _forward(campaign: Campaign, parameters: Sequence[Parameter]) -> ForwardModel:
    body = campaign.body
    parametrisation = parametrise(body, parameters).with_inputs(_own_deviations(body, campaign.inputs))
    dofs = campaign.modes.dofs if campaign.modes.shapes is not None else ()
    points = tuple(dict.fromkeys([*(dof.point for dof in dofs), *campaign.fixed_points]))
    places = np.array([campaign.points[point][:2] for point in points]).reshape(-1, 2)
    count = modes_to_cover(parametrisation, float(campaign.modes.frequency_hz[-1]), len(campaign.modes) + EXTRA_MODES)
    return ForwardModel(body, parametrisation, points, places, count)


def _own_deviations(body: OrientedSpecimen, inputs: Inputs) -> dict[str, float]:
    """Standard deviations of a body's own constants, SI; nothing of what is known exactly."""
    nominal = body.nominal
    found = {name: inputs.standard_deviation(name, nominal[name]) for name in (*SPECIMENS_OWN, *CAMPAIGNS_OWN[:1])}
    if body.clamp_compliance:
        found["clamp_compliance"] = body.clamp_compliance * float(np.sqrt(np.expm1(_CLAMP_LOG_SD**2)))
    return found
