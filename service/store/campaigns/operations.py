"""Campaigns: their table, and what can be done with them: describe, change, delete, restore."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import datetime
from typing import Any
from uuid import UUID

from pydantic import BaseModel
from sqlalchemy import ForeignKey, Index, Select, func, select
from sqlalchemy.dialects.postgresql import JSONB
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.access import Lookup, User, audit
from service.compute.frame import SPECIMEN, Frame, make_frame
from service.db.base import Base, Identified
from service.db.clock import transaction_time
from service.store.campaigns.schemas import CampaignIn, CampaignInputs, CampaignOut, CampaignPatch, FrameIn, Instruments
from service.store.structures.operations import structure_for
from service.web import shown_as


class Campaign(Identified, Base):
    """One measurement of a structure. A deleted campaign keeps its row, so that results keep their lineage."""

    __tablename__ = "campaigns"
    __table_args__ = (Index(None, "structure_id", "id"),)

    structure_id: Mapped[UUID] = mapped_column(ForeignKey("structures.id", ondelete="CASCADE"))
    name: Mapped[str]
    boundary: Mapped[str]
    performed_at: Mapped[datetime | None]
    temperature_c: Mapped[float | None]
    humidity_percent: Mapped[float | None]
    instruments: Mapped[dict[str, Any]]
    frame: Mapped[dict[str, Any] | None] = mapped_column(JSONB(none_as_null=True))
    inputs: Mapped[dict[str, Any] | None] = mapped_column(JSONB(none_as_null=True))
    notes: Mapped[str] = mapped_column(default="")
    updated_at: Mapped[datetime] = mapped_column(server_default=func.now(), onupdate=func.now())
    deleted_at: Mapped[datetime | None]


campaign_for = Lookup(Campaign, "campaign", "structure_id", structure_for)
"""The campaign, if the user has at least a role in its project."""


def frame_of(campaign: Campaign) -> Frame:
    """The campaign's frame: how points and directions of its files lie in the specimen's coordinates.

    A campaign that states none has its files in the specimen's frame already: x along the length from the clamped
    end, y across, z out of plane.
    """
    if campaign.frame is None:
        return SPECIMEN
    body = FrameIn.model_validate(campaign.frame)
    return make_frame(body.origin_m, body.x_axis, body.y_axis)


def create_campaign(session: Session, user: User, structure_id: UUID, body: CampaignIn) -> Campaign:
    """Store a new campaign of a structure and note it in the audit trail."""
    structure = structure_for(session, user, structure_id, "editor")
    described = body.model_dump(mode="json") | {"performed_at": body.performed_at}
    campaign = Campaign(structure_id=structure.id, **described)
    session.add(campaign)
    session.flush()
    session.refresh(campaign)
    audit(session, user, "campaign.create", "campaign", campaign.id, structure.project_id, name=body.name)
    return campaign


def change_campaign(session: Session, user: User, campaign: Campaign, patch: CampaignPatch) -> None:
    """Apply a patch to a locked campaign; the audit trail keeps the fields as they were and as they are now."""
    now = patch.model_dump(mode="json", exclude_unset=True)
    was = describe(campaign).model_dump(mode="json", include=set(now))
    for field in patch.model_fields_set:
        value = getattr(patch, field)
        setattr(campaign, field, value.model_dump(mode="json") if isinstance(value, BaseModel) else value)
    campaign.updated_at = transaction_time(session)
    session.flush()
    project_id = campaign_for.project_of(session, campaign)
    audit(session, user, "campaign.change", "campaign", campaign.id, project_id, was=was, now=now)


def describe(campaign: Campaign) -> CampaignOut:
    """A campaign as clients see it; instruments, frame and inputs are filled up with their defaults. No query."""
    return shown_as(
        CampaignOut,
        campaign,
        instruments=Instruments.model_validate(campaign.instruments),
        frame=FrameIn.model_validate(campaign.frame or {}),
        inputs=CampaignInputs.model_validate(campaign.inputs or {}),
    )


def campaign_of(session: Session, campaign_id: UUID, *, lock: bool = False) -> Campaign:
    """The row of a campaign, whoever asks."""
    return session.get_one(Campaign, campaign_id, with_for_update=lock or None)


def campaigns_of(session: Session, keys: Iterable[UUID]) -> Sequence[Campaign]:
    """Rows by key, whoever asks."""
    return session.scalars(select(Campaign).where(Campaign.id.in_(set(keys)))).all()


def dated_campaigns(session: Session, structure_id: UUID, since: datetime | None) -> Sequence[Campaign]:
    """A structure's campaigns that state a date, from one on, in the order of their dates; read afresh."""
    query = select(Campaign).where(
        Campaign.structure_id == structure_id, Campaign.deleted_at.is_(None), Campaign.performed_at.is_not(None)
    )
    if since is not None:
        query = query.where(Campaign.performed_at >= since)
    order = (Campaign.performed_at, Campaign.id)
    return session.scalars(query.order_by(*order), execution_options={"populate_existing": True}).all()


def campaigns_in(structures: Select[UUID] | Sequence[UUID]) -> Select[UUID]:
    """Keys of the campaigns of some structures, deleted ones too, as part of a query."""
    return select(Campaign.id).where(Campaign.structure_id.in_(structures))


def structures_with(campaigns: Select[UUID]) -> Select[UUID]:
    """Keys of the structures that some campaigns are of, as part of a query."""
    return select(Campaign.structure_id).where(Campaign.id.in_(campaigns))
