"""API keys: `mb_<prefix>_<secret>`. The prefix finds the row; of the secret only its SHA-256 is
kept.

A role says what a user may do in a project; a scope narrows that for one key.

A key is shown once; in a browser the cookie of a session stands for it until it ends. The cookie's
token is `mbs_<secret>`; of the secret only its SHA-256 is kept. A session has the rights of its key
and ends with it. What changes something must also carry the session's request token, which a page
of another origin cannot read.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any, Literal, get_args
from uuid import UUID

from sqlalchemy import delete, func, select, update
from sqlalchemy.dialects.postgresql import insert
from sqlalchemy.orm import Session

from service.platform.access.tables import ApiKey, BrowserSession, User
from service.platform.access.users import audit
from service.platform.db.base import transaction_time
from service.platform.errors import Forbidden, NotFound, Unauthorized

if TYPE_CHECKING:
    from starlette.types import Scope as RequestScope

SCHEME = "mb"
SESSION_SCHEME = "mbs_"
COOKIE = "modalbase_session"
HEADER = "X-CSRF-Token"
LIFETIME = timedelta(hours=12)  # of a session
USED_RESOLUTION = timedelta(minutes=1)


def is_session_token(token: str) -> bool:
    """Whether a bearer token is a session's and not a key."""
    return token.startswith(SESSION_SCHEME)


def request_token(token: str) -> str:
    """What unsafe requests of a session must carry in the header `X-CSRF-Token`: an HMAC-SHA-256
    under the token.
    """
    return hmac.new(
        token.encode("utf-8", "surrogatepass"), b"modalbase request", hashlib.sha256
    ).hexdigest()


def open_session(session: Session, key: ApiKey) -> tuple[BrowserSession, str]:
    """Begin a session of a key; sessions of the key that are over are cleared away.

    Returns:
        Its row and its token, which is shown once.
    """
    now = transaction_time(session)
    session.execute(
        delete(BrowserSession).where(
            BrowserSession.key_id == key.id, BrowserSession.expires_at <= now
        ),
        execution_options={"synchronize_session": False},
    )
    ends = now + LIFETIME
    token = SESSION_SCHEME + secrets.token_urlsafe(32)
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
    """SHA-256 of a token or a secret. Each has 256 random bits, so a plain digest is as good as a
    slow one.
    """
    return hashlib.sha256(token.encode("utf-8", "surrogatepass")).digest()


Scope = Literal["read", "write", "jobs", "admin"]
SCOPES: tuple[Scope, ...] = get_args(Scope)

_ADMIN = ("api-keys", "members", "webhooks", "purge", "laboratory")
_JOBS = (
    "update-jobs",
    "identifications",
    "runs",
    "cancel",
    "retry",
    "plans",
    "processings",
)


def scope_of(method: str, path: str) -> Scope:
    """The scope that a route needs, by its method and its path with the ids' names in braces."""
    steps = [step for step in path.split("/") if not step.startswith("{")]
    if "users" in steps:
        return "admin"
    # whoever may read may do so in a browser
    if method in ("GET", "HEAD") or steps[-1] == "session":
        return "read"
    if any(step in _ADMIN for step in steps) or (method == "DELETE" and steps[-1] == "projects"):
        return "admin"
    return "jobs" if steps[-1] in _JOBS else "write"


def require_scope(key: ApiKey, request: RequestScope) -> None:
    """Refuse a request that the key is not for.

    Raises:
        Forbidden: it lacks the scope.
    """
    route: Any = request.get("route")
    needed = getattr(route.endpoint, "scope", None) or scope_of(request["method"], route.path)
    if needed not in key.scopes:
        raise Forbidden(
            f"this needs a key of the scope {needed}; this one has {', '.join(key.scopes)}"
        )


def create_key(
    session: Session,
    user: User,
    name: str,
    scopes: Sequence[str] = ("read", "write", "jobs", "admin"),
    expires_at: datetime | None = None,
) -> tuple[ApiKey, str]:
    """Make a new API key of a user.

    Returns:
        Its row and the key itself, which is shown once: of its secret only the SHA-256 is stored.
    """
    prefix, secret = secrets.token_hex(6), secrets.token_urlsafe(32)
    row = ApiKey(
        user_id=user.id,
        name=name,
        prefix=prefix,
        secret_sha256=digest(secret),
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


def authenticated_key(session: Session, key: str) -> tuple[ApiKey, User]:
    """A valid key, or that of a browser's session, and the user that it belongs to.

    Raises:
        Unauthorized: the key is malformed, unknown, revoked or expired, or its user is disabled;
            the error does not say which.
    """
    if is_session_token(key):
        opened = key_of_session(session, key)
        if opened is None or not _opens(*opened):
            raise Unauthorized("the session has ended; sign in again")
        _touch(session, opened[0])
        return opened
    scheme, _, rest = key.partition("_")
    prefix, _, secret = rest.partition("_")
    match = None
    if scheme == SCHEME and prefix.isalnum() and prefix.isascii():
        match = session.execute(
            select(ApiKey, User)
            .join(User, User.id == ApiKey.user_id)
            .where(ApiKey.prefix == prefix)
        ).one_or_none()
    stored = match[0].secret_sha256 if match else b"\0" * 32
    proven = hmac.compare_digest(digest(secret), stored)
    if match is None or not proven or not _opens(*match):
        raise Unauthorized(
            "the API key is not valid; make one with `modalbase keys create --name NAME`"
        )
    _touch(session, match[0])
    return match[0], match[1]


def locked_key(session: Session, user_id: UUID, key_id: UUID) -> ApiKey:
    """A key of a user, which nobody else edits until the transaction ends.

    Raises:
        NotFound: the user has no such key.
    """
    query = select(ApiKey).where(ApiKey.id == key_id, ApiKey.user_id == user_id)
    key = session.scalars(query.with_for_update()).one_or_none()
    if key is None:
        raise NotFound("API key", key_id)
    return key


def revoke_key(session: Session, by: User, key: ApiKey) -> None:
    """Revoke a key, which opens nothing from now on; one that is revoked stays so."""
    if key.revoked_at is None:
        key.revoked_at = transaction_time(session)
        audit(session, by, "api_key.revoke", "api_key", key.id)


def _opens(key: ApiKey, user: User) -> bool:
    late = key.expires_at is not None and key.expires_at <= datetime.now(UTC)
    return key.revoked_at is None and user.disabled_at is None and not late


def _touch(session: Session, key: ApiKey) -> None:
    """Note when the key was last used, to the minute, and never wait for another request that does
    the same.
    """
    if key.last_used_at is not None and datetime.now(UTC) - key.last_used_at < USED_RESOLUTION:
        return
    row = select(ApiKey.id).where(ApiKey.id == key.id).with_for_update(skip_locked=True)
    session.execute(
        update(ApiKey).where(ApiKey.id.in_(row)).values(last_used_at=func.now()),
        execution_options={"synchronize_session": False},
    )
