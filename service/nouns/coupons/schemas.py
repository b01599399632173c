"""What a client sends and gets about coupon batches, coupons and their raw curves. Moduli and
strengths in Pa.
"""

from collections.abc import Iterator
from datetime import datetime
from typing import Annotated, Any, Literal, Self
from uuid import UUID

from pydantic import AfterValidator, BeforeValidator, Field, field_validator, model_validator

from fecore.coupons.batch import check_failure_code
from fecore.coupons.curves import Ends
from fecore.errors import InputError
from fecore.quantities import Quantity
from modalbase.formats.machine_csv import factor
from modalbase.formats.tables.layout import Encoding
from service.platform.web import Name, RequestModel, StrictModel, Text, example, wrong
from service.platform.web.quantities import (
    COUPON_SIZE,
    MODULUS,
    MODULUS_SD,
    STRAIN,
    Modulus,
    Strength,
)

Constant = Literal["Ex", "Ey", "Gxy", "nu_xy"]
Standard = Literal["D3039", "D3518"]


def _failure_code(code: str) -> str:
    try:
        return check_failure_code(code)
    except InputError as error:
        raise wrong(error.message) from None


FailureCode = Annotated[
    Text,
    Field(max_length=20, description="three parts: type, area, location"),
    AfterValidator(_failure_code),
]


class _Excludable(StrictModel):
    excluded: bool = False
    exclusion_reason: str | None = Field(None, min_length=1, max_length=1000)

    @model_validator(mode="after")
    def _with_a_reason(self) -> Self:
        if self.excluded != (self.exclusion_reason is not None):
            raise wrong(
                "a specimen is excluded with a reason, and a reason excludes: state both or neither"
            )
        return self


class PublishedMean(RequestModel):
    """A mean that is known without its specimens, from a paper or a data sheet."""

    mean: float = Field(description="Pa; a Poisson's ratio has no unit")
    standard_deviation: float | None = Field(
        None, gt=0, description="between specimens, in the mean's unit"
    )
    n: int | None = Field(None, ge=1, le=1_000_000, description="how many specimens it stands for")


class BatchIn(RequestModel):
    """A batch: which constants of the structure it gives, and a published mean of each that has no
    specimens here.
    """

    model_config = example(name="0°, D3039", constants=["Ex"])

    name: Name
    constants: list[Constant] = Field(
        min_length=1, max_length=4, description="elastic constants that the batch gives"
    )
    sets: list[Name] = Field(
        default_factory=list,
        max_length=200,
        description=(
            "of a body in space: its sets that are made of this material; default: all that are of"
            " one material"
        ),
    )
    published: dict[Constant, PublishedMean] = Field(default_factory=dict)
    conditions: dict[Text, Text] = Field(
        default_factory=dict,
        max_length=50,
        description="conditioning, speed, machine, gauge, grips, in words",
    )

    @field_validator("constants")
    @classmethod
    def _each_once(cls, constants: list[Constant]) -> list[Constant]:
        if len(set(constants)) != len(constants):
            raise wrong("a constant is named twice")
        return constants

    @model_validator(mode="after")
    def _published_is_given(self) -> Self:
        for name, value in self.published.items():
            if name not in self.constants:
                raise wrong(f"published has {name}, which constants does not name")
            if name != "nu_xy" and value.mean <= 0:
                raise wrong(f"the published mean of {name} must be positive")
        return self

    def measured(self) -> Iterator[tuple[str, float, Quantity]]:
        """The published moduli and their spreads."""
        for name, value in self.published.items():
            if name != "nu_xy":
                yield f"published/{name}/mean", value.mean, MODULUS
                yield (
                    f"published/{name}/standard_deviation",
                    value.standard_deviation or 0.0,
                    MODULUS_SD,
                )


class BatchOut(StrictModel):
    """A coupon batch."""

    id: UUID
    structure_id: UUID
    name: str
    constants: list[Constant]
    sets: list[str] = Field(
        description=(
            "of a body in space, that are made of the material; none: all that are of one material"
        )
    )
    published: dict[Constant, PublishedMean]
    conditions: dict[Text, Text]
    coupons: int = Field(description="how many specimens are recorded, excluded ones included")
    created_at: datetime


