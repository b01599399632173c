"""The figures of an update by name: what each is called, and how it is drawn from the job's
result.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from fecore.correlation import (
    auto_mac,
)
from modalbase.client.results import motion_words
from service.figures.answers import require_figure
from service.figures.marks import Figure, words
from service.figures.modes import (
    MOST_MODES,
    MOST_ROWS,
    ShapePair,
    mac_figure,
    sensitivities_figure,
    shapes_figure,
    stabilisation_figure,
)
from service.figures.temperature import temperature_figure
from service.figures.updates import (
    MOST_PARAMETERS,
    budget_figure,
    convergence_figure,
    damping_figure,
    errors_figure,
    parameters_figure,
    posterior_figure,
    single_estimates_figure,
)
from service.platform.errors import Conflict, NotFound
from service.reports.criteria_figures import LINES, criteria_figures
from service.reports.figure_data import (
    FigureQuery,
    UpdateFigures,
    update_frf_figure,
)
from service.reports.named_figure import OLDER, NamedFigure, no_mac


def draw_figure(
    figures: Mapping[str, NamedFigure],
    data: UpdateFigures,
    name: str,
    query: FigureQuery | None = None,
) -> Figure:
    """One of the figures of a kind of result.

    Raises:
        NotFound: there is no figure of that name, or no FRF at the point.
        Conflict: the job has no result, or its result has nothing to draw; the message says why.
    """
    require_figure(name, *figures)
    if (why := figures[name].lacks(data)) is not None:
        raise Conflict(why)
    return figures[name].draw(data, query or FigureQuery())


def draw_sheets(data: UpdateFigures, name: str) -> Sequence[Figure]:
    """A figure for paper: as many figures as it needs pages, none where the result has nothing to
    draw.
    """
    figure = FIGURES[name]
    if figure.lacks(data) is not None:
        return ()
    return [figure.draw(data, FigureQuery())] if figure.sheets is None else figure.sheets(data)


def _no_result(data: UpdateFigures) -> None:
    assert data.document is not None, "asking for it raises where there is none"


def _one_temperature(data: UpdateFigures) -> str | None:
    if not (curve := data.document.get("curve")):
        return "all of it is at one temperature"
    known = {row["name"] for row in data.document["parameters"] if row["identifiable"]}
    shown = any(row["law"] is not None or row["name"] in known for row in curve["constants"])
    return None if shown else "the data determine none of the constants"


def _mac(data: UpdateFigures, _: FigureQuery) -> Figure:
    document = data.document
    matrix = document["correlation"]["mac_matrix"]
    across = document.get("model_modes") or [
        {"number": j + 1, "frequency_hz": None} for j in range(len(matrix[0]))
    ]
    columns = [_mode_name(mode["number"], mode["frequency_hz"]) for mode in across]
    title = "MAC of measured and updated shapes"
    return mac_figure(matrix, _measured_names(data), columns, title, "mode of the updated model")


def _mode_name(number: int, hz: float | None) -> str:
    return str(number) if hz is None else f"{number}: {hz:.4g} Hz"


def _measured_names(data: UpdateFigures) -> list[str]:
    return [_mode_name(mode["number"], mode["measured_hz"]) for mode in data.document["modes"]]


def _automac(data: UpdateFigures, _: FigureQuery) -> Figure:
    matrix = auto_mac(data.arrays["shapes_measured"].astype(complex)).tolist()
    names = _measured_names(data)
    title = "AutoMAC of the measured shapes: can the points keep the modes apart?"
    return mac_figure(matrix, names, names, title, "measured mode")


def _no_shapes(data: UpdateFigures) -> str | None:
    has_points = bool(data.document["provenance"]["frfs"]) or "shapes_updated" in data.arrays
    return (
        None
        if has_points
        else "there are no FRFs and the modes have no shapes, so there is nothing to draw"
    )


def _shapes(data: UpdateFigures, query: FigureQuery) -> Figure:
    pairs = _shape_pairs(data, query)
    if not pairs:
        return words(
            "Mode shapes, measured and updated",
            "this mode has no partner; choose a mode of the other side too",
        )
    which = f"the first {MOST_MODES} of {len(pairs)} pairs" if len(pairs) > MOST_MODES else ""
    return _drawn_shapes(data, query, pairs[:MOST_MODES], which)


def _shape_sheets(data: UpdateFigures) -> list[Figure]:
    pairs = _shape_pairs(data, FigureQuery())
    if len(pairs) <= MOST_ROWS:
        return [_shapes(data, FigureQuery())]
    sheets = np.array_split(pairs[:MOST_MODES], -(-min(len(pairs), MOST_MODES) // MOST_ROWS))
    return [
        _drawn_shapes(
            data, FigureQuery(), sheet.tolist(), f"modes {sheet[0, 0] + 1} to {sheet[-1, 0] + 1}"
        )
        for sheet in sheets
    ]


def _drawn_shapes(
    data: UpdateFigures, query: FigureQuery, places: Sequence[tuple[int, int]], which: str
) -> Figure:
    arrays, modes = data.arrays, data.document["modes"]
    pairs = [
        ShapePair(
            number=modes[i]["number"],
            measured_title=f"mode {modes[i]['number']}, measured: {modes[i]['measured_hz']:.4g} Hz",
            updated_title=(
                _updated_title(modes[i]) if query.model is None else _model_title(data, i, j)
            ),
            measured=arrays["shapes_measured"][i].astype(complex),
            updated=arrays["shapes_updated"][j].astype(float),
        )
        for i, j in places
    ]
    return shapes_figure(pairs, arrays["shape_points"].tolist(), arrays["shape_places_m"], which)


def _shape_pairs(data: UpdateFigures, query: FigureQuery) -> list[tuple[int, int]]:
    """Places of the modes whose shapes are drawn: the pairs of the result, those of one measured
    mode, or any two.
    """
    measured, model = len(data.document["modes"]), len(data.arrays["shapes_updated"])
    for name, number, most in (
        ("measured", query.measured, measured),
        ("model", query.model, model),
    ):
        if number is not None and number > most:
            raise NotFound(f"{name} mode {number} in this result; there are 1 to {most}")
    if query.measured is not None and query.model is not None:
        return [(query.measured - 1, query.model - 1)]
    return [
        (i, j)
        for i, j in data.arrays["shape_pairs"].tolist()
        if query.measured in (None, i + 1) and query.model in (None, j + 1)
    ]


def _model_title(data: UpdateFigures, i: int, j: int) -> str:
    """Of a pair that was asked for, which need not be one of the result."""
    mode, matrix = data.document["model_modes"][j], data.document["correlation"]["mac_matrix"]
    mac = "" if matrix is None or matrix[i][j] is None else f", MAC {matrix[i][j]:.3f}"
    return f"updated model, mode {mode['number']}: {mode['frequency_hz']:.4g} Hz{mac}"


def _updated_title(mode: dict[str, Any]) -> str:
    mac = "" if mode["mac"] is None else f", MAC {mode['mac']:.3f}"
    return f"updated: {mode['updated_hz']:.4g} Hz, {motion_words(mode)}{mac}"


def _parameters(title: str) -> Callable[[UpdateFigures, FigureQuery], Figure]:
    return lambda data, _: parameters_figure(
        data.document["parameters"], f"{title}: prior and updated, 95 % intervals"
    )


def _no_posterior(data: UpdateFigures) -> str | None:
    return OLDER if data.document["posterior"].get("correlation") is None else None


def _posterior(data: UpdateFigures, _: FigureQuery) -> Figure:
    described = data.document["posterior"]
    rows = {row["name"]: row for row in data.document["parameters"]}
    places = [i for i, name in enumerate(described["names"]) if name in rows]
    known_first = sorted(places, key=lambda i: not rows[described["names"][i]]["identifiable"])
    places = sorted(known_first[:MOST_PARAMETERS])
    chosen = [rows[described["names"][i]] for i in places]
    correlation = np.array(described["correlation"], dtype=float)[np.ix_(places, places)]
    samples = data.arrays["samples"][:, places].astype(float) if "samples" in data.arrays else None
    return posterior_figure(chosen, correlation, samples)


def _sensitivities(data: UpdateFigures, _: FigureQuery) -> Figure:
    effects = dict(
        zip(data.arrays["parameter_names"].tolist(), data.arrays["parameter_effects"], strict=True)
    )
    known = {row["name"]: row["identifiable"] for row in data.document["parameters"]}
    return sensitivities_figure(effects, known, _measured_names(data))


def _no_budget(data: UpdateFigures) -> str | None:
    known = any(row["budget"] for row in data.document["parameters"])
    return (
        None if known else "this result does not say what the variance of its parameters is made of"
    )


def _no_single_estimates(data: UpdateFigures) -> str | None:
    known = any(part["alone"] for part in data.document["campaigns"])
    return None if known else "no campaign has an estimate of its own"


def _convergence(data: UpdateFigures, _: FigureQuery) -> Figure:
    document = data.document
    steps = document["convergence"]
    reported = {row["name"] for row in document["parameters"]}
    names = [name for name in steps[0]["parameters"] if name in reported] if steps else []
    constants = {name: [step["parameters"][name] for step in steps] for name in names}
    history = np.array(document["damping_fit"]["history"], dtype=float)
    laws = document["damping_models"]
    coefficients = (
        dict(zip(laws[0]["coefficients"], history.T.tolist(), strict=True)) if history.size else {}
    )
    return convergence_figure(document["starts"], constants, coefficients)


def _no_laws(data: UpdateFigures) -> str | None:
    laws = data.document["damping_models"]
    if not laws:
        damping = next(
            (o["message"] for o in data.document["outcomes"] if o["stage"] == "damping"), ""
        )
        return f"no damping law was fitted: {damping or 'no measured mode has a damping ratio'}"
    return OLDER if laws[0]["curve"] is None else None


def _no_identification(data: UpdateFigures) -> str | None:
    known = data.document["identification"] is not None
    return (
        None
        if known
        else (
            "this update was given its modes and identified none, so there is no stabilisation"
            " diagram"
        )
    )


def _stabilisation(data: UpdateFigures, _: FigureQuery) -> Figure:
    return stabilisation_figure(data.document["identification"])


FIGURES: dict[str, NamedFigure] = {
    "frf": NamedFigure(
        "FRF: measured, initial and updated",
        update_frf_figure,
        UpdateFigures.require_prediction,
        (),
        ("point", "reference", *LINES),
        tab="apart",
    ),
    "parameters": NamedFigure(
        "Parameters: prior and updated with 95 % intervals",
        _parameters("Parameters"),
        _no_result,
        tab="apart",
    ),
    "sensitivities": NamedFigure(
        "Sensitivities of the frequencies, parameter by mode",
        _sensitivities,
        _no_result,
        ("parameter_effects",),
        tab="parameters",
        width=0.8,
    ),
    "budget": NamedFigure(
        "What the variance of each parameter is made of",
        lambda data, _: budget_figure(data.document["parameters"]),
        _no_budget,
        tab="budget",
        width=0.8,
    ),
    "posterior": NamedFigure(
        "Posterior: densities and correlations",
        _posterior,
        _no_posterior,
        tab="budget",
        width=0.75,
    ),
    "shapes": NamedFigure(
        "Mode shapes, measured beside updated",
        _shapes,
        _no_shapes,
        ("shapes_updated",),
        ("measured", "model"),
        _shape_sheets,
        tab="modes",
    ),
    "mac": NamedFigure(
        "MAC of measured and updated shapes", _mac, no_mac, tab="correlation", width=0.8
    ),
    "automac": NamedFigure(
        "AutoMAC of the measured shapes",
        _automac,
        no_mac,
        ("shapes_measured",),
        tab="correlation",
        width=0.8,
    ),
    **dict(criteria_figures()),
    "damping": NamedFigure(
        "Damping ratios and the laws",
        lambda data, _: damping_figure(data.document["damping_models"], data.document["modes"]),
        _no_laws,
        tab="damping",
    ),
    "temperature": NamedFigure(
        "Constants and damping over temperature",
        lambda data, _: temperature_figure(data.document["curve"], data.document["parameters"]),
        _one_temperature,
    ),
    "convergence": NamedFigure(
        "Convergence of all starts", _convergence, _no_result, tab="convergence", width=0.85
    ),
    "stabilisation": NamedFigure(
        "Stabilisation diagram", _stabilisation, _no_identification, tab="modes"
    ),
}
"""Every figure of an update, in the order in which a report shows them."""

FIGURES_OF_SEVERAL: dict[str, NamedFigure] = {
    "parameters": NamedFigure(
        "Parameters of the material: prior and updated",
        _parameters("One material from all campaigns"),
        _no_result,
    ),
    "campaigns": NamedFigure(
        "Each campaign alone, beside all together",
        lambda data, _: single_estimates_figure(
            data.document["parameters"], data.document["campaigns"]
        ),
        _no_single_estimates,
    ),
    "frequencies": NamedFigure(
        "Errors of the frequencies, campaign by campaign",
        lambda data, _: errors_figure(data.document["campaigns"]),
        _no_result,
    ),
    **{name: FIGURES[name] for name in ("budget", "posterior", "temperature")},
}
"""Every figure of an update of several campaigns, in the order in which its page shows them."""
