"""Recipes as clients send them, and update jobs as they see them. Every recipe field is
optional.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any, Literal
from uuid import UUID

from pydantic import Field

from fecore.body.constants import Body, Parameter
from fecore.body.sections import PLY_CONSTANTS
from fecore.body.specimen import CONSTANTS
from fecore.body.supports import Edge, Spring
from fecore.dynamics.laws import DEFAULT_LAWS, LAWS
from fecore.errors import within
from fecore.quantities import Quantity, quantity_of
from fecore.updating import measurement as core
from fecore.updating.inputs import Inputs
from fecore.updating.misfit import Weighting
from service.nouns.campaigns.schemas import CampaignInputs
from service.nouns.modes.schemas import Band, PolesIn
from service.nouns.records.schemas import ProcessingIn
from service.nouns.structures.schemas import StructureInputs
from service.platform.queue.resource import JobOut
from service.platform.web import Id, Int64, LongList, Name, RequestModel, StrictModel, example
from service.platform.web.bodies import SOME_ID

if TYPE_CHECKING:
    DampingModel = str
else:
    DampingModel = Literal[tuple(LAWS)]


class ParameterIn(RequestModel):
    """A constant to update; SI. Without a mean the structure's nominal value, without a spread 30 %
    of the mean.
    """

    name: Name = Field(
        description=(
            f"{', '.join(CONSTANTS)}; of a laminate also its plies' {', '.join(PLY_CONSTANTS)}"
            " (E1_2 and so on of the second ply material from the bottom) and angle_1, angle_2, …"
            " in rad; or the name of one of the recipe's springs; `Ex.per_K`, `web.G12.per_K`,"
            " `a1.per_K`: relative change per kelvin, of which the usual prior has what is not"
            " stated"
        )
    )
    prior_mean: float | None = None
    prior_sd: float | None = None
    fixed: bool = False
    tied_to: Name | None = Field(
        None,
        description=(
            "follows that parameter in the ratio of the nominal values, give or take prior_sd"
        ),
    )

    def measured(self) -> Iterator[tuple[str, float, Quantity]]:
        """Mean and spread of the prior, as what the parameter is."""
        if (quantity := quantity_of(self.name)) is not None and quantity.sd is not None:
            yield "prior_mean", self.prior_mean or 0.0, quantity
            yield "prior_sd", self.prior_sd or 0.0, quantity.sd


class SpringIn(RequestModel):
    """An elastic support, which a parameter of the same name updates; it adds to the campaign's
    boundary.
    """

    name: Name
    stiffness: float = Field(
        gt=0, le=1e18, description="N/m or N·m/rad at a point; per metre of edge on an edge"
    )
    direction: int = Field(ge=1, le=6, description="1, 2, 3 along x, y, z; 4, 5, 6 about them")
    edge: Edge | None = None
    point_m: Annotated[tuple[float, float], Field(strict=False)] | None = Field(
        None, description="x and y on the specimen"
    )

    def to_core(self) -> Spring:
        """The core's spring.

        Raises:
            InputError: it has no place, or two.
        """
        return Spring(self.name, self.stiffness, self.direction, self.edge, self.point_m)


class HoldOutIn(RequestModel):
    """What the fits do not see and the result is checked against."""

    points: LongList[Int64] | None = Field(
        None,
        max_length=10_000,
        description="grid points whose FRFs are held out; default: every eighth FRF; []: none",
    )
    band_hz: Band | None = Field(
        None, description="lines held out; those above the fitted band always are"
    )


class InputsIn(CampaignInputs, StructureInputs):
    """How well the laboratory knows what it hands in; what is null here is as the campaign and the
    structure state it.
    """

    def or_as_stated(
        self,
        structure: StructureInputs | None,
        campaign: CampaignInputs,
        window: tuple[float | None, float | None] = (None, None),
    ) -> InputsIn:
        """These inputs where they are stated, else the campaign's and the structure's.

        Args:
            structure: what the structure states.
            campaign: what the campaign states.
            window: rate 1/τ that the FRFs themselves state, and its standard deviation, 1/s.
        """
        combined = {} if structure is None else structure.model_dump(exclude_none=True)
        for stated in (InputsIn.window(*window), campaign, self):
            values = stated.model_dump(exclude_none=True)
            if values.keys() & _WINDOWS:
                combined = {
                    name: value
                    for name, value in combined.items()
                    if not name.startswith("window_")
                }
            combined |= values
        return InputsIn.model_validate(combined)

    @classmethod
    def window(cls, rate: float | None, sd: float | None = None) -> InputsIn:
        """A window's rate and its standard deviation alone, 1/s."""
        return cls.model_validate({"window_rate_per_s": rate, "window_rate_sd_per_s": sd})

    def to_core(self) -> Inputs:
        """The core's inputs."""
        angle, constant = self.fibre_angle_sd_deg, self.window_time_constant_s
        return Inputs(
            length_sd=self.length_sd_m,
            width_sd=self.width_sd_m,
            height_sd=self.height_sd_m,
            thickness_sd=self.thickness_sd_m,
            density_sd=self.density_sd_kg_m3,
            nu_xy_sd=self.nu_xy_sd,
            fibre_angle_sd=None if angle is None else math.radians(angle),
            ply_angle_sd=(
                None if self.ply_angle_sd_deg is None else math.radians(self.ply_angle_sd_deg)
            ),
            clamp_compliance_sd=self.clamp_compliance_sd,
            sensor_mass_sd=self.sensor_mass_sd_kg,
            delay_sd=self.channel_delay_sd_s,
            window_rate=self.window_rate_per_s if constant is None else 1 / constant,
            window_rate_sd=self.window_rate_sd_per_s or 0.0,
        )


