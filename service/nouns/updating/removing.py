"""The route that removes an import: what no update rests on."""

from __future__ import annotations

from typing import TYPE_CHECKING
from uuid import UUID

from sqlalchemy import Text, cast, select
from sqlalchemy.orm import Session

from service.nouns.imports.operations import import_for, remove_import
from service.nouns.updating.tables import UpdateJob
from service.platform.access import CurrentUser, SessionDep, api_router
from service.platform.errors import Conflict
from service.platform.queue.tables import Job

if TYPE_CHECKING:
    from service.nouns.imports.operations import Import

router = api_router(tags=["imports"])


@router.delete("/imports/{import_id}", status_code=204)
def delete_import(import_id: UUID, session: SessionDep, user: CurrentUser) -> None:
    """Remove an import with its FRFs, time blocks and modes, such as one of a wrong `quantity`;
    grid points stay.

    409 while it runs, and where an update of the campaign may rest on it: results keep what they
    were computed from.
    """
    row = import_for(session, user, import_id, "editor", lock=True)
    _require_unused(session, row)
    remove_import(session, user, row)


def _require_unused(session: Session, row: Import) -> None:
    """Refuse to remove FRFs or modes of which an update was made, or is about to be.

    Raises:
        Conflict: names the first such update.
    """
    brought = row.counts if row.counts and not row.dry_run else {}
    if not (brought.get("frfs") or brought.get("modes")):
        return
    later = (
        select(Job.id)
        .join(UpdateJob, UpdateJob.id == Job.id)
        .where(
            Job.id > row.id,
            Job.state.in_(("queued", "running", "succeeded")),
            cast(UpdateJob.campaigns, Text).contains(str(row.campaign_id)),
        )
    )
    if (update := session.scalars(later.order_by(Job.id).limit(1)).first()) is not None:
        raise Conflict(
            f"update {update} of the campaign may rest on what the import brought; "
            "send the file to a campaign of its own, where it is read anew"
        )
