"""The FRF figure of an update: which FRF is meant, and its curves."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from service.errors import NotFound
from service.show.figures.frf import FrfCurves, Spread, dof_name, frf_figure
from service.show.figures.marks import Figure
from service.show.results.figure_data import UpdateFigures
from service.store.frfs.data import Cut


@dataclass(frozen=True)
class Wanted:
    """What the query of a figure's route says."""

    point: int | None = None  # grid point whose FRF is drawn; None for the first one
    reference: int | None = None  # the other point of the FRF, where one point alone does not say which; or None
    # fmin, fmax: lines that are drawn, Hz; None for all
    fmin: float | None = None
    fmax: float | None = None
    # measured, model: numbers from 1 of a measured mode and of one of the model, whose shapes are drawn; None for all
    # pairs
    measured: int | None = None
    model: int | None = None


ANYTHING = Wanted()


def update_frf_figure(data: UpdateFigures, wanted: Wanted) -> Figure:
    """The overlay of one FRF of an update that predicted some. Its `meta` says which points there are.

    Raises:
        NotFound: there is no FRF at the points.
        Invalid: no line lies in the band.
    """
    row = _row_at(data, wanted)
    frequency = data.arrays["frequency_hz"]
    lines = Cut(wanted.fmin, wanted.fmax).lines(frequency)
    frf = data.measured_frf(row)
    measured, coherence = data.measured(frf)
    response, reference = data.dofs[row]
    held = row in data.arrays["held"] if "held" in data.arrays else False
    spread = None
    if "log_magnitude_sd" in data.arrays:
        sds = [data.arrays.row(name, row)[lines] for name in ("log_magnitude_sd", "phase_sd")]
        spread = Spread(*sds)
    curves = FrfCurves(
        title=f"FRF {dof_name(response)} / {dof_name(reference)}{', held out of the fit' if held else ''}",
        quantity=frf.quantity,
        frequency_hz=frequency[lines],
        measured=measured[lines],
        coherence=None if coherence is None else coherence[lines],
        models={name: data.arrays.row(name, row)[lines] for name in ("initial", "updated")},
        spread=spread,
        band_hz=_pair(data.light["band_hz"]),
        held_band_hz=_pair(data.light["provenance"]["recipe"]["hold_out"]["band_hz"]),
    )
    meta = {"response": response.point, "reference": reference.point, "points": _points(data)}
    return replace(frf_figure(curves), meta=meta)


def _row_at(data: UpdateFigures, wanted: Wanted) -> int:
    """Place of the FRF at a point: that between the two points where both are named."""
    pairs = [(response.point, reference.point) for response, reference in data.dofs]
    named = [point for point in (wanted.point, wanted.reference) if point is not None]
    found = [row for row, pair in enumerate(pairs) if all(point in pair for point in named)]
    if wanted.point is not None and wanted.point == wanted.reference:
        found = [row for row in found if pairs[row][0] == pairs[row][1]]
    if not found:
        raise NotFound(f"FRF at point {' and '.join(map(str, named))} in this result; there are points {_listed(data)}")
    # Of those that share a fixed point the one whose moving point is the wanted one.
    moving = 1 if len({pair[1] for pair in pairs}) >= len({pair[0] for pair in pairs}) else 0
    return next((row for row in found if pairs[row][moving] == wanted.point), found[0])


def _points(data: UpdateFigures) -> list[int]:
    return sorted({dof.point for pair in data.dofs for dof in pair})


def _listed(data: UpdateFigures) -> str:
    points = _points(data)
    return ", ".join(map(str, points[:20])) + (" …" if len(points) > 20 else "")


def _pair(values: Any) -> tuple[float, float] | None:
    return None if values is None else (float(values[0]), float(values[1]))
