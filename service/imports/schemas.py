"""What a client gets about imports."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal
from uuid import UUID

from pydantic import Field

from fecore.frf import Quantity
from service.web import StrictModel


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
    records: int = Field(0, description="time blocks of hammer hits")


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
