"""API keys: `mb_<prefix>_<secret>`. The prefix finds the row; of the secret only its SHA-256 is kept.

The secret has 256 random bits, so a plain digest is as good as a slow one.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
from datetime import UTC, datetime, timedelta

from sqlalchemy import func, select, update
from sqlalchemy.dialects.postgresql import insert
from sqlalchemy.orm import Session

from service.access.tables import ApiKey, User
from service.problems.errors import Unauthorized

SCHEME = "mb"
USED_RESOLUTION = timedelta(minutes=1)


def create_key(session: Session, user: User, name: str) -> tuple[ApiKey, str]:
    """A new key of a user: its row and the key itself, which is shown once and never kept."""
    prefix, secret = secrets.token_hex(6), secrets.token_urlsafe(32)
    row = ApiKey(user_id=user.id, name=name, prefix=prefix, secret_sha256=_digest(secret))
    session.add(row)
    session.flush()
    return row, f"{SCHEME}_{prefix}_{secret}"


def user_named(session: Session, name: str) -> User:
    """The user of that name, made when absent."""
    session.execute(insert(User).values(name=name).on_conflict_do_nothing())
    return session.scalars(select(User).where(User.name == name)).one()


def user_of_key(session: Session, key: str) -> User:
    """The user that a key belongs to.

    Raises:
        Unauthorized: the key is malformed, unknown or revoked; which one is not told.
    """
    scheme, _, rest = key.partition("_")
    prefix, _, secret = rest.partition("_")
    found = None
    if scheme == SCHEME and prefix.isalnum() and prefix.isascii():
        found = session.execute(
            select(ApiKey, User).join(User, User.id == ApiKey.user_id).where(ApiKey.prefix == prefix)
        ).one_or_none()
    stored = found[0].secret_sha256 if found else b"\0" * 32
    proven = hmac.compare_digest(_digest(secret), stored)
    if found is None or not proven or found[0].revoked_at is not None:
        raise Unauthorized("the API key is not valid; make one with `modalbase keys create --name NAME`")
    _touch(session, found[0])
    return found[1]


def _touch(session: Session, key: ApiKey) -> None:
    """Note when the key was last used, to the minute, and never wait for another request that does the same."""
    if key.last_used_at is not None and datetime.now(UTC) - key.last_used_at < USED_RESOLUTION:
        return
    row = select(ApiKey.id).where(ApiKey.id == key.id).with_for_update(skip_locked=True)
    session.execute(
        update(ApiKey).where(ApiKey.id.in_(row)).values(last_used_at=func.now()),
        execution_options={"synchronize_session": False},
    )


def _digest(secret: str) -> bytes:
    return hashlib.sha256(secret.encode("utf-8", "surrogatepass")).digest()
