"""Routes of an update's figures."""

from __future__ import annotations

from typing import Annotated, Any, Literal
from uuid import UUID

from fastapi import Path, Query, Response

from service.access import CurrentUser, SessionDep
from service.errors import Conflict, Invalid
from service.show.figures.answers import RESPONSES, Asked, FigureOut, FiguresOut, require_figure
from service.show.reports.as_html import POLICY, as_html
from service.show.reports.as_pdf import as_pdf
from service.show.results.figure_data import UpdateFigures
from service.show.results.figure_frf import Wanted
from service.show.results.figures import FIGURES, draw_figure
from service.show.results.reporting import report_of
from service.store.updating.operations import update_job_for
from service.web import api_router

router = api_router(tags=["update jobs"])

REPORTS: dict[int | str, dict[str, Any]] = {
    200: {"description": "The report.", "content": {"text/html": {}, "application/pdf": {}}}
}

Hertz = Annotated[float | None, Query(ge=0, le=1e12, allow_inf_nan=False)]
Mode = Annotated[int | None, Query(ge=1, le=10_000)]
Point = Annotated[int | None, Query(ge=0, le=9_999_999_999)]


@router.get("/update-jobs/{job_id}/figures")
def list_figures(job_id: UUID, session: SessionDep, user: CurrentUser) -> FiguresOut:
    """Names of the figures, and which of them this result can be drawn as."""
    data = UpdateFigures(session, update_job_for(session, user, job_id))
    return FiguresOut(items=[_described(data, name) for name in FIGURES])


@router.get("/update-jobs/{job_id}/figures/{name}", response_class=Response, responses=RESPONSES)
def get_figure(
    job_id: UUID,
    name: Annotated[str, Path(max_length=60, description=f"one of {', '.join(FIGURES)}", examples=["frf"])],
    session: SessionDep,
    user: CurrentUser,
    asked: Asked,
    point: Annotated[Point, Query(description="`frf`: grid point whose FRF is drawn; default: the first one")] = None,
    reference: Annotated[Point, Query(description="`frf`: the other point, where one alone does not say which")] = None,
    fmin: Annotated[Hertz, Query(description="`frf`, `csac`, `csf`: lines from here, Hz")] = None,
    fmax: Annotated[Hertz, Query(description="`frf`, `csac`, `csf`: lines up to here, Hz")] = None,
    measured: Annotated[
        Mode, Query(description="`shapes`: number of a measured mode, as rows of the MAC count them")
    ] = None,
    model: Annotated[
        Mode, Query(description="`shapes`: number of a mode of the updated model, as its columns do")
    ] = None,
) -> Response:
    """A figure of the result: Plotly JSON, or the same figure as SVG, PNG or PDF.

    Where the result has nothing to draw, such as the FRFs of a job whose damping failed, the answer is 409 and says why.
    """
    if fmin is not None and fmax is not None and fmin > fmax:
        raise Invalid("fmin", f"is {fmin:g} Hz and above fmax, {fmax:g} Hz")
    job = update_job_for(session, user, job_id)
    data = UpdateFigures(session, job)
    require_figure(name, *FIGURES)
    wanted = Wanted(point, reference, fmin, fmax, measured, model)
    return asked.answer(lambda: draw_figure(data, name, wanted), name, str(job.id))  # a result never changes


@router.get("/update-jobs/{job_id}/report", response_class=Response, responses=REPORTS)
def get_report(
    job_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    file_format: Annotated[
        Literal["html", "pdf"], Query(alias="format", description="a page that stands alone, or A4 for print")
    ] = "html",
) -> Response:
    """The report of a result: two pages for who ordered the test, the rest as annex for who checks it."""
    report = report_of(session, user, update_job_for(session, user, job_id))
    write, kind = (as_html, "text/html; charset=utf-8") if file_format == "html" else (as_pdf, "application/pdf")
    described = {"Content-Disposition": f'inline; filename="report-{job_id}.{file_format}"'}
    if file_format == "html":  # it stands alone: no script, styles and pictures within
        described["Content-Security-Policy"] = POLICY
    return Response(write(report), media_type=kind, headers=described)


def _described(data: UpdateFigures, name: str) -> FigureOut:
    figure, reason = FIGURES[name], None
    try:
        figure.check(data)
    except Conflict as error:
        reason = str(error)
    return FigureOut(
        name=name,
        title=figure.title,
        href=f"/api/v1/update-jobs/{data.job.id}/figures/{name}",
        available=reason is None,
        reason=reason,
        query=list(figure.query),
    )
