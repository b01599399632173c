"""Grid points of a campaign: stored in the file's coordinates, read and written as JSON or CSV."""

from __future__ import annotations

import csv
import io
from uuid import UUID

from pydantic import ValidationError
from sqlalchemy import delete, insert, select
from sqlalchemy.orm import Session

from service.campaigns.schemas import GridPoint, GridPoints
from service.campaigns.tables import GridPoint as Row
from service.problems import Fault, Invalid

COLUMNS = ("label", "x_m", "y_m", "z_m")
MOST_FAULTS = 20

Coordinates = tuple[float, float, float]


def stored_points(session: Session, campaign_id: UUID) -> dict[int, Coordinates]:
    """Label to coordinates, m, in the file's frame; by label."""
    rows = session.execute(
        select(Row.label, Row.x_m, Row.y_m, Row.z_m).where(Row.campaign_id == campaign_id).order_by(Row.label)
    )
    return {label: (x, y, z) for label, x, y, z in rows}


def list_points(session: Session, campaign_id: UUID) -> GridPoints:
    """All points of a campaign, by label."""
    return GridPoints(
        items=[
            GridPoint(label=label, x_m=x, y_m=y, z_m=z)
            for label, (x, y, z) in stored_points(session, campaign_id).items()
        ]
    )


def replace_points(session: Session, campaign_id: UUID, points: GridPoints) -> None:
    """Store these points in place of all that are there."""
    session.execute(delete(Row).where(Row.campaign_id == campaign_id))
    if points.items:
        session.execute(insert(Row), [{"campaign_id": campaign_id, **point.model_dump()} for point in points.items])


def to_csv(points: GridPoints) -> str:
    """Points as CSV with a header line; numbers in their shortest exact form."""
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
        raise Invalid(faults[:MOST_FAULTS])
    try:
        return GridPoints(items=points)
    except ValidationError as error:
        raise Invalid("", error.errors()[0]["msg"]) from None
