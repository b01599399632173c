"""API keys: `mb_<prefix>_<secret>`. The prefix finds the row; of the secret only its SHA-256 is kept.

The secret has 256 random bits, so a plain digest is as good as a slow one.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

from sqlalchemy import func, select, update
from sqlalchemy.dialects.postgresql import insert
from sqlalchemy.orm import Session

from service.access.sessions import is_session_token, key_of_session
from service.access.tables import ApiKey, User
from service.errors import Unauthorized

SCHEME = "mb"
USED_RESOLUTION = timedelta(minutes=1)


def create_key(
    session: Session,
    user: User,
    name: str,
    scopes: Sequence[str] = ("read", "write", "jobs", "admin"),
    expires_at: datetime | None = None,
) -> tuple[ApiKey, str]:
    """Make a new API key of a user.

    Args:
        session: the request's transaction.
        user: whose key.
        name: what the user calls it.
        scopes: what it may be used for.
        expires_at: when it stops being valid.

    Returns:
        Its row and the key itself, which is shown once: of its secret only the SHA-256 is stored.
    """
    prefix, secret = secrets.token_hex(6), secrets.token_urlsafe(32)
    row = ApiKey(
        user_id=user.id,
        name=name,
        prefix=prefix,
        secret_sha256=_digest(secret),
        scopes=list(scopes),
        expires_at=expires_at,
    )
    session.add(row)
    session.flush()
    return row, f"{SCHEME}_{prefix}_{secret}"


def user_named(session: Session, name: str) -> User:
    """The user of that name, who is made when absent; two requests at once get the same user."""
    session.execute(insert(User).values(name=name).on_conflict_do_nothing())
    return session.scalars(select(User).where(User.name == name)).one()


def user_of_key(session: Session, key: str) -> User:
    """The user that a key belongs to; see `found_key`."""
    return found_key(session, key)[1]


def found_key(session: Session, key: str) -> tuple[ApiKey, User]:
    """A valid key, or that of a browser's session, and the user that it belongs to.

    Raises:
        Unauthorized: the key is malformed, unknown, revoked or expired, or its user is disabled; the error does not say
            which.
    """
    if is_session_token(key):
        return _key_of_session(session, key)
    scheme, _, rest = key.partition("_")
    prefix, _, secret = rest.partition("_")
    found = None
    if scheme == SCHEME and prefix.isalnum() and prefix.isascii():
        found = session.execute(
            select(ApiKey, User).join(User, User.id == ApiKey.user_id).where(ApiKey.prefix == prefix)
        ).one_or_none()
    stored = found[0].secret_sha256 if found else b"\0" * 32
    proven = hmac.compare_digest(_digest(secret), stored)
    if found is None or not proven or not _opens(*found):
        raise Unauthorized("the API key is not valid; make one with `modalbase keys create --name NAME`")
    _touch(session, found[0])
    return found[0], found[1]


def _key_of_session(session: Session, token: str) -> tuple[ApiKey, User]:
    found = key_of_session(session, token)
    if found is None or not _opens(*found):
        raise Unauthorized("the session has ended; sign in again")
    _touch(session, found[0])
    return found


def _opens(key: ApiKey, user: User) -> bool:
    late = key.expires_at is not None and key.expires_at <= datetime.now(UTC)
    return key.revoked_at is None and user.disabled_at is None and not late


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
