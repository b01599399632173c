"""What a forecast computes: the nominal model of a structure, before anything is measured."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fecore.body.constants import Body
from fecore.updating.forecasts import ForecastOrder, ModelForecast, forecast
from service.compute.result_arrays import on_mesh

if TYPE_CHECKING:
    from service.jobs.kinds import Report

HARDLY = 0.05  # share of a mode's largest displacement below which a point hardly shows it


@dataclass(frozen=True)
class ForecastInputs:
    """What to solve."""

    body: Body  # nominal
    order: ForecastOrder  # what is asked
    # of the points among which to choose, or of the mesh's nodes; None where these have no numbers
    # of their own
    labels: tuple[int, ...] | None


@dataclass(frozen=True)
class ForecastOutput:
    """What was found, as JSON, and its arrays as npz, as those of a result are kept."""

    document: dict[str, Any]
    arrays: bytes


def compute_forecast(inputs: ForecastInputs, report: Report) -> Iterator[ForecastOutput]:
    """Solve the model.

    Raises:
        InputError: as of `fecore.updating.forecasts.forecast`.
    """
    report("solving the model", 0.0)
    found = forecast(inputs.body, inputs.order)
    count = len(found.mesh.nodes)
    numbers = np.arange(1, count + 1) if inputs.labels is None else np.array(inputs.labels)
    labels = numbers[found.numbers]
    nodes = numbers if inputs.order.places is None else np.arange(1, count + 1)
    yield ForecastOutput(
        _document(found, labels.tolist(), inputs.order), _arrays(found, labels, nodes)
    )


def _document(found: ModelForecast, labels: list[int], order: ForecastOrder) -> dict[str, Any]:
    references, measured = list(found.references), list(found.measured)
    reference, seen = found.seen[:, references].max(axis=1), found.seen[:, measured].max(axis=1)
    return {
        "rigid_modes": found.rigid,
        "model_modes": [
            {
                "number": k + 1,
                "frequency_hz": float(found.frequency_hz[k]),
                "finer_mesh_hz": None if found.finer_hz is None else float(found.finer_hz[k]),
                "kind": found.kinds[k],
                "share_at_references": float(reference[k]),
                "share_at_points": float(seen[k]),
            }
            for k in range(len(seen))
        ],
        "points": [
            {
                "label": label,
                **dict(zip(("x_m", "y_m", "z_m"), found.places[p].tolist(), strict=True)),
                "direction": int(found.axes[p]),
                "reference": p in references,
                "measured": p in measured,
                "least_share": float(found.seen[:, p].min()),
            }
            for p, label in enumerate(labels)
        ],
        "largest_mac": _largest_mac(found),
        "sentence": _said(found, labels),
        "frfs": len(found.frfs) if found.lines_hz.size else 0,
        "lines": found.lines_hz.size,
        "line_spacing_hz": float(found.lines_hz[0]) if found.lines_hz.size else None,
        "damping_ratio": order.damping_ratio,
    }


def _largest_mac(found: ModelForecast) -> float | None:
    """Between two different modes at the points; None where no two can be compared."""
    others = found.mac[~np.eye(len(found.mac), dtype=bool)]
    others = others[np.isfinite(others)]
    return float(others.max()) if others.size else None


def _said(found: ModelForecast, labels: list[int]) -> str:
    """Where to hit, and what it shows, in words."""
    references = list(found.references)
    shown = found.seen[:, references].max(axis=1)
    least = int(np.argmin(shown))
    axes = [f"{labels[p]} along {'xyz'[found.axes[p] - 1]}" for p in references]
    said = (
        f"a sensor or hammer at point {' and '.join(axes)} shows mode {least + 1} least, with"
        f" {100 * shown[least]:.0f} % of its largest displacement"
    )
    hidden = [
        str(k + 1) for k in np.flatnonzero(found.seen[:, list(found.measured)].max(axis=1) < HARDLY)
    ]
    if hidden:
        said += f"; no point shows mode {', '.join(hidden)} with {100 * HARDLY:.0f} % of it"
    mac = _largest_mac(found)
    return (
        said
        if mac is None
        else (
            f"{said}; at the {len(found.measured)} points two modes have a MAC of {mac:.2f} at most"
        )
    )


def _arrays(found: ModelForecast, labels: np.ndarray, nodes: np.ndarray) -> bytes:
    references, measured = list(found.references), list(found.measured)
    dofs = np.column_stack([labels, found.axes])
    arrays: dict[str, Any] = {
        "shape_points": labels,
        "shape_places_m": found.places,
        "shape_directions": np.eye(3)[found.axes - 1],
        "shapes_updated": found.shapes.astype(np.float32),
        "shapes_measured": np.zeros((0, 0), dtype=np.complex64),
        "shape_pairs": np.zeros((0, 2), dtype=np.int64),
        "mesh_numbers": nodes,
        **on_mesh(found.mesh, found.everywhere),
        "frequency_hz": found.lines_hz,
        "responses": np.tile(dofs[measured], (len(references), 1)),
        "references": np.repeat(dofs[references], len(measured), axis=0),
        "frfs": found.frfs.astype(np.complex64),
    }
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()
