"""Mappings of FRFs that suggest themselves: what a file says, in its own words; what it does not
say is empty (null).
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from modalbase.formats.dof_names import dof_in_name
from modalbase.formats.factors import factors_among
from modalbase.formats.frfs.parts import (
    is_frequency,
    names_of,
    propose_parts,
    unit_in_file,
    unit_of_values,
)
from modalbase.formats.frfs.table import DOFS
from modalbase.formats.records.arrays import Variables
from modalbase.formats.units import read_unit, unit_beside, unread_unit

_SPECTRA = ("cross", "spec", "psd", "csd")
"""Parts of the names of complex spectra that are no FRFs."""
_MOST_EMPTY = 200  # points that are asked for one by one
_MOST_LISTED = 20
_ANGULAR = ("w", "om", "omega")
_AXIS = {
    "start": ("start_value", "start", "xstart", "x0", "f0", "fstart", "f_start", "start_hz"),
    "step": (
        "increment",
        "step",
        "delta",
        "dx",
        "df",
        "xinc",
        "xincrement",
        "delta_f",
        "deltaf",
        "step_hz",
    ),
    "count": ("number_of_values", "count", "n"),
}
"""Last parts of names of an even axis, in small letters."""
_SIDES = {
    "response": ("primary", "resp", "output"),
    "reference": ("ref", "input", "excit"),
}


def propose_frfs(variables: Variables, texts: Mapping[str, str] | None = None) -> dict[str, Any]:
    """The mapping that names, types, shapes and texts suggest.

    Args:
        variables: arrays of the file.
        texts: texts of the file by name.
    """
    texts = {**(texts or {}), **factors_among(variables)}
    mapping: dict[str, Any] = {"frequency_hz": _axis(variables, texts)}
    complexes = [n for n, a in variables.items() if a.dtype.kind == "c"]
    frf = min(
        complexes, key=lambda name: any(part in name.lower() for part in _SPECTRA), default=None
    )
    columns = [n for n, a in variables.items() if a.dtype.kind in "fiu" and a.size > 1]
    mapping["frf"] = propose_parts(columns, texts) if frf is None else {"variable": frf}
    valued = names_of(mapping["frf"] or {})
    if valued and (unit := unit_of_values(unit_beside(valued[0], texts), valued[0])):
        mapping["unit"] = unit
    of = frf or (valued[0] if valued else None)
    alike = [
        n
        for n, a in variables.items()
        if of and a.shape == variables[of].shape and a.dtype.kind == "f"
    ]
    ratios = [
        n for n in alike if frf and variables[n].min() >= 0 and variables[n].max() <= 1 + 1e-6
    ]
    if coherence := [n for n in alike if "coh" in n.lower()] or ratios:
        each = frf is None and len(coherence) > 1  # of a table, a column for each FRF
        mapping["coherence"] = {"variable": coherence if each else coherence[0]}
    count = sum(variables[name].size // max(variables[name].shape) for name in valued) or 1
    return mapping | _dofs(texts, count)


def doubts(mapping: Any) -> list[str]:
    """What a mapping leaves to be looked at: frequencies whose name is that of angular ones,
    without a unit.
    """
    axis = mapping.get("frequency_hz") if isinstance(mapping, dict) else None
    name = axis.get("variable") if isinstance(axis, dict) and not axis.get("unit") else None
    if not isinstance(name, str) or name.rpartition(".")[2].lower() not in _ANGULAR:
        return []
    return [
        f'the frequencies {name} are taken in Hz; state "unit": "rad/s" beside the variable where'
        " they are angular"
    ]


def assumed(mapping: Any, texts: Mapping[str, str]) -> list[str]:
    """That neither a mapping nor the file states a unit that is known, so that values are in SI."""
    if not isinstance(mapping, dict) or mapping.get("unit") or mapping.get("factor") is not None:
        return []
    valued = names_of(mapping["frf"])
    unread = unread_unit(valued[0]) if valued else ""
    stated = f"{unread!r} is no unit that is known here" if unread else "nobody states a unit"
    known = read_unit(unit_in_file(mapping["frf"], texts)) is not None
    return (
        [] if known else [f"the FRFs are taken in SI, as {stated}: state `unit` where they are not"]
    )


def left_out(variables: Variables, mapping: Any) -> list[str]:
    """That a file holds further arrays of complex numbers as long as the one that a mapping
    takes.
    """
    frf = mapping.get("frf") if isinstance(mapping, dict) else None
    name = frf.get("variable") if isinstance(frf, dict) else None
    if not isinstance(name, str) or name not in variables:
        return []
    lines = max(variables[name].shape, default=0)
    others = [
        n for n, a in variables.items() if n != name and a.dtype.kind == "c" and lines in a.shape
    ]
    listed = ", ".join(others[:_MOST_LISTED]) + (" …" if len(others) > _MOST_LISTED else "")
    return (
        [f"{name} alone is taken; import {listed} by a mapping of their own where they are FRFs"]
        if others
        else []
    )


def is_empty(given: Any) -> bool:
    """Whether a member of a mapping, or a part of it, is null."""
    parts = given if isinstance(given, list) else given.values() if isinstance(given, dict) else []
    return given is None or any(part is None for part in parts)


def _axis(variables: Variables, texts: Mapping[str, str]) -> dict[str, Any] | None:
    """A rising vector, or an even axis as start and step, with the unit that the file states."""
    lines = [
        name
        for name, array in variables.items()
        if name.lower().rpartition(".")[2][:1] in "fxw" and _rises(array)
    ]
    units = {name: unit for name in variables if (unit := unit_beside(name, texts))}
    lines.sort(key=lambda name: not is_frequency(name, units))
    lines += [
        name
        for name, array in variables.items()
        if is_frequency(name, units) and (_rises(array) or _rises(np.ravel(array)[::-1]))
    ]
    lines += [
        name for name, array in variables.items() if "omega" in name.lower() and _rises(array)
    ]
    if lines:
        axis: dict[str, Any] = {"variable": lines[0]}
    else:
        ends = {
            part: {
                name.rpartition(".")[0]: name
                for name, array in variables.items()
                if array.size == 1 and _ends(name, words)
            }
            for part, words in _AXIS.items()
        }
        parent = next((parent for parent in ends["start"] if parent in ends["step"]), None)
        if parent is None:
            return None
        axis = {
            part: {"variable": names[parent]} for part, names in ends.items() if parent in names
        }
    name = axis.get("variable") or axis["start"]["variable"]
    if unit := unit_beside(name, texts, "frequency"):
        axis["unit"] = unit
    return axis


def _ends(name: str, words: tuple[str, ...]) -> bool:
    return name.rpartition(".")[2].lower() in words


def _dofs(texts: Mapping[str, str], count: int) -> dict[str, Any]:
    """Points and directions that the file states in names; else they are empty, the responses one
    by one.
    """
    mapping: dict[str, Any] = dict.fromkeys(DOFS)
    if 1 < count <= _MOST_EMPTY:
        mapping["response_point"] = [None] * count
    for side, words in _SIDES.items():
        named = {
            tuple(dof_in_name(line) for line in text.split("\n"))
            for name, text in texts.items()
            if any(word in name.lower() for word in words)
        }
        whole = [dofs for dofs in named if None not in dofs and len(dofs) in (1, count)]
        if len(whole) == 1:
            points, directions = (
                [dof[part] for dof in whole[0] if dof is not None] for part in (0, 1)
            )
            for what, numbers in (("point", points), ("direction", directions)):
                mapping[f"{side}_{what}"] = numbers[0] if len(set(numbers)) == 1 else numbers
    return mapping


def _rises(array: np.ndarray[Any, Any]) -> bool:
    """Whether an array is a vector of real numbers that rise from 0 or more."""
    values = np.ravel(array)
    is_vector = array.dtype.kind in "fiu" and array.size == max(array.shape or (0,)) > 1
    return is_vector and bool(np.all(np.diff(values) > 0) and values[0] >= 0)
