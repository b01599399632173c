"""Routes of what is shown of a result: predicted FRFs, the updated model's deck, figures."""

from collections.abc import Mapping
from hashlib import sha256
from typing import IO, Annotated, Any
from uuid import UUID

from anyio import from_thread
from fastapi import Path, Query, Request, Response
from fastapi.responses import FileResponse, PlainTextResponse

from modalbase.formats.registry import WRITERS
from service.compute.models.decks import updated_deck
from service.figures.answers import (
    RESPONSES,
    FigureOut,
    FigureRequestDep,
    FiguresOut,
    require_figure,
)
from service.nouns.frfs.data import require_order
from service.nouns.frfs.routes import FILES, MEDIA_TYPES, CutDep, Hertz, Whole, write_frfs
from service.nouns.structures.model_routes import MESH_FILES, MeshForm
from service.nouns.updates.operations import joint_update_for, update_job_for
from service.platform.access import CurrentUser, SessionDep, api_router
from service.platform.errors import Invalid
from service.platform.queue.subprocess_read import in_subprocess
from service.platform.web.downloads import spooled
from service.platform.web.parameters import form_of, not_modified
from service.reports.decks import SUFFIXES, Element, Program, deck_order, written_deck
from service.reports.figure_data import FigureQuery, UpdateFigures
from service.reports.figures import FIGURES, FIGURES_OF_SEVERAL, draw_figure
from service.reports.named_figure import NamedFigure
from service.reports.predictions import FrfQuery, Model, predicted_table
from service.reports.space import (
    At,
    ResultMeshOut,
    ShapeOut,
    answer_mesh,
    measured_shape,
    model_shape,
)

router = api_router(tags=["update jobs"])
_updated = in_subprocess(updated_deck)

Mode = Annotated[int | None, Query(ge=1, le=10_000)]
_OF_FIGURES = {name for figure in FIGURES.values() for name in figure.query}


def _heeding(parameter: str) -> str:
    return ", ".join(f"`{name}`" for name, each in FIGURES.items() if parameter in each.query)


@router.get("/update-jobs/{job_id}/frfs/data", response_class=FileResponse, responses=FILES)  # type: ignore[arg-type]
def get_predicted_frfs(
    job_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    request: Request,
    cut: CutDep,
    form: Annotated[str, form_of(MEDIA_TYPES, "as of measured FRFs; default: by Accept")],
    model: Annotated[
        Model, Query(description="with the updated parameters, or with the initial ones")
    ] = "updated",
    point: Annotated[Whole, Query(description="response point")] = None,
    direction: Annotated[
        int | None, Query(ge=-6, le=6, description="signed response direction")
    ] = None,
    reference: Annotated[Whole, Query(description="reference point")] = None,
) -> Response:
    """FRFs that the model predicts where FRFs were measured, in the formats, coordinates and order
    of the measured ones.

    `id` and `label` are those of the measured FRF. Values are in single precision.
    """
    job, written = update_job_for(session, user, job_id), WRITERS[form]
    table = predicted_table(session, job, model, FrfQuery(point, direction, reference), cut)
    # A result never changes: the query says which part of it this is, and only UFF holds grid
    # points, which may.
    headers = {"Vary": "Accept"}
    if written.one_table:
        headers["ETag"] = f'"{job.id}-{form}-{sha256(request.url.query.encode()).hexdigest()[:16]}"'
        if (unchanged := not_modified(request, headers)) is not None:
            return unchanged
    name = f"predicted.{written.suffix}"
    return spooled(lambda file: write_frfs([table], file, form), written.media_type, name, headers)


@router.get("/update-jobs/{job_id}/cards", response_class=PlainTextResponse)
def get_cards(
    job_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    program: Annotated[Program, Query(alias="format", description="whose cards")] = "calculix",
    element: Annotated[
        Element | None,
        Query(description="by default `solid` for CalculiX, `shell` for Abaqus and Nastran"),
    ] = None,
) -> PlainTextResponse:
    """The updated model as a deck: what CalculiX, Abaqus or Nastran runs, mesh, material, thickness,
    damping, supports.
    """
    text = written_deck(session, update_job_for(session, user, job_id), program, element)
    name = f"update-{job_id}.{SUFFIXES[program]}"
    return PlainTextResponse(
        text, headers={"Content-Disposition": f'attachment; filename="{name}"'}
    )


@router.get("/update-jobs/{job_id}/deck", response_class=FileResponse)
def get_deck(job_id: UUID, session: SessionDep, user: CurrentUser) -> Response:
    """The deck that was sent as the structure's model, with the updated numbers and a comment at
    each; all else stays.

    Its head says how far each mode of a solver's own model is expected to be off, as that has no
    model of the joints of walls.
    """
    order = deck_order(session, update_job_for(session, user, job_id))
    content = from_thread.run(_updated, order)
    return spooled(
        lambda file: _write(file, content),
        "application/octet-stream",
        f"updated-{order.filename}",
        {},
    )


def _write(file: IO[bytes], content: bytes) -> None:
    file.write(content)


