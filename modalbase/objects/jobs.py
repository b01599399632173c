"""Jobs, what a worker does from queue to end, and what they find: mode sets and results."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self
from urllib.parse import quote

from modalbase.client.display import stages
from modalbase.client.errors import ClientError, Exit, JobFailed
from modalbase.client.results import (
    beside_lines,
    mode_cells,
    mode_set_cells,
    parameter_cells,
    verdict_lines,
)
from modalbase.formats.registry import FRF_SUFFIXES
from modalbase.objects.files import MESH_FORMATS, REPORTS, SOLVERS
from modalbase.objects.finding import MODE_SET, Kind, find_job, uuid_of
from modalbase.objects.thing import Access, Addressed, Attached, Figure, Table, Thing

if TYPE_CHECKING:
    from modalbase.client.connection import Connection
    from modalbase.objects.frfs import Frfs


ENDED = ("succeeded", "failed", "cancelled")
FIRST_PAUSE, LONGEST_PAUSE, GROWTH = 0.05, 1.0, 1.3  # s

Watch = Callable[[str, float], None]
"""Called with a job's stage and the share that is done."""

COLUMNS = (
    "number",
    "frequency_hz",
    "damping_ratio",
    "frequency_sd_hz",
    "damping_sd",
    "probability",
)


class ModeSet(Thing):
    """Modes of a campaign that were typed in, read from a file, or identified; printing it shows
    all that is known of them.
    """

    noun = MODE_SET

    def __str__(self) -> str:
        return "\n".join([str(self.modes), *beside_lines(self.fields["details"])])

    @property
    def modes(self) -> Table:
        """Frequencies in Hz, damping ratios, their standard deviations, and the probability that
        each is a mode.
        """
        rows = [{name: mode.get(name) for name in COLUMNS} for mode in self.fields["modes"]]
        return Table(rows, key="number", shown=mode_set_cells(rows))

    @property
    def doubtful(self) -> Table:
        """Uncertain poles of an identification, each with its `probability` and `reason`; none of a
        set from elsewhere.
        """
        return Table(self.fields["details"].get("doubtful", []), key="frequency_hz")

    @property
    def warnings(self) -> list[str]:
        """What to know of an identification before one uses it; none of a set from elsewhere."""
        return list(self.fields["details"].get("warnings", ()))

    def export(self, file: str | Path, file_format: str | None = None) -> Path:
        """Write it to a file in the format that is stated or that its name says: `.uff` with sets
        15 and 55, `.json`; `-` is standard output.

        Raises:
            ClientError: the name says no format, or the service has no modes in it.
        """
        return self._save("", file, FRF_SUFFIXES, format=file_format)

    def plot(self) -> Figure:
        """Its shapes at the measured points, shown in a notebook."""
        return Figure(self.lab, f"{self.address}/figures/shapes", {})

    def edit(
        self,
        *,
        keep: Mapping[float, str] | None = None,
        drop: Mapping[float, str] | None = None,
        name: str,
    ) -> ModeSet:
        """A new mode set with poles kept and dropped by hand; it records who decided what and why.

        Args:
            keep: frequency in Hz of uncertain or refused poles to keep, each with the reason.
            drop: frequency in Hz of modes to drop, each with the reason.
            name: of the new set.

        Raises:
            ClientError: a frequency names no pole of the set, or no mode is left.
            TypeError: frequencies have no reasons.
        """
        both = ((True, keep or {}), (False, drop or {}))
        if not all(isinstance(poles, Mapping) for _, poles in both):
            raise TypeError(
                "keep and drop take each frequency in Hz with a reason, as {25.6: 'hum of the"
                " mains'}"
            )
        decisions = [
            {"frequency_hz": hz, "keep": which, "reason": why}
            for which, poles in both
            for hz, why in poles.items()
        ]
        return ModeSet(self.lab, self._post("edits", {"name": name, "decisions": decisions}))

    @property
    def frequency_hz(self) -> Any:
        """(M,) numpy array."""
        import numpy as np

        return np.array([mode["frequency_hz"] for mode in self.fields["modes"]])

    @property
    def damping_ratio(self) -> Any:
        """(M,) numpy array, NaN where a mode has none."""
        import numpy as np

        return np.array([mode["damping_ratio"] for mode in self.fields["modes"]], dtype=float)

    def shapes(self) -> tuple[list[tuple[int, int]], Any]:
        """N degrees of freedom as (point, direction), and the shapes, complex (M, N), NaN where a
        value is not known.
        """
        import numpy as np

        dofs = sorted(
            {
                (v["point"], v["direction"])
                for mode in self.fields["modes"]
                for v in mode["shape"] or ()
            }
        )
        place = {dof: i for i, dof in enumerate(dofs)}
        values = np.full((len(self.fields["modes"]), len(dofs)), np.nan, dtype=complex)
        for row, mode in zip(values, self.fields["modes"], strict=True):
            for value in mode["shape"] or ():
                row[place[value["point"], value["direction"]]] = complex(
                    value["real"], value["imag"]
                )
        return dofs, values


