"""Routes of FRFs and their spectra, which are written as `modalbase.formats.registry` says.

Files are written row by row, so that memory does not grow with the number of FRFs.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from operator import eq, ge, le
from typing import IO, Annotated
from uuid import UUID

from fastapi import Depends, Query, Request, Response
from fastapi.responses import FileResponse
from sqlalchemy import Select, select
from sqlalchemy.orm import Session

from fecore.frf import Quantity
from modalbase.formats.registry import WRITERS
from service.nouns.campaigns.operations import campaign_for, stored_points
from service.nouns.frfs import operations
from service.nouns.frfs.data import (
    BY_QUERY,
    Cut,
    FrfTable,
    PredictedTable,
    make_tables,
    only_table,
    require_order,
)
from service.nouns.frfs.operations import Frf
from service.nouns.frfs.schemas import FrfOut, LabelledFrfs
from service.platform.access import CurrentUser, SessionDep, api_router, present
from service.platform.errors import Invalid, NotFound
from service.platform.web import Cursor, Limit, Page, paged
from service.platform.web.bodies import Labels
from service.platform.web.downloads import fits_memory, in_memory, spooled
from service.platform.web.parameters import form_of, not_modified

Table = FrfTable | PredictedTable


def write_frfs(tables: Sequence[Table], file: IO[bytes], form: str) -> None:
    """Write FRFs as `?format=` names it.

    Raises:
        Invalid: they make several tables, and the format has one.
    """
    writer = WRITERS[form]
    writer.write(only_table(tables) if writer.one_table else tables, file)


router = api_router(tags=["FRFs"])

MEDIA_TYPES = {name: writer.media_type for name, writer in WRITERS.items()}
FILES = {
    200: {
        "content": {media_type: {} for media_type in MEDIA_TYPES.values()},
        "description": "The spectra.",
    }
}

Hertz = Annotated[float | None, Query(ge=0, le=1e12, allow_inf_nan=False)]
Whole = Annotated[int | None, Query(ge=0, le=9_999_999_999)]


@dataclass(frozen=True)
class FrfFilter:
    """Which FRFs of a campaign; None does not narrow. A band is that of FRFs with a line in it."""

    point: Annotated[Whole, Query(description="response point")] = None
    direction: Annotated[
        int | None, Query(ge=-6, le=6, description="signed response direction")
    ] = None
    reference: Annotated[Whole, Query(description="reference point")] = None
    quantity: Annotated[Quantity | None, Query(description="of these only")] = None
    import_id: Annotated[UUID | None, Query(description="of this import only")] = None
    fmin: Annotated[Hertz, Query(description="Hz")] = None
    fmax: Annotated[Hertz, Query(description="Hz")] = None
    superseded: Annotated[
        bool, Query(description="also those that a later processing made anew")
    ] = False

    def __post_init__(self) -> None:
        """Refuse a band whose ends are the wrong way round."""
        require_order(self.fmin, self.fmax)

    def query(self, campaign_id: UUID) -> Select[Frf]:
        """The query of the FRFs of a campaign that pass, without an order."""
        conditions = (
            (Frf.response_point, eq, self.point),
            (Frf.response_direction, eq, self.direction),
            (Frf.reference_point, eq, self.reference),
            (Frf.quantity, eq, self.quantity),
            (Frf.import_id, eq, self.import_id),
            (Frf.end_hz, ge, self.fmin),
            (Frf.start_hz, le, self.fmax),
        )
        passed = [
            compared(column, value) for column, compared, value in conditions if value is not None
        ]
        return select(Frf).where(
            Frf.campaign_id == campaign_id, *present(Frf, superseded=self.superseded), *passed
        )

    def rows(self, session: Session, campaign_id: UUID, most: int | None = None) -> Sequence[Frf]:
        """The first of them, or all.

        Raises:
            NotFound: none passes.
        """
        rows = session.scalars(self.query(campaign_id).order_by(Frf.id).limit(most)).all()
        if not rows:
            raise NotFound("FRF that matches in this campaign")
        return rows


FilterDep = Annotated[FrfFilter, Depends()]


@dataclass(frozen=True)
class Spectra:
    """How a client wants spectra: their cut, the name of a format, and what it has of them
    already.
    """

    request: Request
    cut: Cut
    form: str

    def of(
        self, session: Session, frfs: Sequence[Frf], choice: tuple[str, str] = BY_QUERY
    ) -> Response:
        """The spectra of FRFs as a file; 304 where the client has it.

        Args:
            session: of the request.
            frfs: which.
            choice: how the request could choose FRFs that make one table.
        """
        form, campaigns = WRITERS[self.form], {frf.campaign_id for frf in frfs}
        if not form.one_table and len(campaigns) > 1:
            why = (
                "a UFF file has the grid points of one campaign; these FRFs are of"
                f" {len(campaigns)}"
            )
            raise Invalid("format", why)
        tables = make_tables(session, frfs, self.cut)
        if form.one_table:
            only_table(tables, choice)
        headers = {"ETag": _etag(session, tables, self.form), "Vary": "Accept"}
        if (unchanged := not_modified(self.request, headers)) is not None:
            return unchanged
        size = form.value_bytes * sum(len(table.frfs) * table.frequency_hz.size for table in tables)
        send = in_memory if fits_memory(self.request, size) else spooled
        return send(
            lambda file: write_frfs(tables, file, self.form),
            form.media_type,
            f"frfs.{form.suffix}",
            headers,
        )


def _cut(
    fmin: Annotated[Hertz, Query(description="Hz")] = None,
    fmax: Annotated[Hertz, Query(description="Hz")] = None,
    stride: Annotated[int, Query(ge=1, le=1_000_000, description="every how many-th line")] = 1,
) -> Cut:
    require_order(fmin, fmax)
    return Cut(fmin, fmax, stride)


CutDep = Annotated[Cut, Depends(_cut)]


def _spectra(
    request: Request,
    cut: CutDep,
    form: Annotated[
        str, form_of(MEDIA_TYPES, "uff is set 58b, uff-ascii set 58; default: by Accept")
    ],
) -> Spectra:
    return Spectra(request, cut, form)


SpectraDep = Annotated[Spectra, Depends(_spectra)]


@router.get("/campaigns/{campaign_id}/frfs")
def list_frfs(
    campaign_id: UUID,
    selection: FilterDep,
    session: SessionDep,
    user: CurrentUser,
    cursor: Cursor = None,
    limit: Limit = 100,
) -> Page[FrfOut]:
    """FRFs of a campaign, without their spectra."""
    campaign = campaign_for(session, user, campaign_id)
    return paged(
        session, selection.query(campaign.id), cursor, limit, partial(map, operations.describe)
    )


@router.put("/campaigns/{campaign_id}/frfs/labels")
def label_frfs(
    campaign_id: UUID, labels: Labels, selection: FilterDep, session: SessionDep, user: CurrentUser
) -> LabelledFrfs:
    """Label FRFs: give all of a campaign, or those that the query leaves, tags and metadata in place
    of theirs.
    """
    campaign = campaign_for(session, user, campaign_id, "editor")
    return LabelledFrfs(
        count=operations.label_frfs(session, user, campaign, selection.query(campaign.id), labels)
    )


@router.get("/campaigns/{campaign_id}/frfs/data", response_class=FileResponse, responses=FILES)  # type: ignore[arg-type]
def get_campaign_data(
    campaign_id: UUID,
    selection: FilterDep,
    session: SessionDep,
    user: CurrentUser,
    spectra: SpectraDep,
) -> Response:
    """Spectra of a campaign's FRFs, with their band and stride, as `format` or Accept says.

    UFF holds the grid points too, and FRFs of any axes and quantities; the others need one axis and
    one quantity.
    """
    return spectra.of(session, selection.rows(session, campaign_for(session, user, campaign_id).id))


@router.get("/frfs/{frf_id}")
def get_frf(frf_id: UUID, session: SessionDep, user: CurrentUser) -> FrfOut:
    """An FRF without its spectrum."""
    return operations.describe(operations.frf_for(session, user, frf_id))


@router.get("/frfs/{frf_id}/data", response_class=FileResponse, responses=FILES)  # type: ignore[arg-type]
def get_frf_data(
    frf_id: UUID, session: SessionDep, user: CurrentUser, spectra: SpectraDep
) -> Response:
    """Spectrum of one FRF, in a band and with a stride if wanted, as `format` or Accept
    says.
    """
    return spectra.of(session, [operations.frf_for(session, user, frf_id)])


def _etag(session: Session, tables: list[FrfTable], file_format: str) -> str:
    digest = hashlib.sha256(file_format.encode())
    for table in tables:
        digest.update(repr(table.lines).encode())
        for frf in table.frfs:
            digest.update(frf.id.bytes + frf.sha256 + (frf.coherence_sha256 or b""))
    if not WRITERS[file_format].one_table:  # such a file holds the grid points too
        digest.update(repr(stored_points(session, tables[0].frfs[0].campaign_id)).encode())
    return f'"{digest.hexdigest()[:32]}"'


for _path, _handler in (
    ("/campaigns/{campaign_id}/frfs/data", get_campaign_data),
    ("/frfs/{frf_id}/data", get_frf_data),
):
    router.head(_path, include_in_schema=False)(_handler)
