"""Points of series: a row for each value of a parameter, and which of them are shown.

Of a long series a client gets a part, or every k-th campaign; a figure the lowest and the highest
value of each of many pieces, so that what stands out is seen.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import TYPE_CHECKING, Any
from uuid import UUID

from psycopg.types.json import Jsonb
from sqlalchemy import ColumnElement, delete, func, or_, select, tuple_
from sqlalchemy.orm import Session

from fecore.trend import Before, Condition, State
from service.nouns.campaigns.operations import campaign_facts
from service.nouns.monitors.tables import Alarm, MonitorPoint, MonitorRun
from service.platform.db.bytea import copy_rows
from service.platform.errors import Invalid

if TYPE_CHECKING:
    from service.nouns.monitors.tables import Monitor, MonitorSeries

MOST = 1000  # campaigns of a series that are shown where nobody states how many
VALUES = 2000  # of all parameters together, so that an answer has some 1 MB
EVERY = 10_000_000  # more than any series has
PIECES = 400  # of a figure of one parameter; a screen has some 1,000 pixels

_COLUMNS = (
    "campaign_id", "performed_at", "raw", "standard_deviation", "corrected", "in_baseline", "judged",
)  # fmt: skip


@dataclass(frozen=True)
class Part:
    """Which campaigns of a series are shown."""

    begin: datetime | None = None  # from this one on
    end: datetime | None = None  # up to this one
    limit: int = MOST  # at most so many of them
    stride: int | None = None  # every so many-th; None: as `limit` asks for
    values: int | None = None  # at most so many, of all parameters together; None: any

    def of(self, parameters: int) -> Part:
        """The same of a series of so many parameters, with what its values leave of the limit."""
        if self.values is None:
            return self
        return replace(self, limit=min(self.limit, max(1, self.values // max(parameters, 1))))


def shown_runs(session: Session, series: MonitorSeries, part: Part) -> tuple[list[UUID], int, int]:
    """Campaigns of a part that have runs, in the order of time; how many lie between its ends, and
    its stride.
    """
    run = select(MonitorRun.campaign_id).where(MonitorRun.series_id == series.id).distinct()
    campaign = campaign_facts().c
    when = campaign.performed_at
    within = [
        *([] if part.begin is None else [when >= part.begin]),
        *([] if part.end is None else [when <= part.end]),
    ]
    among = (campaign.id.in_(run), *within)
    count = session.scalar(select(func.count()).select_from(campaign.id.table).where(*among)) or 0
    stride = part.stride or max(1, math.ceil(count / part.limit))
    # undated ones stand at the end, by their creation
    order = (when.is_(None), func.coalesce(when, campaign.created_at), campaign.id)
    place = func.row_number().over(order_by=[column.desc() for column in order]).label("place")
    numbered = select(campaign.id, place).where(*among).subquery()
    chosen = select(numbered.c.id).where((numbered.c.place - 1) % stride == 0)
    rows = session.scalars(chosen.order_by(numbered.c.place).limit(part.limit)).all()
    return list(rows)[::-1], count, stride


def points_of(
    session: Session, series: MonitorSeries, campaigns: Sequence[UUID]
) -> dict[str, list[dict[str, Any]]]:
    """Points of campaigns, by parameter."""
    facts = campaign_facts().c
    dates = select(facts.performed_at).where(facts.id.in_(campaigns))
    names = select(MonitorPoint.parameter).where(MonitorPoint.series_id == series.id).distinct()
    rows: Any = session.execute(
        select(MonitorPoint.parameter, *(getattr(MonitorPoint, name) for name in _COLUMNS))
        .where(
            MonitorPoint.series_id == series.id,
            MonitorPoint.parameter.in_(session.scalars(names).all()),
            MonitorPoint.performed_at.in_(session.scalars(dates).all()),
        )
        .order_by(MonitorPoint.parameter, MonitorPoint.performed_at)
    )
    points: dict[str, list[dict[str, Any]]] = {}
    for parameter, *values in rows:
        points.setdefault(parameter, []).append(_plain(values))
    return points


def extremes(
    session: Session, series: MonitorSeries, monitor: Monitor, parameter: str, part: Part
) -> list[dict[str, Any]]:
    """Points of a parameter: all, or of each of `PIECES` equal pieces the lowest, the highest and
    those that raised an alarm.
    """
    value = func.coalesce(MonitorPoint.corrected, MonitorPoint.raw)
    piece = func.ntile(PIECES).over(order_by=MonitorPoint.performed_at)
    pieces = (
        select(MonitorPoint, value.label("value"), piece.label("piece"))
        .where(*_within(series, part), MonitorPoint.parameter == parameter)
        .subquery()
    )
    rank = [
        func.row_number().over(partition_by=pieces.c.piece, order_by=order).label(name)
        for name, order in (("low", pieces.c.value), ("high", pieces.c.value.desc()))
    ]
    ranked = select(pieces, *rank).subquery()
    raised = select(Alarm.campaign_id).where(Alarm.monitor_id == monitor.id)
    kept = or_(ranked.c.low == 1, ranked.c.high == 1, ranked.c.campaign_id.in_(raised))
    rows: Any = session.execute(
        select(*(ranked.c[name] for name in _COLUMNS)).where(kept).order_by(ranked.c.performed_at)
    )
    return [_plain(values) for values in rows]


def _within(series: MonitorSeries, part: Part) -> list[ColumnElement[bool]]:
    """The condition of points of a part."""
    when = MonitorPoint.performed_at
    return [
        MonitorPoint.series_id == series.id,
        *([] if part.begin is None else [when >= part.begin]),
        *([] if part.end is None else [when <= part.end]),
    ]


def _plain(values: Sequence[Any]) -> dict[str, Any]:
    point = dict(zip(_COLUMNS, values, strict=True))
    return point | {
        "campaign_id": str(point["campaign_id"]),
        "performed_at": point["performed_at"].isoformat(),
    }


def counts_of(session: Session, series: MonitorSeries) -> dict[str, int]:
    """How many points each parameter has."""
    query = select(MonitorPoint.parameter, func.count()).where(MonitorPoint.series_id == series.id)
    return dict(session.execute(query.group_by(MonitorPoint.parameter)).all())


def points_page(
    session: Session,
    series: MonitorSeries,
    cursor: str | None,
    part: Part,
    parameters: Sequence[str] | None,
) -> tuple[list[MonitorPoint], str | None]:
    """A page of points in the order of time and parameter, and the cursor of the next one.

    Raises:
        Invalid: the cursor is not one of this list.
    """
    place = (MonitorPoint.performed_at, MonitorPoint.parameter)
    query = select(MonitorPoint).where(*_within(series, part))
    if parameters is not None:
        query = query.where(MonitorPoint.parameter.in_(parameters))
    if cursor is not None:
        query = query.where(tuple_(*place) > _decode(cursor))
    rows = session.scalars(query.order_by(*place).limit(part.limit + 1)).all()
    page = list(rows[: part.limit])
    if len(rows) <= part.limit:
        return page, None
    last = f"{page[-1].performed_at.isoformat()} {page[-1].parameter}"
    return page, base64.urlsafe_b64encode(last.encode()).decode()


def _decode(cursor: str) -> tuple[datetime, str]:
    try:
        date, _, parameter = base64.urlsafe_b64decode(cursor).decode().partition(" ")
        return datetime.fromisoformat(date), parameter
    except ValueError:
        raise Invalid(
            "cursor", "is not a cursor of this list; take `next_cursor` of a page"
        ) from None


def left_before(
    session: Session, series: MonitorSeries, parameters: Iterable[str], date: datetime
) -> dict[str, tuple[Before, str | None]]:
    """What the campaigns up to a date leave of each parameter that was judged there, and the
    campaign that raised the alarm that stands.
    """
    left = {}
    for parameter in parameters:
        row = session.scalars(
            select(MonitorPoint)
            .where(
                MonitorPoint.series_id == series.id,
                MonitorPoint.parameter == parameter,
                MonitorPoint.performed_at <= date,
            )
            .order_by(MonitorPoint.performed_at.desc())
            .limit(1)
        ).one_or_none()
        if row is None or row.judged is None or row.condition is None:
            continue
        stands = row.condition
        condition = Condition(State(stands["state"]), stands["outside"], stands["acknowledged"])
        left[parameter] = (
            Before(row.performed_at, row.judged["chart"], condition),
            stands["raised"],
        )
    return left


def keep_points(
    session: Session,
    series: MonitorSeries,
    points: Mapping[str, tuple[datetime | None, Sequence[Mapping[str, Any]]]],
) -> None:
    """Store the points of a judgement.

    Args:
        session: the transaction.
        series: whose.
        points: of each parameter that is judged: after when its points are new (None: all of
            them), and these.
    """
    old = delete(MonitorPoint).where(MonitorPoint.series_id == series.id)
    session.execute(old.where(MonitorPoint.parameter.not_in([*points])))
    for parameter, (after, _) in points.items():
        own = old.where(MonitorPoint.parameter == parameter)
        session.execute(own if after is None else own.where(MonitorPoint.performed_at > after))
    names = ("series_id", "parameter", *_COLUMNS, "condition")
    with copy_rows(session, MonitorPoint, names) as write:
        for parameter, (_, rows) in points.items():
            for row in rows:
                write((series.id, parameter, *(_typed(name, row[name]) for name in names[2:])))


def _typed(name: str, value: Any) -> Any:
    if name == "campaign_id":
        return UUID(value)
    if name in ("judged", "condition"):
        return None if value is None else Jsonb(value)
    return datetime.fromisoformat(value) if name == "performed_at" else value
