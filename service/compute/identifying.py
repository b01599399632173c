"""The document about an identification."""

from dataclasses import asdict
from typing import Any

import numpy as np

from fecore.arrays import FloatArray
from fecore.modal import Identification, IdentifiedPoles, Stabilisation


def describe_identification(identification: Identification) -> dict[str, Any]:
    """Modes and uncertain poles (`doubtful`) with their quality and probability, refused ones, what
    was left out, warnings, and the stabilisation diagram; whether loads were measured, and the
    harmonics and the amplitude that were seen where they were not.
    """
    chosen = list(zip(_rows(identification.found), identification.found.doubt, strict=True))
    return {
        "modes": [
            {"number": k, **row}
            for k, row in enumerate((row for row, why in chosen if why is None), start=1)
        ],
        "doubtful": [{**row, "reason": why} for row, why in chosen if why is not None],
        "stated": list(identification.stated),
        "used": list(identification.used),
        "refused": [{"frf": each.frf, "reason": each.reason} for each in identification.refused],
        "refused_poles": [asdict(pole) for pole in identification.refused_poles],
        "noise_ratio": identification.noise_ratio,
        "model_error": identification.model_error,
        "drift": identification.drift,
        "delay_s": identification.delay,
        "memory_lines": identification.memory_lines,
        "stabilisation": _stabilisation(identification.stabilisation),
        "warnings": list(identification.warnings),
        "durations_s": identification.seconds,
        "excitation": "measured" if identification.harmonics_hz is None else "unmeasured",
        "harmonics_hz": list(identification.harmonics_hz or ()),
        "window_taken_out_per_s": identification.window_taken_out_per_s,
        "amplitude": _amplitude(identification),
    }


AMPLITUDES = {
    "acceleration": "amplitude_rms_m_s2",
    "velocity": "amplitude_rms_m_s",
    "displacement": "amplitude_rms_m",
}
"""Names of the root mean square of responses as a covariate, by what they measure."""


def _amplitude(identification: Identification) -> dict[str, float]:
    rms = identification.response_rms
    return {} if rms is None else {AMPLITUDES[rms[0]]: rms[1]}


def _rows(assessed: IdentifiedPoles) -> list[dict[str, Any]]:
    modes = assessed.modes
    sd_f, sd_z = modes.frequency_sd_hz, modes.damping_sd
    return [
        {
            "frequency_hz": float(modes.frequency_hz[k]),
            "frequency_sd_hz": _number(sd_f, k),
            "damping_ratio": float(modes.damping_ratio[k]),
            "damping_sd": _number(sd_z, k),
            "phase_collinearity": float(assessed.shapes.collinearity[k]),
            "significance": float(assessed.significance[k]),
            "probability": float(assessed.probability[k]),
            "features": [asdict(one) for one in assessed.features[k]],
        }
        for k in range(len(modes))
    ]


def _stabilisation(diagram: Stabilisation) -> dict[str, Any]:
    poles = {name: values.tolist() for name, values in vars(diagram).items()}
    lines = {
        name: poles.pop(own)
        for name, own in (("frequency_hz", "line_hz"), ("rms", "indicator"), ("cmif", "cmif"))
    }
    return {**poles, "indicator": lines}


def _number(values: FloatArray | None, k: int) -> float | None:
    return float(values[k]) if values is not None and np.isfinite(values[k]) else None


def up_to_date(document: dict[str, Any]) -> dict[str, Any]:
    """A stored document as the present version writes it; the given one stays.

    One of 0.1.0 has no class of doubtful modes, none up to 0.2.0 a probability.
    """
    none = dict.fromkeys(("model_error", "drift", "delay_s", "memory_lines"))
    defaults: dict[str, Any] = {"doubtful": [], "refused_poles": [], "stated": [], **none}
    defaults |= {"excitation": "measured", "harmonics_hz": [], "window_taken_out_per_s": 0.0}
    defaults["amplitude"] = {}
    document = {**defaults, **document}
    unknown: dict[str, Any] = {"probability": None, "features": []}
    poles = ("modes", "doubtful", "refused_poles")
    return {
        **document,
        **{part: [{**unknown, **row} for row in document.get(part, [])] for part in poles},
    }
