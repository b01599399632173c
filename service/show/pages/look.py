"""How every page is made: who looks, the templates, addresses, and the policy that keeps a browser on this host."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any
from uuid import UUID

from fastapi import Depends, Request
from fastapi.responses import HTMLResponse
from sqlalchemy.orm import Session
from starlette.responses import Response

from fecore import __version__
from service.access import CurrentUser, SessionDep, User, role_in
from service.access import routes as access
from service.access.keys import COOKIE, request_token
from service.jobs.resource import ENDED
from service.show.pages import numbers
from service.show.pages.assets import address
from service.show.pages.found import bar
from service.store.campaigns.operations import campaign_for, describe
from service.store.structures import routes as structures
from service.web.templates import templates_in

if TYPE_CHECKING:
    from jinja2 import Environment

PREFIX = "/ui"
EMPTY_STYLE = "'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU='"
"""An empty style element, which Plotly makes and fills by the object model; a policy allows it by this digest of nothing."""

POLICY = (
    "default-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'; script-src 'self'; "
    f"style-src 'self' {EMPTY_STYLE}; img-src 'self' data: blob:; connect-src 'self'"
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
    made = templates_in(Path(__file__).parent / "templates")
    made.filters.update(numbers.FILTERS, bar=bar)
    made.globals.update(asset=address, version=__version__)
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
    return HTMLResponse(_templates().get_template(template).render(shown), status_code, headers=HEADERS)


@dataclass(frozen=True)
class Visit:
    """Somebody who is signed in and looks at a page."""

    request: Request  # theirs
    session: Session  # its transaction, in which the database stands still
    user: User  # who

    def show(self, template: str, **context: Any) -> HTMLResponse:
        """A page of theirs."""
        return page(self.request, template, user=self.user.name, **context)

    def show_progress(self, job: Any, kind: str) -> HTMLResponse:
        """The piece of a page that says how far a job is, and replaces itself; once it has ended, the page is loaded anew."""
        answer = self.show("job_progress.html", job=job, ended=job.status in ENDED, kind=kind)
        if job.status in ENDED:
            answer.headers["HX-Refresh"] = "true"
        return answer

    def in_project(self, project_id: UUID) -> dict[str, Any]:
        """The project of a page below it, as templates have it, and whether the visitor may change what is in it."""
        project = access.get_project(project_id, self.session, self.user, Response())
        may_edit = role_in(self.session, self.user, project_id) in ("editor", "owner") and project.archived_at is None
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
    """A page asks many times and shows one moment: a file that is read has its FRFs, or a browser would wait for them."""
    session.commit()
    session.connection(execution_options={"isolation_level": "REPEATABLE READ"})
    try:
        yield Visit(request, session, user)
    finally:
        session.close()


VisitDep = Annotated[Visit, Depends(_visit, scope="function")]
