"""Finite element models that were sent to a structure."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from modalbase.client.files import save_file
from modalbase.client.finding import Kind
from modalbase.objects.jobs import Job
from modalbase.objects.thing import Table


class Model(Job):
    """A finite element model that was sent to a structure."""

    noun = Kind("model", "models/{}", "structures/{}/models")

    @property
    def sets(self) -> Table:
        """Its sets of elements: materials, area or length, thickness, mass."""
        return Table(self._found["sets"], key="name")

    @property
    def materials(self) -> Table:
        """Its materials with their constants, SI."""
        return Table([{"name": one["name"], **one["constants"]} for one in self._found["materials"]], key="name")

    @property
    def junctions(self) -> Table:
        """Lines along which walls meet, with the model of their joint."""
        return Table(self._found["junctions"])

    @property
    def ignored(self) -> Table:
        """Cards that were not used, and what is lost by that."""
        return Table(self._found["ignored"])

    @property
    def _found(self) -> dict[str, Any]:
        found: dict[str, Any] = self.wait().check().fields["found"]
        return found

    def save(self, file: str | Path) -> Path:
        """Write the deck as it was sent."""
        return save_file(self.lab.connection, f"structures/{self.fields['structure_id']}/model/original", file)

    def summary(self) -> str:
        """What was read, or why it was not."""
        if not self.succeeded:
            return super().summary()
        found = self.fields["found"]
        sets = ", ".join(f"{one['name']} ({one['mass_kg']:.4g} kg)" for one in found["sets"])
        counts = ", ".join(f"{count} {name}" for name, count in found["counts"].items() if count)
        lost = [f"{one['card']} was not used: {one['loss']}" for one in found["ignored"]]
        joints = f"{len(found['junctions'])} lines where walls meet"
        return "\n".join([f"{self.fields['filename']}: {counts}", f"sets: {sets}", joints, *lost])
