"""How every page is made: who looks, the templates, addresses, and the policy that keeps a browser
on this host.

Scripts and styles are served from memory, compressed once, and kept by browsers under their digest.
A problem becomes a page for a browser that asked for something to look at; who has no session gets
the sign-in.
"""

from __future__ import annotations

import gzip
import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import quote
from uuid import UUID

from fastapi import Depends, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse
from sqlalchemy.orm import Session
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from fecore import __version__
from modalbase.formats.registry import FORMATS, titles
from service import tasks
from service.nouns.campaigns.climate import CLIMATE, shown_after, stated
from service.nouns.campaigns.operations import campaign_for, describe
from service.nouns.structures import routes as structures
from service.pages import numbers
from service.pages.findings import bar
from service.pages.forms import labelled, page_words, questions
from service.pages.quantities import attributes
from service.platform.access import CurrentUser, SessionDep, User, role_in
from service.platform.access import routes as access
from service.platform.access.keys import COOKIE, request_token
from service.platform.db.base import at_one_moment
from service.platform.errors import NotAcceptable, NotFound
from service.platform.web.negotiation import choose_format
from service.platform.web.parameters import not_modified
from service.platform.web.routing import UI, page_router
from service.platform.web.templates import templates_in

if TYPE_CHECKING:
    from jinja2 import Environment

FOLDER = Path(__file__).parent / "static"
MEDIA_TYPES = {
    ".js": "text/javascript",
    ".css": "text/css",
    ".svg": "image/svg+xml",
    ".txt": "text/plain",
    ".uff": "application/x-uff",
}
LARGE = 1000  # bytes from which compression is worth a browser's work

files = page_router()


@dataclass(frozen=True)
class Asset:
    """A file."""

    content: bytes  # as it is
    compressed: bytes | None  # by gzip; None where that is not worth it
    digest: str  # the first 16 digits of its SHA-256
    media_type: str  # with the character set


@cache
def assets() -> dict[str, Asset]:
    """All files by their names below `static`."""
    paths = (file for file in sorted(FOLDER.rglob("*")) if file.suffix in MEDIA_TYPES)
    return {file.relative_to(FOLDER).as_posix(): _read(file) for file in paths}


def _read(file: Path) -> Asset:
    content = file.read_bytes()
    compressed = gzip.compress(content, 9, mtime=0) if len(content) > LARGE else None
    media_type = f"{MEDIA_TYPES[file.suffix]}; charset=utf-8"
    return Asset(content, compressed, hashlib.sha256(content).hexdigest()[:16], media_type)


def address(name: str) -> str:
    """Where a page finds a file, relative to the service's root; another content has another
    address.
    """
    return f"static/{assets()[name].digest}/{name}"


@files.api_route("/static/{digest}/{name:path}", methods=["GET", "HEAD"])
def get_asset(digest: str, name: str, request: Request) -> Response:
    """A file of the pages; under the digest of its content it never changes."""
    asset = assets().get(name)
    if asset is None or asset.digest != digest:
        raise NotFound("file", name)
    headers = {
        "Cache-Control": "public, max-age=31536000, immutable",
        "ETag": f'"{asset.digest}"',
        "Vary": "Accept-Encoding",
    }
    if (unchanged := not_modified(request, headers)) is not None:
        return unchanged
    if asset.compressed is not None and "gzip" in request.headers.get("accept-encoding", ""):
        headers["Content-Encoding"] = "gzip"
        return Response(asset.compressed, media_type=asset.media_type, headers=headers)
    return Response(asset.content, media_type=asset.media_type, headers=headers)


EMPTY_STYLE = "'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU='"
"""An empty style element, which Plotly makes and fills by the object model; a policy allows it by
this digest of nothing.
"""

POLICY = (
    "default-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'; script-src"
    f" 'self'; style-src 'self' {EMPTY_STYLE}; img-src 'self' data: blob:; connect-src 'self'"
)
HEADERS = {"Content-Security-Policy": POLICY, "Cache-Control": "no-store"}


def root_of(path: str) -> str:
    """The service's root as seen from a path of it, so that pages work below any prefix of a proxy.

    >>> root_of("/ui/projects/x")
    '../../'
    """
    return "../" * (path.count("/") - 1) or "./"


