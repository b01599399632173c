"""Routes of FRFs and their spectra, which are written as JSON, npz, CSV, Arrow or UFF.

Files are written row by row, so that memory does not grow with the number of FRFs.
"""

import hashlib
import itertools
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from operator import eq, ge, le
from typing import IO, Annotated
from uuid import UUID

import numpy as np
from fastapi import Depends, Query, Request, Response
from fastapi.responses import FileResponse
from sqlalchemy import Select, select
from sqlalchemy.orm import Session

from fecore.frf import Quantity
from modalbase.formats import uff
from modalbase.formats.frfs import write_csv, write_npz
from modalbase.formats.frfs.arrow import write_arrow
from modalbase.formats.frfs.table import DOFS
from modalbase.formats.frfs.table import FrfTable as Written
from modalbase.formats.uff.write import encode
from service.access import CurrentUser, SessionDep, present
from service.errors import Invalid, NotFound
from service.store.campaigns.operations import campaign_for, stored_points
from service.store.frfs import operations
from service.store.frfs.data import (
    BY_QUERY,
    Cut,
    FrfTable,
    PredictedTable,
    make_tables,
    only_table,
    require_order,
)
from service.store.frfs.operations import Frf
from service.store.frfs.schemas import UNITS, FrfOut, LabelledFrfs
from service.web import Cursor, Limit, Page, api_router, paged
from service.web.bodies import Labels
from service.web.downloads import fits_memory, in_memory, spooled
from service.web.parameters import form_of, not_modified

Table = FrfTable | PredictedTable


def write_json(table: Written, file: IO[bytes]) -> None:
    """`{quantity, unit, frequency_hz, frfs: [{id, response_point, …, real, imag, coherence}]}`."""
    quantity = table.quantity
    head = {
        "quantity": quantity,
        "unit": UNITS[quantity],  # type: ignore[index]
        "frequency_hz": table.frequency_hz.tolist(),
    }
    file.write(json.dumps(head, ensure_ascii=False)[:-1].encode() + b', "frfs": [')
    for i, (frf, values, coherence) in enumerate(table.both()):
        item = {
            "id": str(frf.id),
            "label": frf.label,
            **{key: getattr(frf, key) for key in DOFS},
            "averages": frf.averages,
            "real": values.real.tolist(),
            "imag": values.imag.tolist(),
            "coherence": None if coherence is None else coherence.tolist(),
        }
        file.write(
            (b", " if i else b"") + json.dumps(item, ensure_ascii=False, allow_nan=False).encode()
        )
    file.write(b"]}")


def write_uff(tables: Sequence[Table], file: IO[bytes], *, binary: bool) -> None:
    """Grid points of the campaign (set 2411), FRFs and their coherences (set 58b, or 58 as text),
    SI.

    The binary form keeps every bit; the text keeps 13 digits.
    """
    contents: Iterator[uff.Content] = (
        uff.GridPoint(label, xyz) for label, xyz in tables[0].points.items()
    )
    for block in encode(itertools.chain(contents, _functions(tables)), binary=binary):
        file.write(block)


@dataclass(frozen=True)
class Format:
    """A way to write FRFs."""

    media_type: str  # of the file
    suffix: str  # of its name
    value_bytes: int  # about what a value takes, its coherence included
    # writes tables; where `one_table`, there is one
    write: Callable[[Sequence[Table], IO[bytes]], None]
    one_table: bool = True  # only FRFs of one quantity on one axis can be written


def _of_one_table(write: Callable[[FrfTable, IO[bytes]], None]) -> Callable[..., None]:
    return lambda tables, file: write(only_table(tables), file)


FORMATS: dict[str, Format] = {
    "json": Format("application/json", "json", 70, _of_one_table(write_json)),
    "npz": Format("application/x-npz", "npz", 24, _of_one_table(write_npz)),
    "csv": Format("text/csv", "csv", 90, _of_one_table(write_csv)),
    "arrow": Format(
        "application/vnd.apache.arrow.stream", "arrows", 50, _of_one_table(write_arrow)
    ),
    "uff": Format("application/x-uff", "uff", 24, partial(write_uff, binary=True), one_table=False),
    "uff-ascii": Format("text/x-uff", "uff", 62, partial(write_uff, binary=False), one_table=False),
}
"""By their names in `?format=`."""


def _functions(tables: Sequence[Table]) -> Iterator[uff.Content]:
    """Each FRF, and its coherence after it."""
    for table in tables:
        axis = _uff_axis(table)
        for frf, values, coherence in table.both():
            dofs = {key: getattr(frf, key) for key in DOFS}
            ids = (frf.label, table.description, "NONE", "NONE", "NONE")
            yield uff.Frf(
                dataset=0,
                label=frf.label,
                id_lines=ids,
                **dofs,
                quantity=table.quantity,  # type: ignore[arg-type]  # the column holds what was checked on the way in
                frequency=axis,
                values=values,
            )
            if coherence is not None:
                yield uff.Function(
                    dataset=0,
                    label=frf.label,
                    id_lines=ids,
                    function_type=uff.COHERENCE,
                    **dofs,
                    abscissa=axis,
                    abscissa_unit="Hz",
                    values=coherence,
                    unit="",
                )


def _uff_axis(table: Table) -> uff.Axis:
    """Start and step where they give the lines exactly, else the lines."""
    frequency = table.frequency_hz
    if frequency.size > 1:
        even = uff.Axis(float(frequency[0]), float(frequency[1] - frequency[0]), frequency.size)
        if np.array_equal(even.points(), frequency):
            return even
    return uff.Axis(float(frequency[0]), 0.0, frequency.size, frequency)


router = api_router(tags=["FRFs"])

MEDIA_TYPES = {name: form.media_type for name, form in FORMATS.items()}
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
        form, campaigns = FORMATS[self.form], {frf.campaign_id for frf in frfs}
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
            lambda file: form.write(tables, file), form.media_type, f"frfs.{form.suffix}", headers
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
    """Give a set of FRFs, all of the campaign or those that the query leaves, tags and metadata in
    place of theirs.
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
    """Spectra of a campaign's FRFs, with their band and stride, as JSON, npz, CSV, Arrow or UFF.

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
    """Spectrum of one FRF, in a band and with a stride if wanted, as JSON, npz, CSV, Arrow or
    UFF.
    """
    return spectra.of(session, [operations.frf_for(session, user, frf_id)])


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
