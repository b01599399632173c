"""Routes of the browser's session."""

from __future__ import annotations

from fastapi import Request, Response

from service.access.audit import audit
from service.access.dependencies import CurrentKey, CurrentUser, SessionDep
from service.access.schemas import SessionOut
from service.access.sessions import COOKIE, LIFETIME, close_session, is_session_token, open_session, request_token
from service.errors import Conflict
from service.web import api_router

router = api_router(tags=["access"])


@router.post("/session", status_code=201)
def sign_in(
    session: SessionDep, user: CurrentUser, key: CurrentKey, request: Request, response: Response
) -> SessionOut:
    """Begin a browser's session with the key of this request; the answer sets its cookie.

    The cookie is not readable by scripts and is sent to this host alone. A request that changes something and comes with
    the cookie needs `X-CSRF-Token` as well, which the answer holds.
    """
    if is_session_token(_token(request)):
        raise Conflict("this is a session already; sign in with a key")
    row, token = open_session(session, key)
    audit(session, user, "session.create", "session", row.id)
    response.set_cookie(
        COOKIE,
        token,
        max_age=int(LIFETIME.total_seconds()),
        secure=request.url.scheme == "https",
        httponly=True,
        samesite="strict",
    )
    response.headers["Cache-Control"] = "no-store"
    return SessionOut(user=user.name, expires_at=row.expires_at, csrf_token=request_token(token))


@router.delete("/session", status_code=204)
def sign_out(session: SessionDep, user: CurrentUser, request: Request, response: Response) -> None:
    """End the session of this request's cookie, here and for whoever has its cookie."""
    token = _token(request)
    if not is_session_token(token):
        raise Conflict("the request comes with a key and not with a session's cookie; revoke the key to end it")
    close_session(session, token)
    audit(session, user, "session.delete", "session", None)
    response.delete_cookie(COOKIE, httponly=True, samesite="strict")


def _token(request: Request) -> str:
    return request.headers["authorization"].partition(" ")[2].strip()
