"""Files that are dropped on a page: what each holds and states, before anything of it is stored."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import PurePosixPath
from typing import Annotated, Any

from fastapi import Query, Request
from fastapi.responses import HTMLResponse

from fecore.errors import FecoreError
from modalbase.formats.registry import FORMATS, Kind
from service.pages.forms import page_words
from service.pages.look import page
from service.platform.access import CurrentUser
from service.platform.errors import PayloadTooLarge, ServiceError
from service.platform.queue.subprocess_read import in_subprocess
from service.platform.web.admission import without_slot
from service.platform.web.routing import UI, page_router
from service.platform.web.uploads import UploadDep
from service.tasks.look.compute import FileLook, look_at

router = page_router(UI)
_look_at = in_subprocess(look_at)


@router.post("/files")
async def look_at_file(
    request: Request,
    sent: UploadDep,
    _user: CurrentUser,
    filename: Annotated[str, Query(max_length=200)],
    kind: Annotated[Kind | None, Query()] = None,
) -> HTMLResponse:
    """A row that says what a file holds and states, and the form of what it does not say."""
    look, fault, large = FileLook(), "", False
    try:
        async with without_slot(request.scope):
            look = await _look_at(sent.file.path, filename, kind)
    except PayloadTooLarge:
        large = True
    except (ServiceError, FecoreError) as error:
        fault = page_words(_reason(error))
    key = sent.file.sha256.hex()[:12]
    item = {
        "id": key,
        "filename": filename,
        "format": look.format,
        "kind": look.kind,
        "found": {"variables": look.variables},
        "campaign_id": None,
    }
    return page(
        request,
        "looked.html",
        item=item,
        starts={key: look.mapping},
        look=look,
        fault=fault,
        large=large,
        asks=look.kind is not None and (bool(look.mapping) or not _states_all(look)),
        facts={**_facts(look, filename), "refused": bool(fault), "large": large},
    )


def _reason(error: Exception) -> str:
    faults = getattr(error, "faults", None)
    return "; ".join(fault.detail for fault in faults) if faults else str(error)


def _states_all(look: FileLook) -> bool:
    """Whether FRFs in arrays of their own names say also what they are."""
    return FORMATS[look.format].states_quantity


def _facts(look: FileLook, filename: str) -> dict[str, Any]:
    """What a form is filled in with."""
    stem = PurePosixPath(filename).stem
    at = look.performed_at
    return {
        "name": filename,
        "model": look.is_model,
        "asks_units": look.is_model and not look.states_units,
        "fits": look.fits,
        "has_only_modes": set(look.counts) <= {"modes", "grid points"} and "modes" in look.counts,
        "points": 0 if look.only_points else look.counts["grid points"],
        "only_points": look.only_points,
        "offers": [asdict(offer) for offer in look.points],
        "reach_mm": look.reach_m and [1000 * size for size in look.reach_m],
        "structure/name": "" if look.only_points else look.title or stem,
        "campaign/name": "" if look.is_model or look.only_points else stem,
        "campaign/performed_at": at and at.isoformat(timespec="minutes"),
        **{f"campaign/instruments/{name}": text for name, text in look.instruments.items()},
    }
