"""The report of an update: its facts from the rooms that have them, its figures from the result."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any
from uuid import UUID

from sqlalchemy.orm import Session

from service.nouns.campaigns.operations import campaign_of
from service.nouns.campaigns.operations import describe as describe_campaign
from service.nouns.structures.models import model_in_short
from service.nouns.structures.operations import describe_version, structure_of, version_of
from service.platform.access import User, project_for
from service.reports.blocks import Letterhead
from service.reports.figure_data import UpdateFigures
from service.reports.figures import FIGURES, draw_sheets

if TYPE_CHECKING:
    from service.nouns.updates.tables import UpdateJob
    from service.platform.settings import Settings
    from service.reports.blocks import Report


def report_of(session: Session, user: User, job: UpdateJob, settings: Settings) -> Report:
    """The report of an update, with the structure as it was then, under the laboratory's name where
    the settings have one.

    Raises:
        Conflict: the job has no result, yet or ever.
    """
    # with the terminal's tables, by the first report
    from service.reports.update_report import (
        UpdateFacts,
        update_report,
    )

    data = UpdateFigures(session, job)
    campaign = campaign_of(session, job.campaign_id)
    name = structure_of(session, campaign.structure_id).name
    structure = describe_version(version_of(session, job.structure_version_id), name)
    facts = UpdateFacts(
        document=data.document,
        project=project_for(session, user, job.project_id).name,
        structure={**structure.model_dump(mode="json"), "model": _model(session, structure.model)},
        campaign=describe_campaign(campaign).model_dump(mode="json"),
        frfs=len(data.document["provenance"]["frfs"]),
        letterhead=_letterhead(settings),
    )

    return update_report(
        facts, partial(draw_sheets, data), {name: each.width for name, each in FIGURES.items()}
    )


def _letterhead(settings: Settings) -> Letterhead | None:
    if not settings.laboratory:
        return None
    logo = None if settings.laboratory_logo is None else settings.laboratory_logo.read_bytes()
    lines = [line.strip() for line in settings.laboratory_address.split(";")]
    return Letterhead(settings.laboratory, lines, logo)


def _model(session: Session, key: UUID | None) -> dict[str, Any] | None:
    """A model's file and sets; None where the structure is none."""
    return None if key is None else model_in_short(session, key)
