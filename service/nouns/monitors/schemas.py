"""What a client sends and gets about monitors, their runs, and alarms."""

import re
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from typing import Annotated, Any, Literal, Self, TypeVar
from uuid import UUID

from croniter import croniter
from pydantic import (
    AfterValidator,
    Field,
    create_model,
    field_validator,
    model_validator,
)

from fecore.errors import InputError
from fecore.quantities import is_of_stiffness, kind_of, quantity_of
from fecore.trend import Chart, Watch
from service.nouns.campaigns.climate import covariate
from service.nouns.campaigns.schemas import Boundary
from service.nouns.notifications.channels import OF_MONITORS
from service.nouns.updates.schemas import RecipeIn
from service.platform.errors import Invalid
from service.platform.web import (
    Id,
    Name,
    RequestModel,
    StrictModel,
    Text,
    Time,
    example,
    not_null,
    wrong,
)

Direction = Literal["fall", "rise", "both"]
State = Literal["no data", "normal", "pending", "alarm", "acknowledged"]
Covariate = Annotated[str, AfterValidator(covariate)]

COEFFICIENT = re.compile(r"[a-z]\w{0,40}")
OF_A_MODE = re.compile(r"(frequency|damping_ratio)_([1-9]\d?)")
OF_MODES = ("frequency", "damping_ratio")
"""Values of each mode, by which all of them are watched at once."""


class WatchedIn(RequestModel):
    """A parameter to watch, and where it must not go."""

    name: str = Field(
        pattern=r"^\w{1,60}(\.\w{1,60})?$",
        description=(
            "`Ex Ey Gxy …`, of a body in space `web.E1 …`, `a0 a1 …`, or `frequency_2`,"
            " `damping_ratio_2` of the campaigns' second mode; of a monitor of modes `frequency`,"
            " `damping_ratio` of all modes or of one"
        ),
    )
    direction: Direction | None = Field(
        None,
        description=(
            "default: `rise` for damping, `fall` for elastic constants and frequencies, else `both`"
        ),
    )

    @property
    def watched_direction(self) -> Direction:
        """The direction, stated or not."""
        if self.direction is not None:
            return self.direction
        if is_of_stiffness(self.name) or self.name.startswith("frequency"):
            return "fall"
        return "rise" if quantity_of(self.name) is None else "both"


class BaselineIn(RequestModel):
    """What later campaigns are held against: the first campaigns, from a date on if one is
    stated.
    """

    campaigns: int = Field(
        12, ge=4, le=1000, description="how many; with k covariates at least 4 + k"
    )
    since: Time | None = Field(
        None, description="campaigns before this are left out, as after a repair"
    )


class ChartIn(RequestModel):
    """The control chart."""

    kind: Literal["ewma", "cusum", "shewhart"] = "ewma"
    weight: float = Field(
        0.3, gt=0, le=1, description="λ of an EWMA: small for slow and small changes"
    )
    reference: float = Field(
        0.5, gt=0, lt=10, description="k of a CUSUM, half the change to be found, in its sd"
    )
    jump_share: float = Field(
        0.5, ge=0, lt=1, description="share of the false alarms for the limit on single scores"
    )


MOST_WATCHED = 20
MOST_REGRESSED = 10  # covariates of a monitor
USUAL_KINDS, USUAL_COEFFICIENTS = ("Ex", "Gxy", "E1", "G12", "E"), ("a0", "a1")
"""What is watched where nothing is said: the constants of these kinds that the recipe updates, and
these coefficients.
"""


Model = TypeVar("Model", bound=StrictModel)


def with_receivers(kind: Any, **limits: Any) -> Callable[[type[Model]], type[Model]]:
    """Give a model the members of the channels whose addresses a monitor states.

    Args:
        kind: type of each member.
        limits: of each, as of `Field`.
    """
    members: dict[str, Any] = {
        member: (kind, Field(description=channel.meaning, **limits))
        for member, channel in OF_MONITORS.items()
    }

    validators = None
    if "default" in limits:  # of a patch, which may leave them out
        validators = {"_never_null_receivers": not_null(*OF_MONITORS)}

    def extended(model: type[Model]) -> type[Model]:
        return create_model(
            model.__name__,
            __base__=model,
            __module__=model.__module__,
            __doc__=model.__doc__,
            __validators__=validators,
            **members,
        )

    return extended


