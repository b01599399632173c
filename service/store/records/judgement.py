"""How hits that are stored are judged now, and what a person decided of them."""

from __future__ import annotations

from collections.abc import Sequence
from uuid import UUID

from sqlalchemy.orm import Session

from fecore.signal import Processing, Verdict, inspect
from service.compute.hits import by_sensors, describe_verdict, hits_of, whole
from service.store.records.decisions import HitDecision, standing
from service.store.records.operations import Record, block_rows, describe, samples_of
from service.store.records.schemas import HitDecisionOut, StoredHit, StoredRecords
from service.web import shown_as

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
