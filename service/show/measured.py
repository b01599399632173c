"""Figures of what a campaign measured, without any model: an FRF, the shapes of a mode set."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from sqlalchemy.orm import Session

from fecore.frf import Dof
from service.errors import Conflict
from service.show.figures.frf import FrfCurves, dof_name, frf_figure
from service.show.figures.marks import Figure
from service.show.figures.shapes import MOST_MODES, ShapePair, shapes_figure
from service.store.campaigns.operations import campaign_of, frame_of
from service.store.frfs.data import Cut, make_tables, specimen_points
from service.store.modes.operations import load_modes

if TYPE_CHECKING:
    from service.store.frfs.operations import Frf
    from service.store.modes.operations import ModeSet


def measured_frf_figure(session: Session, frf: Frf, cut: Cut) -> Figure:
    """Magnitude, phase and coherence of an FRF.

    Raises:
        Invalid: the cut leaves no line.
        Damaged: stored bytes are not the ones that were stored.
    """
    (table,) = make_tables(session, [frf], cut)
    ((_, values, coherence),) = table.both()
    ends = (frf.response_point, frf.response_direction), (frf.reference_point, frf.reference_direction)
    title = " / ".join(dof_name(Dof(*each)) for each in ends)
    return frf_figure(FrfCurves(f"FRF {title}", frf.quantity, table.frequency_hz, values, coherence))


def measured_shapes_figure(session: Session, mode_set: ModeSet) -> Figure:
    """The shapes of a mode set along the axis in which its modes move most, at the points that were measured there.

    Raises:
        Conflict: it has no shapes, or its points no coordinates.
    """
    campaign, modes = campaign_of(session, mode_set.campaign_id), load_modes(session, mode_set.id)
    if modes.shapes is None:
        raise Conflict("the modes of the set have no shapes at shared degrees of freedom")
    dofs, places = [frame_of(campaign).dof(dof) for dof in modes.dofs], specimen_points(session, campaign)
    moved = np.sum(np.abs(modes.shapes / np.abs(modes.shapes).max(axis=1, keepdims=True)) ** 2, axis=0)
    axis = max((dof.axis for dof in dofs), key=lambda n: sum(moved[i] for i, dof in enumerate(dofs) if dof.axis == n))
    at = {dof.point: i for i, dof in enumerate(dofs) if dof.axis == axis and dof.point in places}
    if not at:
        raise Conflict("the points of the shapes have no coordinates")
    values = modes.shapes[:, list(at.values())] * [dofs[i].sign for i in at.values()]
    titles = [f"mode {number}: {hz:.4g} Hz" for number, hz in enumerate(modes.frequency_hz, start=1)]
    pairs = [
        ShapePair(number, title, "", shape, np.zeros(0))
        for number, (title, shape) in enumerate(zip(titles, values, strict=True), start=1)
    ]
    return shapes_figure(pairs[:MOST_MODES], list(at), np.array([places[point] for point in at]))