OF_CONSTANTS = {
    "length_sd_m": "length",
    "width_sd_m": "width",
    "height_sd_m": "height",
    "thickness_sd_m": "thickness",
    "density_sd_kg_m3": "density",
    "nu_xy_sd": "nu_xy",
    "fibre_angle_sd_deg": "fibre_angle",
    "ply_angle_sd_deg": "ply_angle",
}
"""Members of the inputs that are of constants of a body, and what the core calls each."""

_WINDOWS = {"window_rate_per_s", "window_time_constant_s"}


class IdentificationRecipeIn(PolesIn, RequestModel):
    """How an update identifies modes where it is given none; `{}` will do."""

    include_doubtful: bool = Field(
        True,
        description=(
            "use the uncertain poles, from probability 0.1 on, too; each is weighed by its"
            " probability"
        ),
    )


class RecipeIn(RequestModel):
    """How to use a campaign; `{}` will do for a first look."""

    model_config = example()

    method: Literal["two_stage", "joint"] = Field(
        "two_stage",
        description="joint: constants and damping together from the FRFs, without modes",
    )
    mode_set: Id | None = Field(
        None, description="measured modes; without it they are identified from the FRFs"
    )
    identification: IdentificationRecipeIn = IdentificationRecipeIn(
        band_hz=None, highest_order=40, most_modes=100, threshold=0.9, include_doubtful=True
    )
    springs: list[SpringIn] = Field(
        default_factory=list, max_length=20, description="elastic supports of the specimen"
    )
    zones_m: list[float] = Field(
        default_factory=list,
        max_length=12,
        description=(
            "x in m of lines between zones whose stiffness may have changed by a factor each: the"
            " parameters zone_1, zone_2, …, nearly all expected to be 1"
        ),
    )
    junctions: Literal["on", "off"] = Field(
        "on",
        description=(
            "of a body in space: `off` updates it as a solver has it, walls joined at their middle"
            " surfaces without a model of the joint, and takes an error of 1.6 % of a frequency for"
            " that"
        ),
    )
    parameters: list[ParameterIn] | None = Field(
        None,
        max_length=20,
        description=(
            "default: Ex, Ey, Gxy, Gxz, and Gyz tied to Gxz, nominal ± 30 %; of a laminate that"
            " couples bending with twisting or membrane forces: E1, E2, G12, G13, and G23 tied"
            " to G13"
        ),
    )
    prior_from_coupon_batch: Id | None = Field(
        None,
        description=(
            "means and spreads of the constants that the batch gives, where the recipe states none"
        ),
    )
    processing: ProcessingIn = Field(
        default_factory=lambda: ProcessingIn.model_validate({}),
        description="how time blocks become FRFs, where the campaign has time blocks and no FRFs",
    )
    use_shapes: bool = Field(
        False, description="fit the mode shapes too, not the frequencies alone"
    )
    damping_models: list[DampingModel] = Field(
        list(DEFAULT_LAWS),
        min_length=1,
        max_length=len(LAWS),
        description=(
            "laws to rank; the first one's coefficients are reported as parameters. Those by"
            " mechanism damp the shares of strain energy: eta_E and eta_G (loss factors), b_E and"
            " b_G (viscous), one for each modulus, or the springs' own"
        ),
    )
    weighting: Weighting = "noise"
    band_hz: Band | None = Field(
        None, description="lines of the damping update; default: past the highest mode"
    )
    hold_out: HoldOutIn = HoldOutIn(points=None, band_hz=None)
    reference_temperature_c: float | None = Field(
        None,
        gt=-273.15,
        le=1000,
        description=(
            "temperature at which the constants are asked for; default: that of the campaign, or 23"
            " where campaigns of a joint update have several"
        ),
    )
    inputs: InputsIn = Field(
        default_factory=lambda: InputsIn.model_validate({}),
        description=(
            "what the laboratory does not know exactly; null members are as campaign and structure"
            " state them"
        ),
    )
    posterior: Literal["laplace", "mcmc"] = Field(
        "laplace", description="Gaussian, or sampled with emcee"
    )
    seed: int = Field(0, ge=0, le=2**32 - 1)

    def parameters_of(self, body: Body) -> tuple[Parameter, ...]:
        """The recipe's parameters, or what is updated of such a body when a recipe names none."""
        return self.to_core().parameters or body.default_parameters()

    def to_core(self) -> core.Recipe:
        """The recipe as the core takes it; priors of a coupon batch are put in by who loads the
        batch.

        Raises:
            InputError: the identification's band is empty.
        """
        with within("identification"):
            identification = self.identification.options()
        return core.Recipe(
            method=self.method,
            parameters=(
                None
                if self.parameters is None
                else tuple(Parameter(**parameter.model_dump()) for parameter in self.parameters)
            ),
            use_shapes=self.use_shapes,
            damping_models=tuple(self.damping_models),
            weighting=self.weighting,
            band_hz=self.band_hz,
            hold_out=core.HoldOut(
                None if self.hold_out.points is None else tuple(self.hold_out.points),
                self.hold_out.band_hz,
            ),
            posterior=self.posterior,
            seed=self.seed,
            identification=identification,
            include_doubtful=self.identification.include_doubtful,
            reference_temperature_c=self.reference_temperature_c,
        )


