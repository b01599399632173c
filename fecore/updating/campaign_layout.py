"""Campaigns of one material or body, and how their unknowns are laid out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.clamps import Bed, on_bed
from fecore.body.constants import OWN_SD, Body, Parameter
from fecore.body.structure import Structure
from fecore.dynamics.bodies import body_modes
from fecore.errors import InputError
from fecore.frf import along_z
from fecore.modes import MeasuredModes
from fecore.quantities import CLAMP, kind_of
from fecore.updating.discretisation import meshed
from fecore.updating.forward import ForwardModel
from fecore.updating.inputs import Inputs
from fecore.updating.layout import (
    CAMPAIGNS_OWN,
    SPECIMENS_OWN,
    CampaignModel,
    Coupon,
    Layout,
    Unknown,
)
from fecore.updating.parameters import Parametrisation, parametrise
from fecore.updating.temperature import constant_of, is_of_damping, reference_of, with_temperature

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
_ALIKE = 1e-9  # relative, of nominal constants that are one


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
            if not np.isclose(here, there, rtol=_ALIKE, atol=0.0):
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
            if not np.isclose(here, there, rtol=_ALIKE, atol=_ALIKE):
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
