"""What a client sends and gets about campaigns, grid points and imports."""

from datetime import datetime
from typing import Annotated, Any, Literal, Self, TypeVar
from uuid import UUID

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, model_validator

from fecore.errors import InputError
from fecore.updating.inputs import SOFTEST_CLAMP
from service.compute.frame import make_frame
from service.nouns.campaigns.climate import (
    MOST_COVARIATES,
    Climate,
    Covariates,
    Values,
    climate_apart,
)
from service.nouns.structures.schemas import Deviation
from service.platform.web import (
    LongList,
    Name,
    RequestModel,
    StrictModel,
    Text,
    Time,
    example,
    not_null,
    wrong,
)
from service.platform.web.bodies import Details, Meta, Tags, whole
from service.platform.web.quantities import SENSOR_MASS

Boundary = Literal["cantilever", "free", "simply_supported", "as_modelled"]
Point = Annotated[
    int,
    Field(ge=1, le=9_999_999_999, description="label of a grid point"),
    BeforeValidator(whole),
]
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6, description="m")]
Vector = Annotated[tuple[Coordinate, Coordinate, Coordinate], Field(strict=False)]


class FrameIn(RequestModel):
    """Where the file's coordinates put the specimen: origin and unit axes of the specimen, in the
    file's coordinates.
    """

    origin_m: Vector = (0.0, 0.0, 0.0)
    x_axis: Vector = (1.0, 0.0, 0.0)
    y_axis: Vector = (0.0, 1.0, 0.0)

    @model_validator(mode="after")
    def _orthonormal(self) -> Self:
        try:
            make_frame(self.origin_m, self.x_axis, self.y_axis)
        except InputError as error:
            raise wrong(str(error)) from None
        return self


class AddedMass(RequestModel):
    """A mass that was put on the specimen to be known, such as a nut glued to its tip."""

    x_m: Coordinate = Field(description="m, on the specimen, from its end x = 0")
    y_m: Coordinate = Field(0.0, description="m, from its centre line")
    z_m: Coordinate = Field(
        0.0,
        description="m, on the surface of a body in space; of a strip or plate it does not count",
    )
    mass_kg: float = Field(gt=0, le=1000)
    rotary_inertia_kg_m2: float = Field(
        0.0, ge=0, le=1000, description="about x and y through its place; 0: a point"
    )


class SensorAt(RequestModel):
    """A sensor that stood at some of the grid points."""

    model: str = Field("", max_length=200)
    serial: str = Field("", max_length=200)
    points: LongList[Point] = Field(
        min_length=1, max_length=10_000, description="where it measured responses"
    )


class Instruments(RequestModel):
    """What was measured with. A sensor of a mass but no point stood where all responses are, or
    moved with them.
    """

    hammer: Details = Field(default_factory=dict, max_length=100)
    sensor: Details = Field(default_factory=dict, max_length=100)
    analyser: Details = Field(default_factory=dict, max_length=100)
    sensors: list[SensorAt] = Field(
        default_factory=list,
        max_length=1000,
        description="where others than `sensor` measured the responses",
    )
    sensor_mass_kg: Annotated[float, SENSOR_MASS] | None = Field(
        default=None, ge=0, le=1000, description="kg; 0 for a sensor that does not touch"
    )
    sensor_point: Point | None = Field(
        default=None,
        description="grid point where the sensor sits; none where it moves with the response",
    )
    added_masses: list[AddedMass] = Field(
        default_factory=list,
        max_length=100,
        description="what the specimen carried besides the sensor, weighed",
    )


class CampaignInputs(StrictModel):
    """How well is known what a test was done with: standard deviations. null: a careful
    laboratory's; 0: exactly known.
    """

    clamp_compliance_sd: Deviation = Field(
        None, description="of EI/kL of a clamped edge, 1 at most; half-normal"
    )
    sensor_mass_sd_kg: Deviation = Field(
        None, description="where no sensor is stated: half-normal; null is 1 g there"
    )
    channel_delay_sd_s: Deviation = Field(
        None, description="of the delay between response and force"
    )
    window_rate_per_s: Deviation = Field(
        None,
        description=(
            "1/τ of an exponential window exp(-t/τ) on the response; 0: there was none; null: what"
            " the FRFs state, or nobody knows"
        ),
    )
    window_time_constant_s: float | None = Field(
        None,
        gt=0,
        le=1e9,
        description="τ of that window, where the analyser states it in place of the rate",
    )
    window_rate_sd_per_s: Deviation = Field(
        None, description="of a stated window's rate; null is 0"
    )

    @model_validator(mode="after")
    def _one_window(self) -> Self:
        if self.window_rate_per_s is not None and self.window_time_constant_s is not None:
            raise wrong("state window_rate_per_s or window_time_constant_s, not both")
        return self


