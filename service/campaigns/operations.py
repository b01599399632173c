"""What can be done with campaigns themselves: describe, change, delete, restore."""

from __future__ import annotations

from uuid import UUID

from pydantic import BaseModel
from sqlalchemy import select
from sqlalchemy.orm import Session

from service.access import Role, User, audit, bring_back, hide
from service.campaigns.frame import SPECIMEN, Frame, make_frame
from service.campaigns.schemas import CampaignIn, CampaignOut, CampaignPatch, FrameIn, Instruments
from service.campaigns.tables import Campaign
from service.db.clock import transaction_time
from service.problems import NotFound, not_found_as
from service.structures.operations import structure_for
from service.structures.tables import Structure


def campaign_for(
    session: Session, user: User, campaign_id: UUID, role: Role = "viewer", *, deleted: bool = False
) -> Campaign:
    """The campaign, if the user has at least this role in its project.

    Args:
        session: the request's transaction.
        user: who asks.
        campaign_id: which one.
        role: what the act needs.
        deleted: find a deleted campaign too.

    Raises:
        NotFound: there is none, it is other people's, or it is deleted.
        Forbidden: the user's role is too low.
    """
    campaign = session.get(Campaign, campaign_id)
    if campaign is None or (campaign.deleted_at is not None and not deleted):
        raise NotFound("campaign", campaign_id)
    with not_found_as("campaign", campaign_id):
        structure_for(session, user, campaign.structure_id, role)
    return campaign


def lock_campaign(session: Session, campaign: Campaign) -> None:
    """Read the campaign again and keep other edits of it out until the transaction ends.

    The lock lets rows that refer to the campaign come in: an edit does not wait for an import that is being stored.
    """
    session.refresh(campaign, with_for_update={"key_share": True})


def project_of(session: Session, campaign: Campaign) -> UUID:
    """The project that a campaign belongs to."""
    return session.scalars(select(Structure.project_id).where(Structure.id == campaign.structure_id)).one()


def frame_of(campaign: Campaign) -> Frame:
    """The campaign's frame as the core's conversion wants it."""
    if campaign.frame is None:
        return SPECIMEN
    body = FrameIn.model_validate(campaign.frame)
    return make_frame(body.origin_m, body.x_axis, body.y_axis)


def create_campaign(session: Session, user: User, structure_id: UUID, body: CampaignIn) -> Campaign:
    """A new campaign of a structure."""
    structure = structure_for(session, user, structure_id, "editor")
    campaign = Campaign(
        structure_id=structure.id,
        name=body.name,
        boundary=body.boundary,
        performed_at=body.performed_at,
        temperature_c=body.temperature_c,
        humidity_percent=body.humidity_percent,
        instruments=body.instruments.model_dump(mode="json"),
        frame=body.frame and body.frame.model_dump(mode="json"),
        notes=body.notes,
    )
    session.add(campaign)
    session.flush()
    session.refresh(campaign)
    audit(session, user, "campaign.create", "campaign", campaign.id, structure.project_id, name=body.name)
    return campaign


def change_campaign(session: Session, user: User, campaign: Campaign, patch: CampaignPatch) -> None:
    """Apply a patch to a campaign that is locked for update; what was before is kept in the audit trail."""
    now = patch.model_dump(mode="json", exclude_unset=True)
    was = describe(campaign).model_dump(mode="json", include=set(now))
    for field in patch.model_fields_set:
        value = getattr(patch, field)
        setattr(campaign, field, value.model_dump(mode="json") if isinstance(value, BaseModel) else value)
    campaign.updated_at = transaction_time(session)
    session.flush()
    audit(session, user, "campaign.change", "campaign", campaign.id, project_of(session, campaign), was=was, now=now)


def delete_campaign(session: Session, user: User, campaign: Campaign) -> None:
    """Hide a campaign and all that is in it; everything stays stored, so that results keep their lineage."""
    hide(session, user, campaign, "campaign", project_of(session, campaign))


def restore_campaign(session: Session, user: User, campaign: Campaign) -> None:
    """Undo a deletion.

    Raises:
        Conflict: the campaign is not deleted.
    """
    bring_back(session, user, campaign, "campaign", project_of(session, campaign))


def describe(campaign: Campaign) -> CampaignOut:
    """A campaign as clients see it."""
    return CampaignOut(
        id=campaign.id,
        structure_id=campaign.structure_id,
        name=campaign.name,
        boundary=campaign.boundary,  # type: ignore[arg-type]  # the column holds what CampaignIn let in
        performed_at=campaign.performed_at,
        temperature_c=campaign.temperature_c,
        humidity_percent=campaign.humidity_percent,
        instruments=Instruments.model_validate(campaign.instruments),
        frame=FrameIn.model_validate(campaign.frame or {}),
        notes=campaign.notes,
        created_at=campaign.created_at,
        updated_at=campaign.updated_at,
        deleted_at=campaign.deleted_at,
    )
