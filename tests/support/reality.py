"""What laboratories send, read as a worker reads it, and identified as a campaign of it is."""

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fecore.frf import Dof, FrfSet, Quantity
from fecore.modal import Identification, identify
from service.compute.frf_rows import EncodedFrf
from service.platform.errors import Fault, Invalid
from service.tasks.import_file.compute import Kept, ReadingInputs, read_upload
from tests.support.places import shared_file


def reality(name: str) -> Path:
    return shared_file("REALITY", "reality", name)


def kept(
    path: Path, mapping: Any = None, *, quantity: Quantity | None = None, dry_run: bool = False
) -> list[Kept]:
    """All that is kept of a file; the first is what the file is."""
    inputs = ReadingInputs(path, quantity, path.name, mapping=mapping, dry_run=dry_run)
    return list(read_upload(inputs, lambda *_: None))


def refused(
    content: bytes, path: Path, quantity: Quantity | None = None, **how: Any
) -> list[Fault]:
    """Why the content of a file is refused, which is written there; `how` as `ReadingInputs`."""
    path.write_bytes(content)
    with pytest.raises(Invalid) as caught:
        list(read_upload(ReadingInputs(path, quantity, **how), lambda *_: None))
    return caught.value.faults


def frfs_in(items: Sequence[Kept]) -> list[EncodedFrf]:
    return [item for item in items if isinstance(item, EncodedFrf)]


def values_of(frf: EncodedFrf) -> np.ndarray:
    return np.frombuffer(frf.spectrum.data, frf.spectrum.dtype)


def lines_of(frf: EncodedFrf) -> np.ndarray:
    axis = frf.axis
    return (
        axis.start_hz + axis.step_hz * np.arange(axis.count)
        if axis.lines is None
        else np.frombuffer(axis.lines)
    )


def sets_of(items: Sequence[Kept]) -> list[FrfSet]:
    """The FRFs by quantity and lines."""

    def kind(frf: EncodedFrf) -> tuple[str, float, float, int]:
        return frf.quantity, frf.axis.start_hz, frf.axis.step_hz, frf.axis.count

    return [
        FrfSet(
            lines_of(group[0]),
            np.array([values_of(frf) for frf in group]),
            tuple(Dof(frf.response_point, frf.response_direction) for frf in group),
            tuple(Dof(frf.reference_point, frf.reference_direction) for frf in group),
            group[0].quantity,
        )
        for group in (list(each) for _, each in groupby(sorted(frfs_in(items), key=kind), key=kind))
    ]


def identified(items: Sequence[Kept]) -> Identification:
    return identify(sets_of(items))
