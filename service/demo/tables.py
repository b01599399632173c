"""The demonstration's result as tables for a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from service.demo.paper import UPDATED

_SHOWN = {"Pa": (1e-9, "GPa"), "1/s": (1.0, "1/s"), "s": (1e6, "µs"), "1": (1.0, "")}


def print_result(console: Console, result: Mapping[str, Any], durations: Mapping[str, float]) -> None:
    """Parameters, modes, correlation, warnings, and how long each step took."""
    console.print(_parameters(result), _modes(result), _correlation(result), sep="\n")
    for warning in result["warnings"]:
        console.print(f"[yellow]warning:[/] {warning}", highlight=False)
    total = sum(durations.values())
    steps = ", ".join(f"{name} {seconds:.2f} s" for name, seconds in durations.items())
    console.print(f"{steps}; {total:.2f} s together", highlight=False)


def _parameters(result: Mapping[str, Any]) -> Table:
    table = Table("parameter", "unit", title="Updated parameters", title_justify="left")
    for heading in ("initial", "estimate", "± (1 sd)", "95 % from", "to", "paper"):
        table.add_column(heading, justify="right")
    table.add_column("identified")
    for row in result["parameters"]:
        scale, unit = _SHOWN[row["unit"]]
        values = (row["initial"], row["estimate"], row["standard_deviation"], *row["interval_95"], UPDATED[row["name"]])
        cells = [f"{scale * value:.4g}" for value in values]
        table.add_row(row["name"], unit, *cells, "by the data" if row["identifiable"] else "no: prior")
    return table


def _modes(result: Mapping[str, Any]) -> Table:
    table = Table("mode", title="Modes", title_justify="left")
    for heading in ("measured Hz", "initial Hz", "updated Hz", "error %", "MAC", "measured ζ %", "law's ζ %"):
        table.add_column(heading, justify="right")
    for row in result["modes"]:
        cells = (
            (row["measured_hz"], "{:.2f}"),
            (row["initial_hz"], "{:.2f}"),
            (row["updated_hz"], "{:.2f}"),
            (row["error_percent"], "{:+.2f}"),
            (row["mac"], "{:.4f}"),
            (_percent(row["measured_damping"]), "{:.2f}"),
            (_percent(row["predicted_damping"]), "{:.2f}"),
        )
        table.add_row(str(row["number"]), *(form.format(v) if v is not None else "-" for v, form in cells))
    return table


def _correlation(result: Mapping[str, Any]) -> Table:
    table = Table(
        "of the model", title="Correlation of the fitted FRFs, measured against predicted", title_justify="left"
    )
    for heading in ("SAC mean", "FRAC mean", "CSAC mean", "CSF mean"):
        table.add_column(heading, justify="right")
    updated = result["correlation"]
    for name, values in (("initial", updated["initial"]), ("updated", updated)):
        means = (np.mean(values["sac"]), np.mean(values["frac"]), values["csac_mean"], values["csf_mean"])
        table.add_row(name, *(f"{mean:.4f}" for mean in means))
    return table


def _percent(ratio: float | None) -> float | None:
    return None if ratio is None else 100 * ratio
