"""A figure of the service: shown in a notebook, saved for print, or taken as Plotly JSON."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from modalbase.client.exporting import FIGURES, format_of

if TYPE_CHECKING:
    from modalbase.objects.laboratory import Laboratory


class Figure:
    """A figure; a notebook shows it as SVG, and needs no library for that.

    Attributes:
        lab: where it is of.
        address: its path below `/api/v1/`.
        query: which figure of that address.
    """

    def __init__(self, lab: Laboratory, address: str, query: dict[str, Any]) -> None:
        self.lab, self.address, self.query = lab, address, query

    def __repr__(self) -> str:
        return f"<Figure {self.address}; .save(FILE), .plotly()>"

    def content(self, file_format: str) -> Any:
        """The figure as `svg`, `png` or `pdf` bytes, or as the JSON of `plotly`.

        Raises:
            ClientError: there is none of that name, or nothing to draw.
        """
        return self.lab.connection.call("GET", self.address, params={**self.query, "format": file_format})

    def save(self, file: str | Path) -> Path:
        """Write it to a file: `.svg`, `.png`, `.pdf`, or `.json` for Plotly.

        Raises:
            ClientError: the file's name says none of these.
        """
        path = Path(file)
        chosen = format_of(path, FIGURES)
        self.lab.connection.download(self.address, path, lambda _done, _size: None, **{**self.query, "format": chosen})
        return path

    def plotly(self) -> dict[str, Any]:
        """The figure as Plotly has it: `plotly.graph_objects.Figure(figure.plotly())`."""
        found: dict[str, Any] = self.content("plotly")
        return found

    def _repr_svg_(self) -> str:
        content: bytes = self.content("svg")
        return content.decode()
