"""What a client sends and gets about mode sets."""

from datetime import datetime
from typing import Annotated, Any, Literal
from uuid import UUID

from pydantic import Field, field_validator

from fecore.errors import InputError
from fecore.modal import Options
from service.nouns.campaigns.schemas import Point
from service.platform.web import LongList, Name, RequestModel, StrictModel, example, wrong

Origin = Literal["typed", "file", "identified", "edited"]
Excitation = Literal["measured", "unmeasured"]


class ShapeValue(RequestModel):
    """Displacement of a mode at a point, in a signed direction of the file's coordinates,
    arbitrarily scaled.
    """

    point: Point
    direction: int = Field(ge=-6, le=6, description="±1 … ±3 along x, y, z, ±4 … ±6 about them")
    real: float
    imag: float = 0.0

    @field_validator("direction")
    @classmethod
    def _not_zero(cls, direction: int) -> int:
        if direction == 0:
            raise wrong("is 0, expected ±1 … ±6")
        return direction


class ModeIn(RequestModel):
    """One mode as a client knows it; standard deviations where it knows them too."""

    frequency_hz: float = Field(gt=0, le=1e9, description="undamped natural frequency")
    damping_ratio: float | None = Field(
        None, ge=0, lt=1, description="viscous damping ratio, not per cent"
    )
    frequency_sd_hz: float | None = Field(None, gt=0, le=1e9)
    damping_sd: float | None = Field(None, gt=0, lt=1)
    shape: LongList[ShapeValue] | None = Field(None, min_length=1, max_length=1_000_000)

    @field_validator("shape")
    @classmethod
    def _shape(cls, shape: list[ShapeValue] | None) -> list[ShapeValue] | None:
        seen: set[tuple[int, int]] = set()
        for value in shape or []:
            key = (value.point, abs(value.direction))
            if key in seen:
                raise wrong(f"point {key[0]} has direction {key[1]} twice")
            seen.add(key)
        if shape and not any(value.real or value.imag for value in shape):
            raise wrong("is zero everywhere")
        return shape


class ModeSetIn(RequestModel):
    """Modes of a campaign, in any order."""

    model_config = example(
        name="typed in",
        modes=[
            {"frequency_hz": 25.61, "damping_ratio": 0.1556},
            {"frequency_hz": 160.85, "damping_ratio": 0.0284},
        ],
    )

    name: Name
    modes: LongList[ModeIn] = Field(min_length=1, max_length=10_000)
    excitation: Excitation = Field(
        "measured",
        description=(
            "unmeasured: found in responses to loads that nobody measured; shapes are unscaled"
        ),
    )


Frequency = Annotated[float, Field(ge=0, le=1e7, description="Hz")]
Band = Annotated[tuple[Frequency, Frequency], Field(strict=False)]


class PolesIn(StrictModel):
    """How poles are looked for in FRFs, and from when on one is a mode."""

    band_hz: Band | None = Field(None, description="lines to use; default: all")
    highest_order: int = Field(40, ge=4, le=200, description="of the linear stage")
    most_modes: int = Field(100, ge=1, le=200, description="poles of the fitted series")
    threshold: float = Field(
        0.9,
        ge=0.1,
        lt=1,
        description="probability from which a pole is a mode; below, it is uncertain",
    )

    def options(self) -> Options:
        """The core's options.

        Raises:
            InputError: the band is empty.
        """
        if self.band_hz is not None and not self.band_hz[0] < self.band_hz[1]:
            raise InputError(
                "band_hz", f"is ({self.band_hz[0]:g}, {self.band_hz[1]:g}), expected low < high"
            )
        return Options(self.band_hz, self.highest_order, self.most_modes, self.threshold)


class FeatureOut(StrictModel):
    """One reason for or against a pole being a mode."""

    name: str = Field(
        description="phase, rise, share, damping, apart, shape or reach; twin in older results"
    )
    value: float = Field(description="of the feature, as the page on modes defines it")
    weight: float = Field(description="what it adds to ln(P/(1 − P))")
    words: str = Field(description="the feature in a sentence, with its value")


class ModeOut(StrictModel):
    """One mode of a set."""

    number: int = Field(description="1 for the lowest")
    frequency_hz: float
    damping_ratio: float | None
    frequency_sd_hz: float | None
    damping_sd: float | None
    shape: list[ShapeValue] | None
    probability: float | None = Field(
        description="that the pole is a mode of the structure; null where no job identified it"
    )
    features: list[FeatureOut] = Field(description="the reasons for and against it that weigh most")


class DecisionIn(RequestModel):
    """What a person decides of one pole."""

    frequency_hz: float = Field(
        gt=0,
        le=1e9,
        description="of a mode of the set, or of an uncertain, refused or dropped one beside it",
    )
    keep: bool = Field(description="whether the pole is in the new set")
    reason: str = Field(
        min_length=1, max_length=2000, description="why, for those who read the new set"
    )


class EditIn(RequestModel):
    """Which poles of a mode set are kept and dropped; all others stay as they are."""

    model_config = example(
        name="checked by hand",
        decisions=[
            {
                "frequency_hz": 160.85,
                "keep": False,
                "reason": "of the stand: it is there without the beam, too",
            }
        ],
    )

    name: Name
    decisions: LongList[DecisionIn] = Field(
        min_length=1, max_length=10_000, description="one for each pole in question"
    )


class ModeSetOut(StrictModel):
    """A mode set."""

    id: UUID
    campaign_id: UUID
    name: str
    origin: Origin
    excitation: Excitation = Field(
        description=(
            "unmeasured: identified from responses to loads that nobody measured; shapes are"
            " unscaled"
        )
    )
    window_taken_out_per_s: float = Field(
        0.0,
        description=(
            "rate of the exponential window that the FRFs of measured loads carry, which was taken"
            " out of the damping; 0: none"
        ),
    )
    import_id: UUID | None = Field(description="the import that it came with")
    job_id: UUID | None = Field(description="the job that identified it")
    superseded_by: UUID | None = Field(
        None, description="the newer set that a job identified by the same settings"
    )
    modes: list[ModeOut]
    details: dict[str, Any] = Field(
        description=(
            "of an identified set, what stands beside its modes: `warnings`, `doubtful` modes with"
            " the reason of each, `refused` FRFs, `refused_poles`, `evidence` for each mode,"
            " `harmonics_hz` of machines and `amplitude`, the root mean square of the responses,"
            " where loads are unmeasured; of an edited set `edited_from`, `dropped` modes, and"
            " `decisions`, each with who made it, as well; empty for others, and for sets of versions up to 0.2"
        )
    )
    created_at: datetime