USUAL = RecipeIn.model_validate({})
"""What is done where nobody states a recipe."""


class UpdateJobOut(JobOut):
    """An update job: how far it is, or what became of it."""

    campaign_id: UUID
    campaign_name: str
    structure_version_id: UUID
    recipe: RecipeIn
    priority: int


class BatchJobIn(RequestModel):
    """One update of a batch."""

    campaign_id: Id
    recipe: RecipeIn | None = Field(None, description="default: the batch's recipe")
    specimen: Name | None = Field(
        None,
        description=(
            "of a joint update: campaigns of one specimen share its dimensions; default: the"
            " structure"
        ),
    )
    angle_deg: float | None = Field(
        None,
        ge=-360,
        le=360,
        description=(
            "of a joint update: of the material's x axis from the specimen's; default: that of a"
            " laminate whose plies lie alike, else 0"
        ),
    )


class UpdateBatchIn(RequestModel):
    """Updates to queue together, or one joint update of campaigns of one material."""

    model_config = example(
        jobs=[{"campaign_id": SOME_ID}, {"campaign_id": SOME_ID, "recipe": {"seed": 1}}],
        recipe={"damping_models": [DEFAULT_LAWS[0]]},
    )

    recipe: RecipeIn | None = Field(
        None, description="of the jobs that have none of their own; default: {}"
    )
    jobs: list[BatchJobIn] = Field(min_length=1, max_length=1000)
    joint: bool = Field(
        False,
        description=(
            "one posterior of the material from all campaigns: its constants are shared; geometry,"
            " density and angle are each specimen's own, the length and the clamp each campaign's"
        ),
    )
    scatter: float | None = Field(
        None,
        ge=0,
        le=1,
        description=(
            "of a joint update: scale of the moduli's scatter between specimens; default 0.02; 0:"
            " none"
        ),
    )
    coupon_batches: list[Id] = Field(
        default_factory=list,
        max_length=20,
        description="of a joint update: coupons of the same material, as data",
    )


class JointCampaignOut(StrictModel):
    """One campaign of a joint update, with the structure's version that it is computed with."""

    campaign_id: UUID
    structure_version_id: UUID


class JointUpdateOut(JobOut):
    """A joint update: how far it is, or what became of it. Its result is at
    `/joint-updates/{id}/result`.
    """

    project_id: UUID
    campaigns: list[JointCampaignOut]
    request: dict[str, Any]
    priority: int


class UpdateBatchOut(StrictModel):
    """The jobs of a batch, in its order; or the joint update, and no items."""

    items: list[UpdateJobOut]
    joint: JointUpdateOut | None = None