@with_receivers(list[Text], default_factory=list, max_length=20)
class MonitorIn(RequestModel):
    """A monitor; everything but its name has a default."""

    model_config = example(
        name="stringer 1", baseline={"campaigns": 12}, covariates=["temperature_c"]
    )

    name: Name
    watch: Literal["update", "modes"] = Field(
        "update",
        description=(
            "`update`: every campaign is updated by the recipe; `modes`: natural frequencies and"
            " damping ratios are followed, which needs no model and no recipe"
        ),
    )
    recipe: RecipeIn = Field(default_factory=lambda: RecipeIn.model_validate({}))
    modes: Literal["identify", "given"] = Field(
        "identify",
        description=(
            "`identify`: every run identifies the modes from the FRFs (of a monitor of modes, a"
            " campaign without FRFs gives its mode set); `given`: it takes the campaign's newest"
            " mode set that was typed in or came with a file, and waits for one"
        ),
    )
    priors: Literal["baseline", "last"] = Field(
        "baseline",
        description=(
            "`baseline`: each run has the recipe's priors; `last`: their means are the estimates of"
            " the campaign before, their widths the recipe's, so that the prior follows the"
            " structure and never hides a change"
        ),
    )
    boundary: Boundary | None = Field(
        None, description="only campaigns held like this; default: as the first one run"
    )
    parameters: list[WatchedIn] | None = Field(
        None,
        min_length=1,
        max_length=MOST_WATCHED,
        description=(
            "default: of what the recipe updates Ex and Gxy, or E1 and G12 of each set (E of"
            " beams); a0 and a1; of a monitor of modes frequency and damping_ratio"
        ),
    )
    baseline: BaselineIn = Field(default_factory=lambda: BaselineIn(campaigns=12, since=None))
    covariates: list[Covariate] = Field(
        default_factory=list,
        max_length=MOST_REGRESSED,
        description="`temperature_c`, `humidity_percent`, or others that campaigns state",
    )
    false_alarm_rate: float = Field(
        0.01, gt=0, lt=0.5, description="false alarms a campaign, of all parameters together"
    )
    horizon: int = Field(
        24, ge=1, le=1000, description="campaigns after the baseline over which that rate is held"
    )
    pending: int = Field(
        1, ge=1, le=10, description="consecutive campaigns outside that make an alarm"
    )
    chart: ChartIn = Field(
        default_factory=lambda: ChartIn(kind="ewma", weight=0.3, reference=0.5, jump_share=0.5)
    )
    expected_interval_days: float | None = Field(
        None,
        gt=0,
        le=36500,
        description="a campaign later than 1.5 of it is `no data`; none: nothing is expected",
    )
    runs_on: Literal["campaign", "schedule", "hand"] = Field(
        "campaign",
        description=(
            "when campaigns are run: each when it is complete, at the schedule's times, or by hand"
        ),
    )
    schedule: str | None = Field(
        None, max_length=100, description="five cron fields, UTC, such as `0 3 * * 1`"
    )
    active: bool = Field(True, description="whether it runs and judges by itself, or is at rest")

    @field_validator("parameters")
    @classmethod
    def _known_once(cls, parameters: list[WatchedIn] | None) -> list[WatchedIn] | None:
        names = [p.name for p in parameters or ()]
        for name in names:
            of_damping = any(kind.fullmatch(name) for kind in (OF_A_MODE, COEFFICIENT))
            if name not in OF_MODES and not of_damping and quantity_of(name) is None:
                raise wrong(f"{name} is no parameter that a result has")
            if names.count(name) > 1:
                raise wrong(f"{name} is there twice")
        return parameters

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if (self.runs_on == "schedule") != (self.schedule is not None):
            raise wrong("a schedule belongs to runs_on `schedule`, and that to a schedule")
        if self.schedule is not None and (
            len(self.schedule.split()) != 5 or not croniter.is_valid(self.schedule)
        ):
            raise wrong("schedule is not five cron fields, such as `0 3 * * 1`")
        if len(set(self.covariates)) < len(self.covariates):
            raise wrong("a covariate is there twice")
        if self.baseline.campaigns < 4 + len(self.covariates):
            raise wrong("baseline has too few campaigns: at least 4 and one a covariate")
        self._of_its_kind()
        usual = OF_MODES if self.watch == "modes" else USUAL_COEFFICIENTS
        try:
            self.to_watch(
                self.parameters or [WatchedIn(name=name, direction=None) for name in usual]
            )
        except InputError as error:
            raise wrong(str(error)) from None
        return self

    def _of_its_kind(self) -> None:
        """Refuse what belongs to the other kind of monitor."""
        names = [each.name for each in self.parameters or ()]
        if self.watch == "update":
            if both := [name for name in names if name in OF_MODES]:
                raise wrong(f"{both[0]} of all modes is what `watch: modes` follows")
            return
        if self.recipe != RecipeIn.model_validate({}):
            raise wrong("recipe is of an update, and this monitor follows modes: leave it out")
        if self.priors != "baseline":
            raise wrong("priors are of an update, and this monitor follows modes: leave them out")
        for name in names:
            if name not in OF_MODES and not OF_A_MODE.fullmatch(name):
                raise wrong(f"{name} is of an update, and this monitor follows modes")
            if (kind := name.rpartition("_")[0]) in names:
                raise wrong(f"{name} is among {kind}, which is of all modes")

    def watched(self, updated: Sequence[str]) -> list[WatchedIn]:
        """What is watched, of parameters that the recipe updates where nothing is stated.

        Raises:
            Invalid: there are more than a monitor takes.
        """
        if self.parameters is not None:
            return self.parameters
        if self.watch == "modes":
            return [WatchedIn(name=name, direction=None) for name in OF_MODES]
        names = [*(name for name in updated if kind_of(name) in USUAL_KINDS), *USUAL_COEFFICIENTS]
        if len(names) > MOST_WATCHED:
            raise Invalid(
                "/parameters",
                f"are not stated, and the usual ones are {len(names)}; state {MOST_WATCHED} at"
                " most",
            )
        return [WatchedIn(name=name, direction=None) for name in names]

    def to_watch(
        self,
        watched: Sequence[WatchedIn],
        per_kelvin: Mapping[str, tuple[float, float]] | None = None,
    ) -> Watch:
        """The recipe of the judgement as the core takes it; with what is known of changes by
        temperature.
        """
        return Watch(
            directions={p.name: p.watched_direction for p in watched},
            baseline=self.baseline.campaigns,
            covariates=tuple(self.covariates),
            false_alarm_rate=self.false_alarm_rate,
            horizon=self.horizon,
            pending=self.pending,
            chart=Chart(**self.chart.model_dump()),
            expected_interval_days=self.expected_interval_days,
            per_kelvin=per_kelvin or {},
        )


