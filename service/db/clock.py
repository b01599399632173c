"""The database's clock, which all workers and APIs share."""

from __future__ import annotations

from datetime import datetime

from sqlalchemy import func, select
from sqlalchemy.orm import Session


def transaction_time(session: Session) -> datetime:
    """When the session's transaction began, by the database's clock: all rows that one transaction changes get the same
    time.
    """
    return session.execute(select(func.now())).scalar_one()
