"""Instruments by the campaigns that name them, each with the calibration that counted: the last one before the campaign."""

from __future__ import annotations

from datetime import date, datetime

from sqlalchemy import ColumnElement, Date, DateTime, FromClause, cast, column, func, select, true

from service.db.base import Base


def used_instruments() -> FromClause:
    """A row for each instrument of each campaign; a campaign names one by kind and serial number.

    `calibration_expired` is null where nobody says when the campaign was, or until when the instrument was calibrated.
    """
    campaign, structure, instrument = (
        Base.metadata.tables[n].alias() for n in ("campaigns", "structures", "instruments")
    )
    days = (column("performed_on", Date), column("valid_until", Date))
    each = func.jsonb_to_recordset(instrument.c.calibrations).table_valued(*days).render_derived(with_types=True)
    tested = cast(func.timezone("UTC", campaign.c.performed_at), Date)
    before = select(*each.c).where(each.c.performed_on <= tested).order_by(each.c.performed_on.desc()).limit(1)
    counted = before.lateral()
    named = campaign.c.instruments[instrument.c.kind]["serial"].astext
    return (
        select(
            campaign.c.id.label("campaign_id"),
            *(instrument.c[name] for name in ("id", "kind", "serial", "model")),
            _midnight(counted.c.performed_on).label("calibrated_on"),
            _midnight(counted.c.valid_until).label("calibrated_until"),
            (tested > counted.c.valid_until).label("calibration_expired"),
        )
        .select_from(campaign)
        .join(structure, structure.c.id == campaign.c.structure_id)
        .join(instrument, instrument.c.project_id == structure.c.project_id)
        .outerjoin(counted, true())
        .where(instrument.c.serial == named, instrument.c.deleted_at.is_(None))
        .subquery()
    )


def _midnight(day: ColumnElement[date]) -> ColumnElement[datetime]:
    """The beginning of a day, UTC."""
    return func.timezone("UTC", cast(day, DateTime))
