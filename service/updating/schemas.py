"""Recipes as clients send them, and update jobs as they see them. Every recipe field is optional."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from typing import Annotated, Any, Literal
from uuid import UUID

from pydantic import Field

from fecore.specimen import CONSTANTS, Specimen
from fecore.supports import Edge, Spring
from fecore.updating import recipe as core
from fecore.updating.misfit import Weighting
from fecore.updating.parameters import DEFAULT_PARAMETERS, Parameter
from service.problems import Int64, Name, StrictModel, example

DampingModel = Literal["rayleigh", "caughey3", "caughey4", "generalised", "modal"]
Frequency = Annotated[float, Field(ge=0, le=1e7, description="Hz")]
Band = tuple[Frequency, Frequency]


class ParameterIn(StrictModel):
    """A constant to update; SI. Without a mean the structure's nominal value, without a spread 30 % of the mean."""

    name: Name = Field(description=f"{', '.join(CONSTANTS)}, or the name of one of the recipe's springs")
    prior_mean: float | None = None
    prior_sd: float | None = None
    fixed: bool = False
    tied_to: Name | None = Field(None, description="follows that parameter in the ratio of the nominal values")


class SpringIn(StrictModel):
    """An elastic support, which a parameter of the same name updates; it adds to the campaign's boundary."""

    name: Name
    stiffness: float = Field(gt=0, le=1e18, description="N/m or N·m/rad at a point; per metre of edge on an edge")
    direction: int = Field(ge=1, le=6, description="1, 2, 3 along x, y, z; 4, 5, 6 about them")
    edge: Edge | None = None
    point_m: tuple[float, float] | None = Field(None, description="x and y on the specimen")

    def to_core(self) -> Spring:
        """The core's spring.

        Raises:
            InputError: it has no place, or two.
        """
        return Spring(self.name, self.stiffness, self.direction, self.edge, self.point_m)


class HoldOutIn(StrictModel):
    """What the fits do not see and the result is checked against."""

    points: list[Int64] | None = Field(
        None, max_length=10_000, description="grid points whose FRFs are held out; default: every eighth FRF; []: none"
    )
    band_hz: Band | None = Field(None, description="lines held out; those above the fitted band always are")


class RecipeIn(StrictModel):
    """How to use a campaign; `{}` will do for a first look."""

    model_config = example()

    method: Literal["two_stage", "joint"] = Field(
        "two_stage", description="joint: constants and damping together from the FRFs, without modes"
    )
    mode_set: UUID | None = Field(None, description="measured modes; without it they are identified from the FRFs")
    springs: list[SpringIn] = Field(default_factory=list, max_length=20, description="elastic supports of the specimen")
    parameters: list[ParameterIn] | None = Field(
        None, max_length=20, description="default: Ex, Ey, Gxy, Gxz, and Gyz tied to Gxz, nominal ± 30 %"
    )
    prior_from_coupon_batch: UUID | None = Field(
        None, description="means and spreads of the constants that the batch gives, where the recipe states none"
    )
    use_shapes: bool = Field(False, description="fit the mode shapes too, not the frequencies alone")
    damping_models: list[DampingModel] = Field(
        ["rayleigh", "caughey3", "caughey4", "generalised", "modal"],
        min_length=1,
        max_length=10,
        description="laws to rank; the first one's coefficients are reported as parameters",
    )
    weighting: Weighting = "noise"
    band_hz: Band | None = Field(None, description="lines of the damping update; default: past the highest mode")
    hold_out: HoldOutIn = HoldOutIn(points=None, band_hz=None)
    posterior: Literal["laplace", "mcmc"] = Field("laplace", description="Gaussian, or sampled with emcee")
    seed: int = Field(0, ge=0, le=2**32 - 1)

    def supported(self, specimen: Specimen) -> Specimen:
        """The specimen with the recipe's elastic supports."""
        return replace(specimen, springs=tuple(spring.to_core() for spring in self.springs))

    def to_core(self) -> core.Recipe:
        """The recipe as the core takes it; priors of a coupon batch are put in by who loads the batch."""
        return core.Recipe(
            method=self.method,
            parameters=DEFAULT_PARAMETERS
            if self.parameters is None
            else tuple(Parameter(**parameter.model_dump()) for parameter in self.parameters),
            use_shapes=self.use_shapes,
            damping_models=tuple(self.damping_models),
            weighting=self.weighting,
            band_hz=self.band_hz,
            hold_out=core.HoldOut(
                None if self.hold_out.points is None else tuple(self.hold_out.points), self.hold_out.band_hz
            ),
            posterior=self.posterior,
            seed=self.seed,
        )


class UpdateJobOut(StrictModel):
    """An update job: how far it is, or what became of it."""

    id: UUID
    campaign_id: UUID
    structure_version_id: UUID
    recipe: RecipeIn
    status: Literal["queued", "running", "succeeded", "failed", "cancelled"]
    stage: str | None
    progress: float
    attempt: int
    priority: int
    message: str | None
    error: dict[str, Any] | None
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None
