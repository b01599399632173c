"""`POST …/records` and `POST …/frfs`: what a script sends is stored when it is answered.

JSON is stored in the request. A file goes the way of every file: its import is queued, and the
request waits for the job without slot and transaction. What takes longer than `import_wait_seconds`
is answered 202 with the import's address.
"""

import tempfile
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Annotated, Any
from uuid import UUID

import numpy as np
from anyio import to_thread
from fastapi import Depends, Query, Request, Response
from sqlalchemy.orm import Session

from modalbase.formats.errors import FormatError
from modalbase.formats.records import Variables
from modalbase.formats.registry import FORMATS, JSON, MEMBERS, Format, Kind, of_bodies
from service.nouns.campaigns.operations import campaign_for
from service.nouns.frfs import operations as frfs
from service.nouns.frfs.schemas import FrfOut, FrfsIn, write_rows
from service.nouns.imports.operations import new_import
from service.nouns.records import operations as records
from service.nouns.records.processings import judged
from service.nouns.records.schemas import Proposal, StoredRecords, from_json
from service.platform.access import CurrentUser, SessionDep, SettingsDep, User, api_router
from service.platform.access.dependencies import Beforehand
from service.platform.access.once import KeyHeader, digest_of, keep, made_before
from service.platform.errors import (
    Conflict,
    Fault,
    Invalid,
    PayloadTooLarge,
    ServiceError,
    Unavailable,
    UnsupportedMediaType,
)
from service.platform.queue.events import ChangesDep, shown
from service.platform.queue.subprocess_read import in_subprocess
from service.platform.queue.tables import Job
from service.platform.web import Page, shown_as
from service.platform.web.admission import without_slot
from service.platform.web.openapi import BINARY, TEXT, reads
from service.platform.web.uploads import FilenameQuery, Spooled, UploadDep
from service.tasks.import_file import task
from service.tasks.import_file.arrays_of_files import hits_of
from service.tasks.import_file.routes import (
    MAPPED_UPLOAD,
    ImportOut,
    MappingQuery,
    QuantityQuery,
    of_jobs,
    read_mapping,
)

if TYPE_CHECKING:
    from service.nouns.imports.operations import Import

router = api_router(tags=[])
_rows = in_subprocess(write_rows)

_TIME = np.arange(64) / 1024.0
_HIT = np.where(_TIME < 0.008, np.sin(np.pi * _TIME / 0.008), 0.0)
_HEIGHTS = (80.0, 90.0, 100.0)
_RING = np.sin(2 * np.pi * 100.0 * _TIME) * np.exp(-20.0 * _TIME)
_RECORDS_IN = {
    "title": "RecordsIn",
    "type": "object",
    "description": "A time block of hits: samples by variable, and what each variable is.",
    "required": ["variables"],
    "properties": {
        "variables": {
            "type": "object",
            "additionalProperties": {"type": "array", "items": {}},
            "description": "samples of each variable, or a list of such for several hits",
        },
        "mapping": {
            "type": "object",
            "additionalProperties": True,
            "description": "which variable is what; left out with `?dry_run=true`, which proposes one",
        },
    },
    "examples": [
        {
            "variables": {
                "force": [(h * _HIT).round(1).tolist() for h in _HEIGHTS],
                "acceleration": [(0.1 * h * _RING).round(2).tolist() for h in _HEIGHTS],
            },
            "mapping": {
                "sample_rate_hz": 1024,
                "channels": [
                    {"variable": "force", "quantity": "force", "point": 8},
                    {"variable": "acceleration", "quantity": "acceleration", "point": 14},
                ],
            },
        }
    ],
}
RECORDS = reads(MAPPED_UPLOAD | {"application/json": _RECORDS_IN})
_TABLE = {
    **TEXT,
    "examples": ["frequency_hz,real,imag\n10,0.12,-0.01\n11,0.13,-0.02\n"],
}
FRF_TYPES = of_bodies("frfs")
FRFS = reads(
    {"application/json": FrfsIn}
    | {kind: _TABLE if kind.startswith("text/") else BINARY for kind in FRF_TYPES}
)
LATER: dict[int | str, dict[str, Any]] = {
    202: {"model": ImportOut, "description": "the file is not read yet; `Location` is its import"}
}
UNNAMED = dict.fromkeys(("application/octet-stream", "application/zip"), "npz")
"""Media types that say little, and the format of FRFs that they are read as."""

RECORD_TYPES = of_bodies("hits")
RECORD_SUFFIXES = {
    suffix: row.name
    for row in FORMATS.values()
    if row.looked_at and "hits" in row.takes
    for suffix in row.every_suffix
}


