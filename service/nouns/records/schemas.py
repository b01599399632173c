"""What a client sends and gets about time blocks and their processing."""

from datetime import datetime
from typing import Annotated, Any, Literal
from uuid import UUID

import numpy as np
from pydantic import Field

from fecore.signal import FALSE_DISCOVERY, Estimator, Processing, Windows
from fecore.signal.reasons import Criterion
from modalbase.formats.records import Variables
from service.nouns.campaigns.schemas import Point
from service.nouns.frfs.schemas import Direction
from service.platform.errors import Invalid, pointer
from service.platform.queue.resource import JobOut
from service.platform.web import LongList, RequestModel, StrictModel, example
from service.platform.web.json_body import parse_json

ChannelQuantity = Literal["force", "acceleration", "velocity", "displacement"]
UNITS: dict[str, str] = {
    "force": "N",
    "acceleration": "m/s²",
    "velocity": "m/s",
    "displacement": "m",
}


class RecordOut(StrictModel):
    """One channel's time block of one hit, without its samples."""

    id: UUID
    campaign_id: UUID
    label: str
    filename: str
    quantity: ChannelQuantity
    unit: str
    point: int
    direction: int
    force_point: int
    force_direction: int
    hit: int
    sample_rate_hz: float
    samples: int
    sensitivity: float
    window_rate_per_s: float
    full_scale: float | None
    start_sample: int | None
    dtype: str
    sha256: str
    bytes_deleted_at: datetime | None = Field(
        None, description="when the retention rule deleted its samples; null where they are there"
    )
    created_at: datetime


class HitFindingOut(StrictModel):
    """One criterion of one hit."""

    criterion: Criterion
    number: float | None = Field(description="null where it is infinite")
    limit: float | None = Field(
        description="the number that alone would refuse the hit; null where none would"
    )
    failed: bool
    sentence: str


class HitOut(StrictModel):
    """The judgement of one hit."""

    point: int
    direction: int
    hit: int
    accepted: bool
    probability: float | None = Field(
        None, description="that the hit is good; null in a judgement of an earlier version"
    )
    overruled: bool | None = Field(description="what a user decided against the findings")
    findings: list[HitFindingOut]


class Proposal(StrictModel):
    """What a dry run says of a file."""

    variables: dict[str, str] = Field(
        description="type, shape, least and greatest value of each array"
    )
    mapping: dict[str, Any] = Field(
        description="by what the file says, in its own words; null is what it does not say"
    )
    blocks: int | None = Field(description="time blocks that the stated mapping makes of the file")
    table: dict[str, Any] | None = Field(
        None,
        description=(
            "how a table of text was read: encoding, separator, decimal sign, lines of headings,"
            " units and data, columns; `table` of a mapping states what is wrong of it"
        ),
    )


class WindowsIn(RequestModel):
    """Windows; both are chosen from the hits where no object is sent, and `{}` is neither of
    them.
    """

    force_length_s: float | None = Field(
        None, gt=0, le=100, description="about the pulse; null: the whole block"
    )
    rate_per_s: float = Field(
        0.0,
        ge=0,
        le=1e4,
        description="of the exponential window on both channels, 1/s; 0: there is none",
    )


class HitNamed(StrictModel):
    """A hit of a campaign."""

    point: Point
    direction: Direction | None = Field(
        None, description="null: the one in which the point was hit"
    )
    hit: int = Field(ge=1, le=9_999_999_999)


class OverruleIn(HitNamed, RequestModel):
    """A user's decision about one hit."""

    use: bool


class HitDecisionIn(HitNamed, RequestModel):
    """What a person decides of a hit, for every later processing."""

    model_config = example(point=8, hit=3, good=False, why="a cable was touched")

    good: bool | None = Field(
        description="whether the hit is used; null takes earlier decisions back"
    )
    why: str = Field(min_length=1, max_length=2000, description="for those who read the FRFs")


class HitDecisionOut(StrictModel):
    """What a person decided of a hit; of several decisions the last one counts."""

    id: UUID
    campaign_id: UUID
    point: int
    direction: int
    hit: int
    good: bool | None = Field(
        description="whether the hit is used; null: earlier decisions were taken back"
    )
    why: str
    by: str = Field(description="who decided")
    created_at: datetime


