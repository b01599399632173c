"""Routes of FRFs and their spectra."""

from __future__ import annotations

import hashlib
from typing import Annotated
from uuid import UUID

from fastapi import Depends, Header, Query, Request, Response
from fastapi.responses import FileResponse
from sqlalchemy.orm import Session

from fecore.frf import Quantity
from service.access import CurrentUser, SessionDep
from service.errors import Invalid, NotFound
from service.store.campaigns.grid_points import stored_points
from service.store.campaigns.operations import campaign_for
from service.store.frfs import operations
from service.store.frfs.data import Cut, FrfTable, make_tables
from service.store.frfs.formats import FORMATS
from service.store.frfs.schemas import FrfOut
from service.store.frfs.tables import Frf
from service.web import Cursor, Limit, Page, api_router, paged
from service.web.conditional import not_modified
from service.web.downloads import fits_memory, in_memory, spooled
from service.web.negotiation import choose_format, one_of

router = api_router(tags=["FRFs"])

MEDIA_TYPES = {name: form.media_type for name, form in FORMATS.items()}
FILES = {200: {"content": {media_type: {} for media_type in MEDIA_TYPES.values()}, "description": "The spectra."}}

Hertz = Annotated[float | None, Query(ge=0, le=1e12, allow_inf_nan=False)]
Whole = Annotated[int | None, Query(ge=0, le=9_999_999_999)]


def _filter(
    point: Annotated[Whole, Query(description="response point")] = None,
    direction: Annotated[int | None, Query(ge=-6, le=6, description="signed response direction")] = None,
    reference: Annotated[Whole, Query(description="reference point")] = None,
    quantity: Annotated[Quantity | None, Query(description="of these only")] = None,
    import_id: Annotated[UUID | None, Query(description="of this import only")] = None,
    fmin: Annotated[Hertz, Query(description="Hz")] = None,
    fmax: Annotated[Hertz, Query(description="Hz")] = None,
) -> operations.FrfFilter:
    if fmin is not None and fmax is not None and fmin > fmax:
        raise Invalid("fmin", f"is {fmin:g} Hz and above fmax, {fmax:g} Hz")
    return operations.FrfFilter(
        point=point,
        direction=direction,
        reference=reference,
        quantity=quantity,
        import_id=import_id,
        fmin=fmin,
        fmax=fmax,
    )


FilterDep = Annotated[operations.FrfFilter, Depends(_filter)]
Stride = Annotated[int, Query(ge=1, le=1_000_000, description="every how many-th line")]
Format = Annotated[
    Annotated[str, one_of(MEDIA_TYPES)] | None,
    Query(alias="format", description="uff is set 58b, uff-ascii set 58; default: by Accept"),
]
Accept = Annotated[str | None, Header(include_in_schema=False)]


@router.get("/campaigns/{campaign_id}/frfs")
def list_frfs(
    campaign_id: UUID,
    wanted: FilterDep,
    session: SessionDep,
    user: CurrentUser,
    cursor: Cursor = None,
    limit: Limit = 100,
) -> Page[FrfOut]:
    """FRFs of a campaign, without their spectra."""
    campaign = campaign_for(session, user, campaign_id)
    rows, following = paged(session, wanted.query(campaign.id), Frf.id, cursor, limit)
    return Page(items=[operations.describe(row) for row in rows], next_cursor=following)


@router.get("/campaigns/{campaign_id}/frfs/data", response_class=FileResponse, responses=FILES)  # type: ignore[arg-type]
def get_campaign_data(
    campaign_id: UUID,
    wanted: FilterDep,
    session: SessionDep,
    user: CurrentUser,
    request: Request,
    stride: Stride = 1,
    file_format: Format = None,
    accept: Accept = None,
) -> Response:
    """Spectra of a campaign's FRFs, with their band and stride, as JSON, npz, CSV, Arrow or UFF.

    UFF holds the grid points too, and FRFs of any axes and quantities; the others need one axis and one quantity.
    """
    campaign = campaign_for(session, user, campaign_id)
    rows = session.scalars(wanted.query(campaign.id).order_by(Frf.id)).all()
    if not rows:
        raise NotFound("FRF that matches in this campaign")
    tables = make_tables(session, rows, Cut(wanted.fmin, wanted.fmax, stride))
    return _file(session, tables, choose_format(file_format, accept, MEDIA_TYPES), request)


@router.get("/frfs/{frf_id}")
def get_frf(frf_id: UUID, session: SessionDep, user: CurrentUser) -> FrfOut:
    """An FRF without its spectrum."""
    return operations.describe(operations.frf_for(session, user, frf_id))


@router.get("/frfs/{frf_id}/data", response_class=FileResponse, responses=FILES)  # type: ignore[arg-type]
def get_frf_data(
    frf_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    request: Request,
    fmin: Annotated[Hertz, Query(description="Hz")] = None,
    fmax: Annotated[Hertz, Query(description="Hz")] = None,
    stride: Stride = 1,
    file_format: Format = None,
    accept: Accept = None,
) -> Response:
    """Spectrum of one FRF, in a band and with a stride if wanted, as JSON, npz, CSV, Arrow or UFF."""
    row = operations.frf_for(session, user, frf_id)
    tables = make_tables(session, [row], Cut(fmin, fmax, stride))
    return _file(session, tables, choose_format(file_format, accept, MEDIA_TYPES), request)


def _file(session: Session, tables: list[FrfTable], file_format: str, request: Request) -> Response:
    """The tables as a file; 304 where the client has it."""
    form = FORMATS[file_format]
    headers = {"ETag": _etag(session, tables, file_format), "Vary": "Accept"}
    if (unchanged := not_modified(request, headers)) is not None:
        return unchanged
    size = form.value_bytes * sum(len(table.frfs) * table.frequency_hz.size for table in tables)
    send = in_memory if fits_memory(request, size) else spooled
    return send(lambda file: form.write(tables, file), form.media_type, f"frfs.{form.suffix}", headers)


def _etag(session: Session, tables: list[FrfTable], file_format: str) -> str:
    digest = hashlib.sha256(file_format.encode())
    for table in tables:
        digest.update(repr(table.lines).encode())
        for frf in table.frfs:
            digest.update(frf.id.bytes + frf.sha256 + (frf.coherence_sha256 or b""))
    if not FORMATS[file_format].one_table:  # such a file holds the grid points too
        digest.update(repr(stored_points(session, tables[0].frfs[0].campaign_id)).encode())
    return f'"{digest.hexdigest()[:32]}"'


for _path, _handler in (
    ("/campaigns/{campaign_id}/frfs/data", get_campaign_data),
    ("/frfs/{frf_id}/data", get_frf_data),
):
    router.head(_path, include_in_schema=False)(_handler)
