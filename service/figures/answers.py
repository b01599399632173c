"""A figure over HTTP: Plotly JSON, or a print that a browser shows in place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, get_args

from fastapi import Query, Response

from service.figures.look import Figure, Theme, themed
from service.figures.printing import MEDIA_TYPES, Format, render

FormatQuery = Annotated[
    Format, Query(alias="format", description="Plotly JSON for a page or a notebook; a print as SVG, PNG or PDF")
]
ThemeQuery = Annotated[Theme, Query(description="colours for a light or a dark page")]
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
