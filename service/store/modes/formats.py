"""A mode set as a UFF file: grid points (set 2411) and a mode shape a mode (set 55)."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import IO

import numpy as np
from sqlalchemy.orm import Session

from modalbase.formats import uff
from modalbase.formats.uff.write import encode
from service.errors import Conflict
from service.store.campaigns.grid_points import stored_points
from service.store.modes.operations import modes_of, shape_of
from service.store.modes.tables import Mode, ModeSet


def write_uff(session: Session, mode_set: ModeSet, file: IO[bytes]) -> None:
    """Write the file, SI; shapes with 6 digits or more, 0 along axes that were not measured.

    Raises:
        Conflict: a mode has no shape, which set 55 cannot say.
    """
    rows = modes_of(session, [mode_set.id])[mode_set.id]
    bare = [str(row.number) for row in rows if not shape_of(row)]
    if bare:
        raise Conflict(f"mode {', '.join(bare)} has no shape, and set 55 holds nothing else; use ?format=json")
    points: Iterator[uff.Content] = (
        uff.GridPoint(label, xyz) for label, xyz in stored_points(session, mode_set.campaign_id).items()
    )
    for block in encode(itertools.chain(points, (_shape(mode_set, row) for row in rows))):
        file.write(block)


def _shape(mode_set: ModeSet, row: Mode) -> uff.ModeShape:
    stored = shape_of(row)
    labels = sorted({point for point, _ in stored})
    axes = 6 if any(axis > 3 for _, axis in stored) else 3
    values = np.array([[stored.get((point, axis), 0.0) for axis in range(1, axes + 1)] for point in labels], complex)
    return uff.ModeShape(
        dataset=0,
        label=f"{mode_set.name}, mode {row.number}",
        mode=row.number,
        frequency_hz=row.frequency_hz,
        damping_ratio=float("nan") if row.damping_ratio is None else row.damping_ratio,
        points=np.array(labels),
        values=values,
        kind="complex" if np.any(values.imag) else "normal",
    )
