"""Monitors of a structure, and their alarms."""

from __future__ import annotations

from typing import Any

from modalbase.client.finding import MONITOR, Kind
from modalbase.objects.thing import Editable, Figure, Table, Thing


class Monitor(Editable):
    """A frozen recipe that runs on a structure's campaigns, with control charts of what it finds."""

    noun = MONITOR

    def run(self, campaign: Any = None, **how: Any) -> list[dict[str, Any]]:
        """Run it now.

        Args:
            campaign: on this one; by default on all that are complete and not yet in the series.
            how: `rerun`, `reason`.
        """
        body = {**({} if campaign is None else {"campaign": getattr(campaign, "id", campaign)}), **how}
        runs: list[dict[str, Any]] = self.lab.connection.post(f"{self.address}/runs", body)["items"]
        return runs

    def runs(self) -> Table:
        """What became of each run."""
        return Table(list(self.lab.connection.pages(f"{self.address}/runs")), key="id")

    def series(self, number: int | None = None) -> dict[str, Any]:
        """Values with their uncertainty, baseline, limits, alarms and campaigns."""
        return self.lab.connection.get(f"{self.address}/series", series=number)

    def figure(self, parameter: str | None = None) -> Figure:
        """The control chart of a parameter; by default of the first one that is watched."""
        return Figure(self.lab, f"{self.address}/series/figure", {"parameter": parameter})

    def alarms(self) -> list[Alarm]:
        """Its alarms, newest first."""
        found = self.lab.connection.pages("alarms", monitor=self.fields["id"])
        return [Alarm(self.lab, fields) for fields in found]


class Alarm(Thing):
    """A change that a monitor has found."""

    noun = Kind("alarm", "alarms/{}", "alarms")

    def acknowledge(self, note: str) -> Alarm:
        """Say that one has seen it, and what is done about it."""
        self.fields = self.lab.rest.acknowledge_alarm(self.fields["id"], body={"note": note})
        return self
