"""A mode set as a table, and what its identification says beside the modes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from modalbase.client.display import with_digits


def mode_set_cells(modes: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[list[Any]]]:
    """Columns and rows of the modes of a set, in Hz and per cent, with the probability of each."""
    return ["mode", "Hz", "± Hz", "ζ %", "± %", "P"], [[mode["number"], *_pole(mode), _share(mode)] for mode in modes]


def beside_lines(details: Mapping[str, Any]) -> list[str]:
    """What the identification of a set says beside its modes: each uncertain pole with the reason, each warning; a line each.

    Args:
        details: of the mode set; empty where it was typed in or read from a file.
    """
    doubtful = [f"uncertain: {mode['frequency_hz']:.5g} Hz, {mode['reason']}" for mode in details.get("doubtful", ())]
    return [*doubtful, *(f"warning: {one}" for one in details.get("warnings", ()))]


def _share(mode: Mapping[str, Any]) -> str:
    p = mode.get("probability")
    return "" if p is None else f"{p:.3f}"


def _pole(mode: Mapping[str, Any]) -> list[Any]:
    percent = (None if z is None else 100 * z for z in (mode["damping_ratio"], mode["damping_sd"]))
    return [*with_digits(mode["frequency_hz"], mode["frequency_sd_hz"]), *with_digits(*percent)]
