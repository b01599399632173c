"""Figures of what a campaign measured, without any model: an FRF, the shapes of a mode set, how alike those of two sets are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from sqlalchemy.orm import Session

from fecore.arrays import ComplexArray, FloatArray
from fecore.correlation import mac
from fecore.frf import Dof
from fecore.modes import MeasuredModes
from fecore.trend import TrackedMode
from fecore.trend.tracking import FEWEST_DOFS, same_modes
from service.errors import Conflict
from service.show.figures.frf import FrfCurves, dof_name, frf_figure
from service.show.figures.marks import Figure, counted, shortened
from service.show.figures.matrices import mac_figure
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


@dataclass(frozen=True)
class Likeness:
    """Two sets of modes against each other."""

    hz: FloatArray  # (n,) frequencies of the first set, Hz
    other_hz: FloatArray  # (m,) those of the other one, Hz
    # (n, m) from 0 to 1; None where a set has no shapes, or they share fewer than three degrees of freedom
    mac: FloatArray | None
    dofs: int  # how many they share
    # number from 0 of the other set's mode that each of the first's is, as trends follow modes
    partners: Mapping[int, int]


def likeness(session: Session, first: ModeSet, other: ModeSet) -> Likeness:
    """Compare two mode sets in the specimen's frame, points by their numbers.

    Args:
        session: of the request.
        first: a set.
        other: another one, of the same campaign or of another.

    Raises:
        Conflict: the frames of two campaigns differ and one lies askew, so that directions cannot be compared.
    """
    a, b = (_in_frame(session, each) for each in (first, other))
    if first.campaign_id != other.campaign_id:
        frames = [frame_of(campaign_of(session, each.campaign_id)) for each in (first, other)]
        if any(frame.is_askew for frame in frames) and not np.allclose(frames[0].axes, frames[1].axes):
            raise Conflict("the frames of the two campaigns differ and one lies askew: their directions are not alike")
    values = [_by_axis(modes) for modes in (a, b)]
    shared = sorted(set(values[0]) & set(values[1]))
    sides = [_tracked(modes, each) for modes, each in zip((a, b), values, strict=True)]
    matrix = None
    if len(shared) >= FEWEST_DOFS:
        matrix = mac(*(np.column_stack([each[dof] for dof in shared]) for each in values))
    return Likeness(a.frequency_hz, b.frequency_hz, matrix, len(shared), same_modes(*sides))


def _in_frame(session: Session, mode_set: ModeSet) -> MeasuredModes:
    modes = load_modes(session, mode_set.id)
    frame = frame_of(campaign_of(session, mode_set.campaign_id))
    return MeasuredModes(modes.frequency_hz, modes.damping_ratio, modes.shapes, tuple(map(frame.dof, modes.dofs)))


def _by_axis(modes: MeasuredModes) -> dict[tuple[int, int], ComplexArray]:
    """(n,) values of all modes along the positive axis of each degree of freedom."""
    if modes.shapes is None:
        return {}
    return {(dof.point, dof.axis): dof.sign * modes.shapes[:, k] for k, dof in enumerate(modes.dofs)}


def _tracked(modes: MeasuredModes, values: Mapping[tuple[int, int], ComplexArray]) -> list[TrackedMode]:
    return [
        TrackedMode(float(hz), {dof: complex(each[i]) for dof, each in values.items()})
        for i, hz in enumerate(modes.frequency_hz)
    ]


def likeness_figure(session: Session, first: ModeSet, other: ModeSet) -> Figure:
    """The MAC of two sets as a matrix.

    Raises:
        Conflict: they have no shapes at shared degrees of freedom.
    """
    found = likeness(session, first, other)
    if found.mac is None:
        raise Conflict(
            f"the sets have shapes at {counted(found.dofs, 'shared degree')} of freedom, and a MAC needs {FEWEST_DOFS}"
        )
    names = [shortened(each.name) for each in (first, other)]
    title = f"MAC of {names[0]} and {names[1]}, at {found.dofs} shared degrees of freedom"
    rows, columns = _modes(found.hz), _modes(found.other_hz)
    return mac_figure(found.mac.tolist(), rows, columns, title, f"mode of {names[1]}", f"mode of {names[0]}")


def _modes(hz: FloatArray) -> Sequence[str]:
    return [f"{number}: {value:.4g} Hz" for number, value in enumerate(hz, start=1)]
