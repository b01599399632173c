"""Routes of imports and of the original files."""

from __future__ import annotations

from typing import Annotated, Any
from uuid import UUID

from fastapi import Query, Request, Response
from fastapi.responses import FileResponse
from sqlalchemy import func, select

from fecore.frf import Quantity
from service.access import CurrentUser, SessionDep
from service.compute.arrays_of_files import Kind
from service.errors import Invalid
from service.store.campaigns.operations import campaign_for
from service.store.campaigns.uploads import UPLOAD_CONTENT, UploadDep
from service.store.imports import operations
from service.store.imports.originals import copy_original
from service.store.imports.schemas import ImportOut
from service.store.imports.tables import Import
from service.store.records.operations import judged, records_of_import
from service.store.records.schemas import StoredRecords
from service.web import Cursor, Limit, Name, Page, api_router, paged
from service.web.conditional import not_modified
from service.web.downloads import spooled
from service.web.json_body import parse_parameter
from service.web.uploads import Upload

router = api_router(tags=["imports"])

BODY = {"requestBody": {"required": True, "content": UPLOAD_CONTENT}}

QuantityQuery = Annotated[Quantity | None, Query(description="what an FRF is whose file does not say so, in SI units")]
MappingQuery = Annotated[str | None, Query(description="which variable is what, as JSON", max_length=20_000)]


def read_mapping(stated: str | None, upload: Upload) -> Any:
    """The mapping of a file: the parameter's, or that of the form.

    Raises:
        Invalid: it is not JSON.
    """
    text = stated or upload.fields.get("mapping")
    return None if text is None else parse_parameter("mapping", text)


@router.post("/campaigns/{campaign_id}/imports", status_code=202, openapi_extra=BODY)
def start_import(
    campaign_id: UUID,
    upload: UploadDep,
    session: SessionDep,
    user: CurrentUser,
    response: Response,
    filename: Annotated[Name | None, Query(description="name of a file that is sent as raw body")] = None,
    dry_run: Annotated[bool, Query(description="only report what the file holds")] = False,
    quantity: QuantityQuery = None,
    kind: Annotated[
        Kind | None, Query(description="what an npz, .mat or CSV holds; default: by its mapping and its arrays")
    ] = None,
    mapping: MappingQuery = None,
) -> ImportOut:
    """Send a file as raw body or as multipart field `file`: UFF, npz, .mat, CSV or wav; a job reads it.

    Its format is recognised by its content. Hits, and FRFs of a .mat, need a `mapping` that says which variable is what, as
    parameter or as multipart field; `dry_run` proposes one.

    The answer is 202 with the import's address in `Location`. Bytes that are in the campaign already are not read again:
    then it is 200 with the address of the import that has them, and `already_imported` is true.
    """
    if upload.file.size == 0:
        raise Invalid("", "the body is empty, expected a file: UFF, npz, .mat, CSV or wav")
    wanted = operations.ImportRequest(
        upload.file,
        filename or upload.filename or "upload",
        dry_run,
        quantity,
        kind=kind,
        mapping=read_mapping(mapping, upload),
    )
    row, new = operations.start_import(session, user, campaign_id, wanted)
    response.status_code = 202 if new else 200
    response.headers["Location"] = f"/api/v1/imports/{row.id}"
    return operations.describe(session, row, already_imported=not new)


@router.get("/campaigns/{campaign_id}/imports")
def list_imports(
    campaign_id: UUID, session: SessionDep, user: CurrentUser, cursor: Cursor = None, limit: Limit = 100
) -> Page[ImportOut]:
    """Imports into a campaign, oldest first. A page is shorter where reports on many datasets would make it heavy."""
    campaign = campaign_for(session, user, campaign_id)
    query = select(Import).where(Import.campaign_id == campaign.id)
    rows, following = paged(session, query, Import.id, cursor, limit, weight=func.pg_column_size(Import.datasets))
    return Page(items=operations.describe_all(session, rows), next_cursor=following)


@router.get("/imports/{import_id}")
def get_import(import_id: UUID, session: SessionDep, user: CurrentUser) -> ImportOut:
    """How far an import is, what it brought in, and what became of each dataset."""
    return operations.describe(session, operations.import_for(session, user, import_id))


@router.get("/imports/{import_id}/records")
def get_import_records(import_id: UUID, session: SessionDep, user: CurrentUser) -> StoredRecords:
    """Time blocks that an import brought, and how the hits of their points are judged now."""
    row = operations.import_for(session, user, import_id)
    return judged(session, row.campaign_id, records_of_import(session, row.id))


@router.get("/imports/{import_id}/original", response_class=FileResponse)
def get_original(import_id: UUID, session: SessionDep, user: CurrentUser, request: Request) -> Response:
    """The file as it was uploaded, byte for byte; its ETag is its SHA-256."""
    row = operations.import_for(session, user, import_id)
    headers = {"ETag": f'"{row.sha256.hex()}"'}
    return not_modified(request, headers) or spooled(
        lambda file: copy_original(session, row.sha256, file), "application/octet-stream", row.filename, headers
    )


router.head("/imports/{import_id}/original", include_in_schema=False)(get_original)
