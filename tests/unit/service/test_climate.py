"""Each condition of a campaign is whole: everything that iterates over the table finds what it needs."""

import pytest
from pydantic import TypeAdapter

from service.nouns.campaigns.climate import CLIMATE, Climate, Condition
from service.nouns.campaigns.operations import Campaign
from service.nouns.campaigns.schemas import CampaignIn, CampaignOut, CampaignPatch
from service.nouns.monitors.schemas import Covariate
from service.nouns.search.nouns import NOUNS
from service.nouns.search.trends import TrendPoint
from service.pages.numbers import UNITS_OF_MEMBERS
from service.pages.quantities import SENT
from service.platform.web import typed

each = pytest.mark.parametrize("name", CLIMATE)


@each
def test_a_condition_says_what_it_is(name: str) -> None:
    condition: Condition = CLIMATE[name]
    assert condition.label
    assert condition.unit
    assert condition.meaning
    assert condition.shown
    described = Climate.model_fields[name].description or ""
    assert described.startswith(f"{condition.meaning}, {condition.unit}")
    limits = {type(limit).__name__ for limit in Climate.model_fields[name].metadata}
    assert limits & {"Ge", "Gt"}, "a smallest number is needed, so that a wrong unit is refused"
    assert limits & {"Le", "Lt"}, "a largest number is needed"


@each
def test_a_page_shows_and_takes_a_condition_in_its_own_unit(name: str) -> None:
    """Whatever the name ends with: `wind_m_s` are no seconds."""
    unit = CLIMATE[name].unit
    assert next(of for end, of in SENT.items() if name.endswith(end)) == unit
    assert next(of for end, of in UNITS_OF_MEMBERS.items() if name.endswith(end)) == unit
    assert typed.are_alike(unit, unit)


@each
def test_a_condition_is_stored_searched_and_followed(name: str) -> None:
    assert name in Campaign.__table__.c
    assert all(name in each.model_fields for each in (CampaignIn, CampaignOut, CampaignPatch))
    assert name in TrendPoint.model_fields
    assert name in {field.name for field in NOUNS["campaign"].fields}
    assert TypeAdapter(Covariate).validate_python(name) == name