class StoredHit(HitOut):
    """The judgement of one hit that is stored, and who overruled it."""

    decision: HitDecisionOut | None = Field(
        description="the standing decision by hand, with who, when and why"
    )


class StoredRecords(StrictModel):
    """Time blocks that were stored, and the judgement of the hits of the points they are of."""

    items: list[RecordOut]
    hits: list[StoredHit] = Field(description="all hits of these points as they are judged now")
    coherence: dict[str, float] = Field(
        description=(
            "mean coherence of the good hits in the excited band, by force point; of the sensors of"
            " its newest hit"
        )
    )
    incomplete: list[str] = Field(
        description=(
            "hits of these points that are not judged, since their force or every response was"
            " deleted; delete what is left of them before a processing"
        )
    )


class ProcessingIn(RequestModel):
    """How hits become FRFs; `{}` will do."""

    model_config = example()

    estimator: Estimator = "H1"
    windows: WindowsIn | None = Field(
        None,
        description=(
            "null: a force window, and where needed an exponential one, chosen from the hits; {}:"
            " no windows"
        ),
    )
    band_hz: (
        Annotated[
            tuple[Annotated[float, Field(ge=0, le=1e7)], Annotated[float, Field(gt=0, le=1e7)]],
            Field(strict=False),
        ]
        | None
    ) = None
    delay_s: float = Field(
        0.0, gt=-1, lt=1, description="lag of the response, to be taken out; at most half a block"
    )
    false_discovery: float = Field(
        FALSE_DISCOVERY,
        ge=0,
        le=0.9,
        description="a hit is refused where its probability of being good is below",
    )
    overrules: LongList[OverruleIn] = Field(default_factory=list, max_length=100_000)

    def processing(self) -> Processing:
        """The core's choices, but for the overrules, for which the hits must be known.

        Raises:
            InputError: the band is empty.
        """
        windows = (
            None
            if self.windows is None
            else Windows(self.windows.force_length_s, self.windows.rate_per_s)
        )
        return Processing(self.estimator, windows, self.band_hz, self.delay_s, self.false_discovery)


class ReferenceIn(RequestModel):
    """A sensor that all others are correlated with."""

    point: Point
    direction: Direction


class CampaignProcessingIn(ProcessingIn):
    """How hits become FRFs, and recordings of responses half spectra; `{}` will do."""

    references: list[ReferenceIn] | None = Field(
        None,
        min_length=1,
        max_length=16,
        description=(
            "of recordings of responses: sensors that all others are correlated with; null: chosen"
        ),
    )
    lag_s: float | None = Field(
        None,
        gt=0,
        le=1e5,
        description=(
            "of recordings of responses: longest lag, at most a 40th of the recording, which is the"
            " default"
        ),
    )

    @property
    def of_responses(self) -> list[str]:
        """Members that are stated and of recordings of responses."""
        return [name for name in ("references", "lag_s") if getattr(self, name) is not None]

    @property
    def of_hits(self) -> list[str]:
        """Members that are stated and of hits."""
        own = self.model_fields_set - {"references", "lag_s"}
        usual = CampaignProcessingIn.model_validate({})
        return [name for name in sorted(own) if getattr(self, name) != getattr(usual, name)]


class ProcessingOut(JobOut):
    """A processing: how far it is, and what it did."""

    campaign_id: UUID
    options: CampaignProcessingIn
    result: dict[str, Any] | None = Field(
        description=(
            "choices made, judgement of every hit, and each FRF with the records that it rests on"
        )
    )


def from_json(body: bytes) -> tuple[Variables, Any]:
    """Arrays and mapping of a JSON body `{"variables": {"force": [...], ...}, "mapping": {...}}`;
    None without a mapping.

    Raises:
        Invalid: an array does not hold numbers alone; each fault with its pointer.
    """
    sent = parse_json(body)
    if (
        not isinstance(sent, dict)
        or not isinstance(sent.get("variables"), dict)
        or sent.keys() - {"variables", "mapping"}
    ):
        raise Invalid("", 'is not {"variables": {name: numbers}, "mapping": {...}}')
    variables: Variables = {}
    for name, values in sent["variables"].items():
        try:
            variables[name] = np.array(values, dtype=np.float64)
        except (TypeError, ValueError):
            raise Invalid(
                pointer(["variables", name]), "is not a number or a regular array of numbers"
            ) from None
    return variables, sent.get("mapping")
