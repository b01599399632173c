"""What recordings of responses show over frequency: the singular values of their power spectra, with
the modes that were found in them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from sqlalchemy.orm import Session

from fecore.signal import HalfSpectra
from service.figures.colors import INITIAL, MEASURED, QUIET
from service.figures.marks import (
    Axis,
    Curve,
    Figure,
    Mark,
    Panel,
    Rule,
    counted,
    decades,
    shortened,
)
from service.nouns.frfs.data import Cut
from service.nouns.modes.operations import modes_of, newest_unmeasured
from service.nouns.recordings.operations import (
    recordings_of,
    spectra_of_recording,
    spectra_rows,
)
from service.platform.errors import Conflict

if TYPE_CHECKING:
    from uuid import UUID

    from service.nouns.modes.operations import ModeSet
    from service.nouns.recordings.operations import Recording

MOST_SETUPS = 12  # whose curves one figure has


@dataclass(frozen=True)
class SpectraShown:
    """Recordings that have spectra, and the modes that were found in them."""

    rows: Sequence[Recording]
    modes: ModeSet | None
    version: str  # what changes whenever the figure does


def spectra_shown(session: Session, campaign_id: UUID) -> SpectraShown:
    """What a campaign's figure is drawn from.

    Raises:
        Conflict: it has no recording of responses, or none was processed.
    """
    rows = recordings_of(session, campaign_id)
    known = spectra_rows(session, rows)
    if not known:
        why = "none was processed" if rows else "it has none; import one without a force"
        raise Conflict(f"the campaign has no spectra of recordings of responses: {why}")
    modes = newest_unmeasured(session, campaign_id)
    kept = [row for row in rows if row.id in known]
    version = " ".join([*(known[row.id].sha256.hex() for row in kept), str(modes and modes.id)])
    return SpectraShown(kept, modes, version)


def spectra_figure(session: Session, shown: SpectraShown, cut: Cut) -> Figure:
    """Singular values over frequency: of one recording all, of several the largest of each.

    Raises:
        Invalid: the cut leaves no line.
    """
    drawn = shown.rows[:MOST_SETUPS]
    spectra = [spectra_of_recording(session, row) for row in drawn]
    curves = list(_curves(drawn, spectra, cut))
    lines = np.concatenate([np.asarray(curve.x) for curve in curves])
    values = np.concatenate([np.asarray(curve.y) for curve in curves])
    marks: list[Mark] = list(curves)
    if shown.modes is not None:
        rows = modes_of(session, [shown.modes.id])[shown.modes.id]
        sines = shown.modes.details.get("harmonics_hz", [])
        inside = (lines.min(), lines.max())
        marks += _rules([row.frequency_hz for row in rows], MEASURED, inside)
        marks += _rules(sines, INITIAL, inside)
    unit = {"acceleration": "(m/s²)²/Hz", "velocity": "(m/s)²/Hz", "displacement": "m²/Hz"}
    y = Axis(f"singular value [{unit[spectra[0].quantity]}]", decades(values))
    x = Axis("frequency [Hz]", range=(float(lines.min()), float(lines.max())))
    more = f", the first {len(drawn)}" if len(drawn) < len(shown.rows) else ""
    with_modes = "" if shown.modes is None else f", with the modes of {shortened(shown.modes.name)}"
    title = f"Power spectra of {counted(len(shown.rows), 'recording')}{more}{with_modes}"
    return Figure(title, marks, [Panel(x, y)])


def _curves(rows: Sequence[Recording], spectra: Sequence[HalfSpectra], cut: Cut) -> Iterator[Curve]:
    for row, each in zip(rows, spectra, strict=True):
        at = cut.lines(each.frequency_hz)
        values = each.singular_values if len(rows) == 1 else each.singular_values[:1]
        for number, own in enumerate(values):
            name = shortened(row.filename) if len(rows) > 1 else f"singular value {number + 1}"
            shade = MEASURED if number == 0 and len(rows) == 1 else QUIET
            yield Curve(each.frequency_hz[at], own[at], name, shade, width=1)


def _rules(hz: Sequence[float], color: str, inside: tuple[float, float]) -> Iterator[Rule]:
    for each in hz:
        if inside[0] <= each <= inside[1]:
            yield Rule(each, color, "solid" if color == MEASURED else "dot")