class Drawn(Addressed):
    """What has the figures of an update's result."""

    def figure(self, name: str, **options: Any) -> Figure:
        """A figure, shown in a notebook; `figures()` lists the names.

        Args:
            name: such as `frf` or `mac`.
            options: `point` and `reference` of the FRF, `fmin`, `fmax`, `theme` (`light`, `dark`).
        """
        return Figure(self.lab, self._at(f"figures/{quote(name, safe='')}"), options)

    def figures(self) -> Table:
        """The figures, and which of them this result can be drawn as."""
        return Table(self._get("figures")["items"])


class Result(Drawn):
    """The result of an update job; printing it shows the verdict, the warnings and the parameters.

    Attributes:
        lab: where it is of.
        job: id of the job.
        document: the whole as REST gives it, SI; `result["modes"]` is a part of it.
    """

    def __init__(self, lab: Access, job: str, document: Mapping[str, Any]) -> None:
        self.lab, self.job, self.document = lab, job, document

    @property
    def address(self) -> str:
        """Path of its job below `/api/v1/`."""
        return f"update-jobs/{self.job}"

    def __getitem__(self, name: str) -> Any:
        return self.document[name]

    def __str__(self) -> str:
        warnings = [f"warning: {one}" for one in self.warnings]
        return "\n".join([*verdict_lines(self.document), *warnings, str(self.parameters)])

    def __repr__(self) -> str:
        return f"<Result of update {self.job}: {self.verdict}>"

    def _repr_html_(self) -> str:
        lines = [*verdict_lines(self.document), *(f"warning: {one}" for one in self.warnings)]
        return "<br>".join(map(escape, lines)) + self.parameters._repr_html_()

    @property
    def verdict(self) -> str:
        """`usable`, `with_care` or `do_not_use`; empty where an earlier version made the result."""
        return str((self.document.get("verdict") or {"level": ""})["level"])

    @property
    def warnings(self) -> list[str]:
        """What to know before one uses it, the gravest first."""
        return list(self.document["warnings"])

    @property
    def parameters(self) -> Table:
        """Each parameter with estimate, standard deviation, interval and whether the data identify
        it; SI in the rows.
        """
        rows = self.document["parameters"]
        return Table(rows, shown=parameter_cells(rows))

    @property
    def curve(self) -> Table:
        """Constants over temperature, where they are asked for at another than the campaign's: SI,
        `_low` and `_high` the ends of 95 % intervals; else no rows.
        """
        curve = self.document.get("curve") or {"temperature_c": [], "constants": []}
        ends = {"": "estimate", "_low": "low", "_high": "high"}
        columns = {
            each["name"] + end: each[of] for each in curve["constants"] for end, of in ends.items()
        }
        rows = enumerate(curve["temperature_c"])
        return Table(
            [
                {"temperature_c": at, **{name: column[k] for name, column in columns.items()}}
                for k, at in rows
            ]
        )

    @property
    def modes(self) -> Table:
        """Each mode: measured, initial, updated frequency in Hz, MAC, damping ratios."""
        rows = self.document["modes"]
        return Table(rows, key="number", shown=mode_cells(rows))

    def deck(self, file: str | Path) -> Path:
        """Write the deck that was sent as the structure's model, with the updated numbers.

        Args:
            file: what to write.

        Raises:
            ClientError: the structure is no model that was sent, or the result has no elastic
                constants.
        """
        return self._save("deck", file)

    def shapes(self, file: str | Path, *, at: str = "nodes") -> Path:
        """Write the mesh with the mode shapes of the updated model and the measured ones, for other
        programs.

        Args:
            file: `.vtu` for viewers, or `.uff` with sets 2411, 2412 and 55; the coordinates are the
                structure's.
            at: `nodes` of the mesh, the measured shapes expanded; or the measured `points`.

        Raises:
            ClientError: the name says no format, or the result keeps no shapes.
        """
        return self._save("mesh", file, MESH_FORMATS, at=at)