@cache
def _templates() -> Environment:
    made = templates_in(Path(__file__).parent / "templates", Path(tasks.__path__[0]))
    made.filters.update(
        numbers.FILTERS,
        bar=bar,
        page_words=page_words,
        labelled=labelled,
        climate=stated,
        shown_after=shown_after,
    )
    made.globals.update(
        asset=address,
        version=__version__,
        quantity=attributes,
        climate=CLIMATE,
        formats=FORMATS,
        titles=titles,
        questions=questions,
    )
    for name in ("kit", "fields", "parts", "curves"):  # each uses those before
        made.globals[name] = made.get_template(f"{name}.html").module
    return made


def page(request: Request, template: str, status_code: int = 200, **context: Any) -> HTMLResponse:
    """A template as an answer, with the policy of all pages.

    Args:
        request: whose answer.
        template: its file.
        status_code: of HTTP.
        context: what it shows; `user` is whose session it is, None outside of one.
    """
    token = request.cookies.get(COOKIE)
    shown = {
        "user": None,
        "root": root_of(request.url.path),
        "path": request.url.path,
        "csrf": "" if token is None else request_token(token),
        "docs": request.app.state.settings.docs if "app" in request.scope else True,
        **context,
    }
    return HTMLResponse(
        _templates().get_template(template).render(shown), status_code, headers=HEADERS
    )


@dataclass(frozen=True)
class Visit:
    """Somebody who is signed in and looks at a page."""

    request: Request  # theirs
    session: Session  # its transaction, in which the database stands still
    user: User  # who

    def show(self, template: str, **context: Any) -> HTMLResponse:
        """A page of theirs."""
        return page(self.request, template, user=self.user.name, **context)

    def in_project(self, project_id: UUID) -> dict[str, Any]:
        """The project of a page below it, as templates have it, and whether the visitor may change
        what is in it.
        """
        project = access.get_project(project_id, self.session, self.user, Response())
        may_edit = (
            role_in(self.session, self.user, project_id) in ("editor", "owner")
            and project.archived_at is None
        )
        return {"project": project, "may_edit": may_edit}

    def in_structure(self, structure_id: UUID) -> dict[str, Any]:
        """The structure of a page below it, and what that is in."""
        structure = structures.nouns.one(self.session, self.user, structure_id)
        return {"structure": structure, **self.in_project(structure.project_id)}

    def in_campaign(self, campaign_id: UUID, *, deleted: bool = True) -> dict[str, Any]:
        """The campaign of a page below it, and what that is in; results outlive their campaign."""
        campaign = describe(campaign_for(self.session, self.user, campaign_id, deleted=deleted))
        return {"campaign": campaign, **self.in_structure(campaign.structure_id)}


def _visit(request: Request, session: SessionDep, user: CurrentUser) -> Iterator[Visit]:
    """A page asks many times and shows one moment: a file that is read has its FRFs, or a browser
    would wait for them.
    """
    at_one_moment(session)
    try:
        yield Visit(request, session, user)
    finally:
        session.close()


VisitDep = Annotated[Visit, Depends(_visit, scope="function")]


PROBLEM = "application/problem+json"


class PageErrors:
    """ASGI layer around all others: a problem document becomes a page that says the same, at a
    page's address, and wherever else the client prefers HTML, as a browser does that opens a report
    or a figure in a new tab.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI entry."""
        if scope["type"] != "http" or not (
            scope["path"].startswith(f"{UI}/") or _is_navigation(scope)
        ):
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
        return (
            scope["method"] == "GET"
            and choose_format(None, accept, {"": PROBLEM, "page": "text/html"}) == "page"
        )
    except NotAcceptable:
        return False


def _is_problem(message: Message) -> bool:
    return Headers(raw=message["headers"]).get("content-type", "").startswith(PROBLEM)


def _answer(scope: Scope, problem: dict[str, Any]) -> Response:
    request = Request(scope)
    if problem["status"] == 401 and "authorization" not in request.headers:
        target = scope["path"].lstrip("/") + (f"?{request.url.query}" if request.url.query else "")
        to = f"{root_of(scope['path'])}sign-in?next={quote(target, safe='')}"
        if "hx-request" in request.headers:  # a piece of a page: the page itself must go
            return Response(status_code=204, headers={"HX-Redirect": to})
        return RedirectResponse(to, status_code=303)
    return page(request, "error.html", status_code=problem["status"], problem=problem)
