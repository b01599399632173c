"""What a person sees in a browser: pages below `/ui/`, made on the server, with figures and forms
that use the REST contract.

A page only reads. What it changes it sends to `/api/v1` as a script would, so that every rule has
one place. All its files are served from here, and its policy lets a browser ask nobody else.
"""

from fastapi import FastAPI

from service.pages import (
    comparing,
    files,
    jobs,
    measurements,
    quantities,
    search,
    start,
    tasks,
    updates,
)
from service.pages.look import PageErrors
from service.platform.web.routing import serve

__all__ = ["PageErrors", "add_pages"]


def add_pages(app: FastAPI) -> None:
    """All pages; `/` leads to the first of them."""
    serve(app, start.open_router)
    for module in (start, search, measurements, updates, comparing, quantities, files, jobs, tasks):
        serve(app, module.router)