class Job(Thing):
    """Something that a worker does."""

    def __repr__(self) -> str:
        return f"<{self.noun.word} {self.fields['id']} {self.fields['status']}>"

    @property
    def ended(self) -> bool:
        """Whether it has ended, in whatever way, when it was last fetched."""
        return self.fields.get("status") in ENDED

    @property
    def succeeded(self) -> bool:
        """Whether it has succeeded, when it was last fetched."""
        return bool(self.fields["status"] == "succeeded")

    def wait(self, watch: Watch | None = None) -> Self:
        """Wait until it has ended, in whatever way, with a bar in a terminal and in a notebook;
        returns itself.

        It is asked for at growing intervals, from 50 ms to a second.

        Args:
            watch: called with the stage and the share that is done, for a bar of one's own.

        Raises:
            ClientError: the service does not answer.
        """
        if self.ended:
            return self
        pause = FIRST_PAUSE
        with stages(self._title) as show:
            while True:
                show(self.refresh().fields)
                if watch is not None:
                    watch(
                        self.fields["stage"] or self.fields["status"],
                        self.fields["progress"] or 0.0,
                    )
                if self.fields["status"] in ENDED:
                    return self
                time.sleep(pause)
                pause = min(pause * GROWTH, LONGEST_PAUSE)

    @property
    def _title(self) -> str:
        """What stands beside its bar."""
        return self.noun.word

    def check(self, what: str | None = None) -> Self:
        """Itself, where it has succeeded.

        Args:
            what: begins the error; by default its noun and its id.

        Raises:
            JobFailed: with the reason that it states.
        """
        if not self.succeeded:
            name = what or f"{self.noun.word} {self.fields['id']}"
            raise JobFailed(f"{name} {self.fields['status']}: {self._reason}", self.fields)
        return self

    @property
    def _reason(self) -> str:
        """Why it did not succeed, in the service's words."""
        error = self.fields["error"] or {}
        return str(error.get("detail") or self.fields["message"] or "no reason given")

    @property
    def _document(self) -> dict[str, Any]:
        """What it found; waits for it."""
        document: dict[str, Any] = self.wait().check().fields["found"]
        return document

    def summary(self) -> str:
        """How it stands, in words."""
        if self.ended and not self.succeeded:
            return f"{self.noun.word} {self.fields['status']}: {self._reason}"
        return f"{self.noun.word}: {self.fields['stage'] or self.fields['status']}"


class Import(Job):
    """The reading of a file."""

    noun = Kind("import", "imports/{}", "campaigns/{}/imports")

    @classmethod
    def _id_of(cls, _service: Connection, which: str, _within: str | None, /) -> str:
        if (id_ := uuid_of(which)) is None:
            raise ClientError(
                f"{which!r} is no id of an import; `modalbase import` prints them", Exit.USAGE
            )
        return id_

    @property
    def _title(self) -> str:
        return str(self.fields["filename"])

    def records(self) -> dict[str, Any]:
        """What it read of hits: `items`, the time blocks, and `hits`, the judgement of each hit."""
        return self._get("records")

    def save(self, file: str | Path) -> Path:
        """Write the file as it was sent; `-` is standard output."""
        return self._save("original", file)

    def summary(self) -> str:
        """What was read, what was refused and why."""
        if not self.succeeded:
            return super().summary()
        counts = ", ".join(
            f"{n} {name.replace('_', ' ')}" for name, n in (self.fields["counts"] or {}).items()
        )
        refused = [
            f"dataset {one['number']} (type {one['type']}) refused: {one['reason']}"
            for one in self.fields["datasets"]
            if one["outcome"] == "refused"
        ]
        return "\n".join(
            [f"{self.fields['filename']}: {counts}", *refused, *self.fields["warnings"]]
        )


class Processing(Job):
    """From time blocks to FRFs, and from recordings of responses to half spectra."""

    noun = Kind("processing", "processings/{}", "campaigns/{}/processings")


class Stoppable(Job):
    """A job that can be asked to end."""

    def cancel(self) -> Self:
        """Ask for its end."""
        self.fields = self._call("POST", "cancel")
        return self


