"""The nouns that can be searched, with all their fields: the one declaration, for SQL, messages and
documents.

Search only reads, and joins what other modules keep apart: it names tables and columns, and asks no
other noun's operations.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import Any, get_args

from sqlalchemy import ColumnElement, Double, FromClause, and_, func, select

from fecore.frf import Quantity
from fecore.quantities import quantity_of
from fecore.trend import State
from service.nouns.attachments import operations as attachments
from service.nouns.campaigns.climate import CLIMATE, unit_of_covariate
from service.nouns.campaigns.operations import WORDS as CAMPAIGN_WORDS
from service.nouns.campaigns.schemas import Boundary
from service.nouns.coupons.schemas import Standard
from service.nouns.modes.schemas import Excitation, Origin
from service.nouns.records.schemas import ChannelQuantity
from service.nouns.search import literals
from service.nouns.search.fields import Field, Noun
from service.nouns.search.uses import at_response, covers, sensors, used_instruments
from service.nouns.structures.operations import WORDS as STRUCTURE_WORDS
from service.nouns.updates.result_schemas import CONSTANTS, Level

Value = Callable[[FromClause], ColumnElement[Any]]


def _instrument(*members: str) -> Value:
    return lambda t: t.c.instruments[members].astext


def _one_of(name: str, values: Iterable[str], *, nullable: bool = False) -> Field:
    """A text that has one of these values."""
    among = tuple(map(str, values))
    return Field(
        name,
        "text",
        literals.listed([f"`{value}`" for value in among]),
        among=among,
        nullable=nullable,
    )


def _driving(t: FromClause) -> ColumnElement[Any]:
    same_axis = func.abs(t.c.response_direction) == func.abs(t.c.reference_direction)
    return and_(t.c.response_point == t.c.reference_point, same_axis)


def _sensor(name: str, member: str, meaning: str) -> Field:
    """Of the sensor that an FRF was measured with; one of them where several were at its point."""

    def value(frf: FromClause) -> ColumnElement[Any]:
        use = sensors()
        there = use.c.campaign_id == frf.c.campaign_id, covers(use, frf)
        return select(use.c[member]).where(*there).order_by(use.c.number).limit(1).scalar_subquery()

    return Field(name, "text", meaning, column=member, value=value, nullable=True, via="frf.sensor")


ID = Field("id", "id", "UUIDv7; sorts by the time of creation")
CREATED = Field("created_at", "time", "when it was stored, UTC")
NAME = Field("name", "text", "what people call it")
LABELS = (
    Field("tag", "tags", "any of its tags", column="tags"),
    Field("meta", "json", "free metadata; its members are `meta.client` and the like"),
)

_ENDS = {
    "": "estimate of {}",
    "_sd": "its standard deviation",
    "_low": "lower end of its 95 % interval",
    "_high": "upper end of its 95 % interval",
}


def _constants() -> Iterator[Field]:
    for name, unit in CONSTANTS.items():
        for end, meaning in _ENDS.items():
            column = f"{name}{end}".lower()
            sd = f"{name}_sd"
            yield Field(
                name + end,
                "number",
                meaning.format(name),
                unit,
                column=column,
                nullable=True,
                sd=sd,
            )


def _other_constant(name: str) -> Field | None:
    """A constant that has no column, such as `flange.E1` of a set, or the `_sd`, `_low`, `_high` of
    one.
    """
    end = next((end for end in _ENDS if end and name.endswith(end)), "")
    base = name.removesuffix(end)
    quantity = quantity_of(base)
    if quantity is None:
        return None
    path = (base, end.removeprefix("_") or "estimate")
    value = lambda t: t.c.constants[path].astext.cast(Double)  # noqa: E731
    return Field(
        name,
        "number",
        _ENDS[end].format(base),
        quantity.unit,
        value=value,
        nullable=True,
        sd=f"{base}_sd",
    )


def _covariate(name: str) -> Field | None:
    """A covariate that campaigns state by its name, such as `covariates.wind_m_s`."""
    member, _, own = name.partition(".")
    unit = CLIMATE[own].unit if own in CLIMATE else unit_of_covariate(own)
    if member != "covariates" or unit is None:
        return None
    value = lambda t: t.c[own] if own in CLIMATE else t.c.covariates[own].astext.cast(Double)  # noqa: E731
    return Field(name, "number", "that campaigns state", unit, value=value, nullable=True)


_LINEAGE = ("campaign.id", "campaign.name", "structure.name")

_MADE = _one_of("origin", get_args(Origin)), _one_of("excitation", get_args(Excitation))
_ALL = (
    Noun(
        "project",
        "projects",
        fields=(ID, NAME, Field("description", "text", "in words"), *LABELS, CREATED),
    ),
    Noun(
        "structure",
        "structures",
        owner="project",
        fields=(
            ID,
            NAME,
            Field("version", "whole", "number of its present version"),
            Field("retention_days", "whole", "days for which its files are kept", nullable=True),
            *LABELS,
            CREATED,
        ),
        shown=("id", "name", "project.id", "project.name", "created_at"),
        facets=("project.name",),
        hidden=True,
        words=STRUCTURE_WORDS,
    ),
    Noun(
        "campaign",
        "campaigns",
        owner="structure",
        fields=(
            ID,
            NAME,
            _one_of("boundary", get_args(Boundary)),
            Field("performed_at", "time", "when the test was performed, UTC", nullable=True),
            *(
                Field(name, "number", one.meaning, one.unit, nullable=True)
                for name, one in CLIMATE.items()
            ),
            Field("notes", "text", "in words"),
            Field(
                "hammer",
                "text",
                "model of the hammer",
                value=_instrument("hammer", "model"),
                nullable=True,
            ),
            Field(
                "sensor",
                "text",
                "model of the sensor",
                value=_instrument("sensor", "model"),
                nullable=True,
            ),
            Field(
                "hammer_serial",
                "text",
                "its number",
                value=_instrument("hammer", "serial"),
                nullable=True,
            ),
            Field(
                "sensor_serial",
                "text",
                "its number",
                value=_instrument("sensor", "serial"),
                nullable=True,
            ),
            Field(
                "analyser",
                "text",
                "model of the analyser",
                value=_instrument("analyser", "model"),
                nullable=True,
            ),
            *LABELS,
            CREATED,
        ),
        shown=(
            "id",
            "name",
            "structure.id",
            "structure.name",
            "boundary",
            "performed_at",
            "temperature_c",
        ),
        facets=("boundary", "structure.name"),
        hidden=True,
        words=CAMPAIGN_WORDS,
        more=_covariate,
    ),
    Noun(
        "frf",
        "frfs",
        owner="campaign",
        fields=(
            ID,
            Field("label", "text", "what the file or the script calls it"),
            Field("response_point", "whole", "grid point of the response"),
            Field("response_direction", "whole", "±1 … ±3 along x, y, z, ±4 … ±6 about them"),
            Field("reference_point", "whole", "grid point of the force"),
            Field("reference_direction", "whole", "as of the response"),
            Field(
                "driving_point",
                "truth",
                "whether response and force are at one point and axis",
                value=_driving,
            ),
            _sensor("sensor", "model", "model of the sensor that measured it"),
            _sensor("sensor_serial", "serial", "its number"),
            _one_of("quantity", get_args(Quantity)),
            Field("averages", "whole", "hits or blocks that were averaged", nullable=True),
            Field("start_hz", "number", "first line", "Hz"),
            Field("end_hz", "number", "last line", "Hz"),
            Field("lines", "whole", "number of frequency lines"),
            *LABELS,
            CREATED,
        ),
        shown=(
            *("id", *_LINEAGE, "quantity", "response_point", "response_direction"),
            *("reference_point", "reference_direction", "start_hz", "end_hz", "lines"),
        ),
        facets=("quantity", "structure.name"),
    ),
    Noun(
        "record",
        "records",
        owner="campaign",
        fields=(
            ID,
            Field("label", "text", "what the file or the script calls it"),
            Field("filename", "text", "file that it came in"),
            _one_of("quantity", get_args(ChannelQuantity)),
            Field("point", "whole", "grid point of the sensor"),
            Field("direction", "whole", "±1 … ±3 along x, y, z"),
            Field("force_point", "whole", "grid point that was hit"),
            Field("hit", "whole", "number of the hit at its point"),
            Field("sample_rate_hz", "number", "samples a second", "Hz"),
            Field("samples", "whole", "number of samples"),
            CREATED,
        ),
        shown=(
            "id",
            *_LINEAGE,
            "quantity",
            "point",
            "direction",
            "force_point",
            "hit",
            "sample_rate_hz",
            "samples",
        ),
        facets=("quantity", "structure.name"),
    ),
    Noun(
        "mode_set",
        "mode_sets",
        owner="campaign",
        fields=(ID, NAME, *_MADE, CREATED),
    ),
    Noun(
        "mode",
        "modes",
        owner="mode_set",
        key=("mode_set_id", "number"),
        fields=(
            Field("number", "whole", "in its set, from 1"),
            Field("frequency_hz", "number", "natural frequency", "Hz", sd="frequency_sd_hz"),
            Field(
                "damping_ratio",
                "number",
                "viscous damping ratio ζ, not per cent",
                nullable=True,
                sd="damping_sd",
            ),
            Field(
                "frequency_sd_hz",
                "number",
                "standard deviation of the frequency",
                "Hz",
                nullable=True,
            ),
            Field("damping_sd", "number", "standard deviation of the damping ratio", nullable=True),
        ),
        shown=(
            *(*_LINEAGE, "mode_set.id", "mode_set.origin", "number"),
            *("frequency_hz", "frequency_sd_hz", "damping_ratio", "damping_sd"),
        ),
        facets=("mode_set.origin", "structure.name"),
    ),
    Noun(
        "result",
        "update_results",
        owner="campaign",
        fields=(
            ID,
            _one_of("verdict", get_args(Level), nullable=True),
            *_constants(),
            *LABELS,
            CREATED,
        ),
        shown=(
            *("id", *_LINEAGE, "campaign.temperature_c", "verdict"),
            *(f"{name}{member}" for name in CONSTANTS for member in ("", "_low", "_high")),
            "created_at",
        ),
        facets=("verdict", "structure.name"),
        more=_other_constant,
    ),
    Noun(
        "instrument",
        "instruments",
        owner="campaign",
        fields=(
            ID,
            _one_of("kind", ("hammer", "sensor", "analyser")),
            Field("serial", "text", "its number"),
            Field("model", "text", "model of it"),
            Field("calibrated_on", "time", "last calibration before the campaign", nullable=True),
            Field("calibrated_until", "time", "last day on which that counts", nullable=True),
            Field(
                "calibration_expired",
                "truth",
                "whether the campaign came after that day",
                nullable=True,
            ),
        ),
        made=used_instruments,
        of_part=at_response,
    ),
    Noun(  # what `frf.sensor` and `frf.sensor_serial` ask; it has no field by itself
        "frf.sensor",
        "instrument_uses",
        owner="frf",
        common="campaign_id",
        key=("campaign_id", "number"),
        fields=(),
        made=sensors,
        of_part=at_response,
    ),
    Noun("batch", "coupon_batches", owner="structure", fields=(ID, NAME, CREATED)),
    Noun(
        "coupon",
        "coupons",
        owner="batch",
        fields=(
            ID,
            Field("specimen", "text", "name of the specimen"),
            _one_of("standard", get_args(Standard)),
            Field("E_Pa", "number", "Young's modulus", "Pa", column="e_pa", nullable=True),
            Field("G_Pa", "number", "shear modulus", "Pa", column="g_pa", nullable=True),
            Field("nu", "number", "Poisson's ratio", nullable=True),
            Field("strength_Pa", "number", "strength", "Pa", column="strength_pa", nullable=True),
            Field("ultimate_strain", "number", "strain at failure", nullable=True),
            Field("failure_code", "text", "of ASTM D3039", nullable=True),
            Field("excluded", "truth", "whether it is left out of its batch"),
            CREATED,
        ),
        shown=(
            *("id", "structure.name", "batch.id", "batch.name", "specimen", "standard"),
            *("E_Pa", "G_Pa", "nu", "strength_Pa", "ultimate_strain", "excluded"),
        ),
        facets=("standard", "structure.name"),
    ),
    Noun(
        "monitor",
        "monitors",
        owner="structure",
        fields=(
            ID,
            NAME,
            _one_of("state", State),
            Field("state_since", "time", "since when, UTC"),
            Field("active", "truth", "whether it runs and judges by itself"),
            CREATED,
        ),
        shown=("id", "name", "structure.id", "structure.name", "state", "state_since", "active"),
        facets=("state", "structure.name"),
        hidden=True,
    ),
    Noun(
        "attachment",
        "attachments",
        owner="project",
        fields=(
            ID,
            Field("name", "text", "of the file"),
            Field("caption", "text", "what it shows"),
            Field("media_type", "text", "by its content"),
            Field("size", "whole", "bytes"),
            *(
                Field(each, "id", "of what it is beside", nullable=True)
                for each in attachments.OWNERS
            ),
            CREATED,
        ),
        shown=("id", "name", "caption", "project.name", "size", "created_at"),
        facets=("media_type", "project.name"),
        words=attachments.WORDS,
        made=attachments.present_attachments,
    ),
)

NOUNS = {noun.name: noun for noun in _ALL}
"""By their names in filters."""

_ADDRESSED = (
    "structure", "campaign", "frf", "mode", "result", "coupon", "record", "monitor", "attachment",
)  # fmt: skip
SEARCHED = {f"{name}s": NOUNS[name] for name in _ADDRESSED}
"""Those that have an address, by its last step."""


def lineage(noun: Noun) -> list[Noun]:
    """A noun, its owner, and so on up to the project."""
    return [noun, *(lineage(NOUNS[noun.owner]) if noun.owner else ())]
