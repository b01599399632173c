"""The report of an update: its facts from the rooms that have them, set in a child process."""

from base64 import b64encode
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any, Literal
from uuid import UUID

from anyio import from_thread
from fastapi import Query, Response

from service.figures.typeset import Document, typeset
from service.nouns.attachments.operations import photos_of
from service.nouns.campaigns.operations import campaign_of, describe
from service.nouns.laboratory.routes import laboratory_of, logo_of
from service.nouns.storage.originals import original_chunks
from service.nouns.structures.models import model_in_short
from service.nouns.structures.operations import describe_version, structure_of, version_of
from service.nouns.updates.operations import update_job_for
from service.platform.access import CurrentUser, SessionDep, SettingsDep, api_router, project_for
from service.platform.queue.subprocess_read import in_subprocess
from service.platform.web.downloads import disposition
from service.reports.bodies import bodies_figure
from service.reports.figure_data import UpdateFigures
from service.reports.figures import FIGURES, draw_sheets

router = api_router(tags=["update jobs"])
_typeset = in_subprocess(typeset)

FOLDER = Path(__file__).parent / "templates"
DRAWN_AS_TABLE = "parameters"  # a figure that the table of the report has in its rows
MOST_PHOTOS, MOST_BYTES = 9, 32 * 1024 * 1024  # of photographs, and of one of them
REPORTS: dict[int | str, dict[str, Any]] = {
    200: {"description": "The report.", "content": {"text/html": {}, "application/pdf": {}}}
}


@router.get("/update-jobs/{job_id}/report", response_class=Response, responses=REPORTS)
def get_report(
    job_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    settings: SettingsDep,
    file_format: Annotated[
        Literal["html", "pdf"],
        Query(alias="format", description="a page that stands alone, or PDF/A on A4"),
    ] = "html",
) -> Response:
    """The report of a result: verdict, parameters, correlation, FRFs, what to do, signatures; the data
    as annex.
    """
    from service.pages.report_content import content_of  # with the client's tables

    data = UpdateFigures(session, update_job_for(session, user, job_id))
    campaign = campaign_of(session, data.job.campaign_id)
    name = structure_of(session, campaign.structure_id).name
    version = describe_version(version_of(session, data.job.structure_version_id), name)
    model = None if version.model is None else model_in_short(session, version.model)
    structure = {**version.model_dump(mode="json"), "model": model}
    bodies = bodies_figure(data)
    sheets = {
        "bodies": [] if bodies is None else [bodies],
        **{each: draw_sheets(data, each) for each in FIGURES if each != DRAWN_AS_TABLE},
    }
    project = project_for(session, user, data.job.project_id).name
    test = describe(campaign).model_dump(mode="json")
    content = content_of(data.document, structure, test, project, sheets)
    attached = photos_of(session, campaign.structure_id, campaign.id, job_id)[:MOST_PHOTOS]
    shown = [
        {"file": f"photo-{k}.jpg", "caption": row.caption or row.name}
        for k, row in enumerate(attached)
    ]
    own = laboratory_of(session, settings)
    letterhead = {"name": own.name, "address": own.address.split("\n")} if own.name else None
    content |= {"laboratory": letterhead, "photos": shown}
    photos = {
        f"photo-{k}": b"".join(original_chunks(session, row.sha256))
        for k, row in enumerate(attached)
        if row.size <= MOST_BYTES
    }
    if letterhead is not None and (logo := logo_of(session, settings)) is not None:
        photos["logo"] = logo
    template, style = (FOLDER.joinpath(f"report.{each}").read_bytes() for each in ("typ", "css"))
    figures = {f"{each}-{k}": one for each in sheets for k, one in enumerate(sheets[each])}
    document = Document(template, style, content, figures, photos)
    made = from_thread.run(_typeset, document, file_format)
    headers = {
        "Content-Disposition": disposition(
            _filename(f"{name} {campaign.name}", file_format), inline=True
        )
    }
    if file_format == "html":  # it stands alone: no script, styles and pictures within
        headers["Content-Security-Policy"] = _policy()
    kind = "text/html; charset=utf-8" if file_format == "html" else "application/pdf"
    return Response(made, media_type=kind, headers=headers)


def _filename(name: str, suffix: str) -> str:
    """Of the report, after structure and campaign.

    >>> _filename("beam 7/a, Prüfung", "pdf")
    'report-beam-7-a-Prüfung.pdf'
    """
    parts = "".join(sign if sign.isalnum() or sign in "_." else " " for sign in name).split()
    return f"{'-'.join(['report', *parts])[:120]}.{suffix}"


@cache
def _policy() -> str:
    """The page's Content-Security-Policy: its own style and pictures, and nothing else."""
    style = b64encode(sha256((FOLDER / "report.css").read_bytes()).digest()).decode()
    return f"default-src 'none'; img-src data:; frame-ancestors 'self'; style-src 'sha256-{style}'"
