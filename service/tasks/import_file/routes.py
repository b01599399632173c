"""What a client gets about imports; the routes of imports and of the original files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import datetime
from typing import TYPE_CHECKING, Annotated, Any, Literal
from uuid import UUID

from fastapi import Query, Request, Response
from fastapi.responses import FileResponse
from pydantic import Field, WithJsonSchema
from sqlalchemy.orm import Session

from fecore.frf import Quantity
from modalbase.formats.registry import FORMATS, Kind, either, looked_at, titles
from service.nouns.imports.operations import (
    REPORT_BYTES,
    import_for,
    is_listed,
    new_import,
    remove_import,
)
from service.nouns.records.operations import record_for
from service.nouns.records.processings import judged
from service.nouns.records.schemas import Proposal, StoredRecords
from service.nouns.storage.originals import copy_original, original_sizes
from service.nouns.updates.operations import require_no_update
from service.platform.access import CurrentUser, SessionDep, api_router
from service.platform.errors import Invalid, require_bytes
from service.platform.queue.resource import JobOut
from service.platform.queue.routes import JobRoutes
from service.platform.web import StrictModel
from service.platform.web.downloads import spooled
from service.platform.web.json_body import parse_parameter
from service.platform.web.openapi import reads, upload
from service.platform.web.parameters import not_modified
from service.platform.web.uploads import FilenameQuery, Upload, UploadDep
from service.tasks.import_file import task

if TYPE_CHECKING:
    from service.nouns.imports.operations import Import


class DatasetOutcome(StrictModel):
    """What became of one dataset of the file."""

    number: int = Field(description="1 for the first dataset of the file")
    type: str = Field(description='dataset type: "15", "58", "58b" ...')
    offset: int = Field(description="byte at which the dataset begins")
    outcome: Literal["read", "ignored", "refused"]
    reason: str | None
    notes: list[str] = Field(description="conversions and assumptions made while reading")


FormatName = Annotated[str, WithJsonSchema({"type": "string", "enum": [*FORMATS]})]
LOOKED_AT = titles(looked_at())


class Counts(StrictModel):
    """What an import brought in."""

    frfs: int
    grid_points: int
    modes: int
    records: int = Field(0, description="time blocks of hammer hits")
    recordings: int = Field(0, description="of responses, with or without their loads")


class ImportOut(JobOut):
    """A file's way into a campaign, whatever its format."""

    campaign_id: UUID
    filename: str
    size: int = Field(description="bytes")
    sha256: str
    dry_run: bool
    quantity: Quantity | None
    format: FormatName | None = Field(
        description="by what is in the file; null until that was read"
    )
    kind: Kind | None = Field(
        description=f"what an {LOOKED_AT} holds, as stated or found; null of UFF, which may hold both"
    )
    mapping: Any = Field(description="which variable is what, as it was stated")
    found: Proposal | None = Field(
        description=f"arrays of an {LOOKED_AT}, and a mapping that suggests itself"
    )
    already_imported: bool = Field(
        False, description="these bytes are in the campaign already; nothing new was queued"
    )
    bytes_deleted_at: datetime | None = Field(
        None, description="when the retention rule deleted the file; null where it is there"
    )
    counts: Counts | None = Field(description="what was read; null until it succeeded")
    datasets: list[DatasetOutcome]
    warnings: list[str]


router = api_router(tags=["imports"])

QuantityQuery = Annotated[
    Quantity | None, Query(description="what an FRF is whose file does not say so, in SI units")
]
MappingQuery = Annotated[
    str | None, Query(description="which variable is what, as JSON", max_length=20_000)
]


def _with_files(session: Session, rows: Sequence[Import]) -> Iterator[dict[str, Any]]:
    sizes = original_sizes(session, [row.sha256 for row in rows])
    for row in rows:
        file = {"size": sizes[row.sha256], "sha256": row.sha256.hex()}
        yield {**file, "datasets": row.datasets or [], "warnings": row.warnings or []}


of_jobs = JobRoutes(
    router,
    task.IMPORTS,
    ImportOut,
    "import_id",
    _with_files,
    newest_first=False,
    listed=(is_listed(),),
    weight=REPORT_BYTES,
)


def read_mapping(stated: str | None, sent: Upload) -> dict[str, Any] | None:
    """The mapping of a file: the parameter's, or that of the form.

    Raises:
        Invalid: it is no JSON object, or is stated twice.
    """
    return mapping_of(sent.text_of("mapping", stated))


