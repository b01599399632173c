"""Forecasts: what a structure's nominal model says before anything is measured."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from modalbase.client.files import FRF_FORMATS, MESH_FORMATS, format_of, save_file
from modalbase.client.finding import Kind
from modalbase.objects.jobs import Stoppable
from modalbase.objects.thing import Table

if TYPE_CHECKING:
    from modalbase.objects.frfs import Frfs


class Forecast(Stoppable):
    """The solving of a structure's nominal model."""

    noun = Kind("forecast", "forecasts/{}", "structures/{}/forecasts")

    @property
    def modes(self) -> Table:
        """Its modes: frequency in Hz, kind, and how much of each the references and the points show."""
        return Table(self._found["model_modes"], key="number")

    @property
    def points(self) -> Table:
        """Where to hit and where to measure, m."""
        return Table(self._found["points"], key="label")

    @property
    def _found(self) -> dict[str, Any]:
        found: dict[str, Any] = self.wait().check().fields["found"]
        return found

    def frfs(self) -> Frfs:
        """Accelerances of the model, as numpy arrays: every point to measure by every reference.

        Raises:
            ClientError: no `damping_ratio` was stated.
        """
        from modalbase.objects.frfs import Frfs

        self.wait().check()
        return Frfs.from_npz(self.lab.rest.get_forecast_frfs(self.fields["id"], format="npz"))

    def save_frfs(self, file: str | Path) -> Path:
        """Write the FRFs: `.uff` with sets 2411 and 58b, `.npz`, `.csv`, `.arrow` or `.json`.

        Raises:
            ClientError: the name says no format, or no `damping_ratio` was stated.
        """
        return self._written("frfs/data", file, FRF_FORMATS)

    def shapes(self, file: str | Path, *, at: str = "nodes") -> Path:
        """Write the mesh with the mode shapes: `.vtu` for viewers, or `.uff` with sets 2411, 2412 and 55.

        Args:
            file: what to write; the coordinates are the structure's.
            at: `nodes` of the mesh, or the chosen `points`.

        Raises:
            ClientError: the name says no format.
        """
        return self._written("mesh", file, MESH_FORMATS, at=at)

    def _written(self, part: str, file: str | Path, formats: dict[str, str], **query: Any) -> Path:
        format_of(Path(file), formats)  # before one waits
        self.wait().check()
        return save_file(self.lab.connection, f"{self.address}/{part}", file, formats, **query)

    def summary(self) -> str:
        """Where to hit, and the modes; or why there are none."""
        return f"{self._found['sentence']}\n{self.modes}" if self.succeeded else super().summary()
