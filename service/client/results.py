"""A result document as tables."""

from __future__ import annotations

from typing import Any

import typer

from service.client.display import print_table


def print_result(job: str, document: dict[str, Any]) -> None:
    """Parameters with their uncertainty, modes, correlation; warnings on standard error."""
    columns = ("name", "unit", "initial", "estimate", "standard_deviation")
    rows = [
        [*(p.get(c) for c in columns), _interval(p.get("interval_95")), p.get("identifiable")]
        for p in document["parameters"]
    ]
    print_table(f"update {job}", ("name", "unit", "initial", "estimate", "± s", "95 %", "identifiable"), rows)
    modes = ("number", "measured_hz", "initial_hz", "updated_hz", "error_percent", "mac")
    print_table("\nmodes", modes, [[m.get(c) for c in modes] for m in document["modes"]])
    correlation = document["correlation"]
    means = [[name, correlation[name]] for name in ("csac_mean", "csf_mean") if name in correlation]
    print_table("\ncorrelation", ("criterion", "mean"), means)
    for warning in document["warnings"]:
        typer.echo(f"warning: {warning}", err=True)


def _interval(bounds: list[float] | None) -> str | None:
    return None if not bounds or None in bounds else f"{bounds[0]:.6g} … {bounds[1]:.6g}"
