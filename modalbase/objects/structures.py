"""What a structure has beside its campaigns: coupon tests, models that were sent, forecasts,
monitors with their alarms.
"""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from datetime import datetime
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from modalbase.formats.registry import FRF_SUFFIXES
from modalbase.objects.files import MESH_FORMATS, format_of, save_file
from modalbase.objects.finding import BATCH, MONITOR, Kind
from modalbase.objects.jobs import FIRST_PAUSE, GROWTH, LONGEST_PAUSE, Job, Stoppable
from modalbase.objects.thing import Attached, Editable, Figure, Table, Thing

if TYPE_CHECKING:
    from modalbase.objects.frfs import Frfs


class CouponBatch(Thing):
    """Coupons of one plate and direction, tested to ASTM D3039 or D3518."""

    noun = BATCH

    def add_curve(
        self,
        file: str | Path,
        *,
        confirm: bool = False,
        body: Mapping[str, Any] | None = None,
        **about: Any,
    ) -> dict[str, Any]:
        """Add a specimen from a testing machine's file.

        Args:
            file: CSV of the machine.
            confirm: take unusual dimensions and results as they are.
            body: as REST has it, to which `about` is added.
            about: `dimensions`, `columns`, and where needed `standard`, `specimen` (by default the
                file's name) and the others of `POST /coupon-batches/{id}/coupons`.

        Raises:
            ClientError: the file cannot be read so; the text says what is missing.
        """
        path = Path(file)
        coupon = {"specimen": path.stem, **(body or {}), **about}
        fields = {"coupon": json.dumps(coupon)}
        answer = self.lab.connection.submit(
            f"{self.address}/coupons", path, fields, confirm=confirm or None
        )
        made: dict[str, Any] = answer["items"][0]
        return made

    def add_coupon(self, specimen: str, *, confirm: bool = False, **results: Any) -> dict[str, Any]:
        """Add a specimen whose results are known: `E_Pa`, `G_Pa`, `nu`, `strength_Pa`, `standard`
        and so on; with `confirm` unusual ones too.
        """
        body = {"specimen": specimen, **results}
        made: dict[str, Any] = self._post("coupons", body, confirm)["items"][0]
        return made

    def coupons(self) -> Table:
        """Its specimens with their results, SI."""
        return Table(self._pages("coupons"), key="specimen")

    def summary(self) -> dict[str, Any]:
        """Statistics of the batch, the priors that follow, and warnings."""
        return self._get("summary")

    @property
    def statistics(self) -> Table:
        """Mean, standard deviation and coefficient of variation of each constant."""
        return Table(
            [{"name": name, **value} for name, value in self.summary()["constants"].items()]
        )

    def curve(self, specimen: str) -> dict[str, Any]:
        """The raw curve of a specimen as numpy arrays in SI: force in N, strains in m/m, time in s,
        where it has them.
        """
        import numpy as np

        content = self.lab.rest.get_curve_data(self.coupons()[specimen]["id"], format="npz")
        with np.load(BytesIO(content)) as arrays:
            return {name: arrays[name] for name in arrays.files}


class Model(Job):
    """A finite element model that was sent to a structure."""

    noun = Kind("model", "models/{}", "structures/{}/models")

    @property
    def sets(self) -> Table:
        """Its sets of elements: materials, area or length, thickness, mass."""
        return Table(self._document["sets"], key="name")

    @property
    def materials(self) -> Table:
        """Its materials with their constants, SI."""
        return Table(
            [{"name": one["name"], **one["constants"]} for one in self._document["materials"]],
            key="name",
        )

    @property
    def junctions(self) -> Table:
        """Lines along which walls meet, with the model of their joint."""
        return Table(self._document["junctions"])

    @property
    def ignored(self) -> Table:
        """Cards that were not used, and what is lost by that."""
        return Table(self._document["ignored"])

    def save(self, file: str | Path) -> Path:
        """Write the deck as it was sent."""
        return save_file(
            self.lab.connection, f"structures/{self.fields['structure_id']}/model/original", file
        )

    def summary(self) -> str:
        """What was read, or why it was not."""
        if not self.succeeded:
            return super().summary()
        document = self.fields["found"]
        sets = ", ".join(f"{one['name']} ({one['mass_kg']:.4g} kg)" for one in document["sets"])
        counts = ", ".join(f"{count} {name}" for name, count in document["counts"].items() if count)
        lost = [f"{one['card']} was not used: {one['loss']}" for one in document["ignored"]]
        joints = f"{len(document['junctions'])} lines where walls meet"
        return "\n".join([f"{self.fields['filename']}: {counts}", f"sets: {sets}", joints, *lost])


