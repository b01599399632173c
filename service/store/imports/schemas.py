"""What a client gets about imports."""

from __future__ import annotations

from typing import Any, Literal
from uuid import UUID

from pydantic import Field

from fecore.frf import Quantity
from modalbase.formats.recognise import Format
from service.compute.arrays_of_files import Kind
from service.jobs.state import JobOut
from service.store.records.schemas import Proposal
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
    """A file's way into a campaign, whatever its format."""

    campaign_id: UUID
    filename: str
    size: int = Field(description="bytes")
    sha256: str
    dry_run: bool
    quantity: Quantity | None
    format: Format | None = Field(description="by what is in the file; null until that was read")
    kind: Kind | None = Field(
        description="what an npz, .mat, CSV or wav holds, as stated or found; null of UFF, which may hold both"
    )
    mapping: Any = Field(description="which variable is what, as it was stated")
    found: Proposal | None = Field(description="arrays of an npz, .mat, CSV or wav, and a mapping that suggests itself")
    already_imported: bool = Field(False, description="these bytes are in the campaign already; nothing new was queued")
    counts: Counts | None = Field(description="what was read; null until it succeeded")
    datasets: list[DatasetOutcome]
    warnings: list[str]
