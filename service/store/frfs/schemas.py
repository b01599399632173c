"""What a client sends and gets about FRFs; the spectra themselves are in `frf_formats`."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Self
from uuid import UUID

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from fecore.frf import Quantity
from service.store.campaigns.schemas import Point
from service.web import StrictModel, Text

Direction = Annotated[int, Field(ge=-6, le=6, description="±1 … ±3 along x, y, z, ±4 … ±6 about them")]
UNITS: dict[Quantity, str] = {"accelerance": "m/s²/N", "mobility": "m/s/N", "receptance": "m/N"}


class FrfOut(StrictModel):
    """An FRF without its spectrum."""

    id: UUID
    campaign_id: UUID
    import_id: UUID | None = Field(description="the import that it came with; null where a script posted it")
    dataset: int | None = Field(description="number of the dataset in the file")
    label: str
    response_point: int
    response_direction: int
    reference_point: int
    reference_direction: int
    quantity: Quantity
    unit: str
    averages: int | None
    lines: int
    start_hz: float
    end_hz: float
    step_hz: float | None = Field(description="null where the axis is uneven")
    dtype: str = Field(description="precision that the file had: complex64 or complex128")
    sha256: str = Field(description="of the spectrum's little-endian bytes")
    has_coherence: bool
    processing_id: UUID | None = Field(None, description="the processing of time blocks that made it")
    window_rate_per_s: float | None = Field(
        None, description="rate of the exponential window that it carries: every decay rate is larger by this"
    )
    created_at: datetime


class FrfIn(StrictModel):
    """One FRF of a script."""

    response_point: Point
    response_direction: Direction
    reference_point: Point
    reference_direction: Direction
    real: list[float]
    imag: list[float]
    coherence: list[float] | None = None
    averages: int | None = Field(None, ge=1, le=1_000_000)
    label: Text = Field("", max_length=200)

    @model_validator(mode="after")
    def _as_long(self) -> Self:
        if len(self.real) != len(self.imag):
            raise PydanticCustomError(
                "length", "real has {r} values, imag has {i}", {"r": len(self.real), "i": len(self.imag)}
            )
        return self


class FrfsIn(StrictModel):
    """FRFs of a script, on one frequency axis."""

    quantity: Quantity
    frequency_hz: list[float] = Field(min_length=1)
    frfs: list[FrfIn] = Field(min_length=1, max_length=10_000)
