"""What an update found."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from modalbase.client.results import mode_cells, parameter_cells, verdict_lines
from modalbase.objects.figure import Figure
from modalbase.objects.table import Table

if TYPE_CHECKING:
    from modalbase.objects.laboratory import Laboratory


class Result:
    """The result of an update job; printing it shows the verdict, the warnings and the parameters.

    Attributes:
        lab: where it is of.
        job: id of the job.
        document: the whole as REST gives it, SI; `result["modes"]` is a part of it.
    """

    def __init__(self, lab: Laboratory, job: str, document: Mapping[str, Any]) -> None:
        self.lab, self.job, self.document = lab, job, document

    def __getitem__(self, name: str) -> Any:
        return self.document[name]

    def __str__(self) -> str:
        warnings = [f"warning: {one}" for one in self.warnings]
        return "\n".join([*verdict_lines(self.document), *warnings, str(self.parameters)])

    def __repr__(self) -> str:
        return f"<Result of update {self.job}: {self.verdict}>"

    def _repr_html_(self) -> str:
        from html import escape

        said = [*verdict_lines(self.document), *(f"warning: {one}" for one in self.warnings)]
        return "<br>".join(map(escape, said)) + self.parameters._repr_html_()

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
        """Each parameter with estimate, standard deviation, interval and whether the data identify it; SI in the rows."""
        rows = self.document["parameters"]
        return Table(rows, shown=parameter_cells(rows))

    @property
    def modes(self) -> Table:
        """Each mode: measured, initial, updated frequency in Hz, MAC, damping ratios."""
        rows = self.document["modes"]
        return Table(rows, key="number", shown=mode_cells(rows))

    def figure(self, name: str, **options: Any) -> Figure:
        """A figure, shown in a notebook; `figures()` lists the names.

        Args:
            name: such as `frf` or `mac`.
            options: `point` and `reference` of the FRF, `fmin`, `fmax`, `theme` (`light`, `dark`).
        """
        return Figure(self.lab, f"update-jobs/{self.job}/figures/{name}", options)

    def figures(self) -> Table:
        """The figures, and which of them this result can be drawn as."""
        return Table(self.lab.connection.get(f"update-jobs/{self.job}/figures")["items"])
