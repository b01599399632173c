"""Attachments: what clients see of them, and the routes, alike for all nouns that have some."""

from collections.abc import Iterator, Sequence
from datetime import datetime
from typing import Annotated, Any
from uuid import UUID

from fastapi import Path, Query, Request, Response
from fastapi.responses import FileResponse
from pydantic import AfterValidator, Field
from sqlalchemy import ColumnElement, and_, select
from sqlalchemy.orm import Session

from service.nouns.attachments.operations import (
    OWNERS,
    SHOWN,
    Attachment,
    media_type,
)
from service.nouns.campaigns.operations import campaign_for, campaign_of
from service.nouns.monitors.runs import monitor_for
from service.nouns.storage import book
from service.nouns.storage.originals import copy_original, forget_originals, keep_original
from service.nouns.structures.operations import structure_for
from service.nouns.updates.operations import joint_update_for, update_job_for
from service.platform.access import CurrentUser, Lookup, SessionDep, User, api_router, project_for
from service.platform.access.lookup import Role, projects
from service.platform.access.nouns import NounRoutes
from service.platform.errors import Invalid, NotFound
from service.platform.web import RequestModel, StrictModel, example
from service.platform.web.downloads import disposition, spooled
from service.platform.web.json_body import refuse_unstorable_text
from service.platform.web.openapi import reads, upload
from service.platform.web.parameters import not_modified
from service.platform.web.uploads import FilenameQuery, UploadDep

router = api_router(tags=["attachments"])


class AttachmentOut(StrictModel):
    """A file beside a project, structure, campaign, update or monitor."""

    id: UUID
    project_id: UUID
    structure_id: UUID | None = Field(description="of what it is beside; null of the others")
    campaign_id: UUID | None
    update_job_id: UUID | None = Field(description="of one campaign or of several")
    monitor_id: UUID | None
    name: str = Field(description="of the file")
    caption: str = Field(description="what it shows; below a photograph in the report")
    media_type: str = Field(
        description=f"by its content: {', '.join(SHOWN)}, which pages show, or another"
    )
    size: int = Field(description="bytes")
    sha256: str
    created_at: datetime


class CaptionIn(RequestModel):
    """What is changed of an attachment."""

    model_config = example(caption="the clamp from the left, before the test")

    caption: Annotated[str, AfterValidator(refuse_unstorable_text)] = Field(
        max_length=500, description="what it shows; empty: no caption"
    )


def describe(rows: Sequence[Attachment]) -> Iterator[AttachmentOut]:
    """Attachments as clients see them."""
    for row in rows:
        shown = {name: getattr(row, name) for name in AttachmentOut.model_fields}
        yield AttachmentOut(**{**shown, "sha256": row.sha256.hex()})


def _payer(session: Session, row: Attachment) -> tuple[Lookup[Any], Any]:
    """Whose bytes they are: what takes them along when it is purged."""
    if row.update_job_id is not None:
        row_of = update_job_for.row(session, row.update_job_id)
        if row_of.joint:
            return joint_update_for, row_of
        return campaign_for, campaign_of(session, row_of.campaign_id)
    if row.campaign_id is not None:
        return campaign_for, campaign_for.row(session, row.campaign_id)
    if row.monitor_id is not None:
        monitor = monitor_for.row(session, row.monitor_id)
        return structure_for, structure_for.row(session, monitor.structure_id)
    if row.structure_id is not None:
        return structure_for, structure_for.row(session, row.structure_id)
    return projects, projects.row(session, row.project_id)


def _beside(column: str, owner: Lookup[Any] | None) -> Lookup[Attachment]:
    own: ColumnElement[bool]
    if owner is None:  # of a project itself
        own = and_(*(getattr(Attachment, each).is_(None) for each in OWNERS))
    elif owner.among:
        own = getattr(Attachment, column).in_(select(owner.table.id).where(*owner.among))
    else:
        own = getattr(Attachment, column).is_not(None)
    return Lookup(Attachment, "attachment", column, owner, among=own)


OF = {
    "project_id": _beside("project_id", None),
    "structure_id": _beside("structure_id", structure_for),
    "campaign_id": _beside("campaign_id", campaign_for),
    "update_job_id": _beside("update_job_id", update_job_for),
    "joint_id": _beside("joint_id", joint_update_for),
    "monitor_id": _beside("monitor_id", monitor_for),
}
"""How the attachments of each noun are found: with the rights of what they are beside."""


def attachment_for(
    session: Session, user: User, key: UUID, role: Role = "viewer"
) -> tuple[Lookup[Attachment], Attachment]:
    """An attachment with how it is found, if the user has at least this role in its project.

    Raises:
        NotFound: there is none, it is other people's, or what it is beside is deleted.
        Forbidden: the user's role is too low.
    """
    row = session.get(Attachment, key)
    if row is None:
        raise NotFound("attachment", key)
    beside = next((name for name in OWNERS if getattr(row, name) is not None), "project_id")
    if (of := row.update_job_id) is not None and update_job_for.row(session, of).joint:
        beside = "joint_id"
    return OF[beside], OF[beside](session, user, key, role)


