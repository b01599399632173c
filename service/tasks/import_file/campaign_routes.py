"""`POST /structures/{id}/imports`: a file that is a campaign of its own, in one call; and the imports
into all campaigns of a structure.
"""

from functools import partial
from typing import Annotated
from uuid import UUID

from fastapi import Query, Response
from pydantic import Field

from modalbase.formats.registry import Kind
from service.nouns.campaigns.schemas import CampaignIn
from service.nouns.imports.operations import REPORT_BYTES, imports_into, new_import
from service.nouns.structures.operations import structure_for
from service.platform.access import CurrentUser, SessionDep, api_router
from service.platform.errors import Fault, Invalid
from service.platform.web import Confirm, Cursor, Limit, Page, paged, require_usual
from service.platform.web.json_body import checked, parse_parameter
from service.platform.web.openapi import reads, upload
from service.platform.web.uploads import FilenameQuery, UploadDep
from service.tasks.import_file import task
from service.tasks.import_file.routes import (
    MAPPING,
    THERE,
    ImportOut,
    MappingQuery,
    QuantityQuery,
    mapping_of,
    of_jobs,
)

router = api_router(tags=["imports"])

Sha256 = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
_CAMPAIGN = "the campaign to make, as JSON: what POST /structures/{id}/campaigns takes"
CAMPAIGN_UPLOAD = upload(
    "CampaignForm",
    campaign=(_CAMPAIGN, '{"name": "30 November", "boundary": "as_modelled"}'),
    mapping=MAPPING,
)


def _campaign_of(text: str | None) -> CampaignIn:
    """The campaign that a request states as JSON.

    Raises:
        Invalid: it is missing, or no campaign.
    """
    if text is None:
        raise Invalid("campaign", f"is missing: {_CAMPAIGN}")
    value = parse_parameter("campaign", text)
    try:
        return checked(CampaignIn, value)
    except Invalid as error:
        faults = [Fault(f"campaign{one.pointer}", one.detail) for one in error.faults]
        raise Invalid(faults, count=error.count) from None


@router.post(
    "/structures/{structure_id}/imports",
    status_code=202,
    responses=THERE,
    openapi_extra=reads(CAMPAIGN_UPLOAD),
)
def import_campaign(
    structure_id: UUID,
    sent: UploadDep,
    session: SessionDep,
    user: CurrentUser,
    response: Response,
    campaign: Annotated[str | None, Query(description=_CAMPAIGN, max_length=20_000)] = None,
    filename: FilenameQuery = None,
    quantity: QuantityQuery = None,
    kind: Annotated[
        Kind | None, Query(description="what the file holds, as of POST /campaigns/{id}/imports")
    ] = None,
    mapping: MappingQuery = None,
    complete: Annotated[
        bool,
        Query(description="the file is all of the campaign: monitors run once it was read"),
    ] = True,
    confirm: Confirm = False,
) -> ImportOut:
    """Send a file that is a campaign of its own, such as the recording of an hour. Campaign, original
    and job are made in one transaction, or none of them.

    `performed_at` is the campaign's, or `mapping.recording.performed_at` takes it from the file; means
    of channels become covariates by `mapping.recording.covariates`.

    A structure takes the same bytes once: sent again they are answered 200 with the import that has
    them, `already_imported` true, whatever became of it. One that failed is read anew by POST
    /campaigns/{id}/imports into its campaign; other bytes of the same file and campaign name take that
    campaign, which nothing else is in. Bytes of a deleted campaign are 409.
    """
    if sent.file.size == 0:
        raise Invalid("", "the body is empty, expected a file")
    texts = sent.texts_of({"campaign": campaign, "mapping": mapping})
    body = _campaign_of(texts["campaign"])
    require_usual(body, confirm)
    draft = new_import(
        filename=filename or sent.filename or "upload",
        dry_run=False,
        quantity=quantity,
        kind=kind,
        mapping=mapping_of(texts["mapping"]),
    )
    row, new = task.import_campaign(
        session, user, structure_id, body, sent.file, draft, complete=complete
    )
    response.status_code = 202 if new else 200
    return of_jobs.made(session, row, response).model_copy(update={"already_imported": not new})


@router.get("/structures/{structure_id}/imports")
def list_imports_of_structure(
    structure_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    sha256: Annotated[
        list[Sha256] | None,
        Query(max_length=100, description="of these bytes only, which says what need not be sent"),
    ] = None,
    deleted: Annotated[bool, Query(description="into deleted campaigns instead")] = False,
    cursor: Cursor = None,
    limit: Limit = 100,
) -> Page[ImportOut]:
    """Imports into all campaigns of a structure, newest first, without dry runs."""
    structure = structure_for(session, user, structure_id)
    digests = [bytes.fromhex(each) for each in sha256 or ()]
    query = imports_into(structure.id, digests, deleted=deleted)
    shown = partial(of_jobs.all_shown, session)
    return paged(session, query, cursor, limit, shown, newest_first=True, weight=REPORT_BYTES)
