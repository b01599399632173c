"""What a monitor takes from an update's result: watched values with the part of their uncertainty that differs from one
campaign to the next, and the laboratory's inputs, which all campaigns share, held at what was stated.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any
from uuid import UUID

from sqlalchemy.orm import Session

from fecore.body.specimen import UNITS, kind_of
from fecore.dynamics.damping_laws import CaugheySeries
from service.store.modes.operations import modes_of

if TYPE_CHECKING:
    from service.store.modes.tables import Mode

Pair = tuple[float, float | None]
"""Estimate and standard deviation, None where the measurement states none."""


def watched_values(session: Session, document: dict[str, Any]) -> dict[str, Any]:
    """Values of a result document.

    Returns:
        `parameters`: name to [estimate, noise-only standard deviation], both with the inputs held: a model error or a wrong
        thickness that all campaigns share does not move them; `modes`: (f, sd, ζ, sd) of each measured mode;
        None where not known.
    """
    compared = {row["name"]: row["comparable"] for row in document["parameters"]}
    parameters = {name: [found["estimate"], found["standard_deviation"]] for name, found in compared.items()}
    stated: dict[int, Mode] = {}
    if mode_set := document["provenance"].get("mode_set"):
        key = UUID(mode_set)
        stated = {mode.number: mode for mode in modes_of(session, [key])[key]}
    modes = []
    for row in document["modes"]:
        mode = stated.get(row["number"])
        sds = (None, None) if mode is None else (mode.frequency_sd_hz, mode.damping_sd)
        modes.append([row["measured_hz"], sds[0], row["measured_damping"], sds[1]])
    return {"parameters": parameters, "modes": modes}


def unit_of(parameter: str) -> str | None:
    """SI unit of a watched value; None of a spring's stiffness, whose name is the recipe's."""
    if kind_of(parameter) in UNITS:
        return UNITS[kind_of(parameter)]
    if parameter.startswith("frequency_"):
        return "Hz"
    if re.fullmatch(r"damping_ratio_\d+|zeta\d+", parameter):
        return "1"
    if parameter.startswith("g_"):
        return "1/s"
    if power := re.fullmatch(r"a(\d)", parameter):
        return CaugheySeries("", (int(power[1]),)).coefficient_units[0]
    return None
