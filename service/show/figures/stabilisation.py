"""The stabilisation diagram: poles by order of the model over the mode indicator, coloured by how probably each is a mode."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fecore.arrays import BoolArray, FloatArray
from service.show.figures.colors import INITIAL, MEASURED, QUIET
from service.show.figures.marks import Axis, Curve, Dash, Figure, Mark, Panel, Points, Rule, Scale

NEAR = 0.01
"""Relative distance within which a pole of an order stands for a fitted one: as far as poles of two orders are one."""
KINDS = (
    ("stable in frequency and damping", "circle", 6.0),
    ("stable in frequency", "diamond", 5.0),
    ("new", "cross", 4.0),
)
PROBABILITY = Scale("P", 0, 1, length=0.8)
_DASHES: tuple[Dash, ...] = ("solid", "dash", "dot")


def stabilisation_figure(found: Mapping[str, Any]) -> Figure:
    """Poles by order, the fitted poles above them, and the modes that were chosen.

    A pole of an order has the colour of the fitted pole within 1 % of it; those without one, and all of a document before
    probabilities, are grey. `ids` are the fitted poles' frequencies, by which a page keeps or drops them.

    Args:
        found: an identification's document: `stabilisation`, `modes`, `doubtful` and `refused_poles`.
    """
    diagram, modes, doubtful = found["stabilisation"], found["modes"], found["doubtful"]
    poles = [row for row in (*modes, *doubtful, *found["refused_poles"]) if row["probability"] is not None]
    lines = diagram["indicator"]["frequency_hz"]
    x = Axis("frequency [Hz]", range=(min(lines), max(lines)))
    above = Panel(x, Axis("", "log", bare=True), over=True)
    marks: list[Mark] = [*_indicator(diagram["indicator"], above), *_by_order(diagram, poles)]
    if poles:
        marks.append(_fitted(poles, 1.08 * max(diagram["order"], default=1)))
    marks += [Rule(mode["frequency_hz"], MEASURED, "solid") for mode in modes]
    marks += [Rule(mode["frequency_hz"], INITIAL) for mode in doubtful]
    title = "Stabilisation diagram, with the identified modes as upright lines"
    return Figure(title, marks, [Panel(x, Axis("order of the model")), above], height=520, margins={"r": 90})


def _indicator(indicator: Mapping[str, Any], panel: Panel) -> Iterator[Mark]:
    """The singular values of H, of earlier documents the root of the sum of squares alone."""
    curves = indicator.get("cmif") or [indicator["rms"]]
    name = "CMIF" if "cmif" in indicator else "rms of the FRFs"
    for number, curve in enumerate(curves):
        size = np.asarray(curve, dtype=float)
        look: Any = {"digits": 5, "panel": panel, "hover": None, "listed": number == 0, "dash": _DASHES[number]}
        yield Curve(indicator["frequency_hz"], np.where(size > 0, size, np.nan), name, QUIET, width=1, **look)


def _by_order(diagram: Mapping[str, Any], poles: Sequence[Mapping[str, Any]]) -> Iterator[Mark]:
    hz, order = np.array(diagram["frequency_hz"], dtype=float), np.array(diagram["order"])
    ratio = 100 * np.array(diagram["damping_ratio"], dtype=float)
    near, known = _nearest(hz, np.array([row["frequency_hz"] for row in poles], dtype=float))
    probability = np.array([row["probability"] for row in poles] or [np.nan], dtype=float)[near]
    in_frequency = np.array(diagram["frequency_stable"], dtype=bool)
    in_both = in_frequency & np.array(diagram["damping_stable"], dtype=bool)
    kinds = in_both, in_frequency & ~in_both, ~in_frequency
    for coloured in (False, True):
        for (name, symbol, size), kind in zip(KINDS, kinds, strict=True):
            rows = np.flatnonzero(kind & (known == coloured))
            said = [f"{ratio[k]:.3g} %" + (f", P {probability[k]:.2f}" if coloured else "") for k in rows]
            look: Any = {"text": said, "hover": "%{x:.5g} Hz, ζ %{text}, order %{y}"}
            if coloured:
                look |= {"color": probability[rows], "scale": replace(PROBABILITY, shown=False)}
                look["ids"] = [poles[near[k]]["frequency_hz"] for k in rows]
            else:
                look |= {"color": QUIET, "listed": False}
            yield Points(hz[rows], order[rows], name, symbol=symbol, size=size if coloured else size / 2, **look)


def _nearest(hz: FloatArray, fitted: FloatArray) -> tuple[Any, BoolArray]:
    """(n,) number of the fitted pole that is nearest to each pole, and whether it is near enough to be the same."""
    if not fitted.size:
        return np.zeros(hz.size, dtype=int), np.zeros(hz.size, dtype=bool)
    off = np.abs(hz[:, None] / fitted - 1)
    return np.argmin(off, axis=1), np.asarray(off.min(axis=1, initial=np.inf) < NEAR)


def _fitted(poles: Sequence[Mapping[str, Any]], at: float) -> Mark:
    """The poles of the joint fit in a row on top, each with what speaks most for or against it."""
    hz = [row["frequency_hz"] for row in poles]
    said = [
        f"ζ {100 * row['damping_ratio']:.3g} %, P {row['probability']:.2f}"
        + "".join(f"\n{each['words']}" for each in row["features"][:2])
        for row in poles
    ]
    look: Any = {"text": said, "ids": hz, "hover": "fitted: %{x:.5g} Hz, %{text}", "scale": PROBABILITY}
    return Points(hz, np.full(len(hz), at), "fitted pole", [row["probability"] for row in poles], "square", 10, **look)
