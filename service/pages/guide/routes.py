"""The guide over HTTP. It is the same for everybody, so it asks for no key."""

import hashlib
from collections.abc import Mapping

from fastapi import Request, Response
from fastapi.responses import RedirectResponse

from service.pages.guide.contents import INDEX, PICTURES, files, whole_page
from service.pages.guide.search import search
from service.pages.look import address, root_of
from service.platform.errors import NotFound
from service.platform.web.parameters import not_modified
from service.platform.web.routing import page_router

POLICY = (
    "default-src 'none'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'; style-src"
    " 'self'; img-src 'self'"
)
LINKED = ("icon.svg", "kit.css", "pages.css", "guide.css")

router = page_router()


@router.api_route("/guide", methods=["GET", "HEAD"])
def to_guide() -> RedirectResponse:
    """The address that a person types."""
    return RedirectResponse("guide/")


@router.api_route("/guide/search", methods=["GET", "HEAD"])
def search_guide(request: Request, q: str = "") -> Response:
    """The sections of the guide that have all words of a question."""
    answer = {"question": q, "hits": search(q)}
    return _answered(request, _html("search", request, answer) or b"", "text/html; charset=utf-8")


@router.api_route("/guide/{name:path}", methods=["GET", "HEAD"])
def get_page(name: str, request: Request) -> Response:
    """A page of the guide, or a picture."""
    file = _picture(name) or _page(name or INDEX, request)
    if file is None:
        raise NotFound("page of the guide", name)
    return _answered(request, *file)


def _answered(request: Request, content: bytes, media_type: str) -> Response:
    headers = {
        "Content-Security-Policy": POLICY,
        "Cache-Control": "no-cache",
        "ETag": f'"{hashlib.sha256(content).hexdigest()[:16]}"',
    }
    return not_modified(request, headers) or Response(
        content, media_type=media_type, headers=headers
    )


def _picture(name: str) -> tuple[bytes, str] | None:
    file = files().get(name)
    if file is None or file.suffix not in PICTURES:
        return None
    return file.read_bytes(), PICTURES[file.suffix]


def _page(name: str, request: Request) -> tuple[bytes, str] | None:
    html = _html(name, request)
    return None if html is None else (html, "text/html; charset=utf-8")


def _html(name: str, request: Request, answer: Mapping[str, object] | None = None) -> bytes | None:
    html = whole_page(
        name,
        root_of(request.url.path),
        tuple(address(style) for style in LINKED),
        service=request.app.state.settings.pages,
        search=True,
        answer=answer,
    )
    return None if html is None else html.encode()