@with_receivers(list[Text] | None, default=None, max_length=20)
class MonitorPatch(RequestModel):
    """Members to change. What decides about the series is frozen: for another recipe or baseline
    make another monitor.
    """

    model_config = example(active=False)

    name: Name | None = None
    active: bool | None = Field(
        None, description="a monitor at rest runs nothing by itself and judges nothing"
    )
    expected_interval_days: float | None = Field(
        None, gt=0, le=36500, description="null: nothing is expected"
    )

    _never_null = not_null("name", "active")


@with_receivers(list[str])
class MonitorOut(StrictModel):
    """A monitor, with its state."""

    id: UUID
    created_at: datetime
    updated_at: datetime
    deleted_at: datetime | None
    structure_id: UUID
    structure_name: str
    project_id: UUID
    structure_version_id: UUID
    acts_for: str = Field(description="user whose rights its runs have: who made it")
    name: str
    active: bool
    watch: str = Field(description="`update` or `modes`")
    recipe: dict[str, Any] = Field(description="of the updates; empty of a monitor of modes")
    modes: str
    priors: str
    boundary: str | None
    parameters: list[WatchedIn]
    baseline: BaselineIn
    covariates: list[Covariate]
    false_alarm_rate: float
    horizon: int
    pending: int
    chart: ChartIn
    expected_interval_days: float | None
    runs_on: str
    schedule: str | None
    next_run_at: datetime | None
    series: int = Field(
        description="version of the series that is judged; 0 before the first judgement"
    )
    state: State
    state_since: datetime
    open_alarms: int


class RunsIn(RequestModel):
    """What to run. `{}`: every campaign that has not been run as it is now, in time order."""

    model_config = example()

    campaign: Id | None = Field(
        None, description="this one, complete or not; one that failed is tried again"
    )
    rerun: bool = Field(False, description="all campaigns anew, as the next version of the series")
    reason: str = Field("", max_length=1000, description="why it is rerun")

    @model_validator(mode="after")
    def _one_wish(self) -> Self:
        if self.rerun and self.campaign is not None:
            raise wrong("a rerun is of the whole series; leave campaign out")
        return self


class RunOut(StrictModel):
    """The recipe on one campaign."""

    id: UUID
    series: int
    campaign_id: UUID
    revision: int = Field(description="more than 1: the campaign was corrected, or tried again")
    state: Literal["running", "succeeded", "failed", "refused"]
    message: str | None
    update_job_id: UUID | None
    job_id: UUID | None = Field(
        None, description="of a monitor of modes, the processing or identification that it took"
    )
    software: str | None
    created_at: datetime
    finished_at: datetime | None


class AcknowledgementIn(RequestModel):
    """Somebody has seen the alarm."""

    model_config = example(note="joint 3 retightened")

    note: Annotated[str, Field(min_length=1, max_length=2000)]
    together: bool = Field(
        False, description="with all alarms of this monitor that the same campaign raised"
    )


class AlarmEventOut(StrictModel):
    """A step in an alarm's history."""

    at: datetime
    event: str
    by: str | None
    note: str


class AlarmOut(StrictModel):
    """An alarm."""

    id: UUID
    created_at: datetime
    monitor_id: UUID
    monitor_name: str
    structure_id: UUID
    project_id: UUID
    parameter: str
    unit: str | None
    campaign_id: UUID = Field(description="campaign that raised it")
    series: int
    state: Literal["alarm", "acknowledged", "cleared", "withdrawn"]
    acknowledged_at: datetime | None
    acknowledged_by: str | None
    note: str | None
    details: dict[str, Any] = Field(
        description="value, baseline, score, change point and rate when it was last judged"
    )
    history: list[AlarmEventOut]


class AcknowledgedOut(AlarmOut):
    """An alarm that was acknowledged."""

    together: list[UUID] = Field(description="other alarms that this acknowledged too")


class CompletionOut(StrictModel):
    """Everything of this campaign is in."""

    campaign_id: UUID
    completed_at: datetime
    runs: list[RunOut] = Field(description="what its structure's monitors started")
