"""Figures of what a campaign measured, without any model, and what they are drawn from.

They are the hits of a point, with each hit's FRF and how the hits were judged; an FRF; the shapes
of a mode set; and how alike those of two sets are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING
from uuid import UUID

import numpy as np
from sqlalchemy.orm import Session

from fecore.arrays import ComplexArray, FloatArray
from fecore.correlation import mac
from fecore.frf import Dof
from fecore.modes import MeasuredModes
from fecore.signal import EachHit, Hit, by_point, each_hit
from fecore.signal.blocks import FRF_QUANTITY
from fecore.trend import TrackedMode
from fecore.trend.tracking import FEWEST_DOFS, same_modes
from service.compute.hits import BlockRow, describe_verdict, hits_of, whole
from service.figures.frfs import FrfCurves, HitShown, PointShown, dof_name, frf_figure
from service.figures.marks import Figure, counted, shortened
from service.figures.modes import MOST_MODES, ShapePair, mac_figure, shapes_figure
from service.nouns.campaigns.operations import campaign_of, frame_of
from service.nouns.frfs.data import Cut, make_tables, specimen_points
from service.nouns.modes.operations import load_modes
from service.nouns.records.operations import block_rows, emptied_at, samples_of
from service.nouns.records.processings import newest_document
from service.nouns.records.schemas import HitOut
from service.platform.errors import Conflict, NotFound, require_bytes

if TYPE_CHECKING:
    from service.nouns.frfs.operations import Frf
    from service.nouns.modes.operations import ModeSet
    from service.nouns.records.processings import Processing

MOST_HITS = 40  # hits that one figure draws; of more, the latest
AXES = ("", "x", "y", "z", "rx", "ry", "rz")


@dataclass(frozen=True)
class HitQuery:
    """Which hits are drawn; None takes the first there is."""

    point: int | None = None  # where it was hit
    direction: int | None = None  # of the hit, signed
    response: int | None = None  # where the sensor stood


@dataclass(frozen=True)
class PointBlocks:
    """Blocks of the whole hits of one place, without their samples; and the processing that judged
    them last.
    """

    rows: list[BlockRow]
    judged: Processing | None
    chosen: HitQuery

    @property
    def version(self) -> str:
        """What changes whenever the figure does."""
        blocks = " ".join(f"{row.id} {row.sha256.hex()}" for row in self.rows)
        return f"{blocks} {self.judged.id if self.judged else ''}"


def point_blocks(session: Session, campaign_id: UUID, chosen: HitQuery) -> PointBlocks:
    """The blocks of the place that was asked for.

    Raises:
        NotFound: the campaign has no hits there; says where it has some.
        Gone: a retention rule has emptied all of its time blocks.
    """
    places = block_rows(session, campaign_id, None if chosen.point is None else {chosen.point})
    matches = [
        (place, rows)
        for place, rows in places.items()
        if chosen.point in (None, place[0]) and chosen.direction in (None, place[1])
    ]
    if not matches:
        require_bytes("time blocks", emptied_at(session, campaign_id))
        known = [_name(Dof(*place)) for place in sorted(block_rows(session, campaign_id))]
        there = f"; there are hits at {', '.join(known)}" if known else "; it has no time blocks"
        raise NotFound(f"hit{_where(chosen)} in this campaign{there}")
    rows, lacking = whole(matches[0][1])
    if not rows:
        raise NotFound(f"complete hit{_where(chosen)} in this campaign: {'; '.join(lacking)}")
    return PointBlocks(rows, newest_document(session, campaign_id), chosen)


def point_shown(session: Session, blocks: PointBlocks) -> PointShown:
    """The hits with their samples and FRFs.

    They are judged as the newest processing of the campaign judged them; where it has not seen all
    of them, among themselves.

    Raises:
        NotFound: no sensor stood at the response point.
        InputError: hits are unlike one another.
        Damaged: stored bytes are not the ones that were stored.
    """
    hits, channel = _of_sensor(
        hits_of(blocks.rows, samples_of(session, blocks.rows)), blocks.chosen.response
    )
    drawn = hits[-MOST_HITS:]
    known = _known(blocks.judged, drawn)
    judged = each_hit(drawn, None if known is None else [verdict.accepted for verdict in known])
    verdicts = known or [
        HitOut.model_validate(describe_verdict(verdict)) for verdict in judged.verdicts
    ]
    response = drawn[0].responses[channel]
    many = f", the latest {len(drawn)} of {len(hits)}" if len(drawn) < len(hits) else ""
    return PointShown(
        title=f"Hits at {_name(drawn[0].force.dof)}, measured at {_name(response.dof)}{many}",
        quantity=response.quantity,
        frf_quantity=FRF_QUANTITY[response.quantity],
        sample_rate_hz=drawn[0].sample_rate_hz,
        frequency_hz=judged.frequency_hz,
        pulse_s=judged.pulse_s,
        hits=[
            _shown(hit, verdict, judged, place=(number, channel))
            for number, (hit, verdict) in enumerate(zip(drawn, verdicts, strict=True))
        ],
        mean=judged.mean[channel].values if judged.mean else None,
        coherence=judged.mean[channel].coherence if sum(judged.accepted) > 1 else None,
    )


def _of_sensor(hits: Sequence[Hit], response: int | None) -> tuple[list[Hit], int]:
    """The hits of one set of sensors, and which of its channels is drawn."""
    for group in by_point(hits):
        for channel, dof in enumerate(group[0].pair[1]):
            if response in (None, dof.point):
                return group, channel
    there = sorted({dof.point for hit in hits for dof in hit.pair[1]})
    raise NotFound(
        f"response at point {response} of these hits; there are {', '.join(map(str, there))}"
    )


def _known(processing: Processing | None, hits: Sequence[Hit]) -> list[HitOut] | None:
    """The verdicts of a processing, where it has one of every hit."""
    if processing is None or processing.document is None:
        return None
    rows = [HitOut.model_validate(row) for row in processing.document["hits"]]
    by_key = {(row.point, row.direction, row.hit): row for row in rows}
    known = [by_key.get((hit.force.dof.point, hit.force.dof.direction, hit.number)) for hit in hits]
    return [row for row in known if row is not None] if None not in known else None


def _shown(hit: Hit, verdict: HitOut, judged: EachHit, *, place: tuple[int, int]) -> HitShown:
    failed = [finding for finding in verdict.findings if finding.failed]
    why = ", ".join(finding.criterion for finding in failed)
    if verdict.overruled is not None:
        why = f"{'used' if verdict.overruled else 'left out'} by hand{f' ({why})' if why else ''}"
    return HitShown(
        number=hit.number,
        good=verdict.accepted,
        why=why,
        sentence=" ".join(finding.sentence for finding in failed),
        force=hit.force.samples,
        response=hit.responses[place[1]].samples,
        frf=judged.frfs[place],
    )


def _name(dof: Dof) -> str:
    return f"{dof.point}{'−' if dof.direction < 0 else '+'}{AXES[abs(dof.direction)]}"


def _where(chosen: HitQuery) -> str:
    members = (("point", chosen.point), ("direction", chosen.direction))
    parts = [f"{name} {value}" for name, value in members if value is not None]
    return f" at {' and '.join(parts)}" if parts else ""


def measured_frf_figure(session: Session, frf: Frf, cut: Cut) -> Figure:
    """Magnitude, phase and coherence of an FRF.

    Raises:
        Invalid: the cut leaves no line.
        Damaged: stored bytes are not the ones that were stored.
    """
    (table,) = make_tables(session, [frf], cut)
    ((_, values, coherence),) = table.both()
    ends = (
        (frf.response_point, frf.response_direction),
        (frf.reference_point, frf.reference_direction),
    )
    title = " / ".join(dof_name(Dof(*each)) for each in ends)
    return frf_figure(
        FrfCurves(f"FRF {title}", frf.quantity, table.frequency_hz, values, coherence)
    )


def measured_shapes_figure(session: Session, mode_set: ModeSet) -> Figure:
    """The shapes of a mode set along the axis in which its modes move most, at the points that were
    measured there.

    Raises:
        Conflict: it has no shapes, or its points no coordinates.
    """
    campaign, modes = campaign_of(session, mode_set.campaign_id), load_modes(session, mode_set.id)
    if modes.shapes is None:
        raise Conflict("the modes of the set have no shapes at shared degrees of freedom")
    dofs, places = (
        [frame_of(campaign).dof(dof) for dof in modes.dofs],
        specimen_points(session, campaign),
    )
    moved = np.sum(
        np.abs(modes.shapes / np.abs(modes.shapes).max(axis=1, keepdims=True)) ** 2, axis=0
    )
    axis = max(
        (dof.axis for dof in dofs),
        key=lambda n: sum(moved[i] for i, dof in enumerate(dofs) if dof.axis == n),
    )
    at = {dof.point: i for i, dof in enumerate(dofs) if dof.axis == axis and dof.point in places}
    if not at:
        raise Conflict("the points of the shapes have no coordinates")
    values = modes.shapes[:, list(at.values())] * [dofs[i].sign for i in at.values()]
    titles = [
        f"mode {number}: {hz:.4g} Hz" for number, hz in enumerate(modes.frequency_hz, start=1)
    ]
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
    # (n, m) from 0 to 1; None where a set has no shapes, or they share fewer than three degrees of
    # freedom
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
        Conflict: the frames of two campaigns differ and one lies askew, so that directions cannot
            be compared.
    """
    a, b = (_in_frame(session, each) for each in (first, other))
    if first.campaign_id != other.campaign_id:
        frames = [frame_of(campaign_of(session, each.campaign_id)) for each in (first, other)]
        if any(frame.is_askew for frame in frames) and not np.allclose(
            frames[0].axes, frames[1].axes
        ):
            raise Conflict(
                "the frames of the two campaigns differ and one lies askew: their directions are"
                " not alike"
            )
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
    return MeasuredModes(
        modes.frequency_hz, modes.damping_ratio, modes.shapes, tuple(map(frame.dof, modes.dofs))
    )