class Forecast(Stoppable):
    """The solving of a structure's nominal model."""

    noun = Kind("forecast", "forecasts/{}", "structures/{}/forecasts")

    @property
    def modes(self) -> Table:
        """Its modes: frequency in Hz, kind, and how much of each the references and the points
        show.
        """
        return Table(self._document["model_modes"], key="number")

    @property
    def points(self) -> Table:
        """Where to hit and where to measure, m."""
        return Table(self._document["points"], key="label")

    def frfs(self) -> Frfs:
        """Accelerances of the model, as numpy arrays: every point to measure by every reference.

        Raises:
            ClientError: no `damping_ratio` was stated.
        """
        from modalbase.objects.frfs import Frfs

        self.wait().check()
        return Frfs.from_npz(self.lab.rest.get_forecast_frfs(self.fields["id"], format="npz"))

    def save_frfs(self, file: str | Path) -> Path:
        """Write the FRFs: `.uff` with sets 2411 and 58b, `.npz`, `.h5`, `.csv`, `.arrow`, `.parquet` or `.json`.

        Raises:
            ClientError: the name says no format, or no `damping_ratio` was stated.
        """
        return self._written("frfs/data", file, FRF_SUFFIXES)

    def shapes(self, file: str | Path, *, at: str = "nodes") -> Path:
        """Write the mesh with the mode shapes: `.vtu` for viewers, or `.uff` with sets 2411, 2412
        and 55.

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
        return self._save(part, file, formats, **query)

    def summary(self) -> str:
        """Where to hit, and the modes; or why there are none."""
        return (
            f"{self._document['sentence']}\n{self.modes}" if self.succeeded else super().summary()
        )


def _time(stamp: str) -> datetime:
    return datetime.fromisoformat(stamp)


class Monitor(Attached, Editable):
    """A frozen recipe that runs on a structure's campaigns, with control charts of what it
    finds.
    """

    noun = MONITOR

    def run(self, campaign: Any = None, **how: Any) -> list[dict[str, Any]]:
        """Run it now.

        Args:
            campaign: on this one; by default on all that are complete and not yet in the series.
            how: `rerun`, `reason`.
        """
        on = {} if campaign is None else {"campaign": getattr(campaign, "id", campaign)}
        runs: list[dict[str, Any]] = self._post("runs", {**on, **how})["items"]
        return runs

    def runs(self) -> Table:
        """What became of each run."""
        return Table(self._pages("runs"), key="id")

    def wait(self) -> Self:
        """Wait until every run has ended and what they gave is judged; returns itself.

        It is asked for at growing intervals, from 50 ms to a second. A monitor that never runs is
        waited for without end.

        Raises:
            ClientError: the service does not answer.
        """
        pause = FIRST_PAUSE
        while not self._judged():
            time.sleep(pause)
            pause = min(pause * GROWTH, LONGEST_PAUSE)
        return self.refresh()

    def _judged(self) -> bool:
        runs, series = self._pages("runs"), self.series(limit=1)
        if any(run["state"] == "running" for run in runs):
            return False
        status = (series["judgement"] or {"status": None})["status"]
        ended = [_time(run["finished_at"]) for run in runs if run["finished_at"] is not None]
        if not ended or status in (None, "queued", "running"):
            return False
        if status != "succeeded":
            return True
        # of the same answer, but read a moment before the state: it may be that of before
        assessed = series["assessed_at"]
        return assessed is not None and _time(assessed) >= max(ended)

    def series(self, number: int | None = None, **part: Any) -> dict[str, Any]:
        """Values with their uncertainty, baseline, limits, alarms and campaigns.

        Args:
            number: version of the series; default: the one that is judged.
            part: `from`, `to`, `limit`, `stride`; default: up to 1,000 campaigns of all.
        """
        return self._get("series", series=number, **part)

    def rows(self, *parameters: str) -> Table:
        """The series as flat rows, a value each, of some parameters or of all."""
        return Table(self._pages("series/rows", parameter=list(parameters) or None))

    def figure(self, parameter: str | None = None, over: str | None = None) -> Figure:
        """The control chart of a parameter, by default of the first one that is watched; with
        `over` the parameter over a covariate, before and after it was taken out.
        """
        return Figure(self.lab, self._at("series/figure"), {"parameter": parameter, "over": over})

    def alarms(self) -> list[Alarm]:
        """Its alarms, newest first."""
        rows = self.lab.connection.pages("alarms", monitor=self.fields["id"])
        return [Alarm(self.lab, fields) for fields in rows]


class Alarm(Thing):
    """A change that a monitor has found."""

    noun = Kind("alarm", "alarms/{}", "alarms")

    def acknowledge(self, note: str, *, together: bool = False) -> Alarm:
        """Say that one has seen it, and what is done about it.

        Args:
            note: for others.
            together: with all alarms of this monitor that the same campaign raised.
        """
        body = {"note": note, **({"together": True} if together else {})}
        self.fields = self.lab.rest.acknowledge_alarm(self.fields["id"], body=body)
        return self
