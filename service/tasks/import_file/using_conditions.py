"""What a recording states of its campaign goes into the campaign, where that says nothing of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic_core import PydanticCustomError
from sqlalchemy.orm import Session

from service.nouns.campaigns.climate import (
    CLIMATE,
    MOST_COVARIATES,
    covariate,
    is_unit_of,
    stated,
    unit_of_covariate,
)
from service.nouns.campaigns.operations import campaign_of, take_conditions
from service.platform.errors import Fault, Invalid

if TYPE_CHECKING:
    from service.nouns.imports.operations import Import
    from service.tasks.import_file.conditions import Conditions, Covariate

_PLACE = "/mapping/recording/covariates"


def use_conditions(session: Session, row: Import, own: Conditions) -> list[str]:
    """Add covariates and the time of a recording to its campaign; of a dry run only what is noted.

    Returns:
        What was measured, and what is not used as the campaign states another value.

    Raises:
        Invalid: a covariate's name has no unit, or the file states another one of its channel.
    """
    faults = [Fault(f"{_PLACE}/{name}", why) for name, why in _faults(own.covariates)]
    campaign = campaign_of(session, row.campaign_id)
    before = stated(campaign)
    if len(campaign.covariates.keys() | own.covariates.keys()) > MOST_COVARIATES:
        faults.append(Fault(_PLACE, f"would be more than {MOST_COVARIATES} of the campaign"))
    if faults:
        raise Invalid(faults)
    began, date = own.performed_at, campaign.performed_at
    if not row.dry_run:
        values = {name: each.mean for name, each in own.covariates.items()}
        take_conditions(session, row.campaign_id, values, began)
    notes = [_note(name, each, before.get(name)) for name, each in own.covariates.items()]
    if began is not None and date is not None and began != date:
        both = f"{began.isoformat()}, and the campaign was performed at {date.isoformat()}"
        notes.append(f"the file begins at {both}: that stays")
    return notes


def _faults(covariates: dict[str, Covariate]) -> list[tuple[str, str]]:
    faults = []
    for name, own in covariates.items():
        try:
            covariate(name)
        except PydanticCustomError as error:
            faults.append((name, error.message()))
            continue
        if own.unit and not is_unit_of(name, own.unit):
            unit = CLIMATE[name].unit if name in CLIMATE else unit_of_covariate(name)
            why = f"is in {unit}, and the file says that {own.variable} is in {own.unit}"
            faults.append((name, f"{why}: state sensitivity, and offset where zeros differ"))
    return faults


def _note(name: str, own: Covariate, before: float | None) -> str:
    lost = f", of which {own.left_out} are no numbers" if own.left_out else ""
    mean = f"{own.mean:.6g}, the mean of {own.samples} samples of {own.variable}{lost}"
    if before is None or before == own.mean:
        return f"{name} is {mean}"
    return f"{name} is {before:.6g} as the campaign states it, and not {mean}"