def _by_axis(modes: MeasuredModes) -> dict[tuple[int, int], ComplexArray]:
    """(n,) values of all modes along the positive axis of each degree of freedom."""
    if modes.shapes is None:
        return {}
    return {
        (dof.point, dof.axis): dof.sign * modes.shapes[:, k] for k, dof in enumerate(modes.dofs)
    }


def _tracked(
    modes: MeasuredModes, values: Mapping[tuple[int, int], ComplexArray]
) -> list[TrackedMode]:
    return [
        TrackedMode(float(hz), {dof: complex(each[i]) for dof, each in values.items()})
        for i, hz in enumerate(modes.frequency_hz)
    ]


def likeness_figure(session: Session, first: ModeSet, other: ModeSet) -> Figure:
    """The MAC of two sets as a matrix.

    Raises:
        Conflict: they have no shapes at shared degrees of freedom.
    """
    alike = likeness(session, first, other)
    if alike.mac is None:
        raise Conflict(
            f"the sets have shapes at {counted(alike.dofs, 'shared degree')} of freedom, and a MAC"
            f" needs {FEWEST_DOFS}"
        )
    names = [shortened(each.name) for each in (first, other)]
    title = f"MAC of {names[0]} and {names[1]}, at {alike.dofs} shared degrees of freedom"
    rows, columns = _modes(alike.hz), _modes(alike.other_hz)
    return mac_figure(
        alike.mac.tolist(), rows, columns, title, f"mode of {names[1]}", f"mode of {names[0]}"
    )


def _modes(hz: FloatArray) -> Sequence[str]:
    return [f"{number}: {value:.4g} Hz" for number, value in enumerate(hz, start=1)]
