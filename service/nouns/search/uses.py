"""What each campaign was measured with: a row for each instrument, which triggers keep as campaigns
and instruments change.

The calibration that counts is the last one before the campaign. `calibration_expired` is null where
nobody says when the campaign was, or until when the instrument was calibrated.
"""

from collections.abc import Mapping
from datetime import date, datetime
from uuid import UUID

from sqlalchemy import (
    ARRAY,
    BigInteger,
    ColumnElement,
    DateTime,
    ForeignKey,
    FromClause,
    Index,
    and_,
    any_,
    case,
    cast,
    exists,
    false,
    func,
    not_,
    or_,
    select,
    text,
)
from sqlalchemy.orm import Mapped, mapped_column

from service.platform.db.base import Base


class InstrumentUse(Base):
    """An instrument of a campaign, as the campaign states it, and the registered one that it means.

    A sensor was at its `points`; where it has none, everywhere but at those of the `others`.
    """

    __tablename__ = "instrument_uses"
    __table_args__ = (
        Index(None, "serial"),
        Index(None, "model"),
        Index(None, "instrument_id"),
        Index(
            "ix_instrument_uses_expired",
            "campaign_id",
            postgresql_where=text("calibration_expired"),
        ),
    )

    campaign_id: Mapped[UUID] = mapped_column(
        ForeignKey("campaigns.id", ondelete="CASCADE"), primary_key=True
    )
    number: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    kind: Mapped[str]
    serial: Mapped[str | None]
    model: Mapped[str | None]
    points: Mapped[list[int] | None] = mapped_column(ARRAY(BigInteger))
    others: Mapped[list[int]] = mapped_column(ARRAY(BigInteger), server_default="{}")
    instrument_id: Mapped[UUID | None] = mapped_column(
        ForeignKey("instruments.id", ondelete="SET NULL")
    )
    calibrated_on: Mapped[date | None]
    calibrated_until: Mapped[date | None]
    calibration_expired: Mapped[bool | None]


def used_instruments() -> FromClause:
    """A row for each registered instrument of each campaign."""
    use, instrument = (
        Base.metadata.tables[name].alias() for name in ("instrument_uses", "instruments")
    )
    return (
        select(
            *(use.c[name] for name in ("campaign_id", "points", "others", "calibration_expired")),
            *(instrument.c[name] for name in ("id", "kind", "serial", "model")),
            _midnight(use.c.calibrated_on).label("calibrated_on"),
            _midnight(use.c.calibrated_until).label("calibrated_until"),
        )
        .join(instrument, instrument.c.id == use.c.instrument_id)
        .where(instrument.c.deleted_at.is_(None))
        .subquery()
    )


def sensors() -> FromClause:
    """A row for each sensor of each campaign, registered or not."""
    use = Base.metadata.tables["instrument_uses"].alias()
    return select(use).where(use.c.kind == "sensor").subquery()


def at_response(
    use: FromClause, scope: Mapping[str, FromClause], condition: ColumnElement[bool]
) -> ColumnElement[bool] | None:
    """That an instrument of which something is asked was used for the FRF or time block at hand;
    None where none is at hand.

    Where a campaign's sensors state no points, all were used for all that it measured. The rest
    stands in a function, so that the planner does not take it for a second condition that is
    independent of the first, by which it reaches the campaigns.
    """
    if (measured := scope.get("frf", scope.get("record"))) is None:
        return None
    everywhere = scope["campaign"].c.instruments[("sensors", "0")].is_(None)
    return or_(
        everywhere,
        func.coalesce(exists().select_from(use).where(condition, covers(use, measured)), false()),
    )


def covers(use: FromClause, measured: FromClause) -> ColumnElement[bool]:
    """That an instrument of a campaign was used for one of its FRFs or time blocks. A block of the
    hammer is of no sensor that stood at points.
    """
    of_block = measured.c.get("response_point") is None
    point = (
        case((measured.c.quantity != "force", measured.c.point))
        if of_block
        else measured.c.response_point
    )
    return and_(
        or_(use.c.points.is_(None), point == any_(use.c.points)), not_(point == any_(use.c.others))
    )


def _midnight(day: ColumnElement[date | None]) -> ColumnElement[datetime]:
    """The beginning of a day, UTC."""
    return func.timezone("UTC", cast(day, DateTime))
