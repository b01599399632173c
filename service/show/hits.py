"""What the figure of a point's hits is drawn from: its time blocks, each hit's FRF, and how the hits were judged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING
from uuid import UUID

from sqlalchemy.orm import Session

from fecore.frf import Dof
from fecore.signal import EachHit, Hit, by_point, each_hit
from fecore.signal.blocks import FRF_QUANTITY
from service.compute.hits import BlockRow, describe_verdict, hits_of, whole
from service.errors import NotFound
from service.show.figures.hits import HitShown, PointShown
from service.store.records.operations import block_rows, samples_of
from service.store.records.processings import newest_document
from service.store.records.schemas import HitOut

if TYPE_CHECKING:
    from service.store.records.processings import Processing

MOST_HITS = 40  # hits that one figure draws; of more, the latest
AXES = ("", "x", "y", "z", "rx", "ry", "rz")


@dataclass(frozen=True)
class Chosen:
    """Which hits are drawn; None takes the first there is."""

    point: int | None = None  # where it was hit
    direction: int | None = None  # of the hit, signed
    response: int | None = None  # where the sensor stood


@dataclass(frozen=True)
class PointBlocks:
    """Blocks of the whole hits of one place, without their samples; and the processing that judged them last."""

    rows: list[BlockRow]
    judged: Processing | None
    chosen: Chosen

    @property
    def version(self) -> str:
        """What changes whenever the figure does."""
        blocks = " ".join(f"{row.id} {row.sha256.hex()}" for row in self.rows)
        return f"{blocks} {self.judged.id if self.judged else ''}"


def point_blocks(session: Session, campaign_id: UUID, chosen: Chosen) -> PointBlocks:
    """The blocks of the place that was asked for.

    Raises:
        NotFound: the campaign has no hits there; says where it has some.
    """
    places = block_rows(session, campaign_id, None if chosen.point is None else {chosen.point})
    found = [
        (place, rows)
        for place, rows in places.items()
        if chosen.point in (None, place[0]) and chosen.direction in (None, place[1])
    ]
    if not found:
        known = [_name(Dof(*place)) for place in sorted(block_rows(session, campaign_id))]
        there = f"; there are hits at {', '.join(known)}" if known else "; it has no time blocks"
        raise NotFound(f"hit{_where(chosen)} in this campaign{there}")
    rows, lacking = whole(found[0][1])
    if not rows:
        raise NotFound(f"complete hit{_where(chosen)} in this campaign: {'; '.join(lacking)}")
    return PointBlocks(rows, newest_document(session, campaign_id), chosen)


def point_shown(session: Session, blocks: PointBlocks) -> PointShown:
    """The hits with their samples and FRFs.

    They are judged as the newest processing of the campaign judged them; where it has not seen all of them, among themselves.

    Raises:
        NotFound: no sensor stood at the response point.
        InputError: hits are unlike one another.
        Damaged: stored bytes are not the ones that were stored.
    """
    hits, channel = _of_sensor(hits_of(blocks.rows, samples_of(session, blocks.rows)), blocks.chosen.response)
    drawn = hits[-MOST_HITS:]
    known = _known(blocks.judged, drawn)
    found = each_hit(drawn, None if known is None else [verdict.accepted for verdict in known])
    verdicts = known or [HitOut.model_validate(describe_verdict(verdict)) for verdict in found.verdicts]
    response = drawn[0].responses[channel]
    many = f", the latest {len(drawn)} of {len(hits)}" if len(drawn) < len(hits) else ""
    return PointShown(
        title=f"Hits at {_name(drawn[0].force.dof)}, measured at {_name(response.dof)}{many}",
        quantity=response.quantity,
        frf_quantity=FRF_QUANTITY[response.quantity],
        sample_rate_hz=drawn[0].sample_rate_hz,
        frequency_hz=found.frequency_hz,
        pulse_s=found.pulse_s,
        hits=[
            _shown(hit, verdict, found, place=(number, channel))
            for number, (hit, verdict) in enumerate(zip(drawn, verdicts, strict=True))
        ],
        mean=found.mean[channel].values if found.mean else None,
        coherence=found.mean[channel].coherence if sum(found.accepted) > 1 else None,
    )


def _of_sensor(hits: Sequence[Hit], response: int | None) -> tuple[list[Hit], int]:
    """The hits of one set of sensors, and which of its channels is drawn."""
    for group in by_point(hits):
        for channel, dof in enumerate(group[0].pair[1]):
            if response in (None, dof.point):
                return group, channel
    there = sorted({dof.point for hit in hits for dof in hit.pair[1]})
    raise NotFound(f"response at point {response} of these hits; there are {', '.join(map(str, there))}")


def _known(processing: Processing | None, hits: Sequence[Hit]) -> list[HitOut] | None:
    """The verdicts of a processing, where it has one of every hit."""
    if processing is None or processing.document is None:
        return None
    rows = [HitOut.model_validate(row) for row in processing.document["hits"]]
    by_key = {(row.point, row.direction, row.hit): row for row in rows}
    found = [by_key.get((hit.force.dof.point, hit.force.dof.direction, hit.number)) for hit in hits]
    return [row for row in found if row is not None] if None not in found else None


def _shown(hit: Hit, verdict: HitOut, found: EachHit, *, place: tuple[int, int]) -> HitShown:
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
        frf=found.frfs[place],
    )


def _name(dof: Dof) -> str:
    return f"{dof.point}{'−' if dof.direction < 0 else '+'}{AXES[abs(dof.direction)]}"


def _where(chosen: Chosen) -> str:
    wanted = (("point", chosen.point), ("direction", chosen.direction))
    said = [f"{name} {value}" for name, value in wanted if value is not None]
    return f" at {' and '.join(said)}" if said else ""
