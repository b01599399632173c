"""Removing for good what was deleted: rows, spectra, results, and the original files that nothing else has. Jobs at work on
it are cancelled.

The audit trail keeps who did it, when, and what it was called.
"""

from __future__ import annotations

from uuid import UUID

from sqlalchemy import delete, select
from sqlalchemy.orm import Session

from service.access import CurrentUser, SessionDep, project_for
from service.access.lookup import purge
from service.jobs.queue import cancel_purged
from service.store.campaigns.operations import campaign_for
from service.store.imports.operations import Import
from service.store.imports.originals import Original
from service.store.structures.operations import structure_for
from service.web import api_router

router = api_router(tags=["purge"])


@router.post("/projects/{project_id}/purge", status_code=204)
def purge_project(project_id: UUID, session: SessionDep, user: CurrentUser) -> None:
    """Remove a deleted project and all that is in it for good. Nothing brings it back."""
    project = project_for(session, user, project_id, "owner", resting=True)
    purge(session, user, project, "project", project.id)
    _forget_more(session, project_id)


@router.post("/structures/{structure_id}/purge", status_code=204)
def purge_structure(structure_id: UUID, session: SessionDep, user: CurrentUser) -> None:
    """Remove a deleted structure with its campaigns, results and monitors for good. Nothing brings it back."""
    structure = structure_for(session, user, structure_id, "owner", deleted=True, lock=True)
    project_id = structure_for.project_of(session, structure)
    structure_for.purge(session, user, structure)
    _forget_more(session, project_id)


@router.post("/campaigns/{campaign_id}/purge", status_code=204)
def purge_campaign(campaign_id: UUID, session: SessionDep, user: CurrentUser) -> None:
    """Remove a deleted campaign with its FRFs, original files and results for good. Nothing brings it back."""
    campaign = campaign_for(session, user, campaign_id, "owner", deleted=True, lock=True)
    project_id = campaign_for.project_of(session, campaign)
    campaign_for.purge(session, user, campaign)
    _forget_more(session, project_id)


def _forget_more(session: Session, project_id: UUID) -> None:
    """End the jobs that were for what is gone, and remove the original files that no import has any more."""
    session.flush()
    cancel_purged(session, project_id)
    session.execute(delete(Original).where(Original.sha256.not_in(select(Import.sha256))))
