"""What a client gets about imports."""

from __future__ import annotations

from typing import Literal
from uuid import UUID

from pydantic import Field

from fecore.frf import Quantity
from service.jobs.state import JobOut
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


class ImportOut(JobOut):
    """A file's way into a campaign."""

    campaign_id: UUID
    filename: str
    size: int = Field(description="bytes")
    sha256: str
    dry_run: bool
    quantity: Quantity | None
    already_imported: bool = Field(False, description="these bytes are in the campaign already; nothing new was queued")
    counts: Counts | None = Field(description="what was read; null until it succeeded")
    datasets: list[DatasetOutcome]
    warnings: list[str]
