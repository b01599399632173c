"""Problems for people: a browser that asked for something to look at gets a page, and who has no session gets the sign-in."""

from __future__ import annotations

import json
from typing import Any
from urllib.parse import quote

from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.errors import NotAcceptable
from service.show.pages.look import PREFIX, page, root_of
from service.web.negotiation import choose_format

PROBLEM = "application/problem+json"


class PageErrors:
    """ASGI layer around all others: a problem document becomes a page that says the same, at a page's address, and wherever
    else the client prefers HTML, as a browser does that opens a report or a figure in a new tab.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI entry."""
        if scope["type"] != "http" or not (scope["path"].startswith(f"{PREFIX}/") or _is_navigation(scope)):
            await self.app(scope, receive, send)
            return
        start: Message | None = None
        body = b""

        async def held(message: Message) -> None:
            nonlocal start, body
            if message["type"] == "http.response.start" and _is_problem(message):
                start = message
            elif start is None:
                await send(message)
            else:
                body += message.get("body", b"")

        await self.app(scope, receive, held)
        if start is not None:
            answer = _answer(scope, json.loads(body))
            for name, value in Headers(raw=start["headers"]).items():
                if name not in ("content-length", "content-type"):
                    answer.headers.setdefault(name, value)
            await answer(scope, receive, send)


def _is_navigation(scope: Scope) -> bool:
    try:
        accept = Headers(scope=scope).get("accept")
        return scope["method"] == "GET" and choose_format(None, accept, {"": PROBLEM, "page": "text/html"}) == "page"
    except NotAcceptable:
        return False


def _is_problem(message: Message) -> bool:
    return Headers(raw=message["headers"]).get("content-type", "").startswith(PROBLEM)


def _answer(scope: Scope, problem: dict[str, Any]) -> Response:
    request = Request(scope)
    if problem["status"] == 401 and "authorization" not in request.headers:
        asked = scope["path"].lstrip("/") + (f"?{request.url.query}" if request.url.query else "")
        to = f"{root_of(scope['path'])}sign-in?next={quote(asked, safe='')}"
        if "hx-request" in request.headers:  # a piece of a page: the page itself must go
            return Response(status_code=204, headers={"HX-Redirect": to})
        return RedirectResponse(to, status_code=303)
    return page(request, "error.html", status_code=problem["status"], problem=problem)
