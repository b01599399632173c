"""Routes of figures: hits of a point, a coupon's curve, a series; of a
search a trend and its results.

Those of results are in `service.reports`.
"""

from typing import Annotated
from uuid import UUID

from fastapi import Query, Response

from service.figures.answers import RESPONSES, FigureName, FigureRequestDep, require_figure
from service.figures.coupon import coupon_figure
from service.figures.frfs import hits_figure
from service.figures.marks import Figure
from service.figures.measured import (
    HitQuery,
    likeness_figure,
    measured_frf_figure,
    measured_shapes_figure,
    point_blocks,
    point_shown,
)
from service.figures.responses import spectra_figure, spectra_shown
from service.figures.tracks import FREQUENCY, covariate_figure, tracks_figure
from service.figures.trend import MOST_RESULTS, results_figure, series_figure, trend_figure
from service.nouns.campaigns.operations import campaign_for
from service.nouns.coupons.curves import curve_of, series_of
from service.nouns.coupons.operations import coupon_for
from service.nouns.frfs.data import Cut
from service.nouns.frfs.routes import FrfFilter, Hertz
from service.nouns.modes.operations import mode_set_for
from service.nouns.monitors.operations import series_for
from service.nouns.monitors.parameters import From, To, Version, part_of
from service.nouns.monitors.presentation import series_document, stated_covariates
from service.nouns.monitors.runs import monitor_for
from service.nouns.records.routes import Whole
from service.nouns.search.nouns import NOUNS
from service.nouns.search.operations import Search, SearchQuery, bounded
from service.nouns.search.routes import ModeTrend, OrderedDep, ResultTrend
from service.nouns.updates.result_schemas import CONSTANTS
from service.platform.access import CurrentUser, SessionDep, api_router
from service.platform.db.base import at_one_moment
from service.platform.errors import Invalid

Seconds = Annotated[float | None, Query(ge=0, le=1e9, allow_inf_nan=False)]

router = api_router(tags=[])  # each figure stands beside what it shows

_CAMPAIGN_FIGURES = {
    "frf": ("point", "direction", "reference", "fmin", "fmax"),
    "hits": ("point", "direction", "response", "fmin", "fmax", "tmin", "tmax"),
    "spectra": ("fmin", "fmax"),
}
_MODE_SET_FIGURES = {"mac": ("mode_set",), "shapes": ()}
"""Figures by name, with the parameters of the query that each uses."""


@router.get(
    "/campaigns/{campaign_id}/figures/{name}",
    response_class=Response,
    responses=RESPONSES,
    tags=["records"],
)
def get_campaign_figure(
    campaign_id: UUID,
    name: FigureName,
    session: SessionDep,
    user: CurrentUser,
    request: FigureRequestDep,
    point: Annotated[
        Whole, Query(description="where it was hit, or the response of an FRF; default: the first")
    ] = None,
    direction: Annotated[
        int | None, Query(ge=-6, le=6, description="signed direction there")
    ] = None,
    response: Annotated[
        Whole, Query(description="of `hits`: where the sensor stood; default: the first one")
    ] = None,
    reference: Annotated[Whole, Query(description="of `frf`: reference point")] = None,
    fmin: Annotated[
        Hertz,
        Query(description="lines from here on, Hz; of `hits` those that are drawn one by one"),
    ] = None,
    fmax: Annotated[
        Hertz, Query(description="lines up to here, Hz; of `hits` those that are drawn one by one")
    ] = None,
    tmin: Annotated[
        Seconds, Query(description="of `hits`: samples from here on are drawn one by one, s")
    ] = None,
    tmax: Annotated[
        Seconds, Query(description="of `hits`: samples up to here are drawn one by one, s")
    ] = None,
) -> Response:
    """A figure of a campaign: the first `frf` that matches; the `hits` of a point: good ones alike,
    bad ones with what was found against them; or the singular values of the `spectra` of recordings
    of responses, with the modes of the newest mode set that was found in them.

    Hits are judged as the newest processing judged them; before one, among themselves.
    """
    campaign = campaign_for(session, user, campaign_id)
    require_figure(name, *_CAMPAIGN_FIGURES)
    request.require_used(
        name, _CAMPAIGN_FIGURES[name], {one for used in _CAMPAIGN_FIGURES.values() for one in used}
    )
    if name == "frf":
        (frf,) = FrfFilter(point=point, direction=direction, reference=reference).rows(
            session, campaign.id, 1
        )
        cut, version = Cut(fmin, fmax), f"{frf.id} {frf.coherence_sha256!r}"
        return request.answer(lambda: measured_frf_figure(session, frf, cut), name, version)
    if name == "spectra":
        cut = Cut(fmin, fmax)
        shown = spectra_shown(session, campaign.id)
        return request.answer(lambda: spectra_figure(session, shown, cut), name, shown.version)
    blocks = point_blocks(session, campaign.id, HitQuery(point, direction, response))
    seconds, hertz = (tmin, tmax), (fmin, fmax)
    return request.answer(
        lambda: hits_figure(point_shown(session, blocks), seconds, hertz), name, blocks.version
    )