def mapping_of(text: str | None) -> dict[str, Any] | None:
    """The mapping in a text; None of none.

    Raises:
        Invalid: it is no JSON object.
    """
    value = {} if text is None else parse_parameter("mapping", text)
    if not isinstance(value, dict):
        raise Invalid("mapping", f"is {str(text)[:40]}, expected an object: {{...}}")
    return None if text is None else value


MAPPING = (
    "which variable is what, as JSON",
    '{"channels": [{"variable": "force", "quantity": "force", "unit": "N"}]}',
)
MAPPED_UPLOAD = upload("MappedForm", mapping=MAPPING)
THERE: dict[int | str, dict[str, Any]] = {
    200: {"model": ImportOut, "description": "These bytes are there already"}
}


@router.post(
    "/campaigns/{campaign_id}/imports",
    status_code=202,
    responses=THERE,
    openapi_extra=reads(MAPPED_UPLOAD),
)
def start_import(
    campaign_id: UUID,
    sent: UploadDep,
    session: SessionDep,
    user: CurrentUser,
    response: Response,
    filename: FilenameQuery = None,
    dry_run: Annotated[bool, Query(description="only report what the file holds")] = False,
    quantity: QuantityQuery = None,
    kind: Annotated[
        Kind | None,
        Query(
            description=f"what an {titles(either())} holds; default: by its mapping and its arrays."
            " `responses` of any file: no load was measured; `loads`: one or several, throughout"
        ),
    ] = None,
    mapping: MappingQuery = None,
) -> ImportOut:
    """Send a file of measured data, as raw body or as multipart field `file`; a job reads it.

    Its format, of those in the guide's table, is recognised by its content. Hits, and FRFs of a
    .mat, need a `mapping` that says which variable is what, as parameter or as multipart field;
    `dry_run` proposes one.

    The answer is 202 with the import's address in `Location`. Bytes that are in the campaign
    already are not read again: then it is 200 with the address of the import that has them, and
    `already_imported` is true; with another `quantity` or `kind` it is 409.
    """
    if sent.file.size == 0:
        raise Invalid("", f"the body is empty, expected a file: {titles()}")
    draft = new_import(
        filename=filename or sent.filename or "upload",
        dry_run=dry_run,
        quantity=quantity,
        kind=kind,
        mapping=read_mapping(mapping, sent),
    )
    row, new = task.start_import(session, user, campaign_id, sent.file, draft)
    response.status_code = 202 if new else 200
    return of_jobs.made(session, row, response).model_copy(update={"already_imported": not new})


of_jobs.listing(
    "list_imports",
    "Imports into a campaign, oldest first; a dry run leaves the list once its file was read. A page"
    " is shorter where reports on many datasets would make it heavy.",
)
of_jobs.getting(
    "get_import", "How far an import is, what it brought in, and what became of each dataset."
)


@router.get("/imports/{import_id}/records")
def get_import_records(import_id: UUID, session: SessionDep, user: CurrentUser) -> StoredRecords:
    """Time blocks that an import brought, and how the hits of their points are judged now."""
    row = import_for(session, user, import_id)
    return judged(session, row.campaign_id, record_for.all(session, import_id=[row.id]))


@router.get("/imports/{import_id}/original", response_class=FileResponse)
def get_imports_original(
    import_id: UUID, session: SessionDep, user: CurrentUser, request: Request
) -> Response:
    """The file as it was uploaded, byte for byte; its ETag is its SHA-256. 410 where the
    structure's retention rule has deleted it.
    """
    row = import_for(session, user, import_id)
    require_bytes("original", row.bytes_deleted_at)
    headers = {"ETag": f'"{row.sha256.hex()}"'}
    return not_modified(request, headers) or spooled(
        lambda file: copy_original(session, row.sha256, file),
        "application/octet-stream",
        row.filename,
        headers,
    )


router.head("/imports/{import_id}/original", include_in_schema=False)(get_imports_original)


@router.delete("/imports/{import_id}", status_code=204)
def delete_import(import_id: UUID, session: SessionDep, user: CurrentUser) -> None:
    """Remove an import with its FRFs, time blocks, recordings and modes, such as one of a wrong `quantity`;
    grid points stay.

    409 while it runs, and where an update of the campaign may rest on it: results keep what they
    were computed from.
    """
    row = import_for(session, user, import_id, "editor", lock=True)
    brought = row.counts if row.counts and not row.dry_run else {}
    if brought.get("frfs") or brought.get("modes"):
        require_no_update(session, row.campaign_id, row.id)
    remove_import(session, user, row)
