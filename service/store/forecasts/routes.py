"""Routes of forecasts."""

from uuid import UUID

from pydantic import Field

from service.jobs.resource import JobOut
from service.jobs.routes import JobRoutes
from service.store.forecasts.operations import FORECASTS, ForecastIn, start_forecast
from service.web import StrictModel, api_router

router = api_router(tags=["forecasts"])


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


of_jobs = JobRoutes(
    router,
    FORECASTS,
    ForecastOut,
    "forecast_id",
    lambda _, rows: [{"found": row.document} for row in rows],
)


of_jobs.creating(
    "forecast",
    """Queue a forecast: modes of the nominal model, where to hit, where to measure, and FRFs where damping is stated.

    Nothing needs to be measured before. `{}` gives the ten lowest modes.
    """,
    ForecastIn,
    start_forecast,
    status=202,
)
of_jobs.listing("list_forecasts", "Forecasts of a structure, newest first.")
of_jobs.getting("get_forecast", "How far a forecast is, and what the model says.")
of_jobs.cancelling(
    "cancel_forecast", "Ask for a forecast's end; one that has ended already stays as it is."
)
