"""A series as a client gets it. It is shown as it was judged, not filtered; these models describe it
in the OpenAPI document.
"""

from datetime import datetime
from typing import Any
from uuid import UUID

from pydantic import BaseModel, ConfigDict, Field


class _Part(BaseModel):
    model_config = ConfigDict(extra="allow")


class PointOut(_Part):
    """A campaign's value of a parameter."""

    campaign_id: UUID
    performed_at: datetime
    raw: float = Field(description="the estimate, in the parameter's unit")
    standard_deviation: float = Field(description="of the estimate, in the parameter's unit")
    corrected: float | None = Field(
        description="for covariates, in the parameter's unit; null before there is a baseline"
    )
    in_baseline: bool = Field(description="whether the campaign is one of the baseline's")
    judged: dict[str, Any] | None = Field(
        description=(
            "residual and limit in its unit, score and chart in standard deviations; null in the"
            " baseline"
        )
    )


class SeriesParameterOut(_Part):
    """A watched parameter of a series."""

    name: str = Field(description="Ex Ey Gxy … a0 a1 …, or `frequency_2`, `damping_ratio_2`")
    unit: str | None = Field(description="SI unit of its values")
    direction: str = Field(description="where it must not go: fall, rise or both")
    state: str = Field(description="no data, normal, pending, alarm or acknowledged")
    baseline: dict[str, Any] | None = Field(
        description="mean, its sd, scatter, slopes; null until it is full"
    )
    curve: dict[str, Any] | None = Field(
        None,
        description=(
            "over temperature, with 95 % intervals, and `per_K`, the relative change per kelvin;"
            " null where temperature_c is no covariate"
        ),
    )
    limits: dict[str, float | None] | None = Field(
        description="of chart and single score, standard deviations"
    )
    autocorrelation: dict[str, Any] | None = Field(
        None,
        description=(
            "`lag_1` of the baseline with `interval_95`, and the factor `limits_widened_by` for it;"
            " null without one"
        ),
    )
    count: int = Field(description="how many campaigns have a value of it")
    points: list[PointOut] = Field(description="of the campaigns that are shown, in time order")
    change_point: dict[str, Any] | None = Field(
        description="when and how much it changed; null without a change"
    )
    rate: dict[str, Any] | None = Field(
        description="of change, per year, `since` its onset where it is a ramp; null where unknown"
    )
    timeline: list[dict[str, Any]] = Field(description="states as they came")
    notes: list[str] = Field(description="what is worth saying, in words")


class SeriesOut(_Part):
    """A series: values with their uncertainty, baseline, limits, alarms and campaigns as marks."""

    monitor_id: UUID
    monitor_name: str
    structure_id: UUID
    structure_name: str
    series: int
    software: str | None
    reason: str | None
    current: bool = Field(description="whether it is the one that is judged")
    versions: list[dict[str, Any]] = Field(description="all series of the monitor")
    state: str = Field(description="the worst of its parameters")
    assessed_at: datetime | None = Field(description="when it was last judged, UTC")
    judgement: dict[str, Any] | None = Field(description="how the last judgement went")
    notes: list[str]
    total: int = Field(description="campaigns between `from` and `to`")
    stride: int = Field(description="every so many-th of these is shown")
    campaigns: list[dict[str, Any]] = Field(description="those that are shown, each with its run")
    parameters: list[SeriesParameterOut] = Field(description="the watched ones")
    alarms: list[dict[str, Any]] = Field(description="marks on the series")
