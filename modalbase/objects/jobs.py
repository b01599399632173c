"""Jobs: what a worker does, from queue to end."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from modalbase.client.display import transfer
from modalbase.client.exporting import SOLVERS, format_of
from modalbase.client.jobs import ENDED, Watch, reason_of, require_success, wait_for
from modalbase.objects.results import Result
from modalbase.objects.thing import Thing

if TYPE_CHECKING:
    from modalbase.objects.frfs import Frfs
    from modalbase.objects.modes import ModeSet


class Job(Thing):
    """Something that a worker does."""

    def __repr__(self) -> str:
        return f"<{self.word} {self.fields['id']} {self.fields['status']}>"

    @property
    def ended(self) -> bool:
        """Whether it has ended, in whatever way, when it was last fetched."""
        return self.fields["status"] in ENDED

    @property
    def succeeded(self) -> bool:
        """Whether it has succeeded, when it was last fetched."""
        return bool(self.fields["status"] == "succeeded")

    def wait(self, watch: Watch | None = None) -> Self:
        """Wait until it has ended, in whatever way, with a bar in a terminal and in a notebook; returns itself.

        Args:
            watch: called with the stage and the share that is done, for a bar of one's own.

        Raises:
            ClientError: the service does not answer.
        """
        if not self.ended:
            self.fields = wait_for(self.lab.connection, self.address, self.word, watch)
        return self

    def check(self) -> Self:
        """Itself, where it has succeeded.

        Raises:
            JobFailed: with the reason that it states.
        """
        require_success(self.fields, f"{self.word} {self.fields['id']}")
        return self

    def summary(self) -> str:
        """How it stands, in words."""
        if self.ended and not self.succeeded:
            return f"{self.word} {self.fields['status']}: {reason_of(self.fields)}"
        return f"{self.word}: {self.fields['stage'] or self.fields['status']}"


class Import(Job):
    """The reading of a file."""

    word, path = "import", "imports/{}"

    def summary(self) -> str:
        """What was read, what was refused and why."""
        if not self.succeeded:
            return super().summary()
        counts = ", ".join(f"{n} {name.replace('_', ' ')}" for name, n in (self.fields["counts"] or {}).items())
        refused = [
            f"dataset {one['number']} (type {one['type']}) refused: {one['reason']}"
            for one in self.fields["datasets"]
            if one["outcome"] == "refused"
        ]
        return "\n".join([f"{self.fields['filename']}: {counts}", *refused, *self.fields["warnings"]])


class Processing(Job):
    """From time blocks to FRFs."""

    word, path = "processing", "processings/{}"


class Identification(Job):
    """From FRFs to modes."""

    word, path = "identification", "identifications/{}"

    def mode_set(self) -> ModeSet:
        """The modes that it found; waits for them.

        Raises:
            JobFailed: it found none; the text says why.
        """
        from modalbase.objects.modes import ModeSet

        found = self.wait().check().fields["mode_set"]
        return ModeSet(self.lab, self.lab.connection.get(ModeSet.path.format(found)))

    def cancel(self) -> Self:
        """Ask for its end."""
        self.fields = self.lab.rest.cancel_identification(self.fields["id"])
        return self


class UpdateJob(Job):
    """The updating of a structure's model to a campaign."""

    word, path = "update", "update-jobs/{}"

    def result(self) -> Result:
        """The result; waits for it.

        Raises:
            JobFailed: the job did not succeed; the text is the reason that it states.
        """
        self.wait().check()
        return Result(self.lab, self.fields["id"], self.lab.connection.get(f"{self.address}/result"))

    def summary(self) -> str:
        """Verdict, warnings and parameters of a job that has succeeded, the reason of one that failed, else its stage."""
        return str(self.result()) if self.succeeded else super().summary()

    def cancel(self) -> Self:
        """Ask for its end."""
        self.fields = self.lab.rest.cancel_update_job(self.fields["id"])
        return self

    def retry(self) -> Self:
        """Queue it again, where it failed or was cancelled."""
        self.fields = self.lab.rest.retry_update_job(self.fields["id"])
        return self

    def events(self) -> Iterator[dict[str, Any]]:
        """Its states as they change, until it has ended."""
        for line in self.lab.connection.lines(f"{self.address}/events"):
            if line.startswith("data:"):
                yield json.loads(line.removeprefix("data:"))

    def predicted(self, **wanted: Any) -> Frfs:
        """The FRFs that the model predicts, as numpy arrays.

        Args:
            wanted: `model` (`updated` or `initial`), `point`, `direction`, `reference`, `fmin`, `fmax`, `stride`.
        """
        from modalbase.objects.frfs import Frfs

        content = self.lab.rest.get_predicted_frfs(self.fields["id"], **{**wanted, "format": "npz"})
        return Frfs.from_npz(content)

    def save_cards(self, file: str | Path, solver: str | None = None) -> Path:
        """Write the updated model as a deck that a finite element program runs.

        Args:
            file: what to write; `.inp` is CalculiX's and Abaqus', `.bdf`, `.dat` and `.nas` Nastran's.
            solver: `calculix`, `abaqus` or `nastran`, where the file's name does not say.

        Raises:
            ClientError: the name does not say which, or the job has no result.
        """
        target = Path(file)
        chosen = solver or format_of(target, SOLVERS, "state the program: ")
        with transfer(target.name) as watch:
            self.lab.connection.download(f"{self.address}/cards", target, watch, format=chosen)
        return target
