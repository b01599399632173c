"""What a client sends and gets about campaigns, grid points and imports."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal, Self
from uuid import UUID

from pydantic import Field, JsonValue, field_validator, model_validator
from pydantic_core import PydanticCustomError

from fecore.errors import InputError
from fecore.frf import Quantity
from service.campaigns.frame import make_frame
from service.problems import Name, StrictModel, Text, Time, example

Boundary = Literal["cantilever", "free", "simply_supported"]
Point = Annotated[int, Field(ge=1, le=9_999_999_999, description="label of a grid point")]
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6, description="m")]
Vector = tuple[Coordinate, Coordinate, Coordinate]


class FrameIn(StrictModel):
    """Where the file's coordinates put the specimen: origin and unit axes of the specimen, in the file's coordinates."""

    origin_m: Vector = (0.0, 0.0, 0.0)
    x_axis: Vector = (1.0, 0.0, 0.0)
    y_axis: Vector = (0.0, 1.0, 0.0)

    @model_validator(mode="after")
    def _orthonormal(self) -> Self:
        try:
            make_frame(self.origin_m, self.x_axis, self.y_axis)
        except InputError as error:
            raise PydanticCustomError("not_orthonormal", "{why}", {"why": str(error)}) from None
        return self


class Instruments(StrictModel):
    """What was measured with. A sensor of a mass but no point stood where all responses are, or moved with them."""

    hammer: dict[str, JsonValue] = Field(default_factory=dict, max_length=100)
    sensor: dict[str, JsonValue] = Field(default_factory=dict, max_length=100)
    analyser: dict[str, JsonValue] = Field(default_factory=dict, max_length=100)
    sensor_mass_kg: float | None = Field(
        default=None, ge=0, le=1000, description="kg; 0 for a sensor that does not touch"
    )
    sensor_point: Point | None = Field(
        default=None, description="grid point where the sensor sits; none where it moves with the response"
    )


class CampaignIn(StrictModel):
    """A campaign as a client describes it."""

    model_config = example(name="March", boundary="cantilever", performed_at="2026-03-02T09:30:00Z", temperature_c=21.5)

    name: Name
    boundary: Boundary
    performed_at: Time | None = None
    temperature_c: float | None = Field(None, gt=-273.15, le=1000)
    humidity_percent: float | None = Field(None, ge=0, le=100)
    instruments: Instruments = Instruments()
    frame: FrameIn | None = None
    notes: Text = Field("", max_length=10_000)


class CampaignPatch(StrictModel):
    """Members to change; a member that may be unknown is cleared with null."""

    model_config = example(temperature_c=20.5)

    name: Name | None = None
    boundary: Boundary | None = None
    performed_at: Time | None = None
    temperature_c: float | None = Field(None, gt=-273.15, le=1000)
    humidity_percent: float | None = Field(None, ge=0, le=100)
    instruments: Instruments | None = None
    frame: FrameIn | None = None
    notes: Text | None = Field(None, max_length=10_000)

    @field_validator("name", "boundary", "instruments", "notes")
    @classmethod
    def _not_null(cls, value: Any) -> Any:
        if value is None:
            raise PydanticCustomError("null", "cannot be null; leave it out to keep it")
        return value


class CampaignOut(StrictModel):
    """A campaign."""

    id: UUID
    structure_id: UUID
    name: str
    boundary: Boundary
    performed_at: datetime | None
    temperature_c: float | None
    humidity_percent: float | None
    instruments: Instruments
    frame: FrameIn
    notes: str
    created_at: datetime
    updated_at: datetime
    deleted_at: datetime | None


class GridPoint(StrictModel):
    """A measurement point in the file's coordinates."""

    label: Point
    x_m: Coordinate
    y_m: Coordinate
    z_m: Coordinate = 0.0


class GridPoints(StrictModel):
    """All points of a campaign."""

    items: list[GridPoint] = Field(max_length=1_000_000)

    @field_validator("items")
    @classmethod
    def _labels_once(cls, items: list[GridPoint]) -> list[GridPoint]:
        seen: set[int] = set()
        for i, point in enumerate(items):
            if point.label in seen:
                raise PydanticCustomError(
                    "twice", "point {label} is there twice, again as item {i}", {"label": point.label, "i": i}
                )
            seen.add(point.label)
        return items


class DatasetOutcome(StrictModel):
    """What became of one dataset of the file."""

    number: int = Field(description="1 for the first dataset of the file")
    type: str = Field(description='dataset type: "15", "58", "58b" ...')
    offset: int = Field(description="byte at which the dataset begins")
    outcome: Literal["read", "ignored", "refused"]
    reason: str | None
    notes: list[str] = Field(description="conversions and assumptions made while reading")


class Counts(StrictModel):
    """What an import brought in."""

    frfs: int
    grid_points: int
    modes: int


class ImportOut(StrictModel):
    """A file's way into a campaign."""

    id: UUID
    campaign_id: UUID
    status: Literal["queued", "running", "succeeded", "failed", "cancelled"]
    stage: str | None
    progress: float = Field(description="0 to 1")
    filename: str
    size: int = Field(description="bytes")
    sha256: str
    dry_run: bool
    quantity: Quantity | None
    already_imported: bool = Field(False, description="these bytes are in the campaign already; nothing new was queued")
    counts: Counts | None = Field(description="what was read; null until it succeeded")
    datasets: list[DatasetOutcome]
    warnings: list[str]
    message: str | None
    error: dict[str, Any] | None
    attempt: int
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None