def _routes(column: str, noun: str) -> NounRoutes[Attachment, AttachmentOut]:
    """Attach to a noun, and list what is attached."""
    find = OF[column]
    nouns = NounRoutes(
        router, find, AttachmentOut, lambda _, rows: describe(rows), "attachments", "attachment_id"
    )

    def attach(
        sent: UploadDep,
        session: SessionDep,
        user: CurrentUser,
        response: Response,
        owner_id: Annotated[UUID, Path(alias=column)],
        filename: FilenameQuery = None,
        caption: Annotated[str | None, Query(description=CAPTION)] = None,
    ) -> AttachmentOut:
        owner = (find.owner or project_for)(session, user, owner_id, "editor")
        project_id = owner.id if find.owner is None else find.owner.project_of(session, owner)
        with sent.file.path.open("rb") as file:
            kind = media_type(file.read(16))
        row = Attachment(
            **({column: owner.id} | {"project_id": project_id}),
            name=_stated("filename", filename or sent.filename or "file", 200),
            caption=_stated("caption", sent.text_of("caption", caption) or "", 500),
            media_type=kind,
            size=sent.file.size,
            sha256=sent.file.sha256,
        )
        book(session, *_payer(session, row), "attachments", sent.file.size)
        keep_original(session, sent.file)
        find.add(session, user, row, name=row.name, sha256=row.sha256.hex())
        return nouns.made(session, row, response)

    called = "an update" if noun == "update_job" else f"a {noun.replace('_', ' ')}"
    attach.__name__ = f"attach_to_{noun}"
    attach.__doc__ = (
        f"Keep a file beside {called}, as raw body or as multipart field `file`:"
        " a photograph, a drawing, notes, anything."
    )
    below = f"{noun.replace('_', '-')}s"
    router.add_api_route(
        f"/{below}/{{{column}}}/attachments",
        attach,
        methods=["POST"],
        status_code=201,
        openapi_extra=reads(
            upload("AttachedForm", caption=(CAPTION, "the clamp, before the test"))
        ),
    )
    nouns.listing(
        f"list_attachments_of_{noun}",
        f"Files beside {called}, oldest first.",
        owners=below,
    )
    return nouns


CAPTION = "what it shows, in a line"


def _stated(name: str, text: str, most: int) -> str:
    """A name or a caption that a form may state too.

    Raises:
        Invalid: it is too long, or cannot be stored.
    """
    if len(text) > most:
        raise Invalid(name, f"has {len(text)} characters, {most} at most")
    try:
        return refuse_unstorable_text(text)
    except ValueError as error:
        raise Invalid(name, str(error)) from None


of_nouns = {
    column: _routes(column, noun)
    for column, noun in {
        "project_id": "project",
        "structure_id": "structure",
        "campaign_id": "campaign",
        "update_job_id": "update_job",
        "joint_id": "joint_update",
        "monitor_id": "monitor",
    }.items()
}
"""What is attached to each noun, for pages too."""


@router.get("/attachments/{attachment_id}")
def get_attachment(attachment_id: UUID, session: SessionDep, user: CurrentUser) -> AttachmentOut:
    """A file's name, caption and kind."""
    _, row = attachment_for(session, user, attachment_id)
    return of_nouns["project_id"].shown(session, row)


@router.get("/attachments/{attachment_id}/file", response_class=FileResponse)
def get_attached_file(
    attachment_id: UUID, session: SessionDep, user: CurrentUser, request: Request
) -> Response:
    """The file as it was sent, byte for byte; its ETag is its SHA-256.

    A browser shows PNG, JPEG, WebP and PDF in place, by their content; every other file is saved.
    """
    _, row = attachment_for(session, user, attachment_id)
    shown = row.media_type in SHOWN
    headers = {
        "ETag": f'"{row.sha256.hex()}"',
        "Cache-Control": "private, no-cache",
        "Content-Disposition": disposition(row.name, inline=shown),
    }
    return not_modified(request, headers) or spooled(
        lambda file: copy_original(session, row.sha256, file), row.media_type, row.name, headers
    )


@router.patch("/attachments/{attachment_id}")
def caption_attachment(
    attachment_id: UUID, body: CaptionIn, session: SessionDep, user: CurrentUser
) -> AttachmentOut:
    """Give a file another caption."""
    find, row = attachment_for(session, user, attachment_id, "editor")
    find.note(session, user, row, "change", caption=body.caption)
    row.caption = body.caption
    session.flush()
    return of_nouns["project_id"].shown(session, row)


@router.delete("/attachments/{attachment_id}", status_code=204)
def delete_attachment(attachment_id: UUID, session: SessionDep, user: CurrentUser) -> None:
    """Remove a file for good."""
    find, row = attachment_for(session, user, attachment_id, "editor")
    find.note(session, user, row, "delete", name=row.name, sha256=row.sha256.hex())
    book(session, *_payer(session, row), "attachments", -row.size)
    session.delete(row)
    session.flush()
    forget_originals(session)
