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
    from service.platform.queue.kinds import Reporter

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


def compute_forecast(inputs: ForecastInputs, report: Reporter) -> Iterator[ForecastOutput]:
    """Solve the model.

    Raises:
        InputError: as of `fecore.updating.forecasts.forecast`.
    """
    report("solving the model", 0.0)
    result = forecast(inputs.body, inputs.order)
    count = len(result.mesh.nodes)
    numbers = np.arange(1, count + 1) if inputs.labels is None else np.array(inputs.labels)
    labels = numbers[result.numbers]
    nodes = numbers if inputs.order.places is None else np.arange(1, count + 1)
    yield ForecastOutput(
        _document(result, labels.tolist(), inputs.order), _arrays(result, labels, nodes)
    )


def _document(result: ModelForecast, labels: list[int], order: ForecastOrder) -> dict[str, Any]:
    references, measured = list(result.references), list(result.measured)
    reference, seen = result.seen[:, references].max(axis=1), result.seen[:, measured].max(axis=1)
    return {
        "rigid_modes": result.rigid,
        "model_modes": [
            {
                "number": k + 1,
                "frequency_hz": float(result.frequency_hz[k]),
                "finer_mesh_hz": None if result.finer_hz is None else float(result.finer_hz[k]),
                "kind": result.kinds[k],
                "share_at_references": float(reference[k]),
                "share_at_points": float(seen[k]),
            }
            for k in range(len(seen))
        ],
        "points": [
            {
                "label": label,
                **dict(zip(("x_m", "y_m", "z_m"), result.places[p].tolist(), strict=True)),
                "direction": int(result.axes[p]),
                "reference": p in references,
                "measured": p in measured,
                "least_share": float(result.seen[:, p].min()),
            }
            for p, label in enumerate(labels)
        ],
        "largest_mac": _largest_mac(result),
        "sentence": _sentence(result, labels),
        "frfs": len(result.frfs) if result.lines_hz.size else 0,
        "lines": result.lines_hz.size,
        "line_spacing_hz": float(result.lines_hz[0]) if result.lines_hz.size else None,
        "damping_ratio": order.damping_ratio,
    }


def _largest_mac(result: ModelForecast) -> float | None:
    """Between two different modes at the points; None where no two can be compared."""
    others = result.mac[~np.eye(len(result.mac), dtype=bool)]
    others = others[np.isfinite(others)]
    return float(others.max()) if others.size else None


def _sentence(result: ModelForecast, labels: list[int]) -> str:
    """Where to hit, and what it shows, in words."""
    references = list(result.references)
    shown = result.seen[:, references].max(axis=1)
    least = int(np.argmin(shown))
    axes = [f"{labels[p]} along {'xyz'[result.axes[p] - 1]}" for p in references]
    sentence = (
        f"a sensor or hammer at point {' and '.join(axes)} shows mode {least + 1} least, with"
        f" {100 * shown[least]:.0f} % of its largest displacement"
    )
    hidden = [
        str(k + 1)
        for k in np.flatnonzero(result.seen[:, list(result.measured)].max(axis=1) < HARDLY)
    ]
    if hidden:
        sentence += f"; no point shows mode {', '.join(hidden)} with {100 * HARDLY:.0f} % of it"
    mac = _largest_mac(result)
    return (
        sentence
        if mac is None
        else (
            f"{sentence}; at the {len(result.measured)} points two modes have a MAC of {mac:.2f} at most"
        )
    )


def _arrays(result: ModelForecast, labels: np.ndarray, nodes: np.ndarray) -> bytes:
    references, measured = list(result.references), list(result.measured)
    dofs = np.column_stack([labels, result.axes])
    arrays: dict[str, Any] = {
        "shape_points": labels,
        "shape_places_m": result.places,
        "shape_directions": np.eye(3)[result.axes - 1],
        "shapes_updated": result.shapes.astype(np.float32),
        "shapes_measured": np.zeros((0, 0), dtype=np.complex64),
        "shape_pairs": np.zeros((0, 2), dtype=np.int64),
        "mesh_numbers": nodes,
        **on_mesh(result.mesh, result.everywhere),
        "frequency_hz": result.lines_hz,
        "responses": np.tile(dofs[measured], (len(references), 1)),
        "references": np.repeat(dofs[references], len(measured), axis=0),
        "frfs": result.frfs.astype(np.complex64),
    }
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()