class StatedInputs(CampaignInputs, RequestModel):
    """The same as a client states it; earlier versions took a clamp that is none."""

    clamp_compliance_sd: float | None = Field(
        None, ge=0, le=SOFTEST_CLAMP, description="of EI/kL of a clamped edge; half-normal"
    )


class _Performed(StrictModel):
    name: Name
    boundary: Boundary
    performed_at: Time | None = None


class CampaignIn(Covariates, Climate, _Performed, RequestModel):
    """A campaign as a client describes it."""

    model_config = example(
        name="March", boundary="cantilever", performed_at="2026-03-02T09:30:00Z", temperature_c=21.5
    )

    instruments: Instruments = Instruments.model_construct()  # nothing stated, and nothing to check
    frame: FrameIn | None = None
    inputs: StatedInputs | None = Field(
        None, description="window, and how well clamp, sensor and channels are known"
    )
    notes: Text = ""
    tags: Tags = Field([])
    meta: Meta = Field({})


class _PerformedPatch(StrictModel):
    name: Name | None = None
    boundary: Boundary | None = None
    performed_at: Time | None = None


class CampaignPatch(Climate, _PerformedPatch, RequestModel):
    """Members to change; a member that may be unknown is cleared with null."""

    model_config = example(temperature_c=20.5)

    instruments: Instruments | None = None
    frame: FrameIn | None = None
    inputs: StatedInputs | None = None
    covariates: Values | None = Field(
        None,
        max_length=MOST_COVARIATES,
        description="all of them: they take the place of those before",
    )
    notes: Text | None = None
    tags: Tags | None = None
    meta: Meta | None = None

    _never_null = not_null("name", "boundary", "instruments", "covariates", "notes", "tags", "meta")

    @model_validator(mode="before")
    @classmethod
    def _climate_among_them(cls, data: Any) -> Any:
        return climate_apart(data)


class _PerformedOut(StrictModel):
    id: UUID
    structure_id: UUID
    name: str
    boundary: Boundary
    performed_at: datetime | None


class CampaignOut(Covariates, Climate, _PerformedOut):
    """A campaign."""

    model_config = ConfigDict(json_schema_serialization_defaults_required=True)

    instruments: Instruments
    frame: FrameIn
    inputs: CampaignInputs
    notes: str
    tags: list[str]
    meta: dict[str, Any]
    created_at: datetime
    updated_at: datetime
    deleted_at: datetime | None


class GridPoint(RequestModel):
    """A measurement point in the file's coordinates."""

    label: Point
    x_m: Coordinate
    y_m: Coordinate
    z_m: Coordinate = 0.0


Labelled = TypeVar("Labelled", bound=GridPoint)


def labels_once(points: list[Labelled]) -> list[Labelled]:
    """The points, none of which has the label of another.

    Raises:
        PydanticCustomError: one has.
    """
    seen: set[int] = set()
    for i, point in enumerate(points):
        if point.label in seen:
            raise wrong(f"point {point.label} is there twice, again as item {i}")
        seen.add(point.label)
    return points


class GridPoints(RequestModel):
    """All points of a campaign."""

    model_config = example(
        items=[
            {"label": 1, "x_m": 0.1, "y_m": -0.018},
            {"label": 2, "x_m": 0.3, "y_m": 0.018},
            {"label": 14, "x_m": 0.48, "y_m": -0.018},
        ]
    )

    items: Annotated[LongList[GridPoint], AfterValidator(labels_once)] = Field(max_length=1_000_000)


class GridPointsPage(GridPoints):
    """All points of a campaign, or a page of them where a limit is stated."""

    next_cursor: str | None = Field(
        None, description="of a page; left out where all points are there at once"
    )
