"""What a test was performed in: each condition is stated here once, and any other number that a
campaign states by a name of its own is read by the same function (`stated`).

Requests and answers, the table, search, pages, reports, commands, and the covariates of monitors
and trends take what they need of `CLIMATE`. A new condition is a member of `Climate` and a migration.
"""

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, Field, model_validator

from service.platform.web.bodies import wrong
from service.platform.web.quantities import UNITS


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

_COVARIATE_UNITS = {
    **ENDINGS,
    **UNITS,
    "_m_s2": "m/s²",
    "_W_m2": "W/m²",
    "_N": "N",
    "_W": "W",
    "_V": "V",
    "_A": "A",
    "_ratio": "1",
}
"""Unit of a covariate by the end of its name."""

MOST_COVARIATES = 50
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,59}")


def unit_of_covariate(name: str) -> str | None:
    """Unit of a covariate, by the longest end of its name that is one of a unit; None where there
    is none.

    >>> unit_of_covariate("wind_m_s"), unit_of_covariate("wind")
    ('m/s', None)
    """
    ends = [end for end in _COVARIATE_UNITS if name.endswith(end) and name != end]
    return _COVARIATE_UNITS[max(ends, key=len)] if ends else None


def covariate(name: str) -> str:
    """The name, if it is one that a covariate may have.

    Raises:
        PydanticCustomError: it is not a word, or ends with no unit.
    """
    if not _NAME.fullmatch(name):
        raise wrong(f"{name[:60]!r} is no name: a letter, then letters, digits and _, at most 60")
    if unit_of_covariate(name) is None:
        raise wrong(
            f"{name} does not end with its unit, as wind_m_s does: one of"
            f" {' '.join(_COVARIATE_UNITS)}"
        )
    return name


def _each_named(covariates: dict[str, float]) -> dict[str, float]:
    for name in covariates:
        covariate(name)
    return covariates


Values = Annotated[
    dict[str, Annotated[float, Field(ge=-1e12, le=1e12, allow_inf_nan=False)]],
    AfterValidator(_each_named),
]
_MEANING = (
    "other numbers that were measured in the test, by names that end with their SI unit or"
    " `_c`, `_percent`, such as `wind_m_s`; monitors take out those that they name"
)


class Covariates(BaseModel):
    """Numbers that a campaign states beside its climate."""

    covariates: Values = Field(
        default_factory=dict,
        max_length=MOST_COVARIATES,
        description=_MEANING,
        examples=[{"wind_m_s": 4.2, "temperature_deck_c": 11.0}],
    )

    @model_validator(mode="before")
    @classmethod
    def _climate_among_them(cls, data: Any) -> Any:
        return climate_apart(data)


def climate_apart(data: Any) -> Any:
    """A body in which conditions that stand among the covariates are members, as they are stored.

    Raises:
        PydanticCustomError: one is stated in both places, differently.
    """
    if not isinstance(data, dict) or not isinstance(data.get("covariates"), dict):
        return data
    among = {name: data["covariates"][name] for name in CLIMATE if name in data["covariates"]}
    for name, value in among.items():
        if data.get(name, value) != value:
            raise wrong(f"{name} is stated twice, as {data[name]!r} and among the covariates")
    rest = {name: value for name, value in data["covariates"].items() if name not in among}
    return {**data, **among, "covariates": rest}


def stated(row: Any) -> dict[str, float]:
    """The conditions and covariates that a campaign states, by name."""
    values = {name: getattr(row, name) for name in CLIMATE}
    there = {name: float(value) for name, value in values.items() if value is not None}
    return {**there, **row.covariates}


def shown_after(name: str) -> str:
    """What follows the value of a condition or covariate in a line of text."""
    if name in CLIMATE:
        return CLIMATE[name].shown
    unit, words = unit_of_covariate(name) or "1", label_of_covariate(name)
    return f"({words})" if unit == "1" else f"{unit} ({words})"


_SPELLED = {"degc": "°c", "degcelsius": "°c", "celsius": "°c", "c": "°c", "℃": "°c", "percent": "%"}


def is_unit_of(name: str, text: str) -> bool:
    """Whether the text of a unit means that of a condition or covariate.

    >>> is_unit_of("temperature_deck_c", "deg C"), is_unit_of("wind_m_s", "km/h")
    (True, False)
    """
    own = (CLIMATE[name].unit if name in CLIMATE else unit_of_covariate(name)) or ""
    bare = "".join(text.lower().split()).replace("^", "").replace("²", "2")
    return _SPELLED.get(bare, bare) == own.lower().replace("²", "2")


def label_of_covariate(name: str) -> str:
    """A covariate in words, without its unit."""
    end = max((e for e in _COVARIATE_UNITS if name.endswith(e)), key=len, default="")
    return name.removesuffix(end).replace("_", " ")


def stiffness_sds(given: Collection[str]) -> dict[str, float]:
    """Standard deviations of a relative change of all stiffness over a season, by the conditions
    that are not given.
    """
    changing = {name: one.stiffness_sd for name, one in CLIMATE.items() if one.stiffness_sd}
    return {name: sd for name, sd in changing.items() if name not in given}
