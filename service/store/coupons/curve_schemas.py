"""What a client states about a raw curve, and what it gets of it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from fecore.coupons.curves import Ends
from modalbase.formats.machine_csv.units import factor
from service.store.coupons.schemas import FailureCode, Standard, check_exclusion
from service.web import Name, StrictModel, Text
from service.web.quantities import COUPON_SIZE, Quantity

Series = Literal["force", "strain", "strain_back", "transverse_strain", "time"]
LengthUnit = Literal["m", "cm", "mm", "µm", "um", "in", "inch", "mil"]
Reading = Annotated[float, Field(gt=0, lt=1e6)]
Strain = Annotated[float, Field(ge=0, lt=1)]


class ColumnIn(StrictModel):
    """Where a series stands in the machine's file."""

    header: Name | Annotated[int, Field(ge=1, le=1000)] = Field(
        description="the column's name, unit and capitals apart; or its number, from 1, where there is no header"
    )
    unit: Annotated[Text, Field(max_length=20)] | None = Field(
        None, description="such as kN, %, µε; needed where the file does not state it"
    )


def _as_column(value: Any) -> Any:
    """`"Load"` is short for `{"header": "Load"}`."""
    return {"header": value} if isinstance(value, str | int) and not isinstance(value, bool) else value


Column = Annotated[ColumnIn, BeforeValidator(_as_column)]


class Dimensions(StrictModel):
    """Readings of width and thickness along the gauge section; three each by the standard."""

    unit: LengthUnit
    width: list[Reading] = Field(min_length=1, max_length=100)
    thickness: list[Reading] = Field(min_length=1, max_length=100)
    gauge_length: Reading | None = Field(
        None, description="of the extensometer; with it the columns of longitudinal strain hold elongations"
    )
    transverse_gauge_length: Reading | None = Field(
        None, description="of the transverse extensometer; with it that column holds a change of width"
    )

    def measured(self) -> Iterator[tuple[str, float, Quantity]]:
        """The readings in m."""
        metres = factor("length", self.unit, "unit")
        for name, readings in (("width", self.width), ("thickness", self.thickness)):
            yield from ((f"{name}/{number}", metres * value, COUPON_SIZE) for number, value in enumerate(readings))
        for name in ("gauge_length", "transverse_gauge_length"):
            yield name, metres * (getattr(self, name) or 0.0), COUPON_SIZE


class CurveCouponIn(StrictModel):
    """A specimen as it was tested: its dimensions, and how its raw curve is to be read and reduced."""

    specimen: Name
    standard: Standard = "D3039"
    dimensions: Dimensions
    columns: dict[Series, Column] = Field(description="series to column; force and strain are needed")
    delimiter: Literal["\t", ";", ","] | None = Field(None, description="found out where it is not stated")
    decimal: Literal[".", ","] | None = Field(None, description="found out where it is not stated")
    run: int | None = Field(
        None, ge=1, le=1000, description="which run counts, from 1, where the machine was restarted"
    )
    ends: Ends = Field("nearest", description="ends of the chord: nearest measured points, or interpolated")
    chord_range: tuple[Strain, Strain] | None = Field(
        None, description="D3039, m/m; default 1000 to 3000 µε, or 25 to 50 % of a low ultimate strain"
    )
    chord_start: Strain | None = Field(None, description="D3518, shear strain m/m; default 2000 µε")
    failure_code: FailureCode | None = None
    excluded: bool = False
    exclusion_reason: Text | None = Field(None, min_length=1, max_length=1000)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        check_exclusion(self.excluded, self.exclusion_reason)
        needed = ("force", "strain", *(("transverse_strain",) if self.standard == "D3518" else ()))
        missing = [name for name in needed if name not in self.columns]
        if missing:
            raise PydanticCustomError(
                "columns", "columns lacks {missing}, which {standard} needs",
                {"missing": ", ".join(missing), "standard": self.standard},
            )  # fmt: skip
        if self.chord_range is not None and self.standard != "D3039":
            raise PydanticCustomError("not_of_d3518", "chord_range is of D3039; D3518 takes chord_start")
        if self.chord_start is not None and self.standard != "D3518":
            raise PydanticCustomError("not_of_d3039", "chord_start is of D3518; D3039 takes chord_range")
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


class CurveOut(StrictModel):
    """The raw curve of a specimen: where it came from, what was made of it, and how."""

    file: CurveFile
    series: list[str]
    points: int
    sha256: str = Field(description="of the series as stored: little-endian doubles, one series after the other")
    request: CurveCouponIn
    reduction: dict[str, Any] = Field(description="all that the standard reports of a specimen, SI")
    software: str = Field(description="version that reduced it")