class Reading:
    """Queues the file of a request and waits until it is read."""

    def __init__(
        self,
        request: Request,
        settings: SettingsDep,
        changes: ChangesDep,
        beforehand: Annotated[Beforehand, Depends()],
        idempotency_key: KeyHeader = None,
    ) -> None:
        self._request, self._changes, self._beforehand = request, changes, beforehand
        self._once = idempotency_key
        self._seconds = settings.import_wait_seconds

    async def of(self, campaign_id: UUID, file: Spooled, draft: "Import") -> UUID:
        """The key of the file's import, which has ended or has had its time."""

        def start(session: Any, key: Any, user: Any) -> tuple[UUID, Any, str]:
            import_id = self._started(session, user, campaign_id, file, draft)
            return import_id, shown(session.get_one(Job, import_id)), str(key.id)

        job_id, job, caller = await self._beforehand.do(start)
        async with without_slot(self._request.scope):
            await self._changes.ended(job, job_id, caller, self._seconds)
        return job_id

    def _started(
        self, session: Session, user: User, campaign_id: UUID, file: Spooled, draft: "Import"
    ) -> UUID:
        """A new import, or that of the same request under the same `Idempotency-Key`."""

        def started() -> UUID:
            return task.start_import(session, user, campaign_id, file, draft, urgent=True)[0].id

        if self._once is None:
            return started()
        name = f"file of {self._request.scope['route'].label}", self._once
        about = {
            part: getattr(draft, part)
            for part in ("filename", "dry_run", "quantity", "format", "kind", "mapping")
        }
        sha256 = digest_of({"campaign_id": campaign_id, "file": file.sha256.hex(), **about})
        if (row := made_before(session, user, *name, sha256)) is not None:
            return UUID(bytes=row.answer)
        import_id = started()
        keep(session, user, name, sha256, import_id.bytes)
        return import_id


ReadingDep = Annotated[Reading, Depends()]


@dataclass(frozen=True)
class _Came:
    """Time blocks of a script."""

    sent: tuple[Variables, Any] | UUID  # arrays of JSON and their mapping, or the import of a file
    filename: str  # where they come from
    dry_run: bool  # they shall only be looked at
    stated: list[Any]  # what the request says of them


async def _records(
    campaign_id: UUID,
    reading: ReadingDep,
    upload: UploadDep,
    filename: FilenameQuery = None,
    mapping: MappingQuery = None,
    dry_run: Annotated[
        bool, Query(description="only report what the file holds, and propose a mapping")
    ] = False,
) -> _Came:
    if upload.file.size == 0:
        raise Invalid("", "the body is empty, expected time blocks")
    name = filename or upload.filename
    stated = read_mapping(mapping, upload)
    if upload.content_type == "application/json":
        _require_taken(JSON, "hits", mapping=stated)
        sent = await to_thread.run_sync(lambda: from_json(upload.file.path.read_bytes()))
        return _Came(sent, name, dry_run, [upload.stated, name, dry_run])
    suffix = PurePosixPath(name).suffix.lower()
    if not suffix and upload.content_type in RECORD_TYPES:
        suffix = FORMATS[RECORD_TYPES[upload.content_type]].suffixes[0]
    if suffix not in RECORD_SUFFIXES:
        raise Invalid(
            "",
            f"is a '{suffix}' file, expected one of {', '.join(RECORD_SUFFIXES)}; POST"
            " /campaigns/{id}/imports takes every format, UFF too",
        )
    if stated is None and not dry_run:
        raise Invalid("mapping", "is missing; ?dry_run=true proposes one")
    draft = new_import(
        filename=name or f"upload{suffix}",
        dry_run=dry_run,
        format=RECORD_SUFFIXES[suffix],
        kind="hits",
        mapping=stated,
    )
    import_id = await reading.of(campaign_id, upload.file, draft)
    return _Came(import_id, name, dry_run, [str(import_id)])


@router.post(
    "/campaigns/{campaign_id}/records",
    status_code=201,
    openapi_extra=RECORDS,
    responses=LATER,
    tags=["records"],
)
def create_records(
    campaign_id: UUID,
    came: Annotated[_Came, Depends(_records)],
    session: SessionDep,
    user: CurrentUser,
    response: Response,
) -> StoredRecords | Proposal | ImportOut:
    """Send time blocks of hits as a file with a mapping, or as JSON `{variables, mapping}`.

    All are stored, or none. The answer judges the hits of the points concerned, so a script beside
    the hammer knows after each hit whether it was good. A file is an import: one that is not read
    within `import_wait_seconds` is answered 202 with its address.
    """
    sent = came.sent
    if isinstance(sent, UUID):
        state = _ended(session, user, sent, response)
        if state.status != "succeeded":
            return state
        if came.dry_run and state.found is not None:
            response.status_code = 200
            return state.found
        return judged(session, campaign_id, records.record_for.all(session, import_id=[sent]))
    if came.dry_run:
        campaign_for(session, user, campaign_id, "editor")
    description, blocks = hits_of(*sent, dry_run=came.dry_run)
    if came.dry_run:
        response.status_code = 200
        return shown_as(Proposal, description)
    rows = records.store_records(
        session, user, campaign_id, came.filename, blocks, counted=description.counted
    )
    return judged(session, campaign_id, rows)


