"""Grid points of a campaign: stored in the file's coordinates, read and written as JSON or CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from uuid import UUID

from pydantic import ValidationError
from sqlalchemy import ForeignKey, delete, func, insert, literal, select
from sqlalchemy.dialects.postgresql import aggregate_order_by
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.db.base import Base, Big
from service.db.bytea import copy_rows
from service.errors import MOST_FAULTS, Fault, Invalid
from service.store.campaigns.schemas import GridPoint, GridPoints


class GridPointRow(Base):
    """A measurement point, in the file's coordinates."""

    __tablename__ = "grid_points"

    campaign_id: Mapped[UUID] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"), primary_key=True)
    label: Mapped[Big] = mapped_column(primary_key=True)
    x_m: Mapped[float]
    y_m: Mapped[float]
    z_m: Mapped[float]


COLUMNS = ("label", "x_m", "y_m", "z_m")

Coordinates = tuple[float, float, float]


def stored_points(session: Session, campaign_id: UUID) -> dict[int, Coordinates]:
    """The grid points of a campaign: label to coordinates in m, in the file's frame, ordered by label.

    `service.store.frfs.measured_campaign.specimen_points` gives them in the specimen's frame.
    """
    rows = session.execute(
        select(GridPointRow.label, GridPointRow.x_m, GridPointRow.y_m, GridPointRow.z_m)
        .where(GridPointRow.campaign_id == campaign_id)
        .order_by(GridPointRow.label)
    )
    return {label: (x, y, z) for label, x, y, z in rows}


def list_points(session: Session, campaign_id: UUID) -> GridPoints:
    """All grid points of a campaign as clients see them, ordered by label, in the file's frame; empty where it has
    none.
    """
    return GridPoints(
        items=[
            GridPoint(label=label, x_m=x, y_m=y, z_m=z)
            for label, (x, y, z) in stored_points(session, campaign_id).items()
        ]
    )


def replace_points(session: Session, campaign_id: UUID, points: GridPoints) -> None:
    """Store these points, in the file's frame, in place of all that the campaign has, which the transaction holds."""
    session.execute(delete(GridPointRow).where(GridPointRow.campaign_id == campaign_id))
    if points.items:
        session.execute(
            insert(GridPointRow), [{"campaign_id": campaign_id, **point.model_dump()} for point in points.items]
        )


def to_csv(points: GridPoints) -> str:
    """Points as CSV: the header `label,x_m,y_m,z_m`, one line for each point, numbers in the shortest form that is
    exact.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow(COLUMNS)
    writer.writerows((p.label, p.x_m, p.y_m, p.z_m) for p in points.items)
    return text.getvalue()


def from_csv(body: bytes) -> GridPoints:
    """Points of a CSV text with the header `label,x_m,y_m,z_m` in any order; `z_m` may be missing and is then 0.

    Raises:
        Invalid: the text is not such a table; names the line and the column.
    """
    try:
        text = body.decode("utf-8-sig")
        rows = list(csv.reader(io.StringIO(text), strict=True))
    except UnicodeDecodeError as error:
        raise Invalid("", f"the CSV is not UTF-8: {error.reason} at byte {error.start}") from None
    except csv.Error as error:
        raise Invalid("", f"the CSV cannot be read: {error}") from None
    header = [cell.strip() for cell in rows[0]] if rows else []
    if set(header) - set(COLUMNS) or len(set(header)) != len(header) or not {"label", "x_m", "y_m"} <= set(header):
        raise Invalid("", f"line 1 is {','.join(header)[:200]!r}, expected the header {','.join(COLUMNS)}")
    faults: list[Fault] = []
    points: list[GridPoint] = []
    for line, row in enumerate(rows[1:], 2):
        if len(faults) > MOST_FAULTS:
            break
        if not any(cell.strip() for cell in row):
            continue
        if len(row) != len(header):
            faults.append(Fault(f"line {line}", f"has {len(row)} cells, the header has {len(header)}"))
            continue
        try:
            points.append(GridPoint.model_validate_strings(dict(zip(header, map(str.strip, row), strict=True))))
        except ValidationError as error:
            faults += [Fault(f"line {line}, {e['loc'][-1]}", e["msg"]) for e in error.errors()]
    if faults:
        raise Invalid(faults)
    try:
        return GridPoints(items=points)
    except ValidationError as error:
        raise Invalid("", error.errors()[0]["msg"]) from None


def add_points(session: Session, campaign_id: UUID, points: Iterable[tuple[int, Coordinates]]) -> None:
    """Store more points, by label; none of them is there already."""
    columns = {"campaign_id": "uuid", "label": "int8", "x_m": "float8", "y_m": "float8", "z_m": "float8"}
    with copy_rows(session, GridPointRow.__tablename__, columns) as write:
        for label, xyz in points:
            write((campaign_id, label, *xyz))


def point_digests(session: Session, campaign_ids: Sequence[UUID]) -> dict[UUID, str]:
    """Digest of each campaign's points; those without any are left out."""
    one = func.concat_ws(" ", GridPointRow.label, GridPointRow.x_m, GridPointRow.y_m, GridPointRow.z_m)
    digest = func.md5(func.string_agg(one, aggregate_order_by(literal(","), one)))
    query = (
        select(GridPointRow.campaign_id, digest)
        .where(GridPointRow.campaign_id.in_(campaign_ids))
        .group_by(GridPointRow.campaign_id)
    )
    return dict(session.execute(query).all())
