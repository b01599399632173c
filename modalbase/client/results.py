"""Results and mode sets as tables, in a laboratory's units, with the digits that their uncertainty
leaves.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from math import floor, log10
from statistics import fmean
from typing import TYPE_CHECKING, Any

import typer

from modalbase.client.display import Written, print_table, with_digits

if TYPE_CHECKING:
    from rich.console import Console


@cache
def shown_units() -> dict[str, tuple[float, str]]:
    """Factor and unit in which values of an SI unit are shown, others as they are;
    `python -m tools.reference` makes the file.
    """
    text = files("modalbase.client").joinpath("units.json").read_text(encoding="utf-8")
    return {unit: (factor, shown) for unit, (factor, shown) in json.loads(text).items()}


_Z_95 = 1.96
_SKEWED = (
    # ratio of the sides of an interval from which they are written as two: what the second digit of
    # a ± shows
    1.25
)


def deviations(
    estimate: float, sd: float, interval: Sequence[float | None] | None
) -> tuple[float, ...]:
    """The standard deviation of an estimate; where its 95 % interval is not about its middle, those
    above and below.

    >>> deviations(30.0, 1.0, (28.04, 31.96)), deviations(30.0, 1.0, (28.04, 30.0))
    ((1.0,), (0.0, 1.0))
    """
    low, high = interval or (None, None)
    if low is None or high is None:
        return (sd,)
    above, below = (
        round(max(reach, 0.0) / _Z_95, 12) for reach in (high - estimate, estimate - low)
    )
    return (above, below) if max(above, below) > _SKEWED * min(above, below) else (sd,)


def print_result(
    title: str,
    document: Mapping[str, Any],
    *,
    published: Mapping[str, float] | None = None,
    console: Console | None = None,
) -> None:
    """Parameters with their uncertainty, modes, correlation; warnings on standard error.

    Args:
        title: of the first table.
        document: what `GET /update-jobs/{id}/result` answers.
        published: values of parameters from elsewhere, SI, to stand beside the estimates.
        console: where to; standard output by default.
    """
    from rich.console import Console

    if lines := verdict_lines(document):
        (console or Console()).print(
            "\n".join(lines), highlight=False, markup=False, soft_wrap=True
        )
    print_table(title, *parameter_cells(document["parameters"], published), console)
    print_table("\nmodes", *mode_cells(document["modes"]), console)
    print_table("\ncorrelation, means", *correlation_cells(document["correlation"]), console)
    for warning in document["warnings"]:
        typer.echo(f"warning: {warning}", err=True)


def verdict_lines(document: Mapping[str, Any]) -> list[str]:
    """The verdict and its reasons, a line each; none where an earlier version made the result."""
    verdict = document.get("verdict")
    if verdict is None:
        return []
    return [
        f"{verdict['level'].replace('_', ' ')}: {verdict['sentence']}",
        *(f"  - {r}" for r in verdict["reasons"]),
    ]


def parameter_cells(
    parameters: Sequence[Mapping[str, Any]], published: Mapping[str, float] | None = None
) -> tuple[list[str], list[list[Any]]]:
    """Columns and rows of a result's parameters, in a laboratory's units.

    Args:
        parameters: of the result document.
        published: values from elsewhere, SI, to stand beside the estimates.
    """
    columns = ["parameter", "unit", "initial", "estimate", "± sd", "95 %", "identifiable"]
    rows = [_parameter(row) for row in parameters]
    if published is not None:
        columns.append("published")
        for cells, row in zip(rows, parameters, strict=True):
            cells.append(_scaled(row, published.get(row["name"])))
    return columns, rows


def mode_cells(modes: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[list[Any]]]:
    """Columns and rows of a result's modes."""
    columns = [
        "mode",
        "kind",
        "measured Hz",
        "initial Hz",
        "updated Hz",
        "error %",
        "MAC",
        "measured ζ %",
        "law's ζ %",
    ]
    return columns, [_mode(row) for row in modes]


def motion_words(mode: Mapping[str, Any]) -> str | None:
    """What a mode of a result is: its largest shares of motion and, of a body of several sets, of
    strain energy.
    """
    if mode["kind"] is None:
        return None
    fractions = {mode["kind"]: (mode.get("motion") or {}).get(mode["kind"])}
    if len(energy := mode.get("energy") or {}) > 1:
        first = max(energy, key=lambda name: energy[name])
        fractions[first] = energy[first]
    return ", ".join(
        name if share is None else f"{name} {100 * share:.0f} %"
        for name, share in fractions.items()
    )