class Identification(Stoppable):
    """From FRFs or half spectra to modes."""

    noun = Kind("identification", "identifications/{}", "campaigns/{}/identifications")

    def mode_set(self) -> ModeSet:
        """The modes that it found; waits for them.

        Raises:
            JobFailed: it found none; the text says why.
        """
        id_ = self.wait().check().fields["mode_set"]
        return ModeSet(self.lab, self.lab.connection.get(ModeSet.noun.path.format(id_)))


class UpdateJob(Attached, Drawn, Stoppable):
    """The updating of a structure's model to a campaign."""

    noun = Kind("update", "update-jobs/{}", "campaigns/{}/update-jobs")

    @classmethod
    def _id_of(cls, service: Connection, which: str, _within: str | None, /) -> str:
        return find_job(service, which)

    def result(self, *, wait: bool = True) -> Result:
        """The result.

        Args:
            wait: for it; else the service says why there is none yet.

        Raises:
            JobFailed: the job did not succeed; the text is the reason that it states.
            ClientError: there is no result, which is not waited for.
        """
        if wait:
            self.wait().check()
        return Result(self.lab, self.fields["id"], self._get("result"))

    def report(self, file: str | Path) -> Path:
        """Write its report: verdict, parameters, correlation, what to do; the data as annex.

        Args:
            file: `.pdf` or `.html`.

        Raises:
            ClientError: the name says neither, or the job has no result.
        """
        return self._save("report", file, REPORTS)

    def summary(self) -> str:
        """Verdict, warnings and parameters of a job that has succeeded, the reason of one that
        failed, else its stage.
        """
        return str(self.result()) if self.succeeded else super().summary()

    def retry(self) -> Self:
        """Queue it again, where it failed or was cancelled."""
        self.fields = self.lab.rest.retry_update_job(self.fields["id"])
        return self

    @property
    def labels(self) -> dict[str, Any]:
        """Tags and metadata of its result: `{"tags": […], "meta": {…}}`.

        Raises:
            ClientError: there is no result.
        """
        return self._get("labels")

    def label(
        self, *, tags: Sequence[str] = (), meta: Mapping[str, Any] | None = None
    ) -> dict[str, Any]:
        """Give its result tags and metadata in place of its own, by which a search finds it.

        Raises:
            ClientError: there is no result, or the project demands other metadata.
        """
        body = {"tags": list(tags), "meta": dict(meta or {})}
        kept: dict[str, Any] = self._call("PUT", "labels", json=body, replaced=True)
        return kept

    def events(self) -> Iterator[dict[str, Any]]:
        """Its states as they change, until it has ended."""
        for line in self.lab.connection.lines(self._at("events")):
            if line.startswith("data:"):
                yield json.loads(line.removeprefix("data:"))

    def predicted(self, **filters: Any) -> Frfs:
        """The FRFs that the model predicts, as numpy arrays.

        Args:
            filters: `model` (`updated` or `initial`), `point`, `direction`, `reference`, `fmin`,
                `fmax`, `stride`.
        """
        from modalbase.objects.frfs import Frfs

        content = self.lab.rest.get_predicted_frfs(
            self.fields["id"], **{**filters, "format": "npz"}
        )
        return Frfs.from_npz(content)

    def save_predicted(
        self, file: str | Path, file_format: str | None = None, **filters: Any
    ) -> Path:
        """Write the FRFs that the model predicts to a file, as `Campaign.export` does.

        Args:
            file: what to write; `-` is standard output.
            file_format: where the file's name does not say it.
            filters: as for `predicted`.

        Raises:
            ClientError: the name says no format, or the job has no result.
        """
        return self._save("frfs/data", file, FRF_SUFFIXES, format=file_format, **filters)

    def save_cards(
        self, file: str | Path, solver: str | None = None, element: str | None = None
    ) -> Path:
        """Write the updated model as a deck that a finite element program runs.

        Args:
            file: what to write; `.inp` is CalculiX's and Abaqus', `.bdf`, `.dat` and `.nas`
                Nastran's.
            solver: `calculix`, `abaqus` or `nastran`, where the file's name does not say.
            element: `solid` or `shell`; by default the service chooses.

        Raises:
            ClientError: the name does not say which, or the job has no result.
        """
        advice = "state the program: "
        return self._save("cards", file, SOLVERS, advice, format=solver, element=element)


def update_jobs(lab: Access, most: int | None = None, **narrowed: Any) -> list[UpdateJob]:
    """Update jobs, newest first, as `Laboratory.jobs`."""
    return [
        UpdateJob(lab, fields) for fields in lab.connection.pages("update-jobs", most, **narrowed)
    ]