class CouponIn(_Excludable, RequestModel):
    """Results of one specimen."""

    model_config = example(specimen="A1", E_Pa=33.1e9, nu=0.16, failure_code="AGM")

    specimen: Name
    standard: Standard = "D3039"
    E_Pa: Modulus | None = Field(None, description="tensile chord modulus along the specimen")
    G_Pa: Modulus | None = Field(None, description="in-plane shear chord modulus (D3518)")
    nu: float | None = Field(None, gt=-10, lt=10, description="Poisson's ratio")
    strength_Pa: Strength | None = None
    ultimate_strain: Annotated[float, STRAIN] | None = Field(None, gt=0, lt=10, description="m/m")
    failure_code: FailureCode | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.standard == "D3518" and (self.E_Pa is not None or self.nu is not None):
            raise wrong("D3518 gives a shear modulus G_Pa, not E_Pa or nu")
        if self.standard == "D3039" and self.G_Pa is not None:
            raise wrong("D3039 gives E_Pa and nu; a shear modulus comes from D3518")
        if all(
            value is None
            for value in (self.E_Pa, self.G_Pa, self.nu, self.strength_Pa, self.ultimate_strain)
        ):
            raise wrong("the specimen has no result")
        return self


class ExclusionIn(_Excludable, RequestModel):
    """Whether a recorded specimen counts."""

    model_config = example(excluded=True, exclusion_reason="slipped in the grip")

    excluded: bool


class CouponOut(StrictModel):
    """A recorded specimen."""

    id: UUID
    batch_id: UUID
    specimen: str
    standard: Standard
    E_Pa: float | None
    G_Pa: float | None
    nu: float | None
    strength_Pa: float | None
    ultimate_strain: float | None
    failure_code: str | None
    excluded: bool
    exclusion_reason: str | None
    has_curve: bool = Field(
        description="whether the values come from a raw curve, which `…/curve` gives"
    )
    warnings: list[str] = Field(description="of the reduction of its raw curve")
    created_at: datetime


class Prior(StrictModel):
    """A constant of the structure before an update: one more piece of the same material."""

    mean: float
    standard_deviation: float
    basis: str = Field(description="how the standard deviation came about")


class Statistic(StrictModel):
    """Mean and scatter of a property over the specimens that count."""

    n: int | None = Field(
        description="specimens that count; null where a published mean does not say"
    )
    mean: float
    standard_deviation: float | None = Field(
        description="n-1 in the denominator; null below two specimens"
    )
    cv_percent: float | None = Field(
        description="coefficient of variation, 100 standard_deviation / |mean|"
    )
    unit: str
    source: Literal["specimens", "published"]


class Excluded(StrictModel):
    """A specimen that does not count, and why."""

    specimen: str
    reason: str


class Summary(StrictModel):
    """A batch in numbers: what was measured, and what it gives as constants of the structure."""

    batch_id: UUID
    properties: dict[str, Statistic] = Field(
        description="per measured property: E_Pa, G_Pa, nu, strength_Pa, ..."
    )
    constants: dict[Constant, Statistic] = Field(description="per constant that the batch gives")
    priors: dict[Constant, Prior] = Field(
        description="what the constants say as priors of an update"
    )
    excluded: list[Excluded]
    warnings: list[str]


Series = Literal["force", "strain", "strain_back", "transverse_strain", "time"]
LengthUnit = Literal["m", "cm", "mm", "µm", "um", "in", "inch", "mil"]
Reading = Annotated[float, Field(gt=0, lt=1e6)]
Strain = Annotated[float, Field(ge=0, lt=1)]


class ColumnIn(RequestModel):
    """Where a series stands in the machine's file."""

    header: Name | Annotated[int, Field(ge=1, le=1000)] = Field(
        description=(
            "the column's name, unit and capitals apart; or its number, from 1, where there is no"
            " header"
        )
    )
    unit: Annotated[str, Field(max_length=20)] | None = Field(
        None, description="such as kN, %, µε; needed where the file does not state it"
    )


def _as_column(value: Any) -> Any:
    """`"Load"` is short for `{"header": "Load"}`."""
    return (
        {"header": value} if isinstance(value, str | int) and not isinstance(value, bool) else value
    )


Column = Annotated[ColumnIn, BeforeValidator(_as_column)]