@router.get("/update-jobs/{job_id}/figures")
def list_figures(job_id: UUID, session: SessionDep, user: CurrentUser) -> FiguresOut:
    """Names of the figures, and which of them this result can be drawn as."""
    data = UpdateFigures(session, update_job_for(session, user, job_id))
    return FiguresOut(items=_described(data, FIGURES, "update-jobs"))


@router.get("/update-jobs/{job_id}/figures/{name}", response_class=Response, responses=RESPONSES)
def get_figure(
    job_id: UUID,
    name: Annotated[
        str, Path(max_length=60, description=f"one of {', '.join(FIGURES)}", examples=["frf"])
    ],
    session: SessionDep,
    user: CurrentUser,
    request: FigureRequestDep,
    point: Annotated[
        Whole, Query(description="`frf`: grid point whose FRF is drawn; default: the first one")
    ] = None,
    reference: Annotated[
        Whole, Query(description="`frf`: the other point, where one alone does not say which")
    ] = None,
    fmin: Annotated[Hertz, Query(description=f"{_heeding('fmin')}: lines from here, Hz")] = None,
    fmax: Annotated[Hertz, Query(description=f"{_heeding('fmax')}: lines up to here, Hz")] = None,
    measured: Annotated[
        Mode,
        Query(description="`shapes`: number of a measured mode, as rows of the MAC count them"),
    ] = None,
    model: Annotated[
        Mode,
        Query(description="`shapes`: number of a mode of the updated model, as its columns do"),
    ] = None,
) -> Response:
    """A figure of the result: Plotly JSON, or the same figure as SVG, PNG or PDF.

    Where the result has nothing to draw, such as the FRFs of a job whose damping failed, the answer
    is 409 and says why.
    """
    require_order(fmin, fmax)
    job = update_job_for(session, user, job_id)
    data = UpdateFigures(session, job)
    require_figure(name, *FIGURES)
    request.require_used(name, FIGURES[name].query, _OF_FIGURES)
    query = FigureQuery(point, reference, fmin, fmax, measured, model)
    # a result never changes
    return request.answer(lambda: draw_figure(FIGURES, data, name, query), name, str(job.id))


@router.get("/update-jobs/{job_id}/mesh", response_model=ResultMeshOut, responses=MESH_FILES)
def get_result_mesh(
    job_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    request: Request,
    form: MeshForm,
    at: Annotated[
        At,
        Query(
            description=(
                "of a file: shapes at the mesh's nodes, measured ones expanded; or at the measured"
                " points"
            )
        ),
    ] = "nodes",
) -> Any:
    """The mesh of the updated model, the measured points on it, and the modes whose shapes
    `mesh/shapes` answers.

    As VTU or UFF (sets 2411, 2412, 55) it has all shapes too, each with its largest displacement 1,
    in the structure's frame.
    """
    data = UpdateFigures(session, update_job_for(session, user, job_id))
    return answer_mesh(data, request, form, at, f"update-{job_id}")


@router.get("/update-jobs/{job_id}/mesh/shapes")
def get_result_shape(
    job_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    measured: Annotated[
        Mode, Query(description="number of a measured mode, which is expanded over the mesh")
    ] = None,
    model: Annotated[Mode, Query(description="number of a mode of the updated model")] = None,
) -> ShapeOut:
    """A shape on the mesh, in space: of a measured mode or of one of the model; name one of
    them.
    """
    data = UpdateFigures(session, update_job_for(session, user, job_id))
    if measured is not None and model is None:
        return measured_shape(data, measured)
    if model is not None and measured is None:
        return model_shape(data, model)
    raise Invalid("measured", "or model must be named, one of them")


@router.get("/joint-updates/{joint_id}/figures")
def list_joint_figures(joint_id: UUID, session: SessionDep, user: CurrentUser) -> FiguresOut:
    """Names of the figures of a joint update, and which of them its result can be drawn as."""
    data = UpdateFigures(session, joint_update_for(session, user, joint_id))
    return FiguresOut(items=_described(data, FIGURES_OF_SEVERAL, "joint-updates"))


@router.get(
    "/joint-updates/{joint_id}/figures/{name}", response_class=Response, responses=RESPONSES
)
def get_joint_figure(
    joint_id: UUID,
    name: Annotated[
        str,
        Path(max_length=60, description=f"one of {', '.join(FIGURES_OF_SEVERAL)}"),
    ],
    session: SessionDep,
    user: CurrentUser,
    request: FigureRequestDep,
) -> Response:
    """A figure of a joint update.

    `campaigns` shows what each campaign says alone of each constant, beside all of them together:
    where they contradict.
    """
    data = UpdateFigures(session, joint_update_for(session, user, joint_id))
    require_figure(name, *FIGURES_OF_SEVERAL)
    # a result never changes
    return request.answer(
        lambda: draw_figure(FIGURES_OF_SEVERAL, data, name), name, str(data.job.id)
    )


def _described(
    data: UpdateFigures, figures: Mapping[str, NamedFigure], kind: str
) -> list[FigureOut]:
    """Every figure of a result, and why one of them has nothing to draw."""
    return [
        FigureOut(
            name=name,
            title=figure.title,
            href=f"/api/v1/{kind}/{data.job.id}/figures/{name}",
            available=(reason := figure.lacks(data)) is None,
            reason=reason,
            query=list(figure.query),
        )
        for name, figure in figures.items()
    ]
