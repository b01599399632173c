"""Routes of a joint update's figures."""

from __future__ import annotations

from uuid import UUID

from fastapi import Response

from service.access import CurrentUser, SessionDep
from service.show.figures.answers import RESPONSES, Asked, FigureName, FigureOut, FiguresOut, require_figure
from service.show.results.joint_figures import JOINT_FIGURES, draw_joint_figure
from service.store.updating.joint_operations import joint_document, joint_update_for
from service.web import api_router

router = api_router(tags=["update jobs"])


@router.get("/joint-updates/{joint_id}/figures")
def list_joint_figures(joint_id: UUID, session: SessionDep, user: CurrentUser) -> FiguresOut:
    """Names of the figures of a joint update, and which of them its result can be drawn as."""
    document = joint_document(session, joint_update_for(session, user, joint_id))
    items = [
        FigureOut(
            name=name,
            title=figure.title,
            href=f"/api/v1/joint-updates/{joint_id}/figures/{name}",
            available=figure.lacks(document) is None,
            reason=figure.lacks(document),
            query=[],
        )
        for name, figure in JOINT_FIGURES.items()
    ]
    return FiguresOut(items=items)


@router.get("/joint-updates/{joint_id}/figures/{name}", response_class=Response, responses=RESPONSES)
def get_joint_figure(
    joint_id: UUID,
    name: FigureName,
    session: SessionDep,
    user: CurrentUser,
    asked: Asked,
) -> Response:
    """A figure of a joint update: `parameters`, `campaigns`, `frequencies`, `budget` or `posterior`.

    `campaigns` shows what each campaign says alone of each constant, beside all of them together: where they contradict.
    """
    row = joint_update_for(session, user, joint_id)
    require_figure(name, *JOINT_FIGURES)
    document = joint_document(session, row)
    return asked.answer(lambda: draw_joint_figure(document, name), name, str(row.id))  # a result never changes