def correlation_cells(correlation: Mapping[str, Any]) -> tuple[list[str], list[list[Any]]]:
    """Columns and rows of the means of the criteria, before and after and where something was held
    out.
    """
    initial, held_out = correlation["initial"] or {}, correlation.get("held_out") or {}
    compared = {
        "initial": initial,
        "updated": correlation,
        "updated, FRFs held out": held_out.get("frfs"),
        "updated, lines held out": held_out.get("band"),
    }
    means = [
        [name, *(_mean(criteria[member]) for member in initial)]
        for name, criteria in compared.items()
        if criteria and any(criteria[member] for member in initial)
    ]
    return ["model", *(member.removesuffix("_mean").upper() for member in initial)], means


def _parameter(row: Mapping[str, Any]) -> list[Any]:
    scale, unit = shown_units().get(row["unit"], (1.0, row["unit"]))
    sd = scale * (row["standard_deviation"] or 0.0)
    # two digits of the standard deviation
    places = max(0, 1 - floor(log10(sd))) if sd > 0 else None

    def written(value: float | None) -> Written | None:
        if value is None or places is None:
            return _scaled(row, value)
        return Written(f"{scale * value:z.{places}f}")

    low, high = (written(value) for value in row["interval_95"] or (None, None))
    spread = written(row["standard_deviation"])
    if row["estimate"] is not None and places is not None:
        each = deviations(row["estimate"], row["standard_deviation"], row["interval_95"])
        spread = (
            written(each[0])
            if len(each) == 1
            else Written(f"+{written(each[0])} −{written(each[1])}")
        )
    interval = None if low is None or high is None else Written(f"{low} … {high}")
    return [
        row["name"], unit, written(row["initial"]), written(row["estimate"]), spread,
        interval, f"as {master}" if (master := row.get("tied_to")) else row["identifiable"],
    ]  # fmt: skip


def _scaled(row: Mapping[str, Any], value: float | None) -> Written | None:
    scale, _ = shown_units().get(row["unit"], (1.0, ""))
    return None if value is None else Written(f"{scale * value:.4g}")


def _mode(row: Mapping[str, Any]) -> list[Any]:
    forms = {
        "measured_hz": ".2f",
        "initial_hz": ".2f",
        "updated_hz": ".2f",
        "error_percent": "+z.2f",
        "mac": ".4f",
    }
    cells = [
        None if row[name] is None else Written(f"{row[name]:{form}}")
        for name, form in forms.items()
    ]
    ratios = [row["measured_damping"], row["predicted_damping"]]
    return [
        row["number"],
        motion_words(row),
        *cells,
        *(None if r is None else Written(f"{100 * r:.2f}") for r in ratios),
    ]


def _mean(value: Any) -> Written | None:
    """Of a criterion, which a result states for each FRF, or as a mean already."""
    if isinstance(value, list):
        value = fmean(value) if value else None
    return None if value is None else Written(f"{value:.4f}")


def mode_set_cells(modes: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[list[Any]]]:
    """Columns and rows of the modes of a set, in Hz and per cent, with the probability of each."""
    return ["mode", "Hz", "± Hz", "ζ %", "± %", "P"], [
        [mode["number"], *_pole(mode), _share(mode)] for mode in modes
    ]


def beside_lines(details: Mapping[str, Any]) -> list[str]:
    """What the identification of a set says beside its modes: each uncertain pole with the reason,
    each warning; a line each.

    Args:
        details: of the mode set; empty where it was typed in or read from a file.
    """
    doubtful = [
        f"uncertain: {mode['frequency_hz']:.5g} Hz, {mode['reason']}"
        for mode in details.get("doubtful", ())
    ]
    return [*doubtful, *(f"warning: {one}" for one in details.get("warnings", ()))]


def _share(mode: Mapping[str, Any]) -> str:
    p = mode.get("probability")
    return "" if p is None else f"{p:.3f}"


def _pole(mode: Mapping[str, Any]) -> list[Any]:
    percent = (None if z is None else 100 * z for z in (mode["damping_ratio"], mode["damping_sd"]))
    return [*with_digits(mode["frequency_hz"], mode["frequency_sd_hz"]), *with_digits(*percent)]
