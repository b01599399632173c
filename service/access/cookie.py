"""The session's cookie as a bearer token, for all that stands behind: door, routes, limits."""

from __future__ import annotations

import hmac
from http.cookies import CookieError, SimpleCookie

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from service.access.sessions import COOKIE, HEADER, is_session_token, request_token
from service.errors import Forbidden
from service.web.problems import problem_of

SAFE = ("GET", "HEAD", "OPTIONS")


class SessionCookie:
    """ASGI layer: a request that comes with a session's cookie and without `Authorization` gets the session's token.

    One that changes something is refused where it lacks the session's request token: another site may send the cookie's
    owner here, but cannot read that token.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI entry."""
        token = session_token(scope) if scope["type"] == "http" else None
        if token is None:
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        if scope["method"] not in SAFE and not _proven(token, headers.get(HEADER, "")):
            answer = problem_of(Forbidden(f"a request with a session's cookie needs its token in the header {HEADER}"))
            assert answer is not None
            await answer(scope, receive, send)
            return
        authorization = (b"authorization", f"Bearer {token}".encode())
        await self.app({**scope, "headers": [*scope["headers"], authorization]}, receive, send)


def session_token(scope: Scope) -> str | None:
    """The token of the session's cookie; None where the request has none, or states a key."""
    headers = Headers(scope=scope)
    if "authorization" in headers:
        return None
    try:
        morsel = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
    except CookieError:  # other cookies of this host, which are not ours to judge
        return None
    return morsel.value if morsel is not None and is_session_token(morsel.value) and morsel.value.isascii() else None


def _proven(token: str, sent: str) -> bool:
    return hmac.compare_digest(request_token(token).encode(), sent.encode("utf-8", "surrogatepass"))
