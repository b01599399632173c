"""Routes of what is shown of a forecast: its FRFs, its mesh and its shapes, as those of a result
are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar
from uuid import UUID

from fastapi import Query, Request, Response
from fastapi.responses import FileResponse
from sqlalchemy.orm import Session

from modalbase.formats.frfs import FrfRow
from modalbase.formats.registry import WRITERS
from service.nouns.frfs.data import PredictedTable
from service.nouns.frfs.routes import FILES, MEDIA_TYPES, write_frfs
from service.nouns.structures.model_routes import MESH_FILES, MeshForm
from service.platform.access import CurrentUser, SessionDep, api_router
from service.platform.errors import Conflict
from service.platform.web.downloads import spooled
from service.platform.web.parameters import form_of
from service.reports.space import (
    At,
    ResultMeshOut,
    ShapeOut,
    answer_mesh,
    model_shape,
)
from service.tasks.forecast.task import forecast_arrays, forecast_for

if TYPE_CHECKING:
    from service.tasks.forecast.task import Forecast

router = api_router(tags=["forecasts"])


@dataclass(frozen=True)
class ForecastInSpace:
    """A forecast as it is drawn: without measured modes or trace lines."""

    session: Session
    row: Forecast
    trace_lines: ClassVar[tuple[tuple[int, ...], ...]] = ()

    @cached_property
    def document(self) -> dict[str, Any]:
        """With the model's modes."""
        return {"modes": [], **(self.row.document or {})}

    @cached_property
    def arrays(self) -> Mapping[str, Any]:
        """As of `forecast_arrays`."""
        return forecast_arrays(self.session, self.row)


def _table(session: Session, row: Forecast) -> PredictedTable:
    """The FRFs of a forecast, at points that no campaign has.

    Raises:
        Conflict: it has no result, or nobody stated a damping.
    """
    arrays = forecast_arrays(session, row)
    frequency, values = arrays["frequency_hz"], arrays["frfs"]
    if not frequency.size:
        raise Conflict("this forecast has no FRFs: ask again with a damping_ratio")
    pairs = zip(arrays["responses"].tolist(), arrays["references"].tolist(), strict=True)
    frfs = [
        FrfRow(
            point, along, hit, way, f"{_axis(point, along)} by {_axis(hit, way)}", id=str(row.id)
        )
        for (point, along), (hit, way) in pairs
    ]
    places = dict(
        zip(
            arrays["shape_points"].tolist(),
            map(tuple, arrays["shape_places_m"].tolist()),
            strict=True,
        )
    )
    return PredictedTable(
        frequency_hz=frequency,
        values=values,
        frfs=tuple(frfs),
        description=f"of the nominal model, forecast {row.id}",
        points_of=lambda: places,
    )


def _axis(point: int, direction: int) -> str:
    return f"{point} {'xyz'[direction - 1]}"


@router.get("/forecasts/{forecast_id}/frfs/data", response_class=FileResponse, responses=FILES)  # type: ignore[arg-type]
def get_forecast_frfs(
    forecast_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    form: Annotated[str, form_of(MEDIA_TYPES, "as of measured FRFs; default: by Accept")],
) -> Response:
    """Accelerances of the nominal model: every point to measure by every reference, in the formats
    of measured FRFs.

    Values are in single precision, in the structure's frame. Without a damping ratio there are
    none, and the answer is 409.
    """
    written, table = WRITERS[form], _table(session, forecast_for(session, user, forecast_id))
    name = f"forecast.{written.suffix}"
    return spooled(
        lambda file: write_frfs([table], file, form), written.media_type, name, {"Vary": "Accept"}
    )


@router.get("/forecasts/{forecast_id}/mesh", response_model=ResultMeshOut, responses=MESH_FILES)
def get_forecast_mesh(
    forecast_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    request: Request,
    form: MeshForm,
    at: Annotated[
        At, Query(description="of a file: shapes at the mesh's nodes, or at the chosen points")
    ] = "nodes",
) -> Any:
    """The mesh that was solved, the chosen points on it, and its modes.

    As VTU or UFF (sets 2411, 2412, 55) it has all shapes too, each with its largest displacement 1,
    in the structure's frame.
    """
    shown = ForecastInSpace(session, forecast_for(session, user, forecast_id))
    return answer_mesh(shown, request, form, at, f"forecast-{forecast_id}")


@router.get("/forecasts/{forecast_id}/mesh/shapes")
def get_forecast_shape(
    forecast_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    model: Annotated[int, Query(ge=1, le=10_000, description="number of a mode of the model")] = 1,
) -> ShapeOut:
    """A shape of the nominal model on its mesh, in space."""
    return model_shape(ForecastInSpace(session, forecast_for(session, user, forecast_id)), model)
