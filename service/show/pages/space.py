"""What a page says of measured points for the picture of the structure in space."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from service.compute.frame import Frame
from service.show.figures.joining import joined_as
from service.show.pages.grid import Point3
from service.store.frfs.schemas import FrfOut
from service.store.structures.schemas import StructureOut


def points_in_space(
    points: Mapping[int, Point3],
    rows: Sequence[FrfOut],
    counts: Mapping[int, int],
    frame: Frame,
    lines: Iterable[Sequence[int]],
) -> dict[str, Any]:
    """Points with the directions that were measured there, and which are joined.

    Args:
        points: label to coordinates in the specimen's frame, m.
        rows: FRFs, their directions along the file's axes.
        counts: how many FRFs each point has.
        frame: of the campaign.
        lines: trace lines of its files.

    Returns:
        `points`, each with `response` and `reference`, unit vectors in the specimen's frame; `joined`, pairs of their numbers;
        `axes`, the file's directions 1, 2 and 3 as rows in the specimen's frame.
    """
    responses = _directions((row.response_point, row.response_direction) for row in rows)
    references = _directions((row.reference_point, row.reference_direction) for row in rows)

    def along(directions: Iterable[int]) -> list[list[float]]:
        return [(np.sign(d) * frame.axes[abs(d) - 1]).tolist() for d in sorted(directions) if abs(d) <= 3]

    return {
        "points": [
            {
                "label": label,
                **dict(zip(("x_m", "y_m", "z_m"), xyz, strict=True)),
                "frfs": counts.get(label, 0),
                "response": along(responses.get(label, ())),
                "reference": along(references.get(label, ())),
            }
            for label, xyz in points.items()
        ],
        "joined": joined_as(lines, list(points), np.array(list(points.values())).reshape(-1, 3)),
        "axes": frame.axes.tolist(),
    }


def _directions(dofs: Iterable[tuple[int, int]]) -> dict[int, set[int]]:
    found: dict[int, set[int]] = {}
    for point, direction in dofs:
        found.setdefault(point, set()).add(direction)
    return found


def has_mesh(structure: StructureOut) -> bool:
    """Whether enough is said of a structure to draw it."""
    return bool(structure.geometry or structure.shape or structure.model)