class Dimensions(RequestModel):
    """Readings of width and thickness along the gauge section; three each by the standard."""

    unit: LengthUnit
    width: list[Reading] = Field(min_length=1, max_length=100)
    thickness: list[Reading] = Field(min_length=1, max_length=100)
    gauge_length: Reading | None = Field(
        None,
        description=(
            "of the extensometer; with it the columns of longitudinal strain hold elongations"
        ),
    )
    transverse_gauge_length: Reading | None = Field(
        None,
        description="of the transverse extensometer; with it that column holds a change of width",
    )

    def measured(self) -> Iterator[tuple[str, float, Quantity]]:
        """The readings in m."""
        metres = factor("length", self.unit, "unit")
        for name, readings in (("width", self.width), ("thickness", self.thickness)):
            yield from (
                (f"{name}/{number}", metres * value, COUPON_SIZE)
                for number, value in enumerate(readings)
            )
        for name in ("gauge_length", "transverse_gauge_length"):
            yield name, metres * (getattr(self, name) or 0.0), COUPON_SIZE


class CurveCouponIn(_Excludable, RequestModel):
    """A specimen as it was tested: its dimensions, and how its raw curve is to be read and
    reduced.
    """

    model_config = example(
        specimen="A1",
        dimensions={"unit": "mm", "width": [25.02], "thickness": [2.51]},
        columns={
            "force": {"header": "Load", "unit": "kN"},
            "strain": {"header": "Strain", "unit": "1"},
        },
    )

    specimen: Name
    standard: Standard = "D3039"
    dimensions: Dimensions
    columns: dict[Series, Column] = Field(
        description="series to column; force and strain are needed"
    )
    delimiter: Literal["\t", ";", ",", " "] | None = Field(
        None, description="found out where it is not stated"
    )
    decimal: Literal[".", ","] | None = Field(None, description="found out where it is not stated")
    encoding: Encoding | None = Field(
        None, description="found out where it is not stated, if it is UTF-8, UTF-16 or cp1252"
    )
    run: int | None = Field(
        None, ge=1, le=1000, description="which run counts, from 1, where the machine was restarted"
    )
    zero: dict[Series, Literal["first"] | Annotated[float, Field(ge=-1e9, le=1e9)]] = Field(
        default_factory=dict,
        description=(
            "reading of a series at zero, which is taken off: `first`, its first point, or a number"
            " in the unit of its column; for an extension that was not tared"
        ),
    )
    ends: Ends = Field(
        "nearest", description="ends of the chord: nearest measured points, or interpolated"
    )
    chord_range: Annotated[tuple[Strain, Strain], Field(strict=False)] | None = Field(
        None,
        description="D3039, m/m; default 1000 to 3000 µε, or 25 to 50 % of a low ultimate strain",
    )
    chord_start: Strain | None = Field(None, description="D3518, shear strain m/m; default 2000 µε")
    failure_code: FailureCode | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        needed = ("force", "strain", *(("transverse_strain",) if self.standard == "D3518" else ()))
        missing = [name for name in needed if name not in self.columns]
        if unread := [name for name in self.zero if name not in self.columns]:
            raise wrong(f"zero has {', '.join(unread)}, which columns does not name")
        if "time" in self.zero:
            raise wrong("zero has time, of which only differences count; leave it out")
        if missing:
            raise wrong(f"columns lacks {', '.join(missing)}, which {self.standard} needs")
        if self.chord_range is not None and self.standard != "D3039":
            raise wrong("chord_range is of D3039; D3518 takes chord_start")
        if self.chord_start is not None and self.standard != "D3518":
            raise wrong("chord_start is of D3518; D3039 takes chord_range")
        return self


class CurveFile(StrictModel):
    """How a machine's file was read."""

    filename: str
    size: int
    sha256: str
    encoding: str
    delimiter: str
    decimal: str
    units: dict[str, str] = Field(description="as the file or the client states them, by series")
    run: int
    runs: int
    first_line: int
    last_line: int
    notes: list[str]


class CouponCurveOut(StrictModel):
    """The raw curve of a specimen: where it came from, what was made of it, and how."""

    file: CurveFile
    series: list[str]
    points: int
    sha256: str = Field(
        description="of the series as stored: little-endian doubles, one series after the other"
    )
    request: CurveCouponIn
    reduction: dict[str, Any] = Field(description="all that the standard reports of a specimen, SI")
    software: str = Field(description="version that reduced it")
