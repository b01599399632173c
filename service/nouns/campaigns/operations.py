"""Campaigns and their grid points: the tables, and what can be done with them."""

import csv
import io
from collections.abc import Iterable, Sequence
from datetime import datetime
from typing import Any
from uuid import UUID

from pydantic import BaseModel, ValidationError
from sqlalchemy import (
    ColumnElement,
    Float,
    ForeignKey,
    Index,
    Select,
    Subquery,
    delete,
    func,
    insert,
    literal,
    select,
    text,
)
from sqlalchemy.dialects.postgresql import JSONB, aggregate_order_by
from sqlalchemy.orm import Mapped, Session, mapped_column

from modalbase.formats.errors import FormatError
from modalbase.formats.points import read_points
from service.compute.frame import SPECIMEN, Frame, make_frame
from service.nouns.campaigns.climate import CLIMATE, stated
from service.nouns.campaigns.schemas import (
    CampaignIn,
    CampaignInputs,
    CampaignOut,
    CampaignPatch,
    FrameIn,
    GridPoint,
    GridPoints,
    Instruments,
)
from service.nouns.structures.operations import structure_for
from service.platform.access import Lookup, User
from service.platform.access.metadata_schema import require_metadata
from service.platform.db.base import (
    Base,
    Big,
    Identified,
    Labelled,
    label_indexes,
    transaction_time,
)
from service.platform.db.bytea import copy_rows
from service.platform.errors import MOST_FAULTS, Fault, Invalid
from service.platform.web import shown_as

WORDS = (
    "(to_tsvector('simple'::regconfig, (name::text || ' '::text) || notes::text)"
    """ || jsonb_to_tsvector('simple'::regconfig, instruments, '["string", "numeric"]'::jsonb))"""
)
"""What a free search reads of a campaign."""


class Campaign(Identified, Labelled, Base):
    """One measurement of a structure. A deleted campaign keeps its row, so that results keep their
    lineage.
    """

    __tablename__ = "campaigns"
    __table_args__ = (
        Index(None, "structure_id", "id"),
        Index(None, "performed_at"),
        Index("ix_campaigns_words", text(WORDS), postgresql_using="gin"),
        *label_indexes("campaigns"),
    )

    structure_id: Mapped[UUID] = mapped_column(ForeignKey("structures.id", ondelete="CASCADE"))
    name: Mapped[str]
    boundary: Mapped[str]
    performed_at: Mapped[datetime | None]
    temperature_c: Mapped[float | None]  # of the climate, and what the constants belong to
    instruments: Mapped[dict[str, Any]]
    frame: Mapped[dict[str, Any] | None] = mapped_column(JSONB(none_as_null=True))
    inputs: Mapped[dict[str, Any] | None] = mapped_column(JSONB(none_as_null=True))
    # others than the climate, by name
    covariates: Mapped[dict[str, float]] = mapped_column(JSONB, server_default=text("'{}'"))
    notes: Mapped[str] = mapped_column(default="")
    updated_at: Mapped[datetime] = mapped_column(server_default=func.now(), onupdate=func.now())
    deleted_at: Mapped[datetime | None]


for _name in CLIMATE:
    if _name not in Campaign.__table__.c:
        setattr(Campaign, _name, mapped_column(_name, Float, nullable=True))


class GridPointRow(Base):
    """A measurement point, in the file's coordinates."""

    __tablename__ = "grid_points"

    campaign_id: Mapped[UUID] = mapped_column(
        ForeignKey("campaigns.id", ondelete="CASCADE"), primary_key=True
    )
    label: Mapped[Big] = mapped_column(primary_key=True)
    x_m: Mapped[float]
    y_m: Mapped[float]
    z_m: Mapped[float]


campaign_for = Lookup(Campaign, "campaign", "structure_id", structure_for)
campaign_of, campaigns_of = campaign_for.row, campaign_for.rows


def frame_of(campaign: Campaign) -> Frame:
    """The campaign's frame: how points and directions of its files lie in the specimen's
    coordinates.

    A campaign that states none has its files in the specimen's frame already: x along the length
    from the clamped end, y across, z out of plane.
    """
    if campaign.frame is None:
        return SPECIMEN
    body = FrameIn.model_validate(campaign.frame)
    return make_frame(body.origin_m, body.x_axis, body.y_axis)


def create_campaign(session: Session, user: User, structure_id: UUID, body: CampaignIn) -> Campaign:
    """Store a new campaign of a structure and note it in the audit trail."""
    structure = structure_for(session, user, structure_id, "editor")
    described = body.model_dump(mode="json")
    require_metadata(session, structure.project_id, "campaign", described)
    described["performed_at"] = body.performed_at
    return campaign_for.add(
        session, user, Campaign(structure_id=structure.id, **described), name=body.name
    )


