"""What a browser gets: documentation from this host alone, and headers that keep it from asking any other."""

from __future__ import annotations

import hashlib
import re
from base64 import b64encode
from importlib.util import find_spec
from pathlib import Path

from fastapi import FastAPI
from fastapi.openapi.docs import get_swagger_ui_html
from fastapi.responses import RedirectResponse
from fastapi.staticfiles import StaticFiles
from starlette.responses import HTMLResponse

ASSETS = "static-offline-docs"

NOTHING = "default-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
HEADERS = {
    "Content-Security-Policy": NOTHING,
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), geolocation=(), microphone=()",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}
"""Of every answer that does not set them itself: a browser loads nothing for it and shows it in no frame."""


def add_documentation(app: FastAPI) -> None:
    """`/docs`, and the files that it needs; `/redoc` leads there."""
    page = _page(app)
    # The bundle sets styles in place and draws icons from data: addresses; scripts are ours alone.
    scripts = f"script-src 'self' {_inline_scripts(page)}"
    others = "style-src 'self'; img-src 'self' data:; connect-src 'self'"
    headers = {"Content-Security-Policy": f"{NOTHING}; {scripts}; {others}"}
    app.mount(f"/{ASSETS}", StaticFiles(directory=_assets()), name=ASSETS)

    @app.get("/docs", include_in_schema=False)
    async def documentation() -> HTMLResponse:
        """Every operation, to read and to try."""
        return HTMLResponse(page, headers=headers)

    @app.get("/redoc", include_in_schema=False)
    async def to_documentation() -> RedirectResponse:
        """A browser that was given the address of a page that was."""
        return RedirectResponse("docs")


def _page(app: FastAPI) -> str:
    """Addresses in it are relative, so that it works below a prefix of a proxy; nobody else checks the document."""
    answer = get_swagger_ui_html(
        openapi_url="openapi.json",
        title=f"{app.title}: documentation",
        swagger_js_url=f"{ASSETS}/swagger-ui-bundle.js",
        swagger_css_url=f"{ASSETS}/swagger-ui.css",
        swagger_favicon_url=f"{ASSETS}/favicon.png",
        swagger_ui_parameters={
            "validatorUrl": None,
            "persistAuthorization": True,  # the key is kept over a reload, in this browser
            "docExpansion": "none",
            "defaultModelsExpandDepth": 0,
            "filter": True,
        },
    )
    return bytes(answer.body).decode()


def _inline_scripts(page: str) -> str:
    """The scripts within a page, as a Content-Security-Policy allows them: by their digest."""
    scripts = re.findall(r"<script>(.*?)</script>", page, flags=re.DOTALL)
    digests = (b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts)
    return " ".join(f"'sha256-{digest}'" for digest in digests)


def _assets() -> Path:
    package = find_spec("fastapi_offline")
    if package is None or package.origin is None:
        raise RuntimeError("fastapi-offline is not installed; install modalbase again")
    return Path(package.origin).parent / "static"
