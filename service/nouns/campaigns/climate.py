"""What a test was performed in: each condition is stated here once.

Requests and answers, the table, search, pages, reports, commands, and the covariates of monitors
and trends take what they need of `CLIMATE`. A new condition is a member of `Climate` and a migration.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Annotated

from pydantic import BaseModel, Field


@dataclass(frozen=True)
class Condition:
    """A number that a campaign may state.

    Attributes:
        label: on pages, without the unit.
        unit: of the number.
        meaning: what it is, in words.
        shown: what follows the number in a line of text: the unit, with a word where it alone is
            unclear.
        stiffness_sd: standard deviation of a relative change of all stiffness over a season by it,
            where a monitor is not given it; 0 where it changes none.
    """

    label: str
    unit: str
    meaning: str
    shown: str
    stiffness_sd: float = 0.0


class Climate(BaseModel):
    """The conditions of a campaign; None where nobody knows."""

    # 0.1 % of the stiffness for each kelvin of 20
    temperature_c: Annotated[
        float | None, Condition("Temperature", "°C", "air temperature", "°C", 0.02)
    ] = Field(None, gt=-273.15, le=1000, description="air temperature, °C; null where nobody knows")
    # 2.5 % for each per cent of water, of which a laminate indoors takes up 0.2 %
    humidity_percent: Annotated[
        float | None, Condition("Humidity", "%", "relative humidity", "% humidity", 0.005)
    ] = Field(None, ge=0, le=100, description="relative humidity, %; null where nobody knows")


CLIMATE: Mapping[str, Condition] = {
    name: next(each for each in member.metadata if isinstance(each, Condition))
    for name, member in Climate.model_fields.items()
}
"""The conditions by the names that REST, recipes of monitors and stored rows have."""

ENDINGS: Mapping[str, str] = {
    name.removeprefix(each.label.lower().replace(" ", "_")): each.unit
    for name, each in CLIMATE.items()
}
"""Their units by what stands behind the label in a name: `_c`, `_percent`."""


def stated(row: object) -> dict[str, float]:
    """The conditions that a campaign states, by name."""
    values = {name: getattr(row, name) for name in CLIMATE}
    return {name: float(value) for name, value in values.items() if value is not None}


def stiffness_sds(given: Collection[str]) -> dict[str, float]:
    """Standard deviations of a relative change of all stiffness over a season, by the conditions
    that are not given.
    """
    changing = {name: one.stiffness_sd for name, one in CLIMATE.items() if one.stiffness_sd}
    return {name: sd for name, sd in changing.items() if name not in given}