def describe_anew(session: Session, user: User, campaign_id: UUID, body: CampaignIn) -> Campaign:
    """State of a campaign all that a body says, in place of what was stated before."""
    campaign = campaign_for(session, user, campaign_id, "editor", lock=True)
    patch = CampaignPatch.model_validate(body.model_dump(mode="json"))
    change_campaign(session, user, campaign, patch)
    return campaign


def change_campaign(session: Session, user: User, campaign: Campaign, patch: CampaignPatch) -> None:
    """Apply a patch to a locked campaign; the audit trail keeps the fields as they were and as they
    are now.
    """
    now = patch.model_dump(mode="json", exclude_unset=True)
    was = describe(campaign).model_dump(mode="json", include=set(now))
    for field in patch.model_fields_set:
        value = getattr(patch, field)
        setattr(
            campaign,
            field,
            value.model_dump(mode="json") if isinstance(value, BaseModel) else value,
        )
    demanded = describe(campaign).model_dump(mode="json")
    require_metadata(session, campaign_for.project_of(session, campaign), "campaign", demanded)
    campaign.updated_at = transaction_time(session)
    session.flush()
    campaign_for.note(session, user, campaign, "change", was=was, now=now)


def take_conditions(
    session: Session, campaign_id: UUID, measured: dict[str, float], performed_at: datetime | None
) -> None:
    """Add what a file of a campaign has measured of its conditions, and when it began, to what is
    not stated yet.
    """
    campaign = campaign_for.row(session, campaign_id, lock=True)
    new = {name: value for name, value in measured.items() if name not in stated(campaign)}
    for name in new.keys() & CLIMATE.keys():
        setattr(campaign, name, new[name])
    others = {name: value for name, value in new.items() if name not in CLIMATE}
    campaign.covariates = {**campaign.covariates, **others}
    campaign.performed_at = campaign.performed_at or performed_at
    session.flush()


def describe(campaign: Campaign) -> CampaignOut:
    """A campaign as clients see it; instruments, frame and inputs are filled up with their
    defaults. No query.
    """
    return shown_as(
        CampaignOut,
        campaign,
        instruments=Instruments.model_validate(campaign.instruments),
        frame=FrameIn.model_validate(campaign.frame or {}),
        inputs=CampaignInputs.model_validate(campaign.inputs or {}),
    )


OF_THE_TEST = {"boundary", "frame", "instruments", "inputs", "performed_at", "covariates", *CLIMATE}
"""Members of a campaign that say what the test was like."""


def of_the_test(campaign: CampaignOut) -> dict[str, Any]:
    """What a campaign states of its test, as JSON; what it does not state is left out."""
    return campaign.model_dump(
        mode="json", include=OF_THE_TEST, exclude_none=True, exclude_defaults=True
    )


def dated_campaigns(
    session: Session,
    structure_id: UUID,
    since: datetime | None,
    among: Select[UUID] | Sequence[UUID] | None = None,
) -> Sequence[Campaign]:
    """A structure's campaigns that state a date, from one on, in the order of their dates; all, or
    those among some. Read afresh.
    """
    query = select(Campaign).where(*_dated(structure_id))
    if among is not None:
        query = query.where(Campaign.id.in_(among))
    if since is not None:
        query = query.where(Campaign.performed_at >= since)
    order = (Campaign.performed_at, Campaign.id)
    return session.scalars(
        query.order_by(*order), execution_options={"populate_existing": True}
    ).all()


def _dated(structure_id: UUID) -> tuple[ColumnElement[bool], ...]:
    return (
        Campaign.structure_id == structure_id,
        Campaign.deleted_at.is_(None),
        Campaign.performed_at.is_not(None),
    )


def campaigns_touched(since: datetime) -> Select[UUID]:
    """Campaigns whose own row has changed since a time, as part of a query."""
    return select(Campaign.id).where(Campaign.updated_at >= since)


def campaign_facts() -> Subquery:
    """Campaigns with what a series takes from them, as part of a query: key, structure, creation,
    date, boundary, deletion and conditions.
    """
    plain = (Campaign.id, Campaign.structure_id, Campaign.created_at, Campaign.performed_at)
    climate = (getattr(Campaign, name) for name in CLIMATE)
    return select(
        *plain, Campaign.boundary, Campaign.deleted_at, Campaign.covariates, *climate
    ).subquery()


def dated_count(session: Session, structure_id: UUID) -> int:
    """How many campaigns of a structure state a date."""
    query = select(func.count()).select_from(Campaign).where(*_dated(structure_id))
    return session.scalar(query) or 0


def campaigns_in(structures: Select[UUID] | Sequence[UUID]) -> Select[UUID]:
    """Keys of the campaigns of some structures, deleted ones too, as part of a query."""
    return select(Campaign.id).where(Campaign.structure_id.in_(structures))


def present_campaigns(session: Session, structures: Select[UUID]) -> Sequence[UUID]:
    """Keys of the campaigns of some structures that are not deleted, oldest first."""
    kept = campaigns_in(structures).where(Campaign.deleted_at.is_(None)).order_by(Campaign.id)
    return session.scalars(kept).all()


