"""FRFs that were read, checked in full, as rows of the database.

This module imports neither database nor web, since the child imports it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from fecore.arrays import FloatArray
from fecore.errors import InputError
from fecore.frf import Dof, FrfSet, Quantity
from modalbase.formats.frfs import Frfs
from modalbase.formats.frfs.table import DOFS
from service.compute.spectra import FrequencyAxis, Spectrum, encode, encode_axis
from service.platform.errors import Invalid

MOST_FRFS = 10_000  # of one body: each is a row of the answer

COLUMNS = (
    *("label", *DOFS, "quantity", "averages", "start_hz", "end_hz", "step_hz", "axis"),
    *("dtype", "lines", "data", "sha256", "coherence", "coherence_dtype", "coherence_sha256"),
)
"""What a row says of an FRF."""


@dataclass(frozen=True)
class EncodedFrf:
    """An FRF of a file as it is stored; encoded in the child, where is a processor to spare."""

    dataset: int | None  # number of the dataset of a UFF file
    label: str  # free text, the first ID line of a UFF file
    # response_point, response_direction, reference_point, reference_direction: its degrees of
    # freedom
    response_point: int
    response_direction: int
    reference_point: int
    reference_direction: int
    quantity: Quantity  # accelerance, mobility or receptance
    axis: FrequencyAxis  # frequency lines
    spectrum: Spectrum  # SI values with their SHA-256
    averages: int | None = None  # number of averages, None where it is not known
    coherence: Spectrum | None = None  # γ² where it came with the FRF

    @property
    def size(self) -> int:
        """Bytes that are stored of it."""
        parts = (
            self.spectrum.data,
            self.axis.lines,
            None if self.coherence is None else self.coherence.data,
        )
        return sum(len(part) for part in parts if part is not None)

    def columns(self) -> dict[str, Any]:
        """The values of `COLUMNS`, and `dataset`."""
        return {
            **vars(self),
            **self.axis.columns(),
            **self.spectrum.columns(),
            **coherence_columns(self.coherence),
        }


def encoded(frfs: Frfs) -> Iterator[EncodedFrf]:
    """FRFs of one axis as they are stored, one at a time.

    Raises:
        Invalid: they are too many or do not hold together, before anything is yielded.
    """
    if len(frfs.frfs) > MOST_FRFS:
        raise Invalid(
            "",
            f"holds {len(frfs.frfs)} FRFs, at most {MOST_FRFS} are taken at a time; send several"
            " bodies",
        )
    _require_consistent(frfs)
    axis = encode_axis(frfs.frequency_hz)
    for row, values, coherence in frfs.both():
        yield EncodedFrf(
            dataset=None,
            label=row.label,
            **{name: getattr(row, name) for name in DOFS},
            quantity=frfs.quantity,
            axis=axis,
            spectrum=encode(values),
            averages=row.averages,
            coherence=None if coherence is None else encode(coherence),
        )


def coherence_columns(coherence: Spectrum | FloatArray | None) -> dict[str, Any]:
    """A coherence's columns of an FRF's row; empty ones where there is none."""
    if coherence is None:
        return {"coherence": None, "coherence_dtype": None, "coherence_sha256": None}
    spectrum = coherence if isinstance(coherence, Spectrum) else encode(coherence)
    return {
        "coherence": spectrum.data,
        "coherence_dtype": spectrum.dtype,
        "coherence_sha256": spectrum.sha256,
    }


def _require_consistent(frfs: Frfs) -> None:
    """Raise `Invalid` where FRFs do not hold together; the core says what makes a set of FRFs."""
    for name in ("response_point", "reference_point"):
        if not all(1 <= getattr(row, name) <= 9_999_999_999 for row in frfs.frfs):
            raise Invalid(f"/{name}", "a label of a grid point is a number from 1 to 9999999999")
    if frfs.coherence is not None:
        known = frfs.coherence[~np.isnan(frfs.coherence)]
        if (known < 0).any() or (known > 1 + 1e-6).any():
            raise Invalid("/coherence", "lies outside 0 to 1")
    try:
        FrfSet(
            frequency_hz=frfs.frequency_hz,
            values=frfs.values,
            responses=tuple(Dof(row.response_point, row.response_direction) for row in frfs.frfs),
            references=tuple(
                Dof(row.reference_point, row.reference_direction) for row in frfs.frfs
            ),
            quantity=frfs.quantity,
        )
    except InputError as error:
        raise Invalid(f"/{error.field}", error.message) from None
    if not np.isfinite(frfs.frequency_hz).all():
        raise Invalid("/frequency_hz", "holds NaN or infinite lines")
