"""Hits accepted or refused by hand: a person decides, says why, and each later processing keeps to it. And how stored hits are
judged now, with what was decided of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from uuid import UUID

from sqlalchemy import ForeignKey, Index, Select, select
from sqlalchemy.orm import Mapped, Session, mapped_column

from fecore.errors import InputError
from fecore.frf import Dof
from fecore.signal import Processing, Verdict, inspect
from service.access import User
from service.compute.hits import BlockRow, Place, by_sensors, describe_verdict, hits_of, whole
from service.db.base import Base, Big, Identified
from service.store.campaigns.operations import campaign_for
from service.store.records.operations import Record, block_rows, describe, samples_of
from service.store.records.schemas import HitDecisionIn, HitDecisionOut, HitNamed, OverruleIn, StoredHit, StoredRecords
from service.web import shown_as


class HitDecision(Identified, Base):
    """What a person decided of one hit; of several decisions the last one counts."""

    __tablename__ = "hit_decisions"
    __table_args__ = (Index(None, "campaign_id", "id"),)

    campaign_id: Mapped[UUID] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"))
    point: Mapped[Big]
    direction: Mapped[int]
    hit: Mapped[Big]
    good: Mapped[bool | None]
    why: Mapped[str]
    by: Mapped[str]


def decide(session: Session, user: User, campaign_id: UUID, body: HitDecisionIn) -> HitDecision:
    """Keep a decision, for every later processing.

    Raises:
        InputError: the campaign has no such hit, or several.
    """
    campaign = campaign_for(session, user, campaign_id, "editor")
    there = set(hits_in(block_rows(session, campaign.id, {body.point}).values()))
    direction = _meant(body, there, "").direction
    stated = body.model_dump(exclude={"direction"})
    row = HitDecision(campaign_id=campaign.id, direction=direction, by=user.name, **stated)
    session.add(row)
    session.flush()
    campaign_for.note(session, user, campaign, "hit.judge", direction=direction, **stated)
    return row


def decisions_of(campaign_id: UUID) -> Select[HitDecision]:
    """The query of all decisions about a campaign's hits."""
    return select(HitDecision).where(HitDecision.campaign_id == campaign_id)


def standing(session: Session, campaign_id: UUID) -> dict[tuple[Dof, int], HitDecision]:
    """The last decision about each hit that is neither taken back nor older than the hit, which may have been measured anew."""
    place = HitDecision.point, HitDecision.direction, HitDecision.hit
    first_block = (
        select(Record.id)
        .where(Record.campaign_id == campaign_id, Record.force_point == HitDecision.point)
        .where(Record.force_direction == HitDecision.direction, Record.hit == HitDecision.hit)
        .order_by(Record.id)
        .limit(1)
        .scalar_subquery()
    )
    last = (
        select(HitDecision)
        .where(HitDecision.campaign_id == campaign_id, HitDecision.id > first_block)
        .distinct(*place)
        .order_by(*place, HitDecision.id.desc())
    )
    found = (row for row in session.scalars(last) if row.good is not None)
    return {(Dof(row.point, row.direction), row.hit): row for row in found}


def hits_in(rows: Iterable[Sequence[BlockRow]]) -> Iterator[tuple[Place, int]]:
    """Place and number of each hit, also of those of which a block was deleted."""
    return ((row.place, row.hit) for group in rows for row in group)


def decisions(overrules: Sequence[OverruleIn], hits: Iterable[tuple[Place, int]]) -> dict[tuple[Dof, int], bool]:
    """Which hits are used, whatever the criteria say.

    Args:
        overrules: as the user stated them; without a direction, the one is meant in which the point was hit.
        hits: place and number of each hit that there is.

    Raises:
        InputError: one means no hit, may mean several, or contradicts another.
    """
    if not overrules:
        return {}
    there = set(hits)
    found: dict[tuple[Dof, int], bool] = {}
    for number, one in enumerate(overrules):
        field = f"overrules.{number}"
        if found.setdefault((_meant(one, there, field), one.hit), one.use) != one.use:
            raise InputError(field, f"contradicts another about {_named(one)}: use it, or leave it out")
    return found


_MOST_PLACES = 8  # that a message names


def _meant(one: HitNamed, there: set[tuple[Place, int]], field: str) -> Dof:
    """Where the hit is that is meant; `field` names it in an error."""
    own = sorted({direction for (point, direction), hit in there if (point, hit) == (one.point, one.hit)})
    if one.direction is None and len(own) > 1:
        listed = ", ".join(map(str, own))
        where = f"{field}.direction".lstrip(".")
        raise InputError(where, f"is missing: there is {_named(one)} in directions {listed}")
    if not own or one.direction not in (None, *own):
        raise InputError(field or "hit", f"means {_named(one)}, which does not exist; there are {_listed(there)}")
    return Dof(one.point, own[0] if one.direction is None else one.direction)


def _named(one: HitNamed) -> str:
    way = "" if one.direction is None else f" in direction {one.direction}"
    return f"hit {one.hit} of point {one.point}{way}"


def _listed(there: set[tuple[Place, int]]) -> str:
    numbers: dict[Place, list[int]] = {}
    for place, hit in sorted(there):
        numbers.setdefault(place, []).append(hit)
    found = [
        f"point {point}, direction {direction}: hits {min(own)} to {max(own)}"
        for (point, direction), own in numbers.items()
    ]
    more = f"; and {len(found) - _MOST_PLACES} other places" if len(found) > _MOST_PLACES else ""
    return ("; ".join(found[:_MOST_PLACES]) or "no hits at all") + more


MOST_LOOKED_AT = 64
"""Blocks of the points concerned above which an answer does not judge their hits; a processing does."""


def judged(session: Session, campaign_id: UUID, stored: Sequence[Record]) -> StoredRecords:
    """Blocks as clients see them, with the judgement of all hits of their points where these are not too many.

    A hit of which a block was deleted is no reason to refuse later ones: it is named instead of judged.
    """
    answer = StoredRecords(items=[describe(row) for row in stored], hits=[], coherence={}, incomplete=[])
    known = block_rows(session, campaign_id, {row.force_point for row in stored})
    places = [whole(rows) for rows in known.values()]
    answer.incomplete = [sentence for _, sentences in places for sentence in sentences]
    if sum(len(rows) for rows, _ in places) > MOST_LOOKED_AT:
        return answer
    alike = [of_sensors for rows, _ in places for of_sensors in by_sensors(rows)]
    alike.sort(key=lambda rows: max(row.id for row in rows))  # the coherence of a place is that of its newest hits
    by_hand = standing(session, campaign_id)
    overrules = {hit: bool(decision.good) for hit, decision in by_hand.items()}
    found = inspect([hits_of(rows, samples_of(session, rows)) for rows in alike], Processing(overrules=overrules))
    answer.hits = [_stored(verdict, by_hand.get((verdict.force, verdict.number))) for verdict in found.verdicts]
    answer.coherence = {str(dof.point): value for dof, value in found.coherence.items()}
    return answer


def _stored(verdict: Verdict, decision: HitDecision | None) -> StoredHit:
    by_hand = None if decision is None else shown_as(HitDecisionOut, decision)
    return StoredHit.model_validate({**describe_verdict(verdict), "decision": by_hand})
