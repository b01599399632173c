"""Arrays of a result that are kept beside its document, as one npz: what its figures and its
predicted FRFs are made of.
"""

import io
from collections.abc import Mapping
from typing import Any

import numpy as np

from fecore.arrays import FloatArray
from fecore.body.mesh import Mesh
from fecore.correlation import CRITERIA
from fecore.updating.forecasts import FrequencyEffects
from fecore.updating.result import ModeShapes, Prediction, UpdateResult

MOST_SAMPLES = 2000
_LARGEST_HALF = 60_000.0  # that half precision holds


def arrays_to_keep(result: UpdateResult) -> dict[str, Any]:
    """The arrays of a result by name.

    Predicted FRFs (in single precision) and how sure they are (in half), criteria of lines and of
    their pairs, shapes at the measured points and on the model's mesh, samples of the posterior,
    what would move the frequencies. What a result has not, its arrays have not either; without a
    prediction the FRFs' arrays are there and empty.
    """
    samples = result.posterior.samples
    arrays = {
        **_frfs(result.prediction),
        **_agreement(result),
        **_shapes(result.shapes),
        **_effects(result.effects),
    }
    if samples is not None:
        every = -(-len(samples) // MOST_SAMPLES)
        arrays["samples"] = samples[::every].astype(np.float32)
    return arrays


def as_npz(arrays: Mapping[str, Any]) -> bytes:
    """Arrays by name as one file, without compression."""
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def _frfs(prediction: Prediction | None) -> dict[str, Any]:
    if prediction is None:
        none = np.zeros((0, 2), dtype=np.int64)
        empty = np.zeros((0, 0), dtype=np.complex64)
        return {
            "frequency_hz": np.zeros(0),
            "responses": none,
            "references": none,
            "initial": empty,
            "updated": empty,
        }
    log_magnitude, phase = prediction.spread
    return {
        "frequency_hz": prediction.frequency_hz,
        "responses": np.array([(dof.point, dof.direction) for dof in prediction.responses]),
        "references": np.array([(dof.point, dof.direction) for dof in prediction.references]),
        "initial": prediction.initial.astype(np.complex64),
        "updated": prediction.updated.astype(np.complex64),
        "log_magnitude_sd": _half(log_magnitude),
        "phase_sd": _half(phase),
        "fitted": np.array(prediction.fitted, dtype=np.int64),
        "held": np.array(prediction.held, dtype=np.int64),
    }


def _half(values: FloatArray) -> Any:
    return np.minimum(values, _LARGEST_HALF).astype(np.float16)


def _agreement(result: UpdateResult) -> dict[str, Any]:
    """Criteria before and after: (2, L) of the lines of the band, (2, l, l) of their pairs."""
    prediction, band = result.prediction, result.band_hz
    before, after = result.correlation.initial, result.correlation.updated
    if prediction is None or band is None or before is None or after is None:
        return {}
    hz = prediction.frequency_hz
    return {
        "band_lines_hz": hz[(hz >= band[0]) & (hz <= band[1])],
        **{
            name: np.array([before[name], after[name]], dtype=np.float32)
            for name, criterion in CRITERIA.items()
            if criterion.is_mean
        },
    }


def _shapes(shapes: ModeShapes | None) -> dict[str, Any]:
    if shapes is None:
        return {}
    return {
        "shape_points": np.array(shapes.points, dtype=np.int64),
        "shape_places_m": shapes.places,
        "shapes_measured": shapes.measured.astype(np.complex64),
        "shapes_updated": shapes.updated.astype(np.float32),
        "shape_pairs": np.array(shapes.pairs, dtype=np.int64).reshape(-1, 2),
        "shape_directions": shapes.directions.astype(np.float32),
        **on_mesh(shapes.mesh, shapes.everywhere),
    }


def on_mesh(mesh: Mesh, everywhere: FloatArray) -> dict[str, Any]:
    """The model's mesh, and its shapes at the nodes: each by its largest component, which single
    precision keeps.
    """
    largest = np.abs(everywhere).max(axis=(1, 2), initial=1e-300)
    return {
        "mesh_nodes_m": mesh.nodes.astype(np.float32),
        "mesh_kinds": np.array([block.kind for block in mesh.blocks], dtype=np.str_),
        "mesh_sets": np.array([block.set for block in mesh.blocks], dtype=np.str_),
        **{
            f"mesh_elements_{k}": block.nodes.astype(np.int32)
            for k, block in enumerate(mesh.blocks)
        },
        "mesh_largest": largest.astype(np.float32),
        "mesh_shapes": (everywhere / largest[:, None, None]).astype(np.float16),
    }


def _effects(effects: FrequencyEffects) -> dict[str, Any]:
    """What a monitor explains its alarms by, and the sensitivities of the parameters."""
    modes = len(effects.mass)
    arrays: dict[str, Any] = {
        "mass_sites_m": effects.sites,
        "mass_effects": effects.mass,
        "frf_scale": np.array([] if effects.frf_scale is None else [effects.frf_scale]),
    }
    for kind in ("parameter", "stiffness", "support"):
        by_name: dict[str, FloatArray] = getattr(effects, kind)
        arrays[f"{kind}_names"] = np.array(list(by_name), dtype=np.str_)
        arrays[f"{kind}_effects"] = np.array(list(by_name.values())).reshape(len(by_name), modes)
    return arrays