def among_campaigns(structure_id: UUID, *, deleted: bool, name: str | None = None) -> Select[UUID]:
    """Keys of a structure's campaigns, or of its deleted ones, of any name or of one, as part of a
    query.
    """
    gone = Campaign.deleted_at.is_not(None) if deleted else Campaign.deleted_at.is_(None)
    query = select(Campaign.id).where(Campaign.structure_id == structure_id, gone)
    return query if name is None else query.where(Campaign.name == name)


def newest_campaigns(session: Session, structures: Select[UUID], most: int) -> Sequence[Campaign]:
    """Campaigns of some structures, the newest first."""
    query = select(Campaign).where(
        Campaign.structure_id.in_(structures), Campaign.deleted_at.is_(None)
    )
    return session.scalars(query.order_by(Campaign.id.desc()).limit(most)).all()


def structures_with(campaigns: Select[UUID]) -> Select[UUID]:
    """Keys of the structures that some campaigns are of, as part of a query."""
    return select(Campaign.structure_id).where(Campaign.id.in_(campaigns))


COLUMNS = ("label", "x_m", "y_m", "z_m")

Coordinates = tuple[float, float, float]


def stored_points(session: Session, campaign_id: UUID) -> dict[int, Coordinates]:
    """The grid points of a campaign: label to coordinates in m, in the file's frame, ordered by
    label.

    `service.nouns.frfs.data.specimen_points` gives them in the specimen's frame.
    """
    rows = session.execute(
        select(GridPointRow.label, GridPointRow.x_m, GridPointRow.y_m, GridPointRow.z_m)
        .where(GridPointRow.campaign_id == campaign_id)
        .order_by(GridPointRow.label)
    )
    return {label: (x, y, z) for label, x, y, z in rows}


def list_points(session: Session, campaign_id: UUID) -> GridPoints:
    """All grid points of a campaign as clients see them, ordered by label, in the file's frame;
    empty where it has none.
    """
    return GridPoints(
        items=[
            GridPoint(label=label, x_m=x, y_m=y, z_m=z)
            for label, (x, y, z) in stored_points(session, campaign_id).items()
        ]
    )


def replace_points(session: Session, campaign_id: UUID, points: GridPoints) -> None:
    """Store these points, in the file's frame, in place of all that the campaign has, which the
    transaction holds.
    """
    session.execute(delete(GridPointRow).where(GridPointRow.campaign_id == campaign_id))
    if points.items:
        session.execute(
            insert(GridPointRow),
            [{"campaign_id": campaign_id, **point.model_dump()} for point in points.items],
        )


def to_csv(points: GridPoints) -> str:
    """Points as CSV: the header `label,x_m,y_m,z_m`, one line for each point, numbers in the
    shortest form that is exact.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow(COLUMNS)
    writer.writerows((p.label, p.x_m, p.y_m, p.z_m) for p in points.items)
    return text.getvalue()


def from_csv(body: bytes) -> GridPoints:
    """Points of a table of text with the columns `label,x_m,y_m,z_m` in any order and unit of
    length (`x_mm`); z may be missing and is then 0.

    Raises:
        Invalid: the text is not such a table; names the line and the column.
    """
    faults: list[Fault] = []
    points: list[GridPoint] = []
    try:
        for line, point in read_points(body):
            if len(faults) > MOST_FAULTS:
                break
            try:
                points.append(GridPoint.model_validate_strings(point, strict=False))
            except ValidationError as error:
                faults += [Fault(f"line {line}, {e['loc'][-1]}", e["msg"]) for e in error.errors()]
    except FormatError as error:
        faults += [Fault(place, why) for place, why in error.faults]
    if faults:
        raise Invalid(faults)
    try:
        return GridPoints(items=points)
    except ValidationError as error:
        raise Invalid("", error.errors()[0]["msg"]) from None


def add_points(
    session: Session, campaign_id: UUID, points: Iterable[tuple[int, Coordinates]]
) -> None:
    """Store more points, by label; none of them is there already."""
    with copy_rows(session, GridPointRow) as write:
        for label, xyz in points:
            write((campaign_id, label, *xyz))


def point_digests(session: Session, campaign_ids: Sequence[UUID]) -> dict[UUID, str]:
    """Digest of each campaign's points; those without any are left out."""
    one = func.concat_ws(
        " ", GridPointRow.label, GridPointRow.x_m, GridPointRow.y_m, GridPointRow.z_m
    )
    digest = func.md5(func.string_agg(one, aggregate_order_by(literal(","), one)))
    query = (
        select(GridPointRow.campaign_id, digest)
        .where(GridPointRow.campaign_id.in_(campaign_ids))
        .group_by(GridPointRow.campaign_id)
    )
    return dict(session.execute(query).all())
