"""What a client sends and gets about FRFs. Bodies are read in a child process, checked in full, and
left as rows to store.

This module imports no database, since the child imports it.
"""

import pickle
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, Self
from uuid import UUID

import numpy as np
from pydantic import Field, model_validator

from fecore.frf import Quantity
from modalbase.formats.frfs import FrfRow, Frfs
from modalbase.formats.frfs.table import DOFS
from service.compute.frf_rows import COLUMNS, encoded
from service.nouns.campaigns.schemas import Point
from service.platform.errors import Invalid
from service.platform.web import LongList, RequestModel, StrictModel, example, wrong
from service.platform.web.json_body import BULK_VALUES, checked, parse_json

Direction = Annotated[
    int, Field(ge=-6, le=6, description="±1 … ±3 along x, y, z, ±4 … ±6 about them")
]


class FrfOut(StrictModel):
    """An FRF without its spectrum."""

    id: UUID
    campaign_id: UUID
    import_id: UUID | None = Field(
        description="the import that it came with; null where a script posted it"
    )
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
    processing_id: UUID | None = Field(
        None, description="the processing of time blocks that made it"
    )
    superseded_by: UUID | None = Field(
        None, description="the later processing that made it anew, or found no good hit for it"
    )
    window_rate_per_s: float | None = Field(
        None,
        description=(
            "rate of the exponential window that it carries: every decay rate is larger by this"
        ),
    )
    window_rate_sd_per_s: float | None = Field(
        None, description="its standard deviation, where a processing saw it"
    )
    tags: list[str]
    meta: dict[str, Any]
    created_at: datetime


class LabelledFrfs(StrictModel):
    """What became of a set of FRFs."""

    count: int = Field(description="FRFs that have the labels now")


class FrfIn(RequestModel):
    """One FRF of a script."""

    response_point: Point
    response_direction: Direction
    reference_point: Point
    reference_direction: Direction
    real: LongList[float]
    imag: LongList[float]
    coherence: LongList[float] | None = Field(None, description="at each frequency, 0 to 1")
    averages: int | None = Field(None, ge=1, le=1_000_000)
    label: str = Field("", max_length=200)

    @model_validator(mode="after")
    def _as_long(self) -> Self:
        if len(self.real) != len(self.imag):
            raise wrong(f"real has {len(self.real)} values, imag has {len(self.imag)}")
        return self


class FrfsIn(RequestModel):
    """FRFs of a script, on one frequency axis."""

    model_config = example(
        quantity="accelerance",
        frequency_hz=[10.0, 10.5, 11.0],
        frfs=[
            {
                "response_point": 1,
                "response_direction": 3,
                "reference_point": 14,
                "reference_direction": -3,
                "real": [0.1, 0.2, 0.1],
                "imag": [0.0, -0.4, -0.1],
            }
        ],
    )

    quantity: Quantity
    frequency_hz: LongList[float] = Field(min_length=1)
    frfs: LongList[FrfIn] = Field(min_length=1, max_length=10_000)


def write_rows(body: Path, target: Path) -> int:
    """Read a JSON body and write the rows that are to be stored, each a pickled list in the order
    of `COLUMNS`.

    Returns:
        The number of rows.

    Raises:
        Invalid: it cannot be read, or does not hold together; each fault with its pointer.
    """
    count = 0
    with target.open("wb") as file:
        for count, frf in enumerate(encoded(from_json(body.read_bytes())), 1):  # noqa: B007 - the last is the number
            columns = frf.columns()
            pickle.dump([columns[name] for name in COLUMNS], file)
    return count


def from_json(body: bytes) -> Frfs:
    """FRFs of a JSON body `{quantity, frequency_hz, frfs: [{response_point, …, real, imag}]}`.

    Raises:
        Invalid: each fault with its pointer.
    """
    sent = checked(FrfsIn, parse_json(body, most_values=BULK_VALUES))
    lines = len(sent.frequency_hz)
    for i, frf in enumerate(sent.frfs):
        for name in ("real", "coherence"):
            values = getattr(frf, name)
            if values is not None and len(values) != lines:
                raise Invalid(
                    f"/frfs/{i}/{name}", f"has {len(values)} values, frequency_hz has {lines}"
                )
    values = np.array([np.array(frf.real) + 1j * np.array(frf.imag) for frf in sent.frfs])
    coherence = None
    if any(frf.coherence is not None for frf in sent.frfs):
        coherence = np.array(
            [frf.coherence or [np.nan] * lines for frf in sent.frfs], dtype=np.float64
        )
    rows = tuple(
        FrfRow.between([getattr(f, key) for key in DOFS], f.label, f.averages) for f in sent.frfs
    )
    return Frfs(np.array(sent.frequency_hz), values, rows, sent.quantity, coherence)
