"""Browser sessions: a key is shown once, and a cookie stands for it until it ends.

The cookie's token is `mbs_<secret>`; of the secret only its SHA-256 is kept. A session has the rights of its key and ends with
it. What changes something must also carry the session's request token, which a page of another origin cannot read.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
from datetime import timedelta

from sqlalchemy import delete, select
from sqlalchemy.orm import Session

from service.access.tables import ApiKey, BrowserSession, User
from service.db.clock import transaction_time

SCHEME = "mbs_"
COOKIE = "modalbase_session"
HEADER = "X-CSRF-Token"
LIFETIME = timedelta(hours=12)


def is_session_token(token: str) -> bool:
    """Whether a bearer token is a session's and not a key."""
    return token.startswith(SCHEME)


def request_token(token: str) -> str:
    """What unsafe requests of a session must carry in the header `X-CSRF-Token`: an HMAC-SHA-256 under the token."""
    return hmac.new(token.encode("utf-8", "surrogatepass"), b"modalbase request", hashlib.sha256).hexdigest()


def open_session(session: Session, key: ApiKey) -> tuple[BrowserSession, str]:
    """Begin a session of a key; sessions of the key that are over are cleared away.

    Args:
        session: the request's transaction.
        key: a valid one.

    Returns:
        Its row and its token, which is shown once.
    """
    now = transaction_time(session)
    session.execute(
        delete(BrowserSession).where(BrowserSession.key_id == key.id, BrowserSession.expires_at <= now),
        execution_options={"synchronize_session": False},
    )
    ends = now + LIFETIME
    token = SCHEME + secrets.token_urlsafe(32)
    row = BrowserSession(
        key_id=key.id,
        token_sha256=digest(token),
        expires_at=ends if key.expires_at is None else min(ends, key.expires_at),
    )
    session.add(row)
    session.flush()
    return row, token


def close_session(session: Session, token: str) -> None:
    """End a session; one that has ended already stays so."""
    session.execute(
        delete(BrowserSession).where(BrowserSession.token_sha256 == digest(token)),
        execution_options={"synchronize_session": False},
    )


def key_of_session(session: Session, token: str) -> tuple[ApiKey, User] | None:
    """The key of a session that has not ended and its user; None where there is no such session."""
    row = session.execute(
        select(ApiKey, User)
        .join(User, User.id == ApiKey.user_id)
        .join(BrowserSession, BrowserSession.key_id == ApiKey.id)
        .where(
            BrowserSession.token_sha256 == digest(token),
            BrowserSession.expires_at > transaction_time(session),
        )
    ).one_or_none()
    return None if row is None else (row[0], row[1])


def digest(token: str) -> bytes:
    """SHA-256 of a token. It has 256 random bits, so a plain digest is as good as a slow one."""
    return hashlib.sha256(token.encode("utf-8", "surrogatepass")).digest()
