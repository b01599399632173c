"""Forecasts: what a client may ask of a nominal model, the job that solves it, and what it says."""

import io
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any
from uuid import UUID

import numpy as np
from pydantic import AfterValidator, Field
from sqlalchemy import ForeignKey, Index, LargeBinary
from sqlalchemy.orm import Mapped, Session, mapped_column

from fecore.body.constants import Body
from fecore.updating.forecasts import MOST_MODES, ForecastOrder
from service.nouns.campaigns.schemas import Boundary, GridPoint, labels_once
from service.nouns.storage import book, require_room
from service.nouns.structures.models import load_model
from service.nouns.structures.operations import (
    describe_version,
    present_structure,
    structure_for,
    version_of,
)
from service.nouns.structures.schemas import StructureIn
from service.nouns.updates.bodies import body_for, usual_boundary
from service.nouns.updates.schemas import USUAL
from service.platform.access import Lookup, User
from service.platform.db.base import Base
from service.platform.errors import Invalid
from service.platform.queue.kinds import CORE_LIBRARIES
from service.platform.queue.resource import JobNoun, JobOut, require_result
from service.platform.web import LongList, RequestModel, StrictModel, example
from service.tasks.forecast.compute import ForecastInputs, ForecastOutput, compute_forecast
from service.tasks.task import Card, Ordered, Task

Hertz = Annotated[float, Field(gt=0, le=1e6, description="Hz")]


class ForecastPointIn(GridPoint):
    """A point that could be hit or measured, in the structure's frame."""

    direction: int | None = Field(
        None,
        ge=1,
        le=3,
        description="1, 2, 3 along x, y, z; default: that in which the modes move it most",
    )


class ForecastIn(RequestModel):
    """What to solve; `{}` gives the ten lowest modes and twelve points that show them."""

    model_config = example(damping_ratio=0.01)

    boundary: Boundary | None = Field(
        None,
        description=(
            "default: cantilever; of a model that was sent free, and as_modelled with its own"
            " supports"
        ),
    )
    modes: int | None = Field(
        None,
        ge=1,
        le=MOST_MODES,
        description=(
            "how many of the lowest, where no band is stated; default: 10, or all where there are"
            " fewer"
        ),
    )
    highest_hz: Hertz | None = Field(
        None, description="of the band; all modes in it are solved for, so `modes` is left out"
    )
    points: Annotated[LongList[ForecastPointIn], AfterValidator(labels_once)] | None = Field(
        None,
        min_length=1,
        max_length=2000,
        description="that can be hit or measured; default: nodes of the mesh, far apart",
    )
    points_to_measure: int = Field(12, ge=1, le=500, description="how many of them to choose")
    references: int = Field(
        1,
        ge=1,
        le=20,
        description="how many places to choose where one hits all the time, or where sensors stay",
    )
    damping_ratio: float | None = Field(
        None, gt=0, lt=1, description="of all modes; states it who wants FRFs"
    )
    line_spacing_hz: Hertz | None = Field(
        None,
        description=(
            "of the FRFs; default: four lines in the half-power width of the first mode, 20,000"
            " lines at most"
        ),
    )

    def to_core(self) -> ForecastOrder:
        """The core's order."""
        own = self.points
        return ForecastOrder(
            modes=self.modes,
            highest_hz=self.highest_hz,
            places=None if own is None else np.array([(p.x_m, p.y_m, p.z_m) for p in own]),
            labels=None if own is None else [p.label for p in own],
            axes=None if own is None else np.array([p.direction or 0 for p in own]),
            points=self.points_to_measure,
            references=self.references,
            damping_ratio=self.damping_ratio,
            spacing_hz=self.line_spacing_hz,
        )


class ForecastModeOut(StrictModel):
    """A mode of the nominal model."""

    number: int = Field(description="from 1, rigid-body modes left out")
    frequency_hz: float = Field(description="on the structure's own mesh, Hz")
    finer_mesh_hz: float | None = Field(
        None,
        description=(
            "on a finer mesh, Hz; null of strips, whose mesh is fine, and where the mesh is taken"
            " on trust"
        ),
    )
    kind: str = Field(
        description="bending, torsion, in-plane; of a body in space also axial and walls"
    )
    share_at_references: float = Field(
        description="of its largest displacement, at the reference that shows it best"
    )
    share_at_points: float = Field(
        description="of its largest displacement, at the point that shows it best"
    )


class ForecastPointOut(StrictModel):
    """A point that was chosen."""

    label: int = Field(description="as stated; else the number of the mesh's node")
    x_m: float = Field(description="in the structure's frame, m")
    y_m: float = Field(description="in the structure's frame, m")
    z_m: float = Field(description="in the structure's frame, m")
    direction: int = Field(description="1, 2, 3 along x, y, z")
    reference: bool = Field(
        description="whether one hits there all the time, or a sensor stays there"
    )
    measured: bool = Field(description="whether it is one of the points to measure")
    least_share: float = Field(
        description="of its largest displacement, of the mode that it shows least"
    )


