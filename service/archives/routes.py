"""Routes of archives: of a project, a campaign, or what a search found."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from uuid import UUID

from fastapi.responses import FileResponse
from sqlalchemy.orm import Session

from service.archives.contents import write_archive
from service.nouns.campaigns.operations import campaign_for, present_campaigns
from service.nouns.search.nouns import NOUNS
from service.nouns.search.operations import Search, bounded
from service.nouns.search.routes import FilterDep
from service.nouns.structures.operations import structures_in
from service.platform.access import CurrentUser, SessionDep, User, api_router, project_for
from service.platform.errors import Invalid, NotFound
from service.platform.web.downloads import spooled

router = api_router(tags=["archives"])
MEDIA_TYPE = "application/zip"
MOST_CAMPAIGNS = 5_000  # of an archive
FILES = {200: {"content": {MEDIA_TYPE: {}}, "description": "The archive."}}


@router.get("/projects/{project_id}/archive", response_class=FileResponse, responses=FILES)  # type: ignore[arg-type]
def get_project_archive(project_id: UUID, session: SessionDep, user: CurrentUser) -> FileResponse:
    """All of a project as one zip of UFF, npz, CSV and JSON: instruments, structures with coupons
    and monitors, campaigns.
    """
    project = project_for(session, user, project_id)
    structures = structures_in([project.id])
    campaigns = present_campaigns(session, structures)
    below = session.scalars(structures).all()
    return _archive(session, user, project.name, campaigns, below, [project.id])


@router.get("/campaigns/{campaign_id}/archive", response_class=FileResponse, responses=FILES)  # type: ignore[arg-type]
def get_campaign_archive(campaign_id: UUID, session: SessionDep, user: CurrentUser) -> FileResponse:
    """A campaign in an archive: with its structure and the instruments that it names, one zip of UFF, npz, CSV
    and JSON.
    """
    campaign = campaign_for(session, user, campaign_id)
    return _archive(session, user, campaign.name, [campaign.id])


@router.get("/search/campaigns/archive", response_class=FileResponse, responses=FILES)  # type: ignore[arg-type]
def get_found_archive(query: FilterDep, session: SessionDep, user: CurrentUser) -> FileResponse:
    """All campaigns that a search finds, over all projects, as one zip of UFF, npz, CSV and
    JSON.
    """
    with bounded(session):
        keys = Search(user, NOUNS["campaign"], query).keys(session, MOST_CAMPAIGNS + 1)
    if not keys:
        raise NotFound("campaign that the search finds")
    return _archive(session, user, query.filter or query.words or "all campaigns", keys)


def _archive(
    session: Session,
    user: User,
    title: str,
    campaigns: Sequence[UUID],
    structures: Sequence[UUID] = (),
    projects: Sequence[UUID] = (),
) -> FileResponse:
    if len(campaigns) > MOST_CAMPAIGNS:
        raise Invalid(
            "filter",
            f"finds more than {MOST_CAMPAIGNS:,} campaigns, which is as many as an archive has",
        )
    with _snapshot(session):
        write = partial(
            write_archive, session, user, title, campaigns, structures, project_ids=projects
        )
        return spooled(write, MEDIA_TYPE, "archive.zip", {})


@contextmanager
def _snapshot(session: Session) -> Iterator[None]:
    """Many files are written of one moment."""
    connection = session.connection()
    connection.exec_driver_sql("BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY")
    try:
        yield
    finally:
        connection.exec_driver_sql("ROLLBACK")
