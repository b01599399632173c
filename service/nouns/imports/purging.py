"""The routes that remove what was deleted for good."""

from typing import Any
from uuid import UUID

from sqlalchemy.orm import Session

from service.nouns.campaigns.operations import campaign_for
from service.nouns.storage.originals import forget_originals
from service.nouns.structures.operations import structure_for
from service.platform.access import CurrentUser, Lookup, SessionDep, User, api_router, project_for
from service.platform.access.lookup import projects
from service.platform.queue.queue import cancel_purged

router = api_router(tags=["purge"])


@router.post("/projects/{project_id}/purge", status_code=204)
def purge_project(project_id: UUID, session: SessionDep, user: CurrentUser) -> None:
    """Remove a deleted project and all that is in it for good. Nothing brings it back."""
    project = project_for(session, user, project_id, "owner", resting=True)
    projects.purge(session, user, project)
    _forget_more(session, project_id)


@router.post("/structures/{structure_id}/purge", status_code=204)
def purge_structure(structure_id: UUID, session: SessionDep, user: CurrentUser) -> None:
    """Remove a deleted structure with its campaigns, results and monitors for good. Nothing brings
    it back.
    """
    _purge(session, user, structure_for, structure_id)


@router.post("/campaigns/{campaign_id}/purge", status_code=204)
def purge_campaign(campaign_id: UUID, session: SessionDep, user: CurrentUser) -> None:
    """Remove a deleted campaign with its FRFs, original files and results for good. Nothing brings
    it back.
    """
    _purge(session, user, campaign_for, campaign_id)


def _purge(session: Session, user: User, find: Lookup[Any], key: UUID) -> None:
    row = find(session, user, key, "owner", deleted=True, lock=True)
    project_id = find.project_of(session, row)
    find.purge(session, user, row)
    _forget_more(session, project_id)


def _forget_more(session: Session, project_id: UUID) -> None:
    """End the jobs that were for what is gone, and remove the original files that nothing has any
    more.
    """
    session.flush()
    cancel_purged(session, project_id)
    forget_originals(session)