class ForecastFoundOut(StrictModel):
    """What the nominal model says."""

    rigid_modes: int = Field(description="motions of the whole body that nothing resists")
    model_modes: list[ForecastModeOut] = Field(description="elastic modes, the lowest first")
    points: list[ForecastPointOut] = Field(description="where to hit and where to measure")
    largest_mac: float | None = Field(
        description=(
            "between two modes at the points to measure: near 1 these do not distinguish them"
        )
    )
    sentence: str = Field(description="where to hit and what it shows, in words")
    frfs: int = Field(
        description=(
            "how many `frfs/data` has: each point to measure by each reference; 0 without damping"
        )
    )
    lines: int = Field(description="of each")
    line_spacing_hz: float | None = Field(description="Hz; null without damping")
    damping_ratio: float | None = Field(description="that was stated")


class ForecastOut(JobOut):
    """A forecast: how far it is, and what the model says."""

    structure_id: UUID
    structure_version_id: UUID
    request: ForecastIn = Field(description="what was asked")
    found: ForecastFoundOut | None = Field(description="null until it has succeeded")


class Forecast(Ordered, Base):
    """A forecast, and what was found when it was; its key is its job's."""

    __tablename__ = "forecasts"
    __table_args__ = (Index(None, "structure_id", "id"),)

    structure_id: Mapped[UUID] = mapped_column(ForeignKey("structures.id", ondelete="CASCADE"))
    structure_version_id: Mapped[UUID] = mapped_column(
        ForeignKey("structure_versions.id", deferrable=True)
    )
    arrays: Mapped[bytes | None] = mapped_column(LargeBinary, deferred=True)


def _load(session: Session, row: Forecast, _workspace: Path) -> ForecastInputs:
    structure = describe_version(version_of(session, row.structure_version_id), "")
    request = ForecastIn.model_validate(row.request)
    labels: tuple[int, ...] | None = None
    if request.points is not None:
        labels = tuple(point.label for point in request.points)
    elif structure.model is not None:
        labels = tuple(load_model(session, structure.model).numbers.tolist())
    return ForecastInputs(_body(session, structure, request), request.to_core(), labels)


def _body(session: Session, structure: StructureIn, request: ForecastIn) -> Body:
    return body_for(session, structure, request.boundary or usual_boundary(structure), USUAL)


def _store(session: Session, row: Forecast, items: Iterator[ForecastOutput]) -> None:
    for output in items:
        book(
            session,
            structure_for,
            structure_for.row(session, row.structure_id),
            "results",
            len(output.arrays),
        )
        row.document, row.arrays = output.document, output.arrays


forecast_for = Lookup(Forecast, "forecast", "structure_id", structure_for)
FORECASTS = JobNoun(
    "forecasts", forecast_for, _load, compute_forecast, _store, libraries=CORE_LIBRARIES
)


def start_forecast(
    session: Session, user: User, structure_id: UUID, request: ForecastIn
) -> Forecast:
    """Queue a forecast of a structure as it is now, in the caller's transaction.

    Raises:
        Invalid: both a number of modes and a band are stated.
        InputError: the structure lacks what a model needs, or the boundary is none of it.
        QuotaExceeded: the project has no room for a result.
    """
    if request.modes is not None and request.highest_hz is not None:
        raise Invalid(
            "/modes",
            "is stated beside `highest_hz`, whose band has all its modes solved for: leave one out",
        )
    structure = structure_for(session, user, structure_id, "editor")
    version, described = present_structure(session, structure.id)
    _body(session, described, request)
    require_room(session, structure.project_id)
    row = Forecast(
        structure_id=structure.id,
        structure_version_id=version.id,
        request=request.model_dump(mode="json"),
    )
    return FORECASTS.start(session, user, row)


def forecast_arrays(session: Session, row: Forecast) -> Mapping[str, Any]:
    """The arrays of a forecast: mesh, shapes and FRFs, by the names of a result's.

    Raises:
        Conflict: it has none, yet or ever.
    """
    with np.load(
        io.BytesIO(require_result(session, forecast_for, row, row.arrays)), allow_pickle=False
    ) as arrays:
        return dict(arrays)


TASK = Task(
    FORECASTS,
    about=(
        "forecasts",
        "Modes of a structure before it is measured: which there are, and where to hit.",
    ),
    text="""Queue a forecast: modes of the nominal model, where to hit, where to measure, and FRFs where damping is stated.

    Nothing needs to be measured before. `{}` gives the ten lowest modes.
    """,
    request=ForecastIn,
    answer=ForecastOut,
    start=start_forecast,
    says="what the model says",
    card=Card("Before it is measured", "Solve", template="forecast/page.html"),
)
