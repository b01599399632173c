"""Routes of recordings of responses, and of their spectra."""

from collections.abc import Iterator
from functools import partial
from typing import Annotated, Any
from uuid import UUID

from fastapi import Query, Response
from fastapi.responses import JSONResponse
from pydantic import Field

from fecore.frf import Dof
from fecore.signal import HalfSpectra
from modalbase.formats import uff
from modalbase.formats.arrays_out import ARRAY_WRITERS
from service.nouns.campaigns.operations import stored_points
from service.nouns.recordings import transmissibility
from service.nouns.recordings.functions import function_of, write_functions
from service.nouns.recordings.operations import (
    Recording,
    arrays_of,
    columns_of,
    describe_all,
    recording_for,
    spectra_of_recording,
)
from service.nouns.recordings.schemas import (
    DeflectionOf,
    DeflectionOut,
    RecordingOut,
    SensorOut,
    TransmissibilityOut,
)
from service.nouns.records.schemas import UNITS
from service.platform.access import CurrentUser, SessionDep, api_router
from service.platform.access.nouns import NounRoutes
from service.platform.web.downloads import spooled
from service.platform.web.parameters import form_of

router = api_router(tags=["recordings"])

nouns = NounRoutes(router, recording_for, RecordingOut, describe_all, "recordings", "recording_id")

nouns.listing(
    "list_recordings", "Recordings of responses to loads that nobody measured, of a campaign."
)
nouns.getting(
    "get_recording", "A recording of responses: its channels, and what its half spectra are."
)

MEDIA_TYPES = {
    "json": "application/json",
    **{name: writer.media_type for name, writer in ARRAY_WRITERS.items()},
    "uff": "application/x-uff",
}
FILES: dict[int | str, dict[str, Any]] = {
    200: {"content": {each: {} for each in MEDIA_TYPES.values()}, "description": "The spectra."}
}
TRANSMISSIBILITIES: dict[int | str, dict[str, Any]] = {
    200: {"content": {each: {} for name, each in MEDIA_TYPES.items() if name != "json"}}
}
AUTO, CROSS = 2, 3
"""Types of functions of set 58."""


@router.get("/recordings/{recording_id}/spectra", response_class=Response, responses=FILES)
def get_recording_spectra(
    recording_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    form: Annotated[str, form_of(MEDIA_TYPES, "uff and parquet: the power spectra alone")],
) -> Response:
    """Power spectra of a recording, one-sided, of every sensor and of all with the references; as
    npz or HDF5 with the half spectra of its blocks too, in which modes are found.
    """
    row = recording_for(session, user, recording_id)
    spectra = spectra_of_recording(session, row)
    if form == "json":
        return JSONResponse(_as_json(spectra))
    arrays = columns_of if form == "parquet" else arrays_of
    return spooled(
        lambda file: (
            write_functions(stored_points(session, row.campaign_id), _functions(row, spectra), file)
            if form == "uff"
            else ARRAY_WRITERS[form].write(arrays(spectra), file)
        ),
        MEDIA_TYPES[form],
        f"spectra.{'h5' if form == 'hdf5' else form}",
        {"Vary": "Accept"},
    )


@router.get(
    "/recordings/{recording_id}/transmissibility",
    response_model=TransmissibilityOut,
    responses=TRANSMISSIBILITIES,
)
def get_recording_transmissibility(
    recording_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    form: Annotated[str, form_of(MEDIA_TYPES, "uff: sets 58 of type 5, with coherence")],
    references: Annotated[
        list[Annotated[str, Field(pattern=r"^[0-9]{1,10}:-?[1-6]$")]] | None,
        Query(
            max_length=8,
            description=(
                "`point:direction` of responses among the references of the processing; default: the"
                " first of them"
            ),
        ),
    ] = None,
) -> Any:
    """Transmissibility of a recording of responses: what they do for each unit of one or several of
    them, with variance and multiple coherence: S_xr S_rr⁻¹. They are no FRFs, and no modes are found in
    them.
    """
    row = recording_for(session, user, recording_id)
    made = transmissibility.made_of(spectra_of_recording(session, row), references or ())
    if form == "json":
        return transmissibility.as_json(made)
    points = stored_points(session, row.campaign_id)
    columns = form == "parquet"
    arrays = transmissibility.columns_of if columns else transmissibility.arrays_of
    return spooled(
        lambda file: (
            write_functions(points, transmissibility.functions_of(made, row.filename), file)
            if form == "uff"
            else ARRAY_WRITERS[form].write(arrays(made), file)
        ),
        MEDIA_TYPES[form],
        f"transmissibility.{'h5' if form == 'hdf5' else form}",
        {"Vary": "Accept"},
    )


@router.get("/recordings/{recording_id}/deflection")
def get_recording_deflection(
    recording_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    frequency_hz: Annotated[
        float | None,
        Query(gt=0, le=1e7, description="at which line, Hz; default: the strongest"),
    ] = None,
) -> DeflectionOut:
    """The operating deflection shape of a recording at a frequency, by the power spectra of all
    sensors with the reference that moves most there.
    """
    spectra = spectra_of_recording(session, recording_for(session, user, recording_id))
    line, reference, shape = spectra.deflection(frequency_hz)
    return DeflectionOut(
        frequency_hz=line,
        reference=SensorOut(**_sensor(reference)),
        unit=f"{UNITS[spectra.quantity]}/√Hz",
        shape=[
            DeflectionOf(**_sensor(dof), real=value.real, imag=value.imag)
            for dof, value in zip(spectra.responses, shape.tolist(), strict=True)
        ],
    )


def _as_json(spectra: HalfSpectra) -> dict[str, Any]:
    return {
        "frequency_hz": spectra.frequency_hz.tolist(),
        "unit": _unit(spectra),
        "responses": [_sensor(dof) for dof in spectra.responses],
        "references": [_sensor(dof) for dof in spectra.references],
        "auto": spectra.autos.tolist(),
        "cross": {"real": spectra.crosses.real.tolist(), "imag": spectra.crosses.imag.tolist()},
        "singular_values": spectra.singular_values.tolist(),
    }


def _sensor(dof: Dof) -> dict[str, int]:
    return {"point": dof.point, "direction": dof.direction}


def _unit(spectra: HalfSpectra) -> str:
    return f"({UNITS[spectra.quantity].replace('²', '^2')})^2/Hz"


def _functions(row: Recording, spectra: HalfSpectra) -> Iterator[uff.Function]:
    """An auto spectrum of each sensor, and each cross spectrum."""
    own = partial(function_of, row.filename, frequency_hz=spectra.frequency_hz, unit=_unit(spectra))
    for number, dof in enumerate(spectra.responses):
        yield own((dof, dof), values=spectra.autos[number], function_type=AUTO)
        for column, reference in enumerate(spectra.references):
            if reference != dof:
                cross = spectra.crosses[number, column]
                yield own((dof, reference), values=cross, function_type=CROSS)
