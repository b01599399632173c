"""Route of an updated model's deck."""

from __future__ import annotations

from typing import Annotated
from uuid import UUID

from fastapi import Query
from fastapi.responses import PlainTextResponse

from service.access import CurrentUser, SessionDep
from service.show.results.cards import SUFFIXES, Element, Program, written_deck
from service.store.updating.operations import update_job_for
from service.web import api_router

router = api_router(tags=["update jobs"])


@router.get("/update-jobs/{job_id}/cards", response_class=PlainTextResponse)
def get_cards(
    job_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    program: Annotated[Program, Query(alias="format", description="whose cards")] = "calculix",
    element: Annotated[
        Element | None, Query(description="by default `solid` for CalculiX, `shell` for Abaqus and Nastran")
    ] = None,
) -> PlainTextResponse:
    """The updated model as a deck that CalculiX, Abaqus or Nastran runs: mesh, material, thickness, damping, supports."""
    text = written_deck(session, update_job_for(session, user, job_id), program, element)
    name = f"update-{job_id}.{SUFFIXES[program]}"
    return PlainTextResponse(text, headers={"Content-Disposition": f'attachment; filename="{name}"'})
