"""What a client gets about recordings of responses."""

from datetime import datetime
from typing import Any
from uuid import UUID

from pydantic import Field

from fecore.frf import Quantity
from fecore.signal import ChannelQuantity
from fecore.signal.block_spectra import Motion
from service.platform.web import StrictModel


class RecordedChannel(StrictModel):
    """A sensor of a recording."""

    variable: str = Field(description="its name in the file")
    quantity: ChannelQuantity
    point: int
    direction: int
    sensitivity: float = Field(description="by which samples of the file are divided for SI")
    full_scale: float | None = Field(description="SI; null where it is not known")


class SensorOut(StrictModel):
    """Where and along what a sensor measured, in the file's coordinates."""

    point: int
    direction: int


class SpectraOut(StrictModel):
    """Half spectra of a recording, without their values."""

    processing_id: UUID
    quantity: Motion | Quantity = Field(
        description="the highest derivative that a sensor measured, or what the FRFs are"
    )
    references: list[SensorOut] = Field(description="that all sensors are correlated with")
    lag_s: float = Field(description="longest lag of the correlations")
    length_s: float = Field(description="of the recording that was used")
    start_hz: float
    end_hz: float
    lines: int
    sha256: str
    created_at: datetime


class DeflectionOf(SensorOut):
    """What one sensor does."""

    real: float
    imag: float


class DeflectionOut(StrictModel):
    """An operating deflection shape: what all sensors of a recording do together at a line."""

    frequency_hz: float = Field(description="of the line, the nearest to the one asked for")
    reference: SensorOut = Field(description="whose phase is 0")
    unit: str
    shape: list[DeflectionOf]


class TransmissibilityOut(StrictModel):
    """What N responses do for each unit of R references, at L lines; all of the highest derivative
    that a sensor measured.
    """

    frequency_hz: list[float] = Field(description="lines at which the references differ")
    responses: list[SensorOut] = Field(description="N, in the order of the rows")
    references: list[SensorOut] = Field(description="R, in the order of the columns")
    real: list[list[list[float]]] = Field(description="N × R × L")
    imag: list[list[list[float]]] = Field(description="N × R × L")
    variance: list[list[list[float]]] = Field(
        description="N × R × L, of the complex value; half of it in each part"
    )
    coherence: list[list[float]] = Field(description="N × L, multiple coherence")
    averages: float = Field(description="independent segments")
    warnings: list[str]


class RecordingOut(StrictModel):
    """A recording of responses to loads that nobody measured; its samples stay in the file."""

    id: UUID
    campaign_id: UUID
    import_id: UUID
    filename: str
    format: str
    mapping: dict[str, Any] = Field(description="by which the file is read")
    sample_rate_hz: float
    samples: int = Field(description="of each channel")
    length_s: float = Field(description="how long it is")
    channels: list[RecordedChannel] = Field(description="one of each sensor")
    file_sha256: str = Field(description="of the file's bytes")
    bytes_deleted_at: datetime | None = Field(
        None, description="when the retention rule deleted its file; null where it is there"
    )
    spectra: SpectraOut | None = Field(description="null until a processing has made them")
    created_at: datetime
