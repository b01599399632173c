"""A figure over HTTP: Plotly JSON, or a print that a browser shows in place."""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from hashlib import sha256
from typing import Annotated, Any, get_args

from fastapi import Depends, Path, Query, Request, Response
from pydantic import BaseModel, Field

from fecore import __version__
from service.figures.colors import Theme
from service.figures.marks import Figure
from service.figures.paper import MEDIA_TYPES, Format, render
from service.platform.errors import NotFound
from service.platform.web.middleware import NOTHING
from service.platform.web.parameters import not_modified
from service.platform.web.routing import require_used

FigureName = Annotated[
    str, Path(max_length=60, description="name of the figure, as the text above has it")
]


class PlotlyFigure(BaseModel):
    """A figure as Plotly draws it."""

    data: list[dict[str, Any]] = Field(description="traces of Plotly")
    layout: dict[str, Any] = Field(description="Plotly's layout: title, axes, legend, marks")


RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {
        "model": PlotlyFigure,
        "description": "The figure. JSON is Plotly's: `data` (traces) and `layout`.",
        "content": {MEDIA_TYPES[each]: {} for each in get_args(Format) if each != "plotly"},
    }
}
"""What OpenAPI says of the answer of a figure's route."""


class FigureOut(BaseModel):
    """A figure of a result."""

    name: str = Field(description="in the address of the figure")
    title: str = Field(description="what it shows")
    href: str = Field(description="address of the figure; its default format is Plotly JSON")
    available: bool = Field(description="whether this result has something to draw")
    reason: str | None = Field(description="why not, in words; null where it is available")
    query: list[str] = Field(
        description="parameters of the query that it heeds, besides `format` and `theme`"
    )


class FiguresOut(BaseModel):
    """The figures of a result, in the order of a report."""

    items: list[FigureOut] = Field(description="every figure that there is for such a result")


@dataclass(frozen=True)
class FigureRequest:
    """How a client asks for a figure: what every route of one takes beside its name."""

    request: Request
    file_format: Format
    theme: Theme

    def require_used(self, name: str, used: Collection[str], others: Collection[str]) -> None:
        """Refuse parameters that other figures of a route use, and this one does not.

        Raises:
            Invalid: each of them.
        """
        takes = f"it takes {', '.join([*used, 'format', 'theme'])}"
        require_used(self.request, f"the figure {name}", set(others) - set(used), takes)

    def answer(self, draw: Callable[[], Figure], name: str, version: str | None = None) -> Response:
        """The figure, shown in place and not as an attachment.

        Args:
            draw: makes the figure; not called where the client has kept it as it is now.
            name: of the file, should someone save it; ASCII, without a suffix.
            version: changes whenever the data that are drawn change; None where nothing says so. A
                later release may draw another figure, and the address names the rest.
        """
        headers = {}
        if version is not None:
            url = self.request.url
            key = sha256(f"{__version__} {url.path} {url.query} {version}".encode()).hexdigest()[
                :32
            ]
            headers = {"ETag": f'"{key}"', "Cache-Control": "private, no-cache"}
            if (unchanged := not_modified(self.request, headers)) is not None:
                return unchanged
        if self.file_format != "plotly":
            headers["Content-Disposition"] = f'inline; filename="{name}.{self.file_format}"'
        if self.file_format == "svg":  # a large matrix is a picture within the drawing
            headers["Content-Security-Policy"] = f"{NOTHING}; img-src data:"
        body = render(draw(), self.file_format, self.theme)
        return Response(body, media_type=MEDIA_TYPES[self.file_format], headers=headers)


def _figure_request(
    request: Request,
    file_format: Annotated[
        Format,
        Query(
            alias="format",
            description="Plotly JSON for a page or a notebook; a print as SVG, PNG or PDF",
        ),
    ] = "plotly",
    theme: Annotated[Theme, Query(description="colours for a light or a dark page")] = "light",
) -> FigureRequest:
    return FigureRequest(request, file_format, theme)


# the parameter of a figure's route
FigureRequestDep = Annotated[FigureRequest, Depends(_figure_request)]


def require_figure(name: str, *known: str) -> None:
    """Refuse a name that no figure has; to be called once it is known that the user may see what is
    drawn.

    Raises:
        NotFound: there is no such figure.
    """
    if name not in known:
        raise NotFound(f"figure {name!r}; there are {', '.join(known)}")
