"""The figures of an update by name: what each is called, and how it is drawn from the job's result."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from service.errors import Conflict, NotFound
from service.figures.frf import FrfCurves, frf_figure
from service.figures.look import Figure
from service.figures.matrices import mac_figure
from service.figures.parameters import parameters_figure
from service.frfs.data import Cut
from service.updating.figure_data import UpdateFigures


@dataclass(frozen=True)
class Wanted:
    """What the query of a figure's route says.

    Attributes:
        point: grid point whose FRF is drawn; None for the first one.
        reference: the other point of the FRF, where one point alone does not say which; or None.
        fmin, fmax: lines that are drawn, Hz; None for all.
    """

    point: int | None = None
    reference: int | None = None
    fmin: float | None = None
    fmax: float | None = None


@dataclass(frozen=True)
class NamedFigure:
    """A figure of an update.

    Attributes:
        title: what it shows, in one line.
        draw: draws it.
        check: raises Conflict where the result has nothing for it; `draw` may rely on it.
        query: parameters of the query that it heeds.
    """

    title: str
    draw: Callable[[UpdateFigures, Wanted], Figure]
    check: Callable[[UpdateFigures], object]
    query: tuple[str, ...] = ()


def draw_figure(data: UpdateFigures, name: str, wanted: Wanted) -> Figure:
    """A figure of an update.

    Raises:
        NotFound: there is no figure of that name, or no FRF at the point.
        Conflict: the job has no result, or its result has nothing to draw; the message says why.
    """
    if name not in FIGURES:
        raise NotFound(f"figure {name!r}; there are {', '.join(FIGURES)}")
    FIGURES[name].check(data)
    return FIGURES[name].draw(data, wanted)


def _frf(data: UpdateFigures, wanted: Wanted) -> Figure:
    row = _row_at(data, wanted)
    frequency = data.arrays["frequency_hz"]
    lines = Cut(wanted.fmin, wanted.fmax).lines(frequency)
    (measured,), (coherence,) = data.measured([row])
    response, reference = data.dofs[row]
    held = data.held_points & {response.point, reference.point}
    of = f"FRF {_dof(response)} / {_dof(reference)}{', held out of the fit' if held else ''}"
    recipe = data.document["provenance"]["recipe"]
    curves = FrfCurves(
        title=of,
        quantity=data.rows[row].quantity,
        frequency_hz=frequency[lines],
        measured=measured[lines],
        coherence=None if coherence is None else coherence[lines],
        models={name: data.arrays[name][row, lines] for name in ("initial", "updated")},
        band_hz=_pair(data.document["band_hz"]),
        held_band_hz=_pair(recipe["hold_out"]["band_hz"]),
    )
    figure = frf_figure(curves)
    figure["layout"]["meta"] = {"response": response.point, "reference": reference.point, "points": _points(data)}
    return figure


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


def _require_mac(data: UpdateFigures) -> None:
    if data.document["correlation"]["mac_matrix"] is None:
        raise Conflict("the measured modes have no shapes, so there is no MAC")


def _mac(data: UpdateFigures, _: Wanted) -> Figure:
    matrix = data.document["correlation"]["mac_matrix"]
    modes = data.document["modes"]
    rows = [f"{mode['number']}: {mode['measured_hz']:.4g} Hz" for mode in modes]
    columns = [str(j + 1) for j in range(len(matrix[0]))]
    return mac_figure(matrix, rows, columns, "MAC of measured and updated shapes", "mode of the updated model")


def _parameters(data: UpdateFigures, _: Wanted) -> Figure:
    return parameters_figure(data.document["parameters"], "Parameters: prior and updated, 95 % intervals")


def _dof(dof: Any) -> str:
    return f"{dof.point}{'+' if dof.sign > 0 else '−'}{('X', 'Y', 'Z', 'RX', 'RY', 'RZ')[dof.axis - 1]}"


def _pair(values: Any) -> tuple[float, float] | None:
    return None if values is None else (float(values[0]), float(values[1]))


def _result(data: UpdateFigures) -> object:
    return data.document


_FRF = UpdateFigures.require_prediction

FIGURES: dict[str, NamedFigure] = {
    "frf": NamedFigure("FRF: measured, initial and updated", _frf, _FRF, ("point", "reference", "fmin", "fmax")),
    "mac": NamedFigure("MAC of measured and updated shapes", _mac, _require_mac),
    "parameters": NamedFigure("Parameters: prior and updated with 95 % intervals", _parameters, _result),
}
"""Every figure of an update, in the order in which a report shows them."""