@router.get(
    "/mode-sets/{mode_set_id}/figures/{name}",
    response_class=Response,
    responses=RESPONSES,
    tags=["mode sets"],
)
def get_mode_set_figure(
    mode_set_id: UUID,
    name: FigureName,
    session: SessionDep,
    user: CurrentUser,
    request: FigureRequestDep,
    mode_set: Annotated[
        UUID | None,
        Query(
            description="of `mac`: another mode set, of this campaign or another; default: itself"
        ),
    ] = None,
) -> Response:
    """A figure of a mode set: its `shapes` at the measured points; or its `mac` with another one,
    where both have shapes.
    """
    first = mode_set_for(session, user, mode_set_id)
    require_figure(name, *_MODE_SET_FIGURES)
    request.require_used(name, _MODE_SET_FIGURES[name], {"mode_set"})
    if name == "shapes":
        return request.answer(lambda: measured_shapes_figure(session, first), name)
    second = first if mode_set is None else mode_set_for(session, user, mode_set)
    return request.answer(lambda: likeness_figure(session, first, second), name)


@router.get(
    "/coupons/{coupon_id}/figures/{name}",
    response_class=Response,
    responses=RESPONSES,
    tags=["coupons"],
)
def get_coupon_figure(
    coupon_id: UUID,
    name: FigureName,
    session: SessionDep,
    user: CurrentUser,
    request: FigureRequestDep,
) -> Response:
    """A figure of a specimen, `curve`: raw curve, chord, bounds, strength; of D3518 the 0.2 %
    offset, of D3039 the transverse strain.
    """
    coupon = coupon_for(session, user, coupon_id)
    require_figure(name, "curve")
    curve = curve_of(session, coupon)

    def draw() -> Figure:
        title, shear = f"{coupon.specimen}, {coupon.standard}", coupon.standard == "D3518"
        return coupon_figure(title, series_of(curve), curve.reduction, shear=shear)

    return request.answer(draw, name, curve.sha256.hex())


@router.get(
    "/monitors/{monitor_id}/series/figure",
    response_class=Response,
    responses=RESPONSES,
    tags=["monitoring"],
)
def get_series_figure(
    monitor_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    request: FigureRequestDep,
    parameter: Annotated[
        str | None,
        Query(
            max_length=60,
            description=(
                "default: the first one that is watched; `frequency` of a monitor of modes: all"
                " of its tracks"
            ),
        ),
    ] = None,
    over: Annotated[
        str | None,
        Query(max_length=60, description="a covariate: before and after it was taken out"),
    ] = None,
    series: Version = None,
    begin: From = None,
    end: To = None,
) -> Response:
    """The series of a parameter as a figure, over time or over a covariate: Plotly JSON for the
    browser and notebooks, or SVG, PNG, PDF for print. Of many campaigns the lowest and the highest
    value of each of 400 pieces; `from` and `to` look closer.
    """
    at_one_moment(session)
    monitor = monitor_for(session, user, monitor_id)
    version = series_for(session, monitor, series)
    watched = list(monitor.watch["directions"])
    if monitor.watches == "modes":
        judged = version.document or {"parameters": ()}
        watched += [row["name"] for row in judged["parameters"]]
    chosen = parameter or watched[0]
    if chosen not in watched:
        raise Invalid("parameter", f"{chosen!r} is not watched; {', '.join(watched)} are")
    single = None if monitor.watches == "modes" and chosen == FREQUENCY else chosen
    document = series_document(session, monitor, version, part_of(begin, end), single)
    if over is not None:
        if over not in (stated := stated_covariates(document)):
            known = ", ".join(sorted(stated)) or "none"
            raise Invalid("over", f"{over!r} is stated by none of these campaigns; {known} are")
        return request.answer(lambda: covariate_figure(document, chosen, over), chosen)
    if monitor.watches == "modes" and chosen == FREQUENCY:
        return request.answer(lambda: tracks_figure(document), chosen)
    return request.answer(lambda: series_figure(document, chosen), chosen)


@router.get(
    "/search/results/trend/figure", response_class=Response, responses=RESPONSES, tags=["search"]
)
def get_result_trend_figure(trend: ResultTrend, request: FigureRequestDep) -> Response:
    """A constant of the results that a search finds over time, corrected and as it is, and over
    temperature, with intervals.
    """
    return request.answer(lambda: trend_figure(trend.model_dump(mode="json")), "trend")


@router.get(
    "/search/modes/trend/figure", response_class=Response, responses=RESPONSES, tags=["search"]
)
def get_mode_trend_figure(trend: ModeTrend, request: FigureRequestDep) -> Response:
    """A drawing of modes that a search finds: frequency or damping over time and temperature, each
    mode in a colour of its own.
    """
    return request.answer(lambda: trend_figure(trend.model_dump(mode="json")), "trend")


@router.get("/search/results/figure", response_class=Response, responses=RESPONSES, tags=["search"])
def get_results_figure(
    query: OrderedDep, session: SessionDep, user: CurrentUser, request: FigureRequestDep
) -> Response:
    """The results that a search finds beside one another: a row each, at most 60, a panel a
    constant, with 95 % intervals.
    """
    fields = (
        "structure.name",
        "campaign.name",
        *(f"{name}{end}" for name in CONSTANTS for end in ("", "_low", "_high")),
    )
    with bounded(session):
        search = Search(
            user, NOUNS["result"], SearchQuery(query.filter, query.words, query.sort, fields)
        )
        values, more = search.page(session, None, MOST_RESULTS)
    if more is not None:
        raise Invalid(
            "filter",
            f"finds more than {MOST_RESULTS} results, which is as many as a figure has; narrow it",
        )
    rows = [dict(zip(fields, row, strict=True)) for row in values]
    return request.answer(lambda: results_figure(rows, CONSTANTS), "results")
