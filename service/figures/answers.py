"""A figure over HTTP: Plotly JSON, or a print that a browser shows in place."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from hashlib import sha256
from typing import Annotated, Any, get_args

from fastapi import Path, Query, Request, Response
from pydantic import BaseModel, Field

from fecore import __version__
from service.errors import NotFound
from service.figures.look import Figure, Theme, themed
from service.figures.printing import MEDIA_TYPES, Format, render
from service.web.conditional import not_modified

FormatQuery = Annotated[
    Format, Query(alias="format", description="Plotly JSON for a page or a notebook; a print as SVG, PNG or PDF")
]
ThemeQuery = Annotated[Theme, Query(description="colours for a light or a dark page")]
FigureName = Annotated[str, Path(max_length=60, description="name of the figure, as the text above has it")]
RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "The figure. JSON is Plotly's: `data` (traces) and `layout`.",
        "content": {
            "application/json": {
                "schema": {
                    "type": "object",
                    "required": ["data", "layout"],
                    "properties": {
                        "data": {"type": "array", "items": {"type": "object"}, "description": "Traces of Plotly."},
                        "layout": {"type": "object", "description": "Plotly's layout: title, axes, legend, marks."},
                    },
                }
            },
            **{MEDIA_TYPES[each]: {} for each in get_args(Format) if each != "plotly"},
        },
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
    query: list[str] = Field(description="parameters of the query that it heeds, besides `format` and `theme`")


class FiguresOut(BaseModel):
    """The figures of a result, in the order of a report."""

    items: list[FigureOut] = Field(description="every figure that there is for such a result")


def _headers(request: Request, of: str) -> dict[str, str]:
    """Headers of a figure, by which a browser keeps it while it stays as it is.

    Args:
        request: its path and query name the figure.
        of: what changes whenever the data that are drawn change. The figure of a later version may be another one too.
    """
    key = sha256(f"{__version__} {request.url.path} {request.url.query} {of}".encode()).hexdigest()[:32]
    return {"ETag": f'"{key}"', "Cache-Control": "private, no-cache"}


def unless_known(
    request: Request, of: str, draw: Callable[[], Figure], file_format: Format, name: str, theme: Theme
) -> Response:
    """A figure that is drawn only where the client has not kept it as it is now.

    Args:
        request: its path and query name the figure.
        of: what changes whenever the data that are drawn change.
        draw: makes the figure, for a light page.
        file_format: JSON or a print.
        name: of the file, as of `figure_answer`.
        theme: of the page.
    """
    headers = _headers(request, of)
    if (unchanged := not_modified(request, headers)) is not None:
        return unchanged
    return figure_answer(draw(), file_format, name, theme, headers)


def require_figure(name: str, *known: str) -> None:
    """Refuse a name that no figure has; to be called once it is known that the user may see what is drawn.

    Raises:
        NotFound: there is no such figure.
    """
    if name not in known:
        raise NotFound(f"figure {name!r}; there are {', '.join(known)}")


def figure_answer(
    figure: Figure, file_format: Format, name: str, theme: Theme = "light", headers: Mapping[str, str] | None = None
) -> Response:
    """A figure in the format that was asked for, shown in place and not as an attachment.

    Args:
        figure: as it is built, for a light page.
        file_format: JSON or a print.
        name: of the file, should someone save it; ASCII, without a suffix.
        theme: of the page.
        headers: such as the ETag.
    """
    described = dict(headers or {})
    if file_format != "plotly":
        described["Content-Disposition"] = f'inline; filename="{name}.{file_format}"'
    body = render(themed(figure, theme), file_format)
    return Response(body, media_type=MEDIA_TYPES[file_format], headers=described)