def _require_taken(form: Format, kind: Kind, **stated: Any) -> None:
    """Refuse parameters that are not taken with a body.

    Raises:
        Invalid: each of them.
    """
    try:
        form.require_taken(kind, [name for name in MEMBERS if stated.get(name) is not None])
    except FormatError as error:
        raise Invalid([Fault(name, why) for name, why in error.faults]) from None


async def _frfs(
    campaign_id: UUID,
    request: Request,
    reading: ReadingDep,
    upload: UploadDep,
    quantity: QuantityQuery = None,
    mapping: MappingQuery = None,
) -> AsyncIterator[frfs.NewFrfs | UUID]:
    """JSON as rows to be stored, which a child process made, or a file's import."""
    if upload.file.size == 0:
        raise Invalid("", "the body is empty, expected FRFs as npz or JSON")
    stated = read_mapping(mapping, upload)
    if upload.content_type == "application/json":
        _require_taken(JSON, "frfs", mapping=stated, quantity=quantity)
        with tempfile.NamedTemporaryFile(prefix="modalbase-rows-") as rows:
            path = Path(rows.name)
            async with without_slot(request.scope):
                count = await _rows(upload.file.path, path)
            yield frfs.NewFrfs(path, count, upload.file.sha256.hex())
        return
    form = (FRF_TYPES | UNNAMED).get(upload.content_type)
    if form is None:
        raise UnsupportedMediaType(
            f"the body is {upload.content_type or 'of no stated type'}, expected application/json,"
            f" {', '.join(FRF_TYPES)}"
        )
    row = FORMATS[form]
    if not row.states_quantity and quantity is None and stated is None:
        raise Invalid(
            "quantity", f"is missing: a {form} does not say what it holds, so ?quantity= must"
        )
    _require_taken(row, "frfs", mapping=stated, quantity=quantity)
    name = upload.filename or f"frfs{row.suffixes[0]}"
    draft = new_import(
        filename=name, dry_run=False, quantity=quantity, format=form, kind="frfs", mapping=stated
    )
    yield await reading.of(campaign_id, upload.file, draft)


@router.post(
    "/campaigns/{campaign_id}/frfs",
    status_code=201,
    openapi_extra=FRFS,
    responses=LATER,
    tags=["FRFs"],
)
def create_frfs(
    campaign_id: UUID,
    came: Annotated[frfs.NewFrfs | UUID, Depends(_frfs)],
    session: SessionDep,
    user: CurrentUser,
    response: Response,
) -> Page[FrfOut] | ImportOut:
    """Send FRFs of a script as JSON or a file, as `GET …/frfs/data` writes them, or an analyser's
    file with a mapping.

    All are stored, or none; at most 10,000 at a time. A file is an import: one that is not read
    within `import_wait_seconds` is answered 202 with its address.
    """
    if isinstance(came, UUID):
        state = _ended(session, user, came, response)
        if state.status != "succeeded":
            return state
        rows = frfs.frf_for.all(session, import_id=[came])
    else:
        rows = frfs.store_frfs(
            session, user, campaign_for(session, user, campaign_id, "editor"), came
        )
    return Page(items=[frfs.describe(row) for row in rows])


def _ended(
    session: SessionDep, user: CurrentUser, import_id: UUID, response: Response
) -> ImportOut:
    """A file's import: one that goes on is answered 202.

    Raises:
        ServiceError: it failed; as if the file had been read in the request.
    """
    state = of_jobs.one(session, user, import_id)
    if state.error is not None:
        raise _error_of(state.error)
    if state.status != "succeeded":
        response.status_code = 202
        response.headers["Location"] = f"/api/v1/imports/{state.id}"
    return state


def _error_of(error: dict[str, Any]) -> Exception:
    """What the reading of a file raised, from what is kept of it."""
    reason, kind, detail = error["reason"], error["type"], error["detail"]
    if faults := error.get("errors"):
        return Invalid([Fault(**fault) for fault in faults], count=error["error_count"])
    if reason in ("memory", "time", "crash"):
        return PayloadTooLarge(f"the body cannot be read here: {detail}")
    if reason == "lost":
        return Unavailable(detail)
    if reason == "internal":
        return RuntimeError(detail)
    known: dict[str, type[ServiceError]] = {"Conflict": Conflict}
    return known.get(kind, PayloadTooLarge)(detail)
