"""Problems of pages: who asks for a page gets a page, and who has no session gets the sign-in."""

from __future__ import annotations

import json
from typing import Any
from urllib.parse import quote

from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.pages.look import PREFIX, page, root_of

PROBLEM = "application/problem+json"


class PageErrors:
    """ASGI layer around door and pages: a problem document of a page's address becomes a page that says the same."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI entry."""
        if scope["type"] != "http" or not scope["path"].startswith(f"{PREFIX}/"):
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
            await _answer(scope, start, json.loads(body))(scope, receive, send)


def _is_problem(message: Message) -> bool:
    return Headers(raw=message["headers"]).get("content-type", "").startswith(PROBLEM)


def _answer(scope: Scope, start: Message, problem: dict[str, Any]) -> Response:
    request = Request(scope)
    if problem["status"] == 401:
        asked = scope["path"].lstrip("/") + (f"?{request.url.query}" if request.url.query else "")
        to = f"{root_of(scope['path'])}sign-in?next={quote(asked, safe='')}"
        if "hx-request" in request.headers:  # a piece of a page: the page itself must go
            return Response(status_code=204, headers={"HX-Redirect": to})
        return RedirectResponse(to, status_code=303)
    answer = page(request, "error.html", status_code=problem["status"], problem=problem)
    for name in ("retry-after", "allow"):
        if (value := Headers(raw=start["headers"]).get(name)) is not None:
            answer.headers[name] = value
    return answer
